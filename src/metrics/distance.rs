//! How far surfels lie from the surface that they stand for.

use std::f64::consts::TAU;

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::Sorted;
use crate::scene::{Scene, Surfel};
use crate::truth::TriangleTree;

/// Points at which a rim is measured, one at each end of both half-axes.
const RIM_POINTS: u32 = 8;

/// Distances of points from a surface, world units, none negative.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Distances {
    /// Mean.
    pub mean: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// 99th percentile (nearest rank).
    pub percentile_99: f64,
    /// Largest.
    pub max: f64,
}

/// How far the surfels are from a mesh: the distance of a point is that from the nearest point of any triangle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SurfaceDistances {
    /// Of the surfels' centres from the mesh.
    pub centers_to_mesh: Option<Distances>,
    /// Of eight points on each disk's rim from the mesh: a disk on a curved surface leaves it toward the rim.
    pub rims_to_mesh: Option<Distances>,
}

impl Distances {
    /// None for no values.
    pub fn of(values: Vec<f64>) -> Option<Self> {
        let count = values.len() as f64;
        let (sum, squares) = values.iter().fold((0.0, 0.0), |(sum, squares), d| (sum + d, squares + d * d));
        let sorted = Sorted::new(values);
        Some(Self {
            percentile_99: sorted.percentile(0.99)?,
            max: sorted.percentile(1.0)?,
            mean: sum / count,
            rms: (squares / count).sqrt(),
        })
    }
}

impl SurfaceDistances {
    /// Measures all surfels; without surfels or triangles there are no distances.
    pub fn of(scene: &Scene, mesh: &TriangleTree) -> Self {
        let world = |v: [f32; 3]| Vec3::from_array(v).as_dvec3();
        let center = |surfel: &Surfel| scene.origin + world(surfel.center);
        let rim = |surfel: &Surfel, k: u32| {
            let (sin, cos) = (TAU * f64::from(k) / f64::from(RIM_POINTS)).sin_cos();
            center(surfel) + world(surfel.s) * cos + world(surfel.t) * sin
        };
        let surfels = scene.surfels.par_iter();
        let centers = surfels.clone().map(center).map(|point| mesh.distance(point));
        let rims = surfels.flat_map_iter(|surfel| (0..RIM_POINTS).map(move |k| mesh.distance(rim(surfel, k))));
        let finite = |distances: Vec<f64>| if mesh.is_empty() { None } else { Distances::of(distances) };
        Self { centers_to_mesh: finite(centers.collect()), rims_to_mesh: finite(rims.collect()) }
    }
}
