//! How time grows with the number of surfels, their size in the image, and the number of pixels.

use std::collections::BTreeMap;

use super::family::Families;
use super::plot::{Axis, Plot};
use super::results::Measurement;
use super::text::{escape, significant, tick, tick_count};

/// Fewest values of a curve.
const FEWEST: usize = 3;

/// A quantity that time may grow with.
struct Quantity {
    title: &'static str,
    axis: &'static str,
    tick: fn(f64) -> String,
    class: &'static str,
    value: fn(&Measurement) -> f64,
    /// The properties that must be equal along a curve, the strictest choice first. The first
    /// choice that gives a curve is used, because a study that varies one quantity often has to
    /// vary another.
    alike: &'static [Alike],
}

struct Alike {
    what: &'static str,
    of: fn(&Measurement) -> String,
}

const QUANTITIES: [Quantity; 3] = [
    Quantity {
        title: "Time against surfels",
        axis: "surfels",
        tick: tick_count,
        class: "surfels",
        value: |m| m.surfels as f64,
        alike: &[
            Alike {
                what: "the scene, the image and the size of a splat are the same",
                of: |m| format!("{} {} {}", m.scene, size(m), radius(m)),
            },
            Alike { what: "the scene and the image's size are the same", of: |m| format!("{} {}", m.scene, size(m)) },
            Alike {
                what: "the sizes of the image and of a splat are the same",
                of: |m| format!("{} {}", size(m), radius(m)),
            },
            Alike { what: "the image's size is the same", of: size },
        ],
    },
    Quantity {
        title: "Time against the size of a splat",
        axis: "mean radius of a splat, pixels",
        tick,
        class: "footprint",
        value: |m| m.footprint_px,
        alike: &[
            Alike {
                what: "the scene, its surfels and the image's size are the same",
                of: |m| format!("{} {} {}", m.scene, m.surfels, size(m)),
            },
            Alike {
                what: "the number of surfels and the image's size are the same",
                of: |m| format!("{} {}", m.surfels, size(m)),
            },
        ],
    },
    Quantity {
        title: "Time against pixels",
        axis: "pixels of the image",
        tick: tick_count,
        class: "pixels",
        value: |m| m.pixels() as f64,
        alike: &[
            Alike { what: "the scene and its surfels are the same", of: |m| format!("{} {}", m.scene, m.surfels) },
            Alike { what: "the number of surfels is the same", of: |m| m.surfels.to_string() },
        ],
    },
];

fn size(m: &Measurement) -> String {
    format!("{}x{}", m.width, m.height)
}

fn radius(m: &Measurement) -> String {
    significant(m.footprint_px, 2)
}

/// Curves by configuration and value of the equal properties, each with its points in order.
type Curves<'a> = BTreeMap<(&'a str, String), Vec<(f64, &'a Measurement)>>;

fn curves<'a>(measurements: &'a [Measurement], quantity: &Quantity) -> (Curves<'a>, &'static str) {
    for alike in quantity.alike {
        let mut curves = Curves::new();
        for m in measurements {
            let value = (quantity.value)(m);
            if value.is_finite() && value > 0.0 && m.total_ms.median.is_finite() && m.total_ms.median > 0.0 {
                curves.entry((&m.config, (alike.of)(m))).or_default().push((value, m));
            }
        }
        curves.retain(|_, points| {
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            // Two times for one value mean that another property varied too, so this is no curve.
            points.len() >= FEWEST && points.windows(2).all(|pair| pair[0].0 < pair[1].0)
        });
        if !curves.is_empty() {
            return (curves, alike.what);
        }
    }
    (Curves::new(), "")
}

/// Time as a constant and a cost per surfel: `base + slope * value`, ms.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Line {
    base: f64,
    slope: f64,
    /// Largest distance of a point from the line, as a fraction of the point's time.
    departure: f64,
}

/// Fits the line with the least squares of relative departures, as fractions of each point's time.
fn line(points: &[(f64, f64)]) -> Line {
    let sum = |term: &dyn Fn(f64, f64) -> f64| points.iter().map(|&(value, time)| term(value, time)).sum::<f64>();
    // Weights 1 / t^2.
    let (w, wx, wxx) = (sum(&|_, t| t.powi(-2)), sum(&|x, t| x * t.powi(-2)), sum(&|x, t| x * x * t.powi(-2)));
    let (wt, wxt) = (sum(&|_, t| t.recip()), sum(&|x, t| x / t));
    let slope = (w * wxt - wx * wt) / (w * wxx - wx * wx);
    let base = (wt - slope * wx) / w;
    let departure = points.iter().map(|&(value, time)| ((base + slope * value) / time - 1.0).abs()).fold(0.0, f64::max);
    Line { base, slope, departure }
}

/// Returns the section of the page; empty if nothing was varied.
pub(super) fn section(measurements: &[Measurement], families: &Families) -> String {
    let figures: String = QUANTITIES.iter().map(|quantity| figure(measurements, quantity, families)).collect();
    if figures.is_empty() {
        return String::new();
    }
    format!(
        "<section><h2>How time grows</h2><p>Both scales are logarithmic: where a curve rises by one decade per decade, \
         time is proportional. Bars are one median absolute deviation.</p>{}<div class=\"plots\">{figures}</div></section>",
        families.legend()
    )
}

fn figure(measurements: &[Measurement], quantity: &Quantity, families: &Families) -> String {
    let (curves, alike) = curves(measurements, quantity);
    if curves.is_empty() {
        return String::new();
    }
    let points = || curves.values().flatten();
    let x = Axis::over(quantity.axis, quantity.tick, points().map(|(value, _)| *value));
    let y = Axis::over("median time of a frame, ms", tick, points().map(|(_, m)| m.total_ms.median));
    let mut plot = Plot::of_curves(x, y);
    for curve in curves.values() {
        let places: Vec<(f64, f64)> = curve.iter().map(|(value, m)| (*value, m.total_ms.median)).collect();
        plot.line("curve", families.style(curve[0].1).color, &places);
    }
    for (value, m) in points() {
        let (style, time) = (families.style(m), m.total_ms);
        if time.mad > 0.0 && time.mad < time.median {
            plot.line("deviation", style.color, &[(*value, time.median - time.mad), (*value, time.median + time.mad)]);
        }
        let said = (quantity.tick)(*value);
        plot.marker(
            (*value, time.median),
            style,
            &format!("{}: {} ms at {said}", m.config, significant(time.median, 3)),
        );
    }
    // A name stands at the end of its curve. If a configuration has several curves, the value of
    // the equal properties is added.
    let named = |config: &str| curves.keys().filter(|(other, _)| *other == config).count();
    // Names are placed from the top down, so that they keep the order of their curves when they
    // avoid each other.
    let end = |curve: &[(f64, &Measurement)]| {
        let (value, m) = curve[curve.len() - 1];
        (value, m.total_ms.median)
    };
    let mut down: Vec<_> = curves.iter().collect();
    down.sort_by(|a, b| end(b.1).1.total_cmp(&end(a.1).1));
    for ((config, alike), curve) in down {
        let name = if named(config) > 1 { format!("{config}, {alike}") } else { (*config).to_owned() };
        plot.name(end(curve), &name);
    }
    let title = quantity.title;
    let ends: Vec<String> = curves
        .iter()
        .map(|((config, _), curve)| {
            let (from, to) = (curve[0], curve[curve.len() - 1]);
            let time = |m: &Measurement| significant(m.total_ms.median, 3);
            format!("{config} from {} to {} ms", time(from.1), time(to.1))
        })
        .collect();
    let svg = plot.finish("scaling", &format!("scaling-{}", quantity.class), title, &format!("{}.", ends.join("; ")));
    let lines: String = if quantity.class == "surfels" { curves.iter().map(straight).collect() } else { String::new() };
    format!("<figure>{svg}<figcaption>{}; {alike} along a curve.{lines}</figcaption></figure>", escape(title))
}

/// Describes how close a curve over surfels is to a straight line, as a sentence.
fn straight(((config, _), curve): (&(&str, String), &Vec<(f64, &Measurement)>)) -> String {
    let points: Vec<_> = curve.iter().map(|(value, m)| (*value, m.total_ms.median)).collect();
    let Line { base, slope, departure } = line(&points);
    format!(
        " {}: {} ms and {} ns per surfel, to {} %.",
        escape(config),
        significant(base, 2),
        significant(slope * 1e6, 3),
        significant(departure * 100.0, 2)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::results::Summary;

    fn measurement(config: &str, scene: &str, surfels: u64, footprint_px: f64, width: u32) -> Measurement {
        let total_ms = Summary { median: surfels as f64, ..Summary::default() };
        let (config, scene) = (config.into(), scene.into());
        Measurement { config, scene, surfels, footprint_px, width, height: 100, total_ms, ..Measurement::default() }
    }

    fn lengths(measurements: &[Measurement], quantity: usize) -> Vec<usize> {
        curves(measurements, &QUANTITIES[quantity]).0.values().map(Vec::len).collect()
    }

    #[test]
    fn a_curve_needs_three_values() {
        let mut all = vec![measurement("a", "s", 10, 1.0, 100), measurement("a", "s", 100, 1.0, 100)];
        assert!(lengths(&all, 0).is_empty());
        all.push(measurement("a", "s", 1000, 1.0, 100));
        assert_eq!(lengths(&all, 0), [3]);
        assert!(lengths(&all, 1).is_empty() && lengths(&all, 2).is_empty());
        // A value that occurs twice is no third one.
        let twice = [10, 100, 100].map(|surfels| measurement("a", "s", surfels, 1.0, 100));
        assert!(lengths(&twice, 0).is_empty());
    }

    #[test]
    fn a_line_is_found_and_what_departs_from_it_is_told() {
        let straight = [1e5, 1e6, 1e7].map(|n| (n, 40.0 + 1e-4 * n));
        let found = line(&straight);
        assert!((found.base - 40.0).abs() < 1e-6 && (found.slope - 1e-4).abs() < 1e-12, "{found:?}");
        assert!(found.departure < 1e-9, "{found:?}");
        // Twice the slope from the middle on.
        let bent = [(1e5, 50.0), (1e6, 140.0), (1e7, 1940.0)];
        assert!(line(&bent).departure > 0.1);
    }

    #[test]
    fn what_varies_besides_is_held_if_it_can_be() {
        // Three counts at each of two splat sizes: two curves, not one that jumps.
        let grid: Vec<Measurement> =
            [1.0, 4.0].iter().flat_map(|r| [10, 100, 1000].map(|n| measurement("a", "s", n, *r, 100))).collect();
        assert_eq!(lengths(&grid, 0), [3, 3]);
        // A more finely sampled sphere has smaller splats, and is still a curve over surfels.
        let finer: Vec<Measurement> = [(10, 9.0), (100, 3.0), (1000, 1.0)]
            .map(|(n, r)| measurement("a", &format!("sphere-{n}"), n, r, 100))
            .into();
        assert_eq!(lengths(&finer, 0), [3]);
        assert!(lengths(&finer, 1).is_empty());
        let larger: Vec<Measurement> = [100, 200, 400].map(|w| measurement("a", "s", 10, 1.0, w)).into();
        assert_eq!(lengths(&larger, 2), [3]);
    }
}
