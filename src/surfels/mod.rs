//! From points and meshes to surfels.

pub mod analytic;
mod coarse;
mod colors;
mod coverage;
mod eigen;
mod estimate;
mod forest;
mod from_points;
mod gather;
mod graph;
mod mesh;
mod neighbours;
mod orient;
mod outliers;
mod positions;
pub mod sampling;
mod sheets;
pub mod simplify;
mod sizes;
#[cfg(test)]
mod tests;
mod texture;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

pub use self::coarse::coarse;
pub use self::coverage::{Coverage, coverage};
pub use self::from_points::{FromPoints, Surfels, from_points};
pub use self::orient::Orientation;
pub use self::sizes::{Size, Triangle};

use self::estimate::{Estimate, Estimates, RADIUS_RANGE};
use self::gather::Gathered;
use self::positions::{DistinctPositions, exponent, power_of_two};
use crate::io::Points;
use crate::scene::scene::{low_parts, shows};
use crate::scene::{Bounds, Colors, SMALLEST_SCENE, Scene, Surfel, Texture, Up, body};
use crate::{Error, Progress, Result};

/// The largest absolute coordinate of a point, world units (in metres, a hundred light years). Larger ones are treated
/// like ones that are not finite, because products of f32 lengths would overflow on the way to the image.
pub const LARGEST_COORDINATE: f64 = 1e18;

/// The largest radius of a disk, in extents of the scene: from anywhere near the scene it is a plane without an end, and depths
/// on it are as exact as others.
const LARGEST_IN_EXTENTS: f64 = 1e6;

/// The largest absolute texture coordinate: f32 ones beyond have no digits after the point that a texture could use.
const LARGEST_PLACE: f32 = 1e4;

/// What was done to the points on the way to a scene.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Preparation {
    /// Points in all inputs.
    pub points: u64,
    /// Points that are in the files but not among `points`: they are marked as withheld, which is deleted.
    pub withheld: u64,
    /// Vertices that are in the meshes but not among `points`: no triangle with an area names them.
    pub loose: u64,
    /// Points left out because a coordinate is not finite or exceeds [`LARGEST_COORDINATE`].
    pub dropped_non_finite: u64,
    /// Surfels in the scene: `points - dropped_non_finite`.
    pub surfels: u64,
    /// Surfels whose normal was missing, zero or not finite, and was estimated from neighbours.
    pub estimated_normals: u64,
    /// Surfels whose radius was missing, not positive or not finite, and was estimated from neighbours.
    pub estimated_radii: u64,
    /// Surfels whose colour was not finite and was replaced by [`DEFAULT_COLOR`](crate::scene::color::DEFAULT_COLOR).
    pub replaced_colors: u64,
    /// Points whose texture coordinates were not finite or too large and became 0; counted where a texture paints them.
    pub replaced_places: u64,
    /// Different positions among the surfels; None if nothing had to be estimated, so nobody looked.
    pub distinct_positions: Option<u64>,
    /// Points that stray: they lie so far from nearly all others that the default view leaves them out ([`Scene::body`]).
    pub strays: u64,
    /// Surfels larger than a million times the scene, which were made that large.
    pub limited_radii: u64,
    /// The largest error of a centre's coordinate, world units, where it may show: it is more than 1/256 of the surfel's shorter
    /// half-axis, although coordinates are kept in twice the digits of f32.
    pub rounding: Option<f64>,
    /// Median distance between an estimated position and the nearest other one, world units; None if nothing had to be
    /// estimated or there is only one position.
    pub median_spacing: Option<f64>,
}

impl Preparation {
    /// What a user should hear of: a sentence for everything that was lost or replaced.
    pub fn notes(&self) -> Vec<String> {
        let counted = |count: u64, what: &str| (count > 0).then(|| format!("{count} points {what}"));
        let notes = [
            counted(
                self.withheld,
                "were left out: they are marked as withheld, which is deleted (--keep-withheld keeps them)",
            ),
            (self.loose > 0).then(|| format!("{} vertices of no triangle were left out", self.loose)),
            counted(self.dropped_non_finite, "were dropped: a coordinate is not finite or too large"),
            counted(self.replaced_colors, "had a colour that is not finite and became grey"),
            counted(self.replaced_places, "had texture coordinates that are not finite or too large and became 0"),
        ];
        let strays = counted(
            self.strays,
            "stray: they lie far away from nearly all others, and the default view leaves them out",
        );
        let limited =
            counted(self.limited_radii, "had a radius of more than a million times the scene and became that large");
        let rounding = self.rounding.map(|error| {
            format!("the smallest surfels lie so far from others that their coordinates err by up to {error:.2e} world units")
        });
        notes.into_iter().chain([strays, limited, rounding]).flatten().collect()
    }
}

/// Makes one scene of the points of all inputs.
///
/// Surfels keep the order of the points. Each is the ellipse of its half-axes where they are given, else a disk. What a point lacks is estimated from its neighbours among
/// all points; the result for a point does not depend on the order the points come in, to the last bit.
///
/// # Errors
///
/// [`Error::EmptyScene`] if no input holds a usable point, and
/// [`Error::Usage`] if normals or radii are missing and there are more than 2^32 - 1 points.
pub fn build(inputs: Vec<Points>, progress: &dyn Progress) -> Result<(Scene, Preparation)> {
    let gathered = gather::gather(inputs.into_iter().map(mesh::of_vertices).collect())?;
    built(gathered, progress)
}

/// Makes one scene of the points of all inputs, painted with `texture` at the points' texture coordinates, instead of their colours.
///
/// # Errors
///
/// Those of [`build`], and [`Error::Usage`] if an input has no texture coordinates.
pub fn build_textured(inputs: Vec<Points>, texture: Texture, progress: &dyn Progress) -> Result<(Scene, Preparation)> {
    if inputs.iter().any(|input| input.texture.is_none() && !input.positions.is_empty()) {
        return Err(Error::Usage("a texture paints points that have texture coordinates, and some have none".into()));
    }
    let mut gathered = gather::gather(inputs.into_iter().map(mesh::of_vertices).collect())?;
    let mut places = gathered.texture.take().unwrap_or_default();
    let unusable = |place: &[f32; 2]| !place.iter().all(|turns| turns.abs() <= LARGEST_PLACE);
    for place in places.iter_mut().filter(|place| unusable(place)) {
        *place = [0.0; 2];
        gathered.preparation.replaced_places += 1;
    }
    let (mut scene, preparation) = built(gathered, progress)?;
    scene.colors = Colors::Textured(texture::painted(&scene, texture.into(), &places, progress)?);
    Ok((scene, preparation))
}

fn built(gathered: Gathered, progress: &dyn Progress) -> Result<(Scene, Preparation)> {
    let Gathered { positions, normals, radii, axes, clips, colors, up, closed, provenance, mut preparation, .. } =
        gathered;
    let colors = colors::folded(colors);
    let bounds = Bounds::of(positions.par_iter().map(|position| DVec3::from_array(*position)));
    let (body, _) = body(positions.len(), |index| DVec3::from_array(positions[index]));
    let origin = origin_for(&body);
    let up = up.unwrap_or_else(|| guess_up(&body));

    let given_axes = |i: usize| axes.as_ref().and_then(|all| usable_axes(*all.get(i)?));
    let given_normal = |i: usize| normals.as_ref().and_then(|all| unit(*all.get(i)?));
    let given_radius = |i: usize| radii.as_ref().and_then(|all| usable_radius(*all.get(i)?));
    let lacks_normal = |i: usize| given_normal(i).is_none() && given_axes(i).is_none();
    let lacks_radius = |i: usize| given_radius(i).is_none() && given_axes(i).is_none();
    let count = positions.len();
    preparation.surfels = count as u64;
    preparation.estimated_normals = (0..count).into_par_iter().filter(|&i| lacks_normal(i)).count() as u64;
    preparation.estimated_radii = (0..count).into_par_iter().filter(|&i| lacks_radius(i)).count() as u64;

    let mut estimates: Option<(DistinctPositions, Vec<Estimate>)> = None;
    if preparation.estimated_normals > 0 || preparation.estimated_radii > 0 {
        progress.begin("sorting points", 0);
        let distinct = DistinctPositions::new(&positions, &bounds, origin)?;
        progress.end();
        let all = preparation.estimated_normals.max(preparation.estimated_radii) == count as u64;
        let wanted = (!all).then(|| {
            let mut wanted = vec![false; distinct.len()];
            for (i, &position) in distinct.of_point().iter().enumerate() {
                wanted[position as usize] |= lacks_normal(i) || lacks_radius(i);
            }
            wanted
        });
        let Estimates { of_position, median_spacing } =
            estimate::estimate(&distinct, wanted.as_deref(), up.axis(), progress);
        preparation.distinct_positions = Some(distinct.len() as u64);
        preparation.median_spacing = median_spacing;
        estimates = Some((distinct, of_position));
    }
    let estimate_of = |i: usize| {
        estimates
            .as_ref()
            .and_then(|(distinct, of_position)| of_position.get(*distinct.of_point().get(i)? as usize).copied())
            .unwrap_or_default()
    };
    let mut surfels: Vec<Surfel> = positions
        .par_iter()
        .enumerate()
        .map(|(i, position)| {
            // Adding +0 makes -0 the same coordinate as 0.
            let center = (DVec3::from_array(*position) - origin).as_vec3() + Vec3::ZERO;
            if let Some([s, t]) = given_axes(i) {
                return Surfel::ellipse(center, s, t);
            }
            let normal = given_normal(i).unwrap_or_else(|| Vec3::from_array(estimate_of(i).normal));
            let radius = given_radius(i).unwrap_or_else(|| estimate_of(i).radius);
            Surfel::disk(center, normal, radius)
        })
        .collect();
    preparation.limited_radii = limit_radii(&mut surfels, body.extent().max_element())?;
    let relative = |index: usize| DVec3::from_array(positions[index]) - origin;
    let low = low_parts(&surfels, relative);
    preparation.rounding = rounding(&surfels, &low, relative);
    let oriented = preparation.estimated_normals == 0;
    // A clip is of the half-axes that were given with it.
    let clips = clips.filter(|clips| clips.iter().any(|clip| !clip.is_none())).unwrap_or_default();
    let scene = Scene { origin, surfels, low, clips, colors, oriented, closed: closed && oriented, up, provenance };
    // As the default view sees it.
    preparation.strays = scene.body().1;
    Ok((scene, preparation))
}

/// Limits disks to [`LARGEST_IN_EXTENTS`] and says how many were larger.
///
/// # Errors
///
/// [`Error::EmptyScene`] if the scene is too small for f32 arithmetic.
fn limit_radii(surfels: &mut [Surfel], extent: f64) -> Result<u64> {
    let largest = surfels.par_iter().map(Surfel::radius).reduce(|| 0.0, f32::max);
    if extent >= SMALLEST_SCENE && f64::from(largest) <= LARGEST_IN_EXTENTS * extent {
        return Ok(0);
    }
    // Where most disks are larger than the box of their centres, they are the scene.
    let typical = estimate::median(surfels.par_iter().map(|surfel| surfel.radius().into()).collect());
    let size = extent.max(2.0 * typical.unwrap_or(0.0));
    if size < SMALLEST_SCENE {
        return Err(Error::EmptyScene(format!(
            "the scene is {size:.1e} world units wide, and scenes of {SMALLEST_SCENE:e} to {LARGEST_COORDINATE:e} are drawn: scale it"
        )));
    }
    let most = LARGEST_IN_EXTENTS * size;
    let limit = |surfel: &mut Surfel| {
        // Each half-axis by itself, so that a thin ellipse stays one.
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

/// The largest error of a centre, `center` with all its digits, where it shows at its disk's size.
fn rounding(surfels: &[Surfel], low: &[[f32; 3]], center: impl Fn(usize) -> DVec3 + Sync) -> Option<f64> {
    let error = |(index, low): (usize, &[f32; 3])| {
        let surfel = &surfels[index];
        let kept = DVec3::from_array(surfel.center.map(f64::from)) + DVec3::from_array(low.map(f64::from));
        let error = (center(index) - kept).abs().max_element();
        shows(surfel, error).then_some(error)
    };
    low.par_iter().enumerate().filter_map(error).reduce_with(f64::max)
}

/// The normal with unit length, or None if it has no direction.
fn unit(normal: [f32; 3]) -> Option<Vec3> {
    // In f64 the squares of f32 numbers neither overflow nor underflow.
    let [x, y, z] = normal.map(f64::from);
    let length = (x * x + y * y + z * z).sqrt();
    (length.is_finite() && length > 0.0).then(|| (DVec3::new(x, y, z) / length).as_vec3())
}

/// The radius within [`RADIUS_RANGE`], or None if it says nothing.
fn usable_radius(radius: f32) -> Option<f32> {
    let (smallest, largest) = RADIUS_RANGE;
    (radius.is_finite() && radius > 0.0).then(|| radius.clamp(smallest as f32, largest as f32))
}

/// The half-axes, or None if they span no ellipse that an f32 can say, or one outside [`RADIUS_RANGE`].
fn usable_axes(axes: [[f32; 3]; 2]) -> Option<[Vec3; 2]> {
    /// Below this sine of the angle between them, two half-axes are one.
    const PARALLEL: f64 = 1e-6;
    let (smallest, largest) = RADIUS_RANGE;
    let [s, t] = axes.map(|axis| DVec3::from_array(axis.map(f64::from)));
    let (shorter, longer) = (s.length().min(t.length()), s.length().max(t.length()));
    // Half-axes that are not perpendicular stand for a shorter one, and for a longer one by at most a square root of two.
    let shortest = s.cross(t).length() / (1.5 * longer);
    let sound = longer <= largest / 1.5 && shortest >= smallest.max(PARALLEL * shorter);
    sound.then(|| axes.map(Vec3::from_array))
}

/// The box of the points whose coordinates are usable, world coordinates as they were read.
pub fn bounds(points: &Points) -> Bounds {
    let usable = points.positions.par_iter().filter(|position| gather::is_usable(position));
    // Adding +0 makes -0 the same coordinate as 0.
    Bounds::of(usable.map(|position| DVec3::from_array(*position) + DVec3::ZERO))
}

/// The scene's origin for positions in `bounds`, world units, axis by axis.
///
/// Let E be the longest edge of the box (1 if all points coincide). An axis on which no coordinate exceeds 2 E keeps
/// origin 0: coordinates that already sit near zero stay what they are, and f32 ones exact. On any other axis the
/// origin is the middle of the box, rounded to a multiple of the power of two between E / 16 and E / 8. Relative
/// coordinates are then within 2 E, so a surfel centre is off by at most 2^-24 * 2 E (0.12 mm in a scene of 1 km).
/// The origin depends on the box alone, so on no order of points.
fn origin_for(bounds: &Bounds) -> DVec3 {
    let extent = bounds.extent().max_element();
    let extent = if extent > 0.0 { extent } else { 1.0 };
    let grid = power_of_two(exponent(extent) - 3);
    let axis = |low: f64, high: f64, center: f64| {
        let steps = center / grid;
        if low.abs().max(high.abs()) <= 2.0 * extent {
            0.0
        } else if steps.abs() < 4503599627370496.0 {
            steps.round() * grid
        } else {
            center
        }
    };
    let center = bounds.center();
    DVec3::new(
        axis(bounds.min.x, bounds.max.x, center.x),
        axis(bounds.min.y, bounds.max.y, center.y),
        axis(bounds.min.z, bounds.max.z, center.z),
    )
}

/// Up for inputs whose format does not say: flat in z means survey data, anything else a model.
fn guess_up(bounds: &Bounds) -> Up {
    let extent = bounds.extent();
    if extent.z < 0.5 * extent.x.min(extent.y) { Up::Z } else { Up::Y }
}
