//! Sampling of a mesh at evenly spread points, whose density follows a priority.
//!
//! The method is that of Tien 2008, chapter 3, with the following steps:
//!
//! 1. [`voxels`]: a tree of boxes, halved across their longest side where triangles are
//!    (`overlap`), ends in voxels.
//! 2. [`priority`]: each voxel has a priority, from any function of voxels.
//! 3. `distribute`: a heap gives each sample to the voxel of the highest priority, which then
//!    falls.
//! 4. `candidates`: the samples of each voxel start evenly spread over the triangles in it.
//! 5. `relax`: samples move apart, across voxels too, and stay on the triangles.
//! 6. `voronoi`: the part of the surface nearest to each sample is cut out of the triangles;
//!    `disks`: a disk in the plane nearest to that part covers it; `ends`: clip lines end the disk
//!    where the surface ends.
//!
//! The thesis projects one or several points per voxel onto its triangles and does not say which
//! points. Their choice decides how well a surface is sampled: independent random points leave gaps
//! three times as wide as needed.

mod candidates;
mod disks;
mod distribute;
mod ends;
mod overlap;
pub mod priority;
mod projected;
mod relax;
pub mod surface;
mod uniform;
mod voronoi;
pub mod voxels;

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

pub use self::priority::{Priority, PriorityFunction};
pub use self::surface::MeshSurface;
use self::surface::Place;
use self::voxels::Voxel;
use crate::error::{Error, Result};
use crate::io::closed::is_closed;
use crate::io::{Mesh, Points};
use crate::memory;
use crate::progress::Progress;
use crate::scene::{Colors, Up, body};
use crate::surfels::guess_up;

/// The largest number of samples.
pub const MOST: usize = 1 << 28;

/// Samples per voxel if the depth of the tree is not given. Fewer voxels follow the priority less
/// closely; with more, the share of many voxels is less than one sample.
const FOR_EACH_VOXEL: usize = 4;

/// The largest number of voxels, unless there are more samples. A voxel takes 600 bytes.
const MOST_VOXELS: usize = 1 << 21;

/// Memory per sample, bytes at most: its voxels, its candidates on the surface around it, and its
/// cell.
const OF_SAMPLE: u64 = 1500;
/// Memory per independent random point, bytes at most.
const OF_UNIFORM: u64 = 250;

/// The method that places samples.
pub enum Method<'a> {
    /// By the priority of voxels.
    Stratified {
        /// The priority function.
        priority: &'a PriorityFunction<'a>,
        /// The number of halvings of boxes, limited to 2^21 voxels or as many as samples, whichever
        /// is more. If None, the limit is one voxel for every 4 samples.
        depth: Option<u32>,
    },
    /// By the priority of voxels, at the points that Tien 2008 uses (section 3.2): a baseline.
    /// Fewer samples than voxels go to those of the highest priorities.
    Projected {
        /// The priority function.
        priority: &'a PriorityFunction<'a>,
        /// As in [`Method::Stratified`].
        depth: Option<u32>,
    },
    /// Independent random points, uniform by area: a baseline. [`build`](super::build) computes
    /// their radii.
    Uniform,
}

/// A record of the sampling of a mesh.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Sampling {
    /// The number of samples.
    pub samples: u64,
    /// Triangles that have an area.
    pub triangles: u64,
    /// Triangles left out because a coordinate is not finite or too large.
    pub dropped_non_finite: u64,
    /// Triangles left out because they have no area.
    pub dropped_flat: u64,
    /// Voxels that contain a part of the surface; 0 for [`Method::Uniform`].
    pub voxels: u64,
    /// Voxels among these that got no sample.
    pub empty_voxels: u64,
    /// Whether no triangle was left out for its coordinates and every disk faces as its triangles
    /// are wound, also where the mesh has normals.
    pub faces_as_wound: bool,
    /// The number of times that boxes were halved.
    pub halvings: u32,
    /// Requested halvings that were left out, as they would give too many voxels.
    pub undone: u32,
}

impl Sampling {
    /// Returns a sentence for the user about each thing that was left out.
    pub fn notes(&self) -> Vec<String> {
        let counted = |count: u64, what: &str| (count > 0).then(|| format!("{count} {what}"));
        let notes = [
            counted(self.dropped_non_finite, "triangles were dropped: a coordinate is not finite or too large"),
            counted(self.dropped_flat, "triangles were dropped: they have no area"),
        ];
        let halved = (self.undone > 0).then(|| {
            format!(
                "the mesh's box was halved {} times, not {}: there would be more than {} voxels",
                self.halvings,
                self.halvings + self.undone,
                MOST_VOXELS.max(self.samples as usize)
            )
        });
        notes.into_iter().flatten().chain(halved).collect()
    }
}

/// Samples a mesh at `count` points.
///
/// The points have positions on the triangles, normals, and the texture coordinates and colours
/// that the mesh has. Except for [`Method::Uniform`], they have half-axes such that the disks cover
/// the surface. If the mesh has no normals, each normal is that of the disk's plane, which is
/// nearest to the sample's part of the surface; for [`Method::Uniform`] it is the triangle's.
///
/// The same seed gives the same points for any number of threads.
///
/// # Errors
///
/// [`Error::EmptyScene`] if no triangle has an area; [`Error::Usage`] if the count is 0 or more
/// than [`MOST`], or the parts of the mesh do not fit each other; and [`Error::NoMemory`].
pub fn sample(
    mesh: &Mesh,
    count: usize,
    method: &Method<'_>,
    seed: u64,
    progress: &dyn Progress,
) -> Result<(Points, Sampling)> {
    if !(1..=MOST).contains(&count) {
        return Err(Error::Usage(format!("a mesh is sampled at 1 to {MOST} points, not {count}")));
    }
    let each = if matches!(method, Method::Uniform) { OF_UNIFORM } else { OF_SAMPLE };
    memory::check(count as u64 * each, || format!("{count} samples of a mesh"))?;
    let surface = MeshSurface::new(mesh)?;
    let mut sampling = Sampling {
        samples: count as u64,
        triangles: surface.triangles.len() as u64,
        dropped_non_finite: surface.dropped_non_finite,
        dropped_flat: surface.dropped_flat,
        ..Sampling::default()
    };
    let points = match method {
        Method::Uniform => {
            let places = uniform::places(&surface, count, seed);
            let colors = surface.is_colored().then(|| places.par_iter().map(|place| surface.color(*place)).collect());
            points(&surface, &places, normals_at(&surface, &places), colors)
        }
        Method::Projected { priority, depth } => {
            let (voxels, quotas, _) = divided(&surface, count, (method, priority, *depth), &mut sampling, progress)?;
            let places = projected::places(&surface, &voxels, &quotas);
            let colors = surface.is_colored().then(|| places.par_iter().map(|place| surface.color(*place)).collect());
            covering(&surface, &places, colors, &mut sampling, progress)?
        }
        Method::Stratified { priority, depth } => {
            let (voxels, quotas, fair) = divided(&surface, count, (method, priority, *depth), &mut sampling, progress)?;
            let (candidates, mut places) = candidates::candidates(&voxels, &quotas, &fair, seed);
            let cells = relax::relax(&surface, &candidates, &mut places, progress)?;
            let colors = surface.is_colored().then(|| relax::colors(&surface, &candidates, &places, &cells));
            covering(&surface, &places, colors, &mut sampling, progress)?
        }
    };
    Ok((points, sampling))
}

/// Returns the voxels of a surface, the number of samples of each, and the fractional number of
/// samples that its priority asks for.
fn divided(
    surface: &MeshSurface<'_>,
    count: usize,
    (method, priority, depth): (&Method<'_>, &PriorityFunction<'_>, Option<u32>),
    sampling: &mut Sampling,
    progress: &dyn Progress,
) -> Result<(Vec<Voxel>, Vec<usize>, Vec<f64>)> {
    progress.begin("dividing the mesh", 0);
    let most = if depth.is_some() { MOST_VOXELS.max(count) } else { count / FOR_EACH_VOXEL };
    let (voxels, halvings) = voxels::voxels(surface, depth, most);
    sampling.halvings = halvings;
    sampling.undone = depth.map_or(0, |depth| depth - halvings);
    let priorities = priority(surface, &voxels);
    if priorities.len() != voxels.len() {
        let (given, needed) = (priorities.len(), voxels.len());
        return Err(Error::Usage(format!(
            "a priority function returns a number for each of {needed} voxels, not {given}"
        )));
    }
    let quotas = match method {
        Method::Projected { .. } => distribute::distribute_by_rank(&priorities, count),
        Method::Stratified { .. } | Method::Uniform => distribute::distribute(&priorities, count),
    };
    progress.end();
    sampling.voxels = voxels.len() as u64;
    sampling.empty_voxels = quotas.iter().filter(|quota| **quota == 0).count() as u64;
    // As in the heap, only positive priorities count. If there is none, all shares are 0 and the
    // quotas alone decide.
    let usable = |priority: &f64| if priority.is_finite() && *priority > 0.0 { *priority } else { 0.0 };
    let sum = priorities.iter().map(usable).sum::<f64>().max(f64::MIN_POSITIVE);
    let fair = priorities.iter().map(|priority| count as f64 * (usable(priority) / sum)).collect();
    Ok((voxels, quotas, fair))
}

/// The samples, with half-axes such that their disks cover the surface.
fn covering(
    surface: &MeshSurface<'_>,
    places: &[Place],
    colors: Option<Vec<[f32; 4]>>,
    sampling: &mut Sampling,
    progress: &dyn Progress,
) -> Result<Points> {
    let mesh = surface.mesh;
    let mut disks = disks::disks(surface, places, progress)?;
    let named = mesh.normals.as_ref().map(|_| normals_at(surface, places));
    let faces_as_named = named.as_ref().is_none_or(|named| disks.turn_to(named));
    let normals = named.unwrap_or_else(|| disks.normals());
    let mut points = points(surface, places, normals, colors);
    sampling.faces_as_wound = surface.dropped_non_finite == 0 && faces_as_named;
    points.closed = sampling.faces_as_wound && is_closed(&mesh.positions, &mesh.triangles);
    (points.axes, points.radii) = (Some(disks.half_axes()), Some(disks.radii()));
    points.clips = (!disks.clips.is_empty()).then_some(disks.clips);
    Ok(points)
}

fn normals_at(surface: &MeshSurface<'_>, places: &[Place]) -> Vec<DVec3> {
    places.par_iter().map(|place| surface.normal(*place)).collect()
}

/// The up direction of a mesh that does not state one, guessed as for its vertices.
fn guessed_up(mesh: &Mesh) -> Up {
    guess_up(&body(mesh.positions.len(), |index| DVec3::from_array(mesh.positions[index])).0)
}

fn points(surface: &MeshSurface<'_>, places: &[Place], normals: Vec<DVec3>, colors: Option<Vec<[f32; 4]>>) -> Points {
    let places = places.par_iter();
    // A sample without a texture may have any texture coordinates.
    let place_of = |place: &Place| surface.texture(*place).unwrap_or_default();
    Points {
        positions: places.clone().map(|place| (surface.center + surface.point(*place)).to_array()).collect(),
        normals: Some(normals.into_iter().map(|normal| normal.as_vec3().to_array()).collect()),
        colors: colors.map(Colors::Linear),
        texture: surface.mesh.texture.as_ref().map(|_| places.clone().map(place_of).collect()),
        texture_numbers: surface.texture_numbers().map(|of| places.map(|place| of[surface.index(*place)]).collect()),
        up: Some(surface.mesh.up.unwrap_or_else(|| guessed_up(surface.mesh))),
        ..Points::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halvings_that_were_left_out_are_told() {
        let sampling = Sampling { samples: 9, halvings: 28, undone: 32, ..Sampling::default() };
        let note = "the mesh's box was halved 28 times, not 60: there would be more than 2097152 voxels";
        assert_eq!(sampling.notes(), [note]);
        assert!(Sampling { undone: 0, ..sampling }.notes().is_empty());
    }
}
