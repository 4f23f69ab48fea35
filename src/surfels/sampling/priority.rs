//! The priorities of voxels.

use std::str::FromStr;

use glam::DVec3;
use rayon::prelude::*;

use super::surface::{MeshSurface, Place};
use super::voxels::{Patch, Voxel};
use crate::error::Error;

/// A function that returns one priority per voxel; the number of samples is proportional to it.
/// Pass another function to sample by anything else.
pub type PriorityFunction<'a> = dyn Fn(&MeshSurface<'_>, &[Voxel]) -> Vec<f64> + Sync + 'a;

/// A built-in priority.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Priority {
    /// The number of triangles, each weighted by the fraction of its area in the voxel.
    #[default]
    Triangles,
    /// The number of triangles that reach into the voxel, as in Tien 2008 (section 3.1). It favours
    /// voxels that the surface only just reaches into.
    Touched,
    /// The area of the surface in the voxel.
    Area,
    /// The area times the variance of the normals, which grows with the square of the curvature.
    Curvature,
    /// The area times the standard deviation of the colours, which grows with the gradient of the
    /// texture.
    Texture,
}

/// The fraction of the samples that [`Priority::Curvature`] and [`Priority::Texture`] distribute by
/// area alone, as a plane in one colour must be covered too.
const EVEN: f64 = 0.25;

/// The number of points of a voxel at which its colour is evaluated.
const PROBES: usize = 16;

impl Priority {
    /// Each priority with its name and its description in the command line's help.
    pub const ALL: [(Self, &'static str, &'static str); 5] = [
        (Self::Triangles, "triangles", "where the mesh has many"),
        (Self::Touched, "touched", "the same, but each counts as one in every voxel that it reaches"),
        (Self::Area, "area", "evenly"),
        (Self::Curvature, "curvature", "where the surface bends"),
        (Self::Texture, "texture", "where the colour changes"),
    ];

    /// Returns the priority of each voxel.
    pub fn of(self, surface: &MeshSurface<'_>, voxels: &[Voxel]) -> Vec<f64> {
        let share = |patch: &Patch| patch.area / surface.triangles[patch.triangle as usize].area;
        match self {
            Self::Triangles => voxels.par_iter().map(|voxel| voxel.patches.iter().map(share).sum()).collect(),
            Self::Touched => voxels.par_iter().map(|voxel| voxel.patches.len() as f64).collect(),
            Self::Area => voxels.par_iter().map(|voxel| voxel.area).collect(),
            Self::Curvature => blended(voxels, |voxel| bend(surface, voxel)),
            Self::Texture => blended(voxels, |voxel| contrast(surface, voxel)),
        }
    }
}

/// The area of each voxel times `quantity`, plus a multiple of the area. The multiple is chosen so
/// that the second term attracts the fraction [`EVEN`] of the samples.
fn blended(voxels: &[Voxel], quantity: impl Fn(&Voxel) -> f64 + Sync) -> Vec<f64> {
    let weighted: Vec<f64> = voxels.par_iter().map(|voxel| voxel.area * quantity(voxel)).collect();
    let (sum, area) = (weighted.iter().sum::<f64>(), voxels.iter().map(|voxel| voxel.area).sum::<f64>());
    let even = if sum > 0.0 { sum / area * EVEN / (1.0 - EVEN) } else { 1.0 };
    weighted.iter().zip(voxels).map(|(weighted, voxel)| weighted + even * voxel.area).collect()
}

/// The variance of the unit normals, weighted by area.
fn bend(surface: &MeshSurface<'_>, voxel: &Voxel) -> f64 {
    let normals = voxel.patches.iter().map(|patch| surface.triangles[patch.triangle as usize].normal * patch.area);
    let mean = normals.sum::<DVec3>() / voxel.area;
    (1.0 - mean.length_squared()).max(0.0)
}

/// The standard deviation of the linear colours at [`PROBES`] points.
fn contrast(surface: &MeshSurface<'_>, voxel: &Voxel) -> f64 {
    let places = super::candidates::spread(voxel, PROBES, [0.5; 3]);
    let colors: Vec<DVec3> = places
        .map(|(triangle, weights)| {
            let [r, g, b, a] = surface.color(Place { triangle, weights }).map(f64::from);
            DVec3::new(r, g, b) * a
        })
        .collect();
    let mean = colors.iter().sum::<DVec3>() / colors.len() as f64;
    (colors.iter().map(|color| color.distance_squared(mean)).sum::<f64>() / colors.len() as f64).sqrt()
}

impl FromStr for Priority {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        Self::ALL.iter().find(|(_, known, _)| *known == name).map(|(priority, _, _)| *priority).ok_or_else(|| {
            let names = Self::ALL.map(|(_, known, _)| known).join(", ");
            Error::Usage(format!("there is no priority `{name}`: take one of {names}"))
        })
    }
}
