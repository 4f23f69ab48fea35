//! Points that face the camera: sizes past their limits, and shapes that cross the near depth and
//! each other.

use glam::{DVec2, DVec3};

use super::HardCase;
use super::precision::{Bound, E, Precision};
use super::staging::{BOTH, Entry, Filling, NEAR, Stage, build, fraction};
use crate::error::Result;
use crate::passes::facing::Point;
use crate::passes::splat::{Intersection, Splat};
use crate::scene::facing::{Facing, PointShape};
use crate::scene::{Projection, Surfel};

/// Builds the cases.
pub fn cases() -> Result<Vec<HardCase>> {
    build(LIST)
}

/// The parts of the cases' bounds.
const SHAPE: &str = "a disk's bound, the height's change over the error of rho, and 40 e of the height";

const LIST: &[Entry] = &[
    Entry {
        name: "points of 0 and 50 pixels",
        about: "Circles of radii from 1e-9 to 1e3 pixels, clamped to 1 to 50 pixels across, some outside the image.",
        bound: SHAPE,
        size: (64, 48),
        stage: Stage::askew,
        fill: |stage| facing(PointShape::Circle, (0.9, 1.0), sizes(stage, 1e3)),
        projections: BOTH,
    },
    Entry {
        name: "squares of a pixel",
        about: "Squares of at most a pixel, each of which shows at the pixel that contains it.",
        bound: SHAPE,
        size: (64, 48),
        stage: Stage::askew,
        fill: |stage| facing(PointShape::Square, (0.05, 0.2), sizes(stage, 0.5)).with_lone_rims(),
        projections: BOTH,
    },
    Entry {
        name: "spheres at the near depth",
        about: "Spheres with centres from just before the near depth to a sphere's height past it, so that the near depth can cut them.",
        bound: SHAPE,
        size: (48, 40),
        stage: Stage::plain,
        fill: |stage| facing(PointShape::Sphere, (0.2, 1.0), near(stage)).with_lone_rims(),
        projections: BOTH,
    },
    Entry {
        name: "cones through each other",
        about: "Wide cones at three depths, so that heights decide nearly every pixel.",
        bound: SHAPE,
        size: (64, 48),
        stage: Stage::askew,
        fill: |stage| facing(PointShape::Cone, (0.9, 1.0), crowd(stage)),
        projections: BOTH,
    },
    Entry {
        name: "paraboloids around the camera",
        about: "Paraboloids behind, around and in front of the camera, from a fraction of a pixel to the whole image.",
        bound: SHAPE,
        size: (48, 40),
        stage: Stage::plain,
        fill: |stage| facing(PointShape::Paraboloid, (0.2, 1.0), around(stage)).with_lone_rims(),
        projections: BOTH,
    },
];

fn facing(shape: PointShape, covered: (f64, f64), surfels: Vec<Surfel>) -> Filling {
    let mut filling = Filling { excused: 0.05, ..Filling::of(surfels, covered) };
    filling.options.facing = Some(Facing { shape, pixels: Facing::LIMITS });
    filling
}

/// A point with a radius of `pixels`, at a place (x, y) of the image and a depth. The orientation
/// of its disk does not matter.
fn point(stage: &Stage, (x, y): (f64, f64), z: f64, pixels: f64) -> Surfel {
    stage.disk(stage.at(x, y, z), stage.ray(stage.at(x, y, z)), pixels * stage.pixel(z))
}

fn sizes(stage: &Stage, most: f64) -> Vec<Surfel> {
    let (width, height) = stage.size();
    let of = |k: usize| {
        let at = ((1.4 * fraction(k, 0) - 0.2) * width as f64, (1.4 * fraction(k, 1) - 0.2) * height as f64);
        let pixels = most * 10f64.powf(-12.0 * fraction(k, 3).powi(2));
        point(stage, at, 3.0 + 0.2 * fraction(k, 2), pixels)
    };
    (0..400).map(of).collect()
}

fn near(stage: &Stage) -> Vec<Surfel> {
    let (width, height) = stage.size();
    let of = |k: usize| {
        let at = (fraction(k, 0) * width as f64, fraction(k, 1) * height as f64);
        // With a pinhole, the height is a fraction of the depth. With an orthographic camera, a
        // pixel is wider than the near depth.
        let (z, pixels) = match stage.camera.projection {
            Projection::Pinhole => (NEAR * (0.9 + 0.6 * fraction(k, 2)), 12.0 * fraction(k, 3)),
            Projection::Orthographic => (0.9 * NEAR + 2.0 * stage.pixel(1.0) * fraction(k, 2), 2.5 * fraction(k, 3)),
        };
        point(stage, at, z, pixels)
    };
    (0..200).map(of).collect()
}

fn crowd(stage: &Stage) -> Vec<Surfel> {
    let (width, height) = stage.size();
    let of = |k: usize| {
        let at = (fraction(k, 0) * width as f64, fraction(k, 1) * height as f64);
        point(stage, at, [3.0, 3.01, 3.02][k % 3], 6.0 + 14.0 * fraction(k, 3))
    };
    (0..150).map(of).collect()
}

fn around(stage: &Stage) -> Vec<Surfel> {
    let of = |k: usize| {
        let center = DVec3::new(3.0 * (fraction(k, 0) - 0.5), 3.0 * (fraction(k, 1) - 0.5), 2.0 * fraction(k, 2) - 0.6);
        stage.disk(center, DVec3::NEG_Z, 0.01 * 2f64.powf(6.0 * fraction(k, 3)))
    };
    (0..160).map(of).collect()
}

impl Precision {
    /// Bounds the device's error at pixel (x, y) of a point that faces the camera, including the
    /// evaluation.
    ///
    /// The error has three parts. The first is the error of a disk parallel to the image, whose
    /// radius has a relative error of 6 e, like the radius of a turned disk. The second applies at
    /// the pixel that contains the point: the distance in pixels errs by 5 e of a pixel and 4 e of
    /// the terms. The third is the error of the height, which is evaluated at a rho with an error,
    /// and to 40 e of the height.
    pub fn point(&self, point: &Point, splat: &Splat, (x, y): (u32, u32), at: &Intersection) -> Bound {
        let height = |rho: f64| point.shape().height((rho * rho).min(1.0)) * point.radius();
        let rho = at.rho2.sqrt();
        let plane = at.depth + height(rho);
        // The bound of a disk limits the error of the length of (u, v). So it also limits the
        // errors of u and v, which decide whether a square is hit.
        let disk = self.fragment(splat, x, y, &Intersection { depth: plane, rho2: at.uv.length_squared(), ..*at });
        let step = DVec2::new(f64::from(x) - splat.anchor[0] as f64, f64::from(y) - splat.anchor[1] as f64);
        let own = 2.0 * (5.0 * E + 4.0 * E * (step.abs().element_sum() + 1.0)) + 16.0 * E * rho;
        let of_rho = disk.rho.max(own) + 8.0 * E * rho;
        let changes = height((rho - of_rho).max(0.0)) - height(rho + of_rho);
        let of_height = changes + 40.0 * E * height(rho);
        Bound { rho: of_rho, depth: (disk.depth * plane.abs() + of_height + 4.0 * E * plane.abs()) / at.depth.abs() }
    }
}
