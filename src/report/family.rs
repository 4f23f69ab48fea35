//! Families: configurations of one backend and accumulator share a colour and a marker in every
//! plot and table.

use super::results::Measurement;
use super::text::escape;

/// Colours that the common kinds of colour blindness can tell apart (Okabe and Ito 2008), without
/// their yellow, which is too light for paper. Markers differ too, so that nothing depends on
/// colour alone.
const COLORS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"];

/// Markers as polygons of radius about 1. The numbers of colours and markers have no common
/// divisor, so a pair repeats only after all pairs.
const MARKERS: [&[(f64, f64)]; 8] = [
    &DISK,
    &[(-0.88, -0.88), (0.88, -0.88), (0.88, 0.88), (-0.88, 0.88)],
    &[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)],
    &[(0.0, -1.25), (1.0, 0.0), (0.0, 1.25), (-1.0, 0.0)],
    &[(0.0, 1.2), (1.1, -0.8), (-1.1, -0.8)],
    &PLUS,
    &CROSS,
    &[(-1.2, 0.0), (0.8, -1.1), (0.8, 1.1)],
];

const DISK: [(f64, f64); 16] = [
    (1.0, 0.0),
    (0.924, 0.383),
    (0.707, 0.707),
    (0.383, 0.924),
    (0.0, 1.0),
    (-0.383, 0.924),
    (-0.707, 0.707),
    (-0.924, 0.383),
    (-1.0, 0.0),
    (-0.924, -0.383),
    (-0.707, -0.707),
    (-0.383, -0.924),
    (0.0, -1.0),
    (0.383, -0.924),
    (0.707, -0.707),
    (0.924, -0.383),
];

const PLUS: [(f64, f64); 12] = [
    (-0.4, -1.2),
    (0.4, -1.2),
    (0.4, -0.4),
    (1.2, -0.4),
    (1.2, 0.4),
    (0.4, 0.4),
    (0.4, 1.2),
    (-0.4, 1.2),
    (-0.4, 0.4),
    (-1.2, 0.4),
    (-1.2, -0.4),
    (-0.4, -0.4),
];

/// [`PLUS`] rotated by 45 degrees.
const CROSS: [(f64, f64); 12] = [
    (-1.1, -0.55),
    (-0.55, -1.1),
    (0.0, -0.55),
    (0.55, -1.1),
    (1.1, -0.55),
    (0.55, 0.0),
    (1.1, 0.55),
    (0.55, 1.1),
    (0.0, 0.55),
    (-0.55, 1.1),
    (-1.1, 0.55),
    (-0.55, 0.0),
];

/// Colour and marker of a family.
#[derive(Clone, Copy)]
pub(super) struct Style {
    /// A colour for SVG and CSS.
    pub color: &'static str,
    outline: &'static [(f64, f64)],
}

impl Style {
    /// Returns the marker around (x, y) as the `points` of a polygon.
    pub fn marker(&self, x: f64, y: f64, radius: f64) -> String {
        let corners = self.outline.iter().map(|(u, v)| format!("{:.1},{:.1}", x + u * radius, y + v * radius));
        corners.collect::<Vec<_>>().join(" ")
    }

    /// Returns the marker alone, for a line of text.
    pub fn swatch(&self) -> String {
        let (points, color) = (self.marker(8.0, 8.0, 5.5), self.color);
        format!(
            r#"<svg class="swatch" viewBox="0 0 16 16" aria-hidden="true"><polygon points="{points}" fill="{color}"/></svg>"#
        )
    }
}

/// Names of the families of a study, in the order of first occurrence.
pub(super) struct Families(Vec<String>);

impl Families {
    pub fn of(measurements: &[Measurement]) -> Self {
        let mut names: Vec<String> = Vec::new();
        for name in measurements.iter().map(name) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        Self(names)
    }

    pub fn style(&self, measurement: &Measurement) -> Style {
        let name = name(measurement);
        style(self.0.iter().position(|known| *known == name).unwrap_or(0))
    }

    /// Returns a list of all families with their markers.
    pub fn legend(&self) -> String {
        let entry = |(index, name): (usize, &String)| format!("<li>{} {}</li>", style(index).swatch(), escape(name));
        let entries: String = self.0.iter().enumerate().map(entry).collect();
        format!(r#"<ul class="legend">{entries}</ul>"#)
    }
}

/// Returns the family's name: the backend, and the accumulator if there is one.
pub(super) fn name(measurement: &Measurement) -> String {
    format!("{} {}", measurement.backend, measurement.accumulator).trim().to_owned()
}

fn style(index: usize) -> Style {
    Style { color: COLORS[index % COLORS.len()], outline: MARKERS[index % MARKERS.len()] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn no_two_families_look_alike() {
        let looks: BTreeSet<_> =
            (0..56).map(|index| (style(index).color, style(index).marker(0.0, 0.0, 10.0))).collect();
        assert_eq!(looks.len(), 56);
    }

    #[test]
    fn a_family_is_a_backend_and_an_accumulator() {
        let of = |backend: &str, accumulator: &str| Measurement {
            backend: backend.into(),
            accumulator: accumulator.into(),
            ..Measurement::default()
        };
        let all = [of("gpu", "fixed"), of("reference", ""), of("gpu", "fixed"), of("gpu", "float")];
        let families = Families::of(&all);
        assert_eq!(families.0, ["gpu fixed", "reference", "gpu float"]);
        assert_eq!(families.style(&all[0]).color, families.style(&all[2]).color);
        assert_ne!(families.style(&all[0]).color, families.style(&all[3]).color);
    }
}
