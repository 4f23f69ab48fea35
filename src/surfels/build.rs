//! Builds a scene from points.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::curvature::{Around, normals_at};
use super::estimate::{self, Estimate, Estimates};
use super::gather::{self, Gathered};
use super::graph::NeighbourGraph;
use super::mesh::{By, Painting};
use super::orient::opposed;
use super::outliers::drop_outliers;
use super::positions::DistinctPositions;
use super::{
    LARGEST_COORDINATE, Limits, Preparation, colors, guess_up, mesh, origin_for, painting, unit, usable_axes,
    usable_radius,
};
use crate::io::{Points, settle_colors};
use crate::scene::scene::{low_parts, shows};
use crate::scene::{Atlas, Bounds, Cap, Clip, SMALLEST_SCENE, Scene, Surfel, Texture, body};
use crate::{Error, Progress, Result};

/// The largest radius of a disk, in extents of the scene. Seen from anywhere near the scene, such a
/// disk is an infinite plane, and depths on it are as exact as on any other disk.
pub(super) const LARGEST_IN_EXTENTS: f64 = 1e6;

/// The largest absolute texture coordinate: larger f32 values have too few fractional bits for a
/// texture.
pub(super) const LARGEST_PLACE: f32 = 1e4;

/// Builds one scene from the points of all inputs, within the default [`Limits`].
///
/// Surfels keep the order of the points. A point with half-axes becomes an ellipse; a point with a
/// normal and a radius becomes a disk. Missing attributes are estimated from the neighbours among
/// all points. The result for a point is the same to the bit for any order of the points.
///
/// # Errors
///
/// [`Error::EmptyScene`] if no input holds a usable point, and [`Error::Usage`] if normals or radii
/// are missing and there are more than 2^32 - 1 points.
pub fn build(inputs: Vec<Points>, progress: &dyn Progress) -> Result<(Scene, Preparation)> {
    build_within(inputs, Vec::new(), &Limits::default(), progress)
}

/// Builds one scene from the points of all inputs, painted with `textures` at the points' texture
/// coordinates instead of their colours.
///
/// There is one texture for all inputs, or one for each input in their order, or as many as the
/// inputs' [`Points::texture_numbers`] name. Points of inputs without coordinates keep their
/// colours.
///
/// # Errors
///
/// The errors of [`build`], and [`Error::Usage`] if no input has texture coordinates, or the number
/// of textures is none of these three.
pub fn build_textured(
    inputs: Vec<Points>,
    textures: Vec<Texture>,
    progress: &dyn Progress,
) -> Result<(Scene, Preparation)> {
    build_within(inputs, textures, &Limits::default(), progress)
}

/// Builds a scene as [`build`] does, or [`build_textured`] if there are textures, within `limits`.
///
/// [`Limits::largest_ratio`] does not apply to given radii and half-axes, nor to those of a mesh's
/// vertices.
///
/// # Errors
///
/// The errors of [`build`] and [`build_textured`], and [`Error::Usage`] for limits out of range.
pub fn build_within(
    inputs: Vec<Points>,
    textures: Vec<Texture>,
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<(Scene, Preparation)> {
    limits.check()?;
    let mut inputs = inputs;
    settle_colors(&mut inputs);
    let painting = if textures.is_empty() { Painting::Means } else { Painting::Given };
    let mut inputs: Vec<Points> = inputs.into_iter().map(|input| mesh::of_mesh(input, By::Looks, painting)).collect();
    if textures.is_empty() {
        return built(gather::gather(inputs)?, limits, progress).map(|(made, _)| made);
    }
    painting::number(&mut inputs, textures.len())?;
    painting::painted(inputs, textures.into_iter().map(Arc::new).collect(), limits, progress)
}

/// Builds the scene of points with texture coordinates, and returns the coordinates in the common
/// plane of at least `textures` textures. Unusable coordinates become 0 and are counted.
pub(super) fn built_in_texture(
    mut gathered: Gathered,
    textures: u32,
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<(Scene, Preparation, Coordinates)> {
    painting::clear_bare(&mut gathered.points);
    let unusable = |place: &[f32; 2]| !place.iter().all(|turns| turns.abs() <= LARGEST_PLACE);
    for place in gathered.points.texture.iter_mut().flatten().filter(|place| unusable(place)) {
        *place = [0.0; 2];
        gathered.preparation.replaced_places += 1;
    }
    let atlas = painting::join(&mut gathered.points, textures);
    let ((scene, preparation), places) = built(gathered, limits, progress)?;
    Ok((scene, preparation, Coordinates { atlas, ..places }))
}

/// Builds a scene as [`build`] does, but always with the surfels of a mesh at its vertices, for
/// algorithms that use surfels as samples of a surface. Also returns the surfels' texture
/// coordinates if all inputs have some.
///
/// # Errors
///
/// The errors of [`build`].
pub fn build_at_vertices(inputs: Vec<Points>, progress: &dyn Progress) -> Result<(Scene, Preparation, Coordinates)> {
    let mut inputs = inputs;
    settle_colors(&mut inputs);
    let mut inputs: Vec<Points> =
        inputs.into_iter().map(|input| mesh::of_mesh(input, By::Vertices, Painting::Means)).collect();
    painting::number_together(&mut inputs)?;
    let all_placed = inputs.iter().all(|input| input.texture.is_some() || input.positions.is_empty());
    let mut gathered = gather::gather(inputs)?;
    if !all_placed {
        (gathered.points.texture, gathered.points.texture_slopes) = (None, None);
    }
    gathered.points = std::mem::take(&mut gathered.points).in_light();
    // Only the samples' positions matter, not how their surfels curve.
    let flat = Limits { curved: false, ..Limits::default() };
    built_in_texture(gathered, 1, &flat, progress)
}

/// The texture coordinates of surfels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Coordinates {
    /// Coordinates (u, v) at the surfels' centres, origin bottom left, in the common plane of the
    /// textures; empty for a scene without texture coordinates.
    pub centers: Vec<[f32; 2]>,
    /// The gradients of u and of v along x, y and z, per world unit; all zero where they are
    /// unknown.
    pub slopes: Vec<[[f32; 3]; 2]>,
    /// The layout of the textures in that plane.
    pub atlas: Atlas,
}

/// The scene, its preparation, and the texture coordinates of its surfels.
pub(super) type Built = ((Scene, Preparation), Coordinates);

pub(super) fn built(mut gathered: Gathered, limits: &Limits, progress: &dyn Progress) -> Result<Built> {
    let bounds = Bounds::of(gathered.points.positions.par_iter().map(|position| DVec3::from_array(*position)));
    let (body, _) = body(gathered.points.positions.len(), |index| DVec3::from_array(gathered.points.positions[index]));
    // Points of a file with levels of detail may be rounded relative to the origin that the file
    // states, so that origin is used. Otherwise it is computed from the points.
    let of_tree = gathered.points.whole.as_ref().filter(|whole| gathered.points.tree.is_some() && whole.is_near());
    let origin = of_tree.map_or_else(|| origin_for(&body), |whole| whole.origin);
    let up = gathered.points.up.unwrap_or_else(|| guess_up(&body));
    let sorted = |positions: &[[f64; 3]]| {
        progress.begin("sorting points", 0);
        let distinct = DistinctPositions::new(positions, &bounds, origin);
        progress.end();
        distinct
    };
    let mut distinct = None;
    if let Some(deviations) = limits.outliers {
        let mut all = sorted(&gathered.points.positions)?;
        gathered.preparation.dropped_outliers = drop_outliers(&mut gathered, &mut all, deviations, progress);
        distinct = Some(all);
    }
    let mut preparation = std::mem::take(&mut gathered.preparation);
    let given = Given(&gathered);
    let count = gathered.points.positions.len();
    preparation.surfels = count as u64;
    preparation.guessed_up = gathered.points.up.is_none();
    preparation.estimated_normals = (0..count).into_par_iter().filter(|&i| given.lacks_normal(i)).count() as u64;
    preparation.estimated_radii = (0..count).into_par_iter().filter(|&i| given.lacks_radius(i)).count() as u64;
    let estimated = if preparation.estimated_normals > 0 || preparation.estimated_radii > 0 {
        let distinct = distinct.map_or_else(|| sorted(&gathered.points.positions), Ok)?;
        let how = (up.axis(), limits.largest_ratio);
        let (of_position, graph) = estimated(&given, &distinct, how, &mut preparation, progress);
        Some(Estimated { of_position, distinct, graph })
    } else {
        None
    };
    let mut surfels = given.surfels(estimated.as_ref(), origin);
    // Gaussians have no front side.
    let oriented = preparation.estimated_normals == 0
        && !preparation.has_random_sides()
        && !gathered.points.encoded
        && !gathered.points.unsided;
    let caps = match estimated {
        Some(estimated) if limits.curved && preparation.estimated_radii > 0 => {
            estimated.caps(&given, &surfels, oriented)
        }
        _ => given.caps(),
    };
    preparation.limited_radii = limit_radii(&mut surfels, body.extent().max_element())?;
    let caps = usable_caps(caps, &surfels);
    let relative = |index: usize| DVec3::from_array(gathered.points.positions[index]) - origin;
    let low = low_parts(&surfels, relative);
    preparation.rounding = rounding(&surfels, &low, relative);
    let normals = own_normals(&given, &surfels);
    let Gathered { points, provenance, .. } = gathered;
    let Points { colors, encoded, closed, clips, thirds, texture, texture_slopes, tree, .. } = points;
    let (centers, slopes) = (texture.unwrap_or_default(), texture_slopes.unwrap_or_default());
    let (colors, closed) = (colors::folded(colors), closed && oriented);
    let (clips, thirds) = (usable_clips(clips), usable_thirds(thirds, &surfels));
    let of_disks = Scene { low, clips, caps, normals, thirds, ..Scene::default() };
    let mut hierarchy = tree.filter(|_| !encoded).and_then(|tree| tree.hierarchy(origin));
    hierarchy.iter_mut().for_each(|tree| tree.settle(&surfels, &of_disks.low));
    let hierarchy = hierarchy.map(Arc::new);
    let scene = Scene { origin, surfels, colors, encoded, oriented, closed, up, provenance, hierarchy, ..of_disks };
    // The points that the default view leaves out.
    preparation.strays = scene.framed().1;
    Ok(((scene, preparation), Coordinates { centers, slopes, atlas: Atlas::ONE }))
}

/// The clip lines of surfels; empty if no disk is clipped, as in most scenes.
fn usable_clips(clips: Option<Vec<Clip>>) -> Vec<Clip> {
    let clips: Vec<Clip> = clips.unwrap_or_default().into_iter().map(Clip::usable).collect();
    if clips.iter().all(Clip::is_none) { Vec::new() } else { clips }
}

/// The third half-axes of 3D Gaussians, which stay the shortest where a radius was limited.
fn usable_thirds(thirds: Option<Vec<f32>>, surfels: &[Surfel]) -> Vec<f32> {
    let thirds = thirds.unwrap_or_default().into_iter().zip(surfels);
    thirds.map(|(third, surfel)| third.min(surfel.shorter())).collect()
}

/// The caps of these surfels, limited to usable heights; empty if all are flat, as in most scenes.
fn usable_caps(caps: Vec<Cap>, surfels: &[Surfel]) -> Vec<Cap> {
    let caps = caps.into_iter().zip(surfels);
    let caps: Vec<Cap> = caps.map(|(cap, surfel)| cap.usable(surfel.radius().into())).collect();
    if caps.iter().all(Cap::is_flat) { Vec::new() } else { caps }
}

/// The ellipse with the half-axes `axes` turned into the plane perpendicular to `normal`: s is
/// projected onto that plane, t follows, and both keep their lengths.
fn laid(center: Vec3, axes: [[f32; 3]; 2], normal: Vec3) -> Surfel {
    let [s, t] = axes.map(|axis| DVec3::from_array(axis.map(f64::from)));
    let normal = normal.as_dvec3().normalize();
    let along = s.reject_from_normalized(normal).try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
    let [s, t] = [along * s.length(), normal.cross(along) * t.length()];
    Surfel::ellipse(center, s.as_vec3(), t.as_vec3())
}

/// A given normal counts as equal to the normal of the half-axes if the angle between them is at
/// most this, radians.
const LEAST_TURN: f32 = 1e-3;

/// The unit normal of a surfel's plane; +z if it is degenerate.
pub(super) fn plane_of(surfel: &Surfel) -> Vec3 {
    unit(surfel.normal().to_array()).unwrap_or(Vec3::Z)
}

/// The shading normal of point `i`: the given one if the point also has half-axes and their normal
/// differs, else the normal of the surfel's plane.
pub(super) fn own_normal(given: &Given<'_>, i: usize, surfel: &Surfel) -> [f32; 3] {
    let normal = given.axes(i).and_then(|_| given.normal(i));
    let plane = plane_of(surfel);
    normal.filter(|normal| normal.angle_between(plane) > LEAST_TURN).unwrap_or(plane).to_array()
}

/// The shading normals of all surfels, if one of them differs from the normal of its surfel's
/// plane; else empty.
fn own_normals(given: &Given<'_>, surfels: &[Surfel]) -> Vec<[f32; 3]> {
    let own = |(i, surfel): (usize, &Surfel)| own_normal(given, i, surfel);
    let differs = |(i, surfel): (usize, &Surfel)| own((i, surfel)) != plane_of(surfel).to_array();
    if given.0.points.normals.is_none() || given.0.points.axes.is_none() || !surfels.par_iter().enumerate().any(differs)
    {
        return Vec::new();
    }
    surfels.par_iter().enumerate().map(own).collect()
}

/// The attributes of points. Unusable attributes count as missing.
pub(super) struct Given<'a>(pub(super) &'a Gathered);

impl Given<'_> {
    fn axes(&self, i: usize) -> Option<[Vec3; 2]> {
        usable_axes(*self.0.points.axes.as_ref()?.get(i)?)
    }

    fn normal(&self, i: usize) -> Option<Vec3> {
        unit(*self.0.points.normals.as_ref()?.get(i)?)
    }

    /// The largest given radius or half-axis; 0 if there is none.
    pub(super) fn largest_radius(&self) -> f32 {
        let largest = |i: usize| match self.axes(i) {
            Some([s, t]) => s.length().max(t.length()),
            None => self.radius(i).unwrap_or(0.0),
        };
        (0..self.0.points.positions.len()).into_par_iter().map(largest).reduce(|| 0.0, f32::max)
    }

    fn radius(&self, i: usize) -> Option<f32> {
        usable_radius(*self.0.points.radii.as_ref()?.get(i)?)
    }

    /// The given cap, if there are usable half-axes.
    fn cap(&self, i: usize) -> Option<Cap> {
        self.axes(i).and(self.0.points.caps.as_ref()?.get(i).copied())
    }

    /// The given caps, flat where they are missing; empty if no input has any.
    pub(super) fn caps(&self) -> Vec<Cap> {
        let count = self.0.points.caps.as_ref().map_or(0, Vec::len);
        (0..count).map(|i| self.cap(i).unwrap_or_default()).collect()
    }

    /// The surfels of all points relative to `origin`, with missing attributes from `estimated`.
    pub(super) fn surfels(&self, estimated: Option<&Estimated>, origin: DVec3) -> Vec<Surfel> {
        let estimate_of = |i: usize| estimated.map_or_else(Estimate::default, |all| all.of_point(i));
        let surfel = |(i, position): (usize, &[f64; 3])| {
            // Adding +0 makes -0 the same coordinate as 0.
            let center = (DVec3::from_array(*position) - origin).as_vec3() + Vec3::ZERO;
            if let Some([s, t]) = self.axes(i) {
                return Surfel::ellipse(center, s, t);
            }
            match (self.normal(i), self.radius(i)) {
                (Some(normal), Some(radius)) => Surfel::disk(center, normal, radius),
                (None, Some(radius)) => Surfel::disk(center, estimate_of(i).normal(), radius),
                (Some(normal), None) => laid(center, estimate_of(i).axes, normal),
                (None, None) => {
                    let [s, t] = estimate_of(i).axes.map(Vec3::from_array);
                    Surfel::ellipse(center, s, t)
                }
            }
        };
        self.0.points.positions.par_iter().enumerate().map(surfel).collect()
    }

    pub(super) fn lacks_normal(&self, i: usize) -> bool {
        self.normal(i).is_none() && self.axes(i).is_none()
    }

    pub(super) fn lacks_radius(&self, i: usize) -> bool {
        self.radius(i).is_none() && self.axes(i).is_none()
    }
}

/// The estimates for points that lack attributes.
pub(super) struct Estimated {
    distinct: DistinctPositions,
    of_position: Vec<Estimate>,
    graph: NeighbourGraph,
}

impl Estimated {
    fn of_point(&self, i: usize) -> Estimate {
        self.of_position[self.distinct.of_point()[i] as usize]
    }

    /// The cap of each surfel: the given one, or, where the size was estimated, one with the
    /// curvature of the surface. `sided` says whether the normals distinguish the surface's two
    /// sides.
    fn caps(&self, given: &Given<'_>, surfels: &[Surfel], sided: bool) -> Vec<Cap> {
        let given_normals = normals_at(&self.distinct, |i| given.normal(i));
        let normal = |position: u32| {
            let given = given_normals.get(position as usize).copied().flatten();
            given.unwrap_or_else(|| self.of_position[position as usize].normal()).to_array()
        };
        // Each normal is used at all neighbours.
        let normals: Vec<[f32; 3]> = (0..self.distinct.len() as u32).into_par_iter().map(normal).collect();
        let normal = |position: u32| DVec3::from_array(normals[position as usize].map(f64::from));
        let around = Around { distinct: &self.distinct, graph: &self.graph, normal, sided };
        self.distinct.map_points(|point, position| {
            let (point, surfel) = (point as usize, &surfels[point as usize]);
            match given.cap(point) {
                Some(cap) => cap,
                None if given.lacks_radius(point) => around.cap(position, [surfel.s, surfel.t]),
                None => Cap::FLAT,
            }
        })
    }
}

/// Estimates the missing attributes. `up` is the scene's up direction, and `largest_ratio` limits
/// the ratio of a radius to the radii of its neighbours. Returns the estimate for each position and
/// the neighbour graph, and fills in the counts of `preparation`.
fn estimated(
    given: &Given<'_>,
    distinct: &DistinctPositions,
    (up, largest_ratio): (DVec3, f64),
    preparation: &mut Preparation,
    progress: &dyn Progress,
) -> (Vec<Estimate>, NeighbourGraph) {
    let all = preparation.estimated_normals.max(preparation.estimated_radii) == preparation.surfels;
    let wanted = (!all).then(|| {
        let mut wanted = vec![false; distinct.len()];
        for (i, &position) in distinct.of_point().iter().enumerate() {
            wanted[position as usize] |= given.lacks_normal(i) || given.lacks_radius(i);
        }
        wanted
    });
    let Estimates { of_position, median_spacing, limited, graph } =
        estimate::estimate(distinct, wanted.as_deref(), (up, largest_ratio), progress);
    preparation.distinct_positions = Some(distinct.len() as u64);
    preparation.median_spacing = median_spacing;
    let smaller = |(i, &position): (usize, &u32)| limited[position as usize] && given.lacks_radius(i);
    let limited = distinct.of_point().par_iter().enumerate().filter(|point| smaller(*point)).count() as u64;
    preparation.limited_by_neighbours = Some(limited);
    if preparation.estimated_normals == 0 {
        preparation.opposed_normals = opposed(distinct, &graph, |point| given.normal(point));
    }
    (of_position, graph)
}

/// Shortens half-axes to [`LARGEST_IN_EXTENTS`] times the scene's size; returns how many surfels
/// changed.
///
/// # Errors
///
/// [`Error::EmptyScene`] if the scene is too small for f32 arithmetic.
fn limit_radii(surfels: &mut [Surfel], extent: f64) -> Result<u64> {
    let largest = surfels.par_iter().map(Surfel::radius).reduce(|| 0.0, f32::max);
    if extent >= SMALLEST_SCENE && f64::from(largest) <= LARGEST_IN_EXTENTS * extent {
        return Ok(0);
    }
    // If most disks are larger than the box of their centres, the median diameter is the scene's
    // size.
    let typical = estimate::median(&mut surfels.par_iter().map(|surfel| surfel.radius().into()).collect::<Vec<_>>());
    let size = extent.max(2.0 * typical.unwrap_or(0.0));
    if size < SMALLEST_SCENE {
        return Err(Error::EmptyScene(format!(
            "the scene is {size:.1e} world units wide, but only scenes of {SMALLEST_SCENE:e} to {LARGEST_COORDINATE:e} can be drawn: scale it"
        )));
    }
    let most = LARGEST_IN_EXTENTS * size;
    let limit = |surfel: &mut Surfel| {
        // Each half-axis is limited separately, so that a thin ellipse stays thin.
        let shortened = |axis: [f32; 3]| {
            let axis = DVec3::from_array(axis.map(f64::from));
            axis.clamp_length_max(most).as_vec3().to_array()
        };
        let before = *surfel;
        (surfel.s, surfel.t) = (shortened(before.s), shortened(before.t));
        u64::from(*surfel != before)
    };
    Ok(surfels.par_iter_mut().map(limit).sum())
}

/// The largest rounding error of a centre's coordinate, world units, among surfels small enough to
/// show it; None if no surfel shows its error. `center` returns exact centres relative to the
/// origin.
fn rounding(surfels: &[Surfel], low: &[[f32; 3]], center: impl Fn(usize) -> DVec3 + Sync) -> Option<f64> {
    let error = |(index, low): (usize, &[f32; 3])| {
        let surfel = &surfels[index];
        let kept = DVec3::from_array(surfel.center.map(f64::from)) + DVec3::from_array(low.map(f64::from));
        let error = (center(index) - kept).abs().max_element();
        shows(surfel, error).then_some(error)
    };
    low.par_iter().enumerate().filter_map(error).reduce_with(f64::max)
}
