//! Distances between surfels and the surface that they stand for.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::Serialize;

use super::Sorted;
use crate::error::Result;
use crate::io::Mesh;
use crate::scene::Scene;
use crate::surfels::sampling::{Method, sample};
use crate::truth::{DiskTree, TriangleTree};

/// The number of points at which a disk's rim is measured; four of them are ends of half-axes.
const RIM_POINTS: u32 = 8;

/// The number of points of the mesh at which its distance from the surfels is measured.
pub const MESH_POINTS: usize = 200_000;

/// The seed of those points, different from that of any sampling.
const SEED: u64 = 0x6d65_6173_7572_6521;

/// Statistics of the distances of points from a surface, world units, none negative.
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

/// Distances between the surfels and a mesh. The distance of a point from the mesh is that from the
/// nearest point of any triangle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SurfaceDistances {
    /// From the surfels' centres to the mesh.
    pub centers_to_mesh: Option<Distances>,
    /// From eight points on each disk's rim to the mesh: a flat disk on a curved surface departs
    /// from the surface towards its rim.
    ///
    /// Where clip lines cut the disk, the points on the lines count instead; disks whose centre is
    /// clipped away are left out.
    pub rims_to_mesh: Option<Distances>,
    /// From [`MESH_POINTS`] random points of the mesh, uniform by area, to the nearest surfel's
    /// centre: the fineness of the sampling.
    pub mesh_to_centers: Option<Distances>,
    /// From the same points to the nearest disk: the shape that the surfels miss. 0 where a disk
    /// passes through the point.
    pub mesh_to_disks: Option<Distances>,
}

impl Distances {
    /// Summarises `values`; None if there are none.
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
    /// Measures all surfels against `mesh`; `triangles` is its tree. Without surfels there are no
    /// distances.
    ///
    /// # Errors
    ///
    /// The errors of [`sample`], such as for a mesh without area.
    pub fn of(scene: &Scene, mesh: &Mesh, triangles: &TriangleTree) -> Result<Self> {
        let world = |v: [f32; 3]| Vec3::from_array(v).as_dvec3();
        let center = |index: usize| scene.origin + scene.center(index);
        let rim = |index: usize, k: u32| {
            let surfel = &scene.surfels[index];
            let (sin, cos) = (TAU * f64::from(k) / f64::from(RIM_POINTS)).sin_cos();
            let kept = scene.clips.get(index).map_or(1.0, |clip| clip.reach(cos, sin));
            let height = scene.caps.get(index).map_or(0.0, |cap| cap.height(kept * cos, kept * sin));
            let up = || world(surfel.s).cross(world(surfel.t)).normalize_or_zero() * height;
            (kept > 0.0).then(|| center(index) + (world(surfel.s) * cos + world(surfel.t) * sin) * kept + up())
        };
        let surfels = (0..scene.surfels.len()).into_par_iter();
        let centers = surfels.clone().map(center).map(|point| triangles.distance(point));
        let rims = surfels
            .flat_map_iter(|index| (0..RIM_POINTS).filter_map(move |k| Some(triangles.distance(rim(index, k)?))));
        let disks = DiskTree::new(scene);
        let (on_mesh, _) = sample(mesh, MESH_POINTS, &Method::Uniform, SEED, &())?;
        let points = on_mesh.positions.par_iter().map(|point| DVec3::from_array(*point));
        let to_centers = points.clone().map(|point| disks.distance_to_center(point));
        let to_disks = points.map(|point| disks.distance(point));
        let of = |distances: Vec<f64>| if disks.is_empty() { None } else { Distances::of(distances) };
        Ok(Self {
            centers_to_mesh: of(centers.collect()),
            rims_to_mesh: of(rims.collect()),
            mesh_to_centers: of(to_centers.collect()),
            mesh_to_disks: of(to_disks.collect()),
        })
    }
}
