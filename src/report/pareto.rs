//! Time against error: the configurations that no other one beats in both.

use super::case::Case;
use super::family::Families;
use super::plot::{Axis, Plot};
use super::results::Measurement;
use super::text::{escape, significant, tick};

/// Returns the Pareto front of points (time, error): the indices of the points that no other point
/// dominates, in order of time.
///
/// A point dominates another if it is no worse in both and better in one. Of equal points, all or
/// none are on the front.
///
/// ```
/// use epsplat::low_level::report::pareto::front;
/// // The third is slower than the first and no more exact.
/// assert_eq!(front(&[(1.0, 0.1), (5.0, 0.0), (2.0, 0.1), (2.0, 0.01)]), [0, 3, 1]);
/// ```
pub fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    let key = |index: usize| points[index];
    order.sort_by(|a, b| key(*a).0.total_cmp(&key(*b).0).then(key(*a).1.total_cmp(&key(*b).1)));
    let mut front: Vec<usize> = Vec::new();
    for index in order {
        if front.last().is_none_or(|last| points[index].1 < points[*last].1 || points[index] == points[*last]) {
            front.push(index);
        }
    }
    front
}

/// Returns the measurements that have a time and this kind of error, each with both values.
pub(super) fn points<'a>(
    measurements: &[&'a Measurement],
    error: fn(&Measurement) -> Option<f64>,
) -> Vec<(&'a Measurement, (f64, f64))> {
    let point = |m: &&'a Measurement| {
        let time = m.total_ms.median;
        let error = error(m)?;
        (time.is_finite() && time > 0.0).then_some((*m, (time, error)))
    };
    measurements.iter().filter_map(point).collect()
}

/// Returns the measurements on the front of time against numeric error, the fastest first.
pub(super) fn best<'a>(measurements: &[&'a Measurement]) -> Vec<&'a Measurement> {
    let points = points(measurements, Measurement::numeric_error);
    let places: Vec<(f64, f64)> = points.iter().map(|(_, point)| *point).collect();
    front(&places).into_iter().map(|index| points[index].0).collect()
}

/// A kind of error that a plot shows.
struct Kind {
    name: &'static str,
    axis: &'static str,
    class: &'static str,
    error: fn(&Measurement) -> Option<f64>,
}

const KINDS: [Kind; 2] = [
    Kind {
        name: "numeric error",
        axis: "numeric RMSE against the f64 reference",
        class: "numeric",
        error: Measurement::numeric_error,
    },
    Kind {
        name: "error against ground truth",
        axis: "RMSE against ground truth",
        class: "truth",
        error: Measurement::reconstruction_error,
    },
];

/// Returns the section of the page; empty if there are no errors.
pub(super) fn section(cases: &[Case<'_>], families: &Families) -> String {
    let plots: String = cases
        .iter()
        .enumerate()
        .flat_map(|(index, case)| KINDS.iter().map(move |kind| figure(index, case, kind, families)))
        .collect();
    if plots.is_empty() {
        return String::new();
    }
    let legend = families.legend();
    format!(
        "<section><h2>What each speed costs</h2>\
         <p>Faster is to the left, more exact is below; both scales are logarithmic. The line joins the \
         configurations that no other beats in both.</p>{legend}<div class=\"plots\">{plots}</div></section>"
    )
}

fn figure(index: usize, case: &Case<'_>, kind: &Kind, families: &Families) -> String {
    let points = points(&case.measurements, kind.error);
    if points.is_empty() {
        return String::new();
    }
    let places: Vec<(f64, f64)> = points.iter().map(|(_, place)| *place).collect();
    let front = front(&places);
    let x = Axis::over("median time of a frame, ms", tick, places.iter().map(|(time, _)| *time));
    let y = Axis::over(kind.axis, tick, places.iter().map(|(_, error)| *error));
    let mut plot = Plot::of_points(x, y);
    let on_front: Vec<(f64, f64)> = front.iter().map(|index| places[*index]).collect();
    plot.steps("front", "#555555", &on_front);
    if kind.class == "numeric" {
        let mut limits: Vec<f64> = points.iter().filter_map(|(m, _)| m.error_limit).collect();
        limits.sort_by(f64::total_cmp);
        limits.dedup();
        limits.iter().for_each(|limit| plot.level(&format!("limit {}", tick(*limit)), *limit));
    }
    for (measurement, place) in &points {
        plot.marker(*place, families.style(measurement), &describe(measurement, *place));
    }
    // Names on the front are placed first, because earlier names get the better places.
    let behind = (0..points.len()).filter(|index| !front.contains(index));
    for index in front.iter().copied().chain(behind) {
        plot.name(places[index], &points[index].0.config);
    }
    let title = format!("{}: time and {}", case.title, kind.name);
    let listed: Vec<String> = front.iter().map(|index| describe(points[*index].0, places[*index])).collect();
    let description = format!("{} configurations. On the front: {}.", points.len(), listed.join("; "));
    let svg = plot.finish(&format!("pareto {}", kind.class), &format!("{}-{index}", kind.class), &title, &description);
    let missing = case.measurements.len() - points.len();
    let note = if missing > 0 { format!(" {missing} without such an error are not shown.") } else { String::new() };
    format!("<figure>{svg}<figcaption>{}.{note}</figcaption></figure>", escape(&title))
}

fn describe(measurement: &Measurement, (time, error): (f64, f64)) -> String {
    let (time, error) = (significant(time, 3), significant(error, 2));
    format!("{}: {time} ms, error {error}", measurement.config)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dominated_point_is_not_on_the_front() {
        assert!(front(&[]).is_empty());
        assert_eq!(front(&[(1.0, 1.0)]), [0]);
        // A staircase whose points are all on the front, and for each of its points one that it
        // dominates.
        let stairs: Vec<(f64, f64)> = (0..10).map(|i| (f64::from(i), f64::from(10 - i))).collect();
        let above: Vec<(f64, f64)> = stairs.iter().map(|(t, e)| (t + 0.5, e + 0.25)).collect();
        let all: Vec<(f64, f64)> = above.iter().chain(&stairs).copied().collect();
        assert_eq!(front(&all), (10..20).collect::<Vec<usize>>());
        // A point that is as fast but less exact, or as exact but slower, is dominated.
        assert_eq!(front(&[(1.0, 2.0), (1.0, 1.0), (2.0, 1.0)]), [1]);
        assert_eq!(front(&[(2.0, 0.0), (1.0, 0.5), (2.0, 0.0)]), [1, 0, 2]);
    }

    #[test]
    fn the_front_is_what_the_definition_says() {
        // Pseudo-random points on a small grid, so that ties are frequent.
        let points: Vec<(f64, f64)> = (0u32..200).map(|i| (f64::from(i * 37 % 11), f64::from(i * 53 % 13))).collect();
        let dominated = |p: &(f64, f64)| points.iter().any(|q| q.0 <= p.0 && q.1 <= p.1 && q != p);
        let mut found = front(&points);
        found.sort_unstable();
        let expected: Vec<usize> = (0..points.len()).filter(|index| !dominated(&points[*index])).collect();
        assert_eq!(found, expected);
    }
}
