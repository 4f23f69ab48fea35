//! Points that face the camera (Schuetz and Wimmer 2015): their half-axes and their intersection
//! with a ray.
//!
//! The twin of `wgsl/project/facing.wgsl` and `wgsl/project/axes_facing.wgsl`.

use glam::{DVec2, DVec3};

use super::splat::{Intersection, Splat};
use crate::plan::pass::{Making, Pass};
use crate::scene::facing::{Facing, PointShape};
use crate::scene::{Camera, Projection, Samples, Surfel};

/// The pass's files and constants; no constants where surfels lie in planes of their own.
pub const PASS: Pass = Pass {
    name: "facing",
    files: |needs| {
        let Some(shape) = needs.facing else {
            return vec![if needs.solid { "axes_conic.wgsl" } else { "axes_own.wgsl" }];
        };
        let rise = match shape {
            PointShape::Square | PointShape::Circle => "shape_flat.wgsl",
            PointShape::Sphere => "shape_sphere.wgsl",
            PointShape::Cone => "shape_cone.wgsl",
            PointShape::Paraboloid => "shape_paraboloid.wgsl",
        };
        vec!["axes_facing.wgsl", rise]
    },
    kernels: |_| Vec::new(),
    constants,
};

fn constants(making: &Making<'_>) -> Vec<(&'static str, f64)> {
    let Some(facing) = making.options.facing else { return Vec::new() };
    let [least, most] = facing.pixels.map(|diameter| 0.5 * diameter * f64::from(making.options.samples.down));
    let square = f64::from(u8::from(facing.shape == PointShape::Square));
    vec![("LEAST_RADIUS", least), ("MOST_RADIUS", most), ("SQUARE", square)]
}

/// A point that faces the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    shape: PointShape,
    /// The radius, world units.
    radius: f64,
}

/// How the points of a picture face its camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Faced {
    facing: Facing,
    samples: Samples,
}

impl Faced {
    /// Points of a picture with these `samples` per pixel.
    pub fn new(facing: Facing, samples: Samples) -> Self {
        Self { facing, samples }
    }

    /// The point for a surfel at depth `z`. The pixels of `camera` are the samples.
    pub fn point(&self, surfel: &Surfel, z: f64, camera: &Camera) -> Point {
        let radius = self.facing.radius(surfel.radius().into(), z, camera, self.samples);
        Point { shape: self.facing.shape, radius }
    }
}

impl Point {
    /// The shape that is drawn.
    pub fn shape(&self) -> PointShape {
        self.shape
    }

    /// The radius, world units.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The half-axes in camera space, world units.
    pub fn axes(&self) -> [DVec3; 2] {
        [DVec3::X * self.radius, DVec3::Y * self.radius]
    }
}

/// Intersects the ray through the pixel at `d` from the anchor with a point.
pub(super) fn meet(point: &Point, splat: &Splat, camera: &Camera, d: DVec2) -> Intersection {
    let change = DVec2::new(splat.a.x, splat.b.y);
    let uv = change * d + DVec2::new(splat.a.z, splat.b.z);
    let (scale, depth) = match camera.projection {
        Projection::Pinhole => (splat.c.z, 1.0 / splat.c.z),
        Projection::Orthographic => (1.0, splat.c.z),
    };
    // A point always shows at the pixel that it lies in, like a square of that pixel's size.
    let own = (2.0 * uv / change).abs().max_element();
    let beside = uv / scale;
    let rho = if point.shape == PointShape::Square { beside.abs().max_element() } else { beside.length().min(own) };
    let depth = depth - point.shape.height((rho * rho).min(1.0)) * point.radius;
    Intersection { depth, rho2: rho * rho, inside: f64::INFINITY, uv: beside, away: false }
}
