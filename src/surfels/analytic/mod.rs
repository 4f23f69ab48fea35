//! Generated scenes with an analytic surface: the ground truth of depth, normal and coverage.

mod gaussians;
mod lattice;
mod mesh;
mod ray;
mod text;

use std::f64::consts::{PI, TAU};
use std::str::FromStr;

use glam::DVec3;

pub use self::gaussians::gaussians;
pub use self::mesh::mesh;
pub use self::ray::depth_along_ray;
use crate::scene::Up;
use crate::{Error, Result};

/// Distance of the centre of the torus' tube from the axis, world units.
pub const TORUS_MAJOR: f64 = 1.0;

/// Radius of the torus' tube, world units.
pub const TORUS_MINOR: f64 = 0.4;

/// Squares of the checkerboard along each edge.
pub const CHECKER_SQUARES: u32 = 32;

/// Disk radius of a sample in units of the mean spacing, the square root of the area per sample.
pub const RADIUS_IN_SPACINGS: f64 = 1.5;

/// A surface with a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// The unit sphere around the world origin.
    Sphere,
    /// The torus around the z axis with radii [`TORUS_MAJOR`] and [`TORUS_MINOR`].
    Torus,
    /// The square [-1, 1] x [-1, 1] at z = 0, normal +z, in one colour.
    Plane,
    /// The same square with [`CHECKER_SQUARES`] x [`CHECKER_SQUARES`] black and white squares.
    Checkerboard,
    /// The same square with lines of text, each half as high as the one above.
    Text,
    /// Concentric spheres with the radii [`SHELLS`] around the world origin.
    Shells,
    /// The same square at z = 0, and an equal one at x = 0 that crosses it.
    Crossing,
}

/// Radii of the shells, world units.
pub const SHELLS: [f64; 4] = [1.0, 0.75, 0.5, 0.25];

impl Shape {
    /// Each shape with its name and its description in the command line's help.
    pub const ALL: [(Self, &'static str, &'static str); 7] = [
        (Self::Sphere, "sphere", "the unit sphere"),
        (Self::Torus, "torus", "a torus around the z axis, radii 1 and 0.4"),
        (Self::Plane, "plane", "a square of edge 2 at z = 0, in one colour"),
        (Self::Checkerboard, "checkerboard", "the same square with 32 x 32 black and white squares"),
        (Self::Text, "text", "the same square with lines of text, each half as high as the one above"),
        (Self::Shells, "shells", "spheres of radii 1, 0.75, 0.5 and 0.25 around one another"),
        (Self::Crossing, "crossing", "squares of edge 2 that cross, at z = 0 and x = 0"),
    ];

    /// The up direction of the default view.
    pub fn up(self) -> Up {
        match self {
            Self::Sphere | Self::Shells => Up::Y,
            Self::Torus | Self::Plane | Self::Checkerboard | Self::Text | Self::Crossing => Up::Z,
        }
    }

    /// The surface's area, square world units.
    pub fn area(self) -> f64 {
        match self {
            Self::Sphere => 4.0 * PI,
            Self::Torus => 4.0 * PI * PI * TORUS_MAJOR * TORUS_MINOR,
            Self::Plane | Self::Checkerboard | Self::Text => 4.0,
            Self::Shells => 4.0 * PI * SHELLS.iter().map(|radius| radius * radius).sum::<f64>(),
            Self::Crossing => 8.0,
        }
    }

    /// The signed distance of a point from the surface, world units, positive on the side of the
    /// normals. The squares count as infinite planes.
    pub fn distance(self, p: DVec3) -> f64 {
        match self {
            Self::Sphere => p.length() - 1.0,
            Self::Torus => (p.truncate().length() - TORUS_MAJOR).hypot(p.z) - TORUS_MINOR,
            Self::Plane | Self::Checkerboard | Self::Text => p.z,
            Self::Shells => {
                let from = SHELLS.map(|radius| p.length() - radius);
                from.into_iter().min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(f64::INFINITY)
            }
            Self::Crossing => {
                if crosses_at_z(p) {
                    p.z
                } else {
                    p.x
                }
            }
        }
    }

    /// The outward unit normal at a point of the surface, accurate to about 1e-15: the gradient of
    /// [`distance`](Self::distance).
    pub fn normal(self, p: DVec3) -> DVec3 {
        match self {
            Self::Sphere | Self::Shells => p.normalize(),
            Self::Torus => {
                let from_axis = p.truncate().length();
                (p.truncate() * ((from_axis - TORUS_MAJOR) / from_axis)).extend(p.z).normalize()
            }
            Self::Plane | Self::Checkerboard | Self::Text => DVec3::Z,
            Self::Crossing => {
                if crosses_at_z(p) {
                    DVec3::Z
                } else {
                    DVec3::X
                }
            }
        }
    }

    /// The colour at a point of the surface, 8-bit sRGB.
    pub fn color(self, p: DVec3) -> [u8; 3] {
        let code = |value: f64| (value * 255.0).round() as u8;
        match self {
            Self::Plane => [200, 160, 90],
            Self::Crossing if crosses_at_z(p) => [200, 160, 90],
            Self::Crossing => [60, 110, 190],
            Self::Checkerboard => {
                let square = |c: f64| ((c + 1.0) * 0.5 * f64::from(CHECKER_SQUARES)) as u32;
                if (square(p.x) + square(p.y)) % 2 == 0 { [255; 3] } else { [0; 3] }
            }
            Self::Text => {
                if text::ink(0.5 + 0.5 * p.x, 0.5 - 0.5 * p.y) {
                    [20, 24, 48]
                } else {
                    [250, 246, 236]
                }
            }
            // Bands along x, y and z of different widths: smooth, with detail at several scales and
            // in several directions.
            Self::Sphere | Self::Torus | Self::Shells => {
                let band = |c: f64, bands: f64, shift: f64| 0.5 + 0.5 * (PI * bands * c + shift).sin();
                [
                    code(0.2 + 0.7 * band(p.z, 6.0, 0.0)),
                    code(0.2 + 0.5 * band(p.x, 3.0, 1.0) + 0.2 * band(p.y, 11.0, 0.0)),
                    code(0.2 + 0.5 * band(p.y, 4.0, 2.0) + 0.2 * band(p.x + p.z, 9.0, 0.5)),
                ]
            }
        }
    }

    /// The texture coordinates (u, v) of a point of the surface, in [0, 1], v upward.
    ///
    /// On spheres, u is the turn around the upward axis and v the latitude. On the torus, u is the
    /// turn around the axis and v the turn around the tube, from its inside. On squares, they run
    /// across and up.
    pub fn texture_at(self, p: DVec3) -> [f32; 2] {
        let turns = |y: f64, x: f64| 0.5 + y.atan2(x) / TAU;
        let (u, v) = match self {
            Self::Sphere | Self::Shells => (turns(p.x, p.z), 0.5 + (p.y / p.length()).clamp(-1.0, 1.0).asin() / PI),
            Self::Torus => (turns(p.y, p.x), turns(p.z, p.truncate().length() - TORUS_MAJOR)),
            Self::Crossing if !crosses_at_z(p) => (0.5 + 0.5 * p.z, 0.5 + 0.5 * p.y),
            Self::Plane | Self::Checkerboard | Self::Text | Self::Crossing => (0.5 + 0.5 * p.x, 0.5 + 0.5 * p.y),
        };
        [u as f32, v as f32]
    }
}

/// Whether a point belongs to the square at z = 0, being nearer to it than to the one at x = 0.
fn crosses_at_z(p: DVec3) -> bool {
    p.z.abs() <= p.x.abs()
}

impl FromStr for Shape {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.iter().find(|(_, known, _)| *known == name).map(|(shape, _, _)| *shape).ok_or_else(|| {
            let names = Self::ALL.map(|(_, known, _)| known).join(", ");
            Error::Usage(format!("there is no shape `{name}`: take one of {names}"))
        })
    }
}

/// One point of a generated surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// World units, on the surface to 1e-15.
    pub position: [f64; 3],
    /// Outward unit normal.
    pub normal: [f32; 3],
    /// Disk radius, world units: 1.5 times the square root of the area per sample.
    pub radius: f32,
    /// Colour, 8-bit sRGB.
    pub color: [u8; 3],
}

/// Generates exactly `count` samples, evenly spaced on the surface. Each is computed on demand, and
/// the samples are always the same.
pub fn generate(shape: Shape, count: u64) -> impl ExactSizeIterator<Item = Sample> + Clone + Send {
    let radius = (RADIUS_IN_SPACINGS * (shape.area() / count.max(1) as f64).sqrt()) as f32;
    Samples { shape, count, next: 0, radius }
}

#[derive(Clone, Debug)]
struct Samples {
    shape: Shape,
    count: u64,
    next: u64,
    radius: f32,
}

impl Iterator for Samples {
    type Item = Sample;

    fn next(&mut self) -> Option<Sample> {
        if self.next >= self.count {
            return None;
        }
        let index = self.next;
        self.next += 1;
        let position = match self.shape {
            Shape::Sphere => lattice::sphere(index, self.count),
            Shape::Torus => lattice::torus(index, self.count),
            Shape::Plane | Shape::Checkerboard | Shape::Text => lattice::square(index, self.count),
            Shape::Shells => lattice::shells(index, self.count),
            Shape::Crossing => lattice::crossing(index, self.count),
        };
        Some(Sample {
            position: position.to_array(),
            normal: self.shape.normal(position).as_vec3().to_array(),
            radius: self.radius,
            color: self.shape.color(position),
        })
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.count - self.next;
        (usize::try_from(left).unwrap_or(usize::MAX), usize::try_from(left).ok())
    }

    fn nth(&mut self, skip: usize) -> Option<Sample> {
        self.next = self.next.saturating_add(skip as u64).min(self.count);
        self.next()
    }
}

impl ExactSizeIterator for Samples {}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::Bounds;
    use crate::surfels::neighbours::NeighbourSearch;
    use crate::surfels::positions::DistinctPositions;

    #[test]
    fn samples_lie_on_the_surface_with_its_normal() {
        for (shape, name, _) in Shape::ALL {
            assert_eq!(name.parse::<Shape>().unwrap(), shape);
            for count in [0, 1, 2, 3, 10, 1009] {
                let samples = generate(shape, count);
                assert_eq!(samples.len() as u64, count);
                assert_eq!(samples.clone().count() as u64, count);
                for sample in samples {
                    let p = DVec3::from_array(sample.position);
                    assert!(shape.distance(p).abs() < 1e-14 && p.abs().max_element() <= 1.4 + 1e-15);
                    let normal = DVec3::from_array(sample.normal.map(f64::from));
                    assert!((normal.length() - 1.0).abs() < 1e-6);
                    let step = 1e-6;
                    let slope = DVec3::AXES
                        .map(|axis| (shape.distance(p + axis * step) - shape.distance(p - axis * step)) / (2.0 * step));
                    assert!(DVec3::from_array(slope).distance(normal) < 1e-6, "{shape:?} {p}");
                }
            }
        }
        assert!("cube".parse::<Shape>().unwrap_err().to_string().contains("checkerboard"));
    }

    #[test]
    fn spacing_is_even() {
        // Where the squares cross, samples of both are close together.
        for (shape, _, _) in Shape::ALL.into_iter().filter(|(shape, _, _)| *shape != Shape::Crossing) {
            for count in [500, 1000, 4181, 12_345, 100_000] {
                let points: Vec<_> = generate(shape, count).map(|s| s.position).collect();
                let bounds = points.iter().fold(Bounds::EMPTY, |b, p| b.with_point(DVec3::from_array(*p)));
                let distinct = DistinctPositions::new(&points, &bounds, DVec3::ZERO).unwrap();
                assert_eq!(distinct.len(), points.len());
                let search = NeighbourSearch::new(&distinct, 1);
                let spacing = (shape.area() / count as f64).sqrt();
                let mut found = Vec::new();
                let (mut low, mut high) = (f64::MAX, 0.0f64);
                for index in 0..distinct.len() as u32 {
                    search.nearest(index, &mut found);
                    let ratio = found[0].squared_distance.sqrt() / distinct.scale() / spacing;
                    (low, high) = (low.min(ratio), high.max(ratio));
                }
                println!("{shape:?} {count}: {low:.3} {high:.3}");
                assert!(low > 0.55 && high < 1.4, "{shape:?} {count}: {low} to {high}");
            }
        }
    }

    #[test]
    fn a_billion_samples_are_still_even() {
        // Neighbours on the lattice are a Fibonacci number of samples apart.
        let count = 1_000_000_000;
        let spacing = (Shape::Sphere.area() / count as f64).sqrt();
        let at = |index: usize| DVec3::from_array(generate(Shape::Sphere, count).nth(index).unwrap().position);
        for index in [300_000_000, 499_999_999, 900_000_000] {
            let nearest = [10946, 17711, 28657, 46368, 75025]
                .map(|step| at(index).distance(at(index + step)))
                .into_iter()
                .fold(f64::MAX, f64::min);
            assert!((0.6..1.2).contains(&(nearest / spacing)), "{}", nearest / spacing);
        }
    }

    #[test]
    fn a_checkerboard_is_half_black() {
        let black = generate(Shape::Checkerboard, 100_000).filter(|s| s.color == [0; 3]).count();
        assert!((49_500..50_500).contains(&black), "{black}");
        assert!(generate(Shape::Checkerboard, 100_000).all(|s| s.color == [0; 3] || s.color == [255; 3]));
    }
}
