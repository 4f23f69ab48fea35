//! From a mesh to points on it, by priority and evenly (Tien 2008, chapter 3).
//!
//! 1. [`voxels`]: a tree of boxes, halved across their longest side where triangles are (`overlap`), ends in voxels.
//! 2. [`priority`]: each voxel has a priority; any function of voxels will do.
//! 3. `distribute`: a heap hands out the samples, always to the voxel of the highest priority, which then falls.
//! 4. `candidates`: each voxel's samples begin evenly spread over the triangles in it.
//! 5. `relax`: they move apart, also from those of other voxels, and stay on the triangles.
//! 6. `voronoi`: the part of the surface that is nearest to each sample is cut out of the triangles; and `disks`: a disk covers
//!    it, in the plane that is nearest to it; and `ends` at lines, where the surface ends.
//!
//! The thesis projects one point a voxel, or several, onto its triangles and does not say which. Where these lie decides
//! how well a surface is sampled: independent random points leave gaps three times as wide as needed.

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

/// The most samples.
pub const MOST: usize = 1 << 28;

/// Samples for each voxel where the depth of the tree is not given. Fewer voxels follow the priority less closely; with
/// more, many a voxel's share is less than one sample.
const FOR_EACH_VOXEL: usize = 4;

/// The most voxels, unless there are more samples: they take 600 bytes each.
const MOST_VOXELS: usize = 1 << 21;

/// Memory that a sample takes, bytes at most: of voxels, of points of the surface around it, of its
/// cell; and of an independent point.
const OF_SAMPLE: u64 = 1500;
const OF_UNIFORM: u64 = 250;

/// How samples are placed.
pub enum Method<'a> {
    /// By the priority of voxels.
    Stratified {
        /// The priority function.
        priority: &'a PriorityFunction<'a>,
        /// How often boxes are halved, but not beyond 2^21 voxels or as many as samples; None for as many voxels as samples allow.
        depth: Option<u32>,
    },
    /// By the priority of voxels, where Tien 2008 places samples (section 3.2): a baseline.
    Projected {
        /// The priority function.
        priority: &'a PriorityFunction<'a>,
        /// As of [`Method::Stratified`].
        depth: Option<u32>,
    },
    /// Independent random points, evenly by area: a baseline. Their radii are left to [`build`](super::build).
    Uniform,
}

/// What was done to a mesh on the way to samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Sampling {
    /// Points.
    pub samples: u64,
    /// Triangles that have an area.
    pub triangles: u64,
    /// Triangles left out because a coordinate is not finite or too large.
    pub dropped_non_finite: u64,
    /// Triangles left out because they have no area.
    pub dropped_flat: u64,
    /// Voxels that hold some of the surface; 0 for [`Method::Uniform`].
    pub voxels: u64,
    /// Of these, voxels that got no sample.
    pub empty_voxels: u64,
    /// No triangle was left out for its coordinates, and each disk is turned as its triangles are, whatever normals the mesh gives.
    pub faces_as_wound: bool,
    /// How often boxes were halved.
    pub halvings: u32,
    /// How many of the halvings that were asked for were left out, as there would have been too many voxels.
    pub undone: u32,
}

impl Sampling {
    /// What a user should hear of: a sentence for everything that was left out.
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

/// Samples a mesh at `count` points: with positions on its triangles, normals, texture coordinates and colours as far as the
/// mesh has them, and, but by [`Method::Uniform`], half-axes with which the disks cover it. Without normals of the mesh those are
/// those of the disks' planes, which lie nearest to the part that each sample stands for, or of [`Method::Uniform`] of triangles.
///
/// The same seed gives the same points, whatever the machine's number of threads.
///
/// # Errors
///
/// [`Error::EmptyScene`] for a mesh without a triangle that has an area, [`Error::Usage`] for a count of none or more than
/// [`MOST`], or for a mesh whose parts do not fit each other, and [`Error::NoMemory`].
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
            let (voxels, quotas, _) = divided(&surface, count, (priority, *depth), &mut sampling, progress);
            let places = projected::places(&surface, &voxels, &quotas);
            let colors = surface.is_colored().then(|| places.par_iter().map(|place| surface.color(*place)).collect());
            covering(&surface, &places, colors, &mut sampling, progress)?
        }
        Method::Stratified { priority, depth } => {
            let (voxels, quotas, fair) = divided(&surface, count, (priority, *depth), &mut sampling, progress);
            let (candidates, mut places) = candidates::candidates(&voxels, &quotas, &fair, seed);
            let cells = relax::relax(&surface, &candidates, &mut places, progress)?;
            let colors = surface.is_colored().then(|| relax::colors(&surface, &candidates, &places, &cells));
            covering(&surface, &places, colors, &mut sampling, progress)?
        }
    };
    Ok((points, sampling))
}

/// The voxels of a surface, how many of `count` samples each gets, and how many it should have.
fn divided(
    surface: &MeshSurface<'_>,
    count: usize,
    (priority, depth): (&PriorityFunction<'_>, Option<u32>),
    sampling: &mut Sampling,
    progress: &dyn Progress,
) -> (Vec<Voxel>, Vec<usize>, Vec<f64>) {
    progress.begin("dividing the mesh", 0);
    let most = if depth.is_some() { MOST_VOXELS.max(count) } else { count / FOR_EACH_VOXEL };
    let (voxels, halvings) = voxels::voxels(surface, depth, most);
    sampling.halvings = halvings;
    sampling.undone = depth.map_or(0, |depth| depth - halvings);
    let priorities = priority(surface, &voxels);
    let quotas = distribute::distribute(&priorities, count);
    progress.end();
    sampling.voxels = voxels.len() as u64;
    sampling.empty_voxels = quotas.iter().filter(|quota| **quota == 0).count() as u64;
    // As the heap takes them; where none is positive, quotas alone decide.
    let usable = |priority: &f64| if priority.is_finite() && *priority > 0.0 { *priority } else { 0.0 };
    let sum = priorities.iter().map(usable).sum::<f64>().max(f64::MIN_POSITIVE);
    let fair = priorities.iter().map(|priority| count as f64 * (usable(priority) / sum)).collect();
    (voxels, quotas, fair)
}

/// Samples with half-axes with which they cover the surface.
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

/// Up of a mesh that does not say, as for its vertices.
fn guessed_up(mesh: &Mesh) -> Up {
    guess_up(&body(mesh.positions.len(), |index| DVec3::from_array(mesh.positions[index])).0)
}

fn points(surface: &MeshSurface<'_>, places: &[Place], normals: Vec<DVec3>, colors: Option<Vec<[f32; 4]>>) -> Points {
    let places = places.par_iter();
    // A place on no texture may be any.
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
