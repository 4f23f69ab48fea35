//! The element `scene` of a file with levels of detail: one row of facts of all its points.

use super::header::{Element, Kind, Property, Scalar};
use crate::scene::Bounds;
use crate::scene::whole::{Has, LevelFacts, Whole};
use glam::DVec3;

/// The name of the element.
pub(super) const ELEMENT: &str = "scene";

/// The properties of the element, all `double`: boxes and colours as minimum and maximum, flags
/// last.
const NAMES: [&str; 44] = [
    "origin_x",
    "origin_y",
    "origin_z",
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "body_min_x",
    "body_min_y",
    "body_min_z",
    "body_max_x",
    "body_max_y",
    "body_max_z",
    "core_min_x",
    "core_min_y",
    "core_min_z",
    "core_max_x",
    "core_max_y",
    "core_max_z",
    "framed_min_x",
    "framed_min_y",
    "framed_min_z",
    "framed_max_x",
    "framed_max_y",
    "framed_max_z",
    "min_red",
    "min_green",
    "min_blue",
    "min_alpha",
    "max_red",
    "max_green",
    "max_blue",
    "max_alpha",
    "radius",
    "shorter",
    "node_radius",
    "node_shorter",
    "node_caps",
    "low",
    "clips",
    "caps",
    "own_normals",
];

/// Size of the row, bytes.
pub(super) const BYTES: usize = 8 * NAMES.len();

/// The lines of the element in a header.
pub(super) fn lines() -> String {
    let properties: String = NAMES.iter().map(|name| format!("property double {name}\n")).collect();
    format!("element {ELEMENT} 1\n{properties}")
}

/// Whether an element has the name, row and properties of this one.
pub(super) fn is_whole(element: &Element) -> bool {
    let is = |(property, name): (&Property, &str)| property.name == name && property.kind == Kind::Scalar(Scalar::F64);
    element.name == ELEMENT
        && element.count == 1
        && element.properties.len() == NAMES.len()
        && element.properties.iter().zip(NAMES).all(is)
}

/// Encodes the row, little-endian.
pub(super) fn bytes(whole: &Whole) -> Vec<u8> {
    let Whole { origin, bounds, body, core, framed, color: (low, high), levels, has, .. } = whole;
    let boxes = [bounds, body, core, framed].into_iter().flat_map(|bounds| [bounds.min, bounds.max]);
    let places = [*origin].into_iter().chain(boxes);
    let lengths = [whole.largest_radius, whole.largest_shorter, levels.largest_radius, levels.largest_shorter];
    let flags = [levels.caps, has.low, has.clips, has.caps, has.normals].map(|flag| if flag { 1.0 } else { 0.0 });
    let floats = low.iter().chain(high).chain(&lengths).map(|number| f64::from(*number));
    let numbers = places.flat_map(|place| place.to_array()).chain(floats).chain(flags);
    numbers.flat_map(f64::to_le_bytes).collect()
}

/// Decodes the row of a file with this many surfels and nodes.
pub(super) fn parse(row: &[u8; BYTES], surfels: u32, nodes: u32) -> Whole {
    let (words, _) = row.as_chunks::<8>();
    let number = |at: usize| f64::from_le_bytes(words[at]);
    let place = |at: usize| DVec3::new(number(at), number(at + 1), number(at + 2));
    let bounds = |at: usize| Bounds { min: place(at), max: place(at + 3) };
    let color = |at: usize| [0, 1, 2, 3].map(|k| number(at + k) as f32);
    let flag = |at: usize| number(at) != 0.0;
    Whole {
        surfels,
        nodes,
        origin: place(0),
        bounds: bounds(3),
        body: bounds(9),
        core: bounds(15),
        framed: bounds(21),
        color: (color(27), color(31)),
        largest_radius: number(35) as f32,
        largest_shorter: number(36) as f32,
        levels: LevelFacts { largest_radius: number(37) as f32, largest_shorter: number(38) as f32, caps: flag(39) },
        has: Has { low: flag(40), clips: flag(41), caps: flag(42), normals: flag(43) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_read_as_it_is_written() {
        let place = |k: f64| DVec3::new(k, k + 0.25, -k);
        let bounds = |k: f64| Bounds { min: place(k), max: place(k + 1.0) };
        let whole = Whole {
            surfels: 7,
            nodes: 3,
            origin: place(6e6),
            bounds: bounds(1.0),
            body: bounds(3.0),
            core: bounds(5.0),
            framed: bounds(7.0),
            color: ([0.1, 0.2, 0.3, 0.4], [0.5, 0.6, 0.7, 0.8]),
            largest_radius: 1.5,
            largest_shorter: 1.25,
            levels: LevelFacts { largest_radius: 2.5, largest_shorter: 2.25, caps: true },
            has: Has { low: true, clips: false, caps: true, normals: false },
        };
        let row = bytes(&whole);
        assert_eq!(row.first_chunk().map(|row| parse(row, 7, 3)), Some(whole));
        assert_eq!((row.len(), lines().lines().count()), (BYTES, 1 + NAMES.len()));
    }
}
