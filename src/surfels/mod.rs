//! Computes surfels from points and meshes.

pub mod analytic;
pub mod borders;
mod build;
mod caps;
mod colors;
mod complete;
mod coverage;
mod creases;
mod curvature;
mod density;
mod eigen;
mod ellipse;
mod estimate;
mod facing;
#[cfg(test)]
mod few;
mod forest;
mod from_points;
mod gaps;
pub(crate) mod gather;
mod graph;
pub mod hierarchy;
pub mod hybrid;
mod limits;
mod lines;
mod mesh;
mod neighbours;
mod orient;
mod outliers;
mod painting;
pub mod part;
mod planes;
mod positions;
mod preparation;
pub mod sampling;
mod sheets;
pub mod simplify;
mod sizes;
pub mod smooth;
mod spacing;
mod survey;
#[cfg(test)]
mod tests;
mod texture;
mod triangles;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

pub use self::build::{Coordinates, build, build_at_vertices, build_textured, build_within};
pub use self::caps::curve;
pub use self::coverage::{ASLANT, Coverage, coverage};
pub(crate) use self::density::densities;
pub use self::facing::build_facing;
pub use self::from_points::{FromPoints, Surfels, from_points};
pub use self::limits::Limits;
pub use self::orient::Orientation;
pub use self::painting::build_painted;
pub use self::preparation::Preparation;
pub use self::sizes::{Size, Triangle};
pub use self::survey::{Sample, Survey, survey};
pub use self::triangles::{MeshPreparation, with_triangles};

use self::estimate::RADIUS_RANGE;
use self::positions::{exponent, power_of_two};
use crate::io::Points;
use crate::scene::{Bounds, Up};

/// The largest absolute coordinate of a point, world units (in metres, a hundred light years).
/// Points with larger coordinates are left out like those that are not finite, because products of
/// f32 lengths would overflow during rendering.
pub const LARGEST_COORDINATE: f64 = 1e18;

/// The normal with unit length; None if it has no direction.
fn unit(normal: [f32; 3]) -> Option<Vec3> {
    // In f64, the squares of f32 numbers neither overflow nor underflow.
    let [x, y, z] = normal.map(f64::from);
    let length = (x * x + y * y + z * z).sqrt();
    (length.is_finite() && length > 0.0).then(|| (DVec3::new(x, y, z) / length).as_vec3())
}

/// The radius clamped to [`RADIUS_RANGE`]; None if it is not positive or not finite.
fn usable_radius(radius: f32) -> Option<f32> {
    let (smallest, largest) = RADIUS_RANGE;
    (radius.is_finite() && radius > 0.0).then(|| radius.clamp(smallest as f32, largest as f32))
}

/// The half-axes; None if they are parallel, not finite, or outside [`RADIUS_RANGE`].
fn usable_axes(axes: [[f32; 3]; 2]) -> Option<[Vec3; 2]> {
    /// Two half-axes are parallel if the sine of the angle between them is below this.
    const PARALLEL: f64 = 1e-6;
    let (smallest, largest) = RADIUS_RANGE;
    let [s, t] = axes.map(|axis| DVec3::from_array(axis.map(f64::from)));
    let (shorter, longer) = (s.length().min(t.length()), s.length().max(t.length()));
    // Half-axes that are not perpendicular describe an ellipse whose shorter half-axis is shorter
    // than both, and whose longer one is longer by up to a factor of the square root of two.
    let shortest = s.cross(t).length() / (1.5 * longer);
    let sound = longer <= largest / 1.5 && shortest >= smallest.max(PARALLEL * shorter);
    sound.then(|| axes.map(Vec3::from_array))
}

/// The box of the points that a scene uses, in world coordinates as they were read: those with
/// usable coordinates and, among Gaussians, with a shape.
pub fn bounds(points: &Points) -> Bounds {
    let is_kept = |(index, position): &(usize, &[f64; 3])| {
        gather::is_usable(position) && (!points.encoded || gather::has_shape(points, *index))
    };
    let kept = points.positions.par_iter().enumerate().filter(is_kept);
    // Adding +0 makes -0 the same coordinate as 0.
    Bounds::of(kept.map(|(_, position)| DVec3::from_array(*position) + DVec3::ZERO))
}

/// Returns the scene's origin for positions in `bounds`, world units, axis by axis.
///
/// Let E be the longest edge of the box (1 if all points coincide). An axis on which no absolute
/// coordinate exceeds 2 E has origin 0: coordinates that are already near zero do not change, and
/// f32 ones stay exact. On any other axis the origin is the centre of the box, rounded to a
/// multiple of the power of two between E / 16 and E / 8. Relative coordinates are then within 2 E,
/// so a surfel's centre has an error of at most 2^-24 * 2 E (0.12 mm in a scene of 1 km). The
/// origin depends only on the box, not on the order of points.
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

/// The up axis for inputs whose format does not define one: z if the box is flat in z, as in survey
/// data, else y, as in models.
fn guess_up(bounds: &Bounds) -> Up {
    let extent = bounds.extent();
    if extent.z < 0.5 * extent.x.min(extent.y) { Up::Z } else { Up::Y }
}
