//! What makes a voxel worth a sample.

use std::str::FromStr;

use glam::DVec3;
use rayon::prelude::*;

use super::surface::{MeshSurface, Place};
use super::voxels::{Patch, Voxel};
use crate::error::Error;

/// The priorities of voxels, one for each; samples are handed out in proportion. Replace it to sample by anything else.
pub type PriorityFunction<'a> = dyn Fn(&MeshSurface<'_>, &[Voxel]) -> Vec<f64> + Sync + 'a;

/// A priority that is built in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Priority {
    /// The number of triangles, each counted in a voxel by the share of its area there.
    #[default]
    Triangles,
    /// The number of triangles that have a part in the voxel, as in Tien 2008 (section 3.1): it favours voxels that the surface only just
    /// reaches into.
    Touched,
    /// The area of the surface.
    Area,
    /// The area times the variance of the normals, so with the square of the curvature.
    Curvature,
    /// The area times the standard deviation of the colours, so with the gradient of the texture.
    Texture,
}

/// What of the samples [`Priority::Curvature`] and [`Priority::Texture`] spread by area alone: a plane in one colour too is
/// a surface that must be covered.
const EVEN: f64 = 0.25;

/// Points of a voxel at which its colour is looked at.
const PROBES: usize = 16;

impl Priority {
    /// Each priority with its name and what it is, for a command line's help.
    pub const ALL: [(Self, &'static str, &'static str); 5] = [
        (Self::Triangles, "triangles", "where the mesh has many"),
        (Self::Touched, "touched", "the same, each counted wholly wherever it reaches"),
        (Self::Area, "area", "evenly"),
        (Self::Curvature, "curvature", "where the surface bends"),
        (Self::Texture, "texture", "where the colour changes"),
    ];

    /// The priorities of voxels.
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

/// The area times a quantity, and so much of the area alone that the samples which follow it are the share [`EVEN`].
fn blended(voxels: &[Voxel], quantity: impl Fn(&Voxel) -> f64 + Sync) -> Vec<f64> {
    let weighted: Vec<f64> = voxels.par_iter().map(|voxel| voxel.area * quantity(voxel)).collect();
    let (sum, area) = (weighted.iter().sum::<f64>(), voxels.iter().map(|voxel| voxel.area).sum::<f64>());
    let even = if sum > 0.0 { sum / area * EVEN / (1.0 - EVEN) } else { 1.0 };
    weighted.iter().zip(voxels).map(|(weighted, voxel)| weighted + even * voxel.area).collect()
}

/// The variance of the unit normals, by area.
fn bend(surface: &MeshSurface<'_>, voxel: &Voxel) -> f64 {
    let normals = voxel.patches.iter().map(|patch| surface.triangles[patch.triangle as usize].normal * patch.area);
    let mean = normals.sum::<DVec3>() / voxel.area;
    (1.0 - mean.length_squared()).max(0.0)
}

/// The standard deviation of the linear colours over a few points.
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
