//! Paints surfels with a texture: computes how the texture coordinates change over each disk, and
//! the mean of the texture over each disk.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat2, DVec2, DVec3};
use rayon::prelude::*;

use super::build::{Coordinates, LARGEST_PLACE};
use super::neighbours::{Neighbour, NeighbourSearch};
use super::positions::DistinctPositions;
use crate::scene::{Atlas, Bounds, Place, Scene, Surfel, Texture, Textured};
use crate::{Progress, Result};

/// The number of neighbours from which the change of coordinates is estimated: the first two rings
/// of a square grid.
const NEIGHBOURS: usize = 8;

/// The typical change per unit length is the one of this rank, from 0, among the changes to the
/// neighbours in ascending order. At a straight seam, three neighbours of the first ring lie on the
/// other side; at a seam's corner, five.
const RANK: usize = 2;

/// A change of more than this many times the typical one is a jump across a seam: parameterisations
/// stretch a surface less.
const STRETCH: f64 = 3.0;

/// Least squares with a smaller ratio of determinant to squared trace do not determine the change
/// in one direction.
const LEAST_SPREAD: f64 = 1e-3;

/// Paints the surfels of `scene` with `textures` at their coordinates.
pub(super) fn painted(
    scene: &Scene,
    textures: Vec<Arc<Texture>>,
    coordinates: &Coordinates,
    progress: &dyn Progress,
) -> Result<Textured> {
    let mut places = match given(scene, coordinates) {
        Some(places) => places,
        None => places(scene, coordinates, progress)?,
    };
    let given = scene.surfels.iter().zip(&coordinates.slopes).enumerate();
    for (index, (surfel, slopes)) in given.filter(|(_, given)| are_known(*given)) {
        places[index] = of_slopes(surfel, coordinates.centers[index], *slopes);
    }
    // Disks overlap, so the surfel's own part of the surface reaches about half a radius to each
    // side.
    let color = |(index, place): (usize, &Place)| {
        let center = place.center.map(f64::from);
        let texture = textures.get(coordinates.atlas.number(center) as usize);
        texture.map_or_else(
            || scene.colors.linear(index),
            |texture| texture.mean_about(center, 0.5 * f64::from(place.reach)),
        )
    };
    let colors = places.par_iter().enumerate().map(color).collect();
    Textured::new(textures, coordinates.atlas, places, colors)
}

/// Whether the given slopes of a surfel are known and usable: over its disk, coordinates must not
/// change by more than [`LARGEST_PLACE`].
fn are_known((surfel, slopes): (&Surfel, &[[f32; 3]; 2])) -> bool {
    let all = slopes.as_flattened();
    all.iter().any(|gain| *gain != 0.0) && all.iter().all(|gain| gain.abs() * surfel.radius() <= LARGEST_PLACE)
}

/// Places whose slopes are still to be set, if every surfel has given slopes or no texture; else
/// None.
fn given(scene: &Scene, coordinates: &Coordinates) -> Option<Vec<Place>> {
    let Coordinates { centers, slopes, atlas } = coordinates;
    let is_bare = |center: &[f32; 2]| atlas.number(center.map(f64::from)) >= atlas.textures;
    let is_given = |index: usize| {
        let known = slopes.get(index).is_some_and(|slopes| are_known((&scene.surfels[index], slopes)));
        known || is_bare(&centers[index])
    };
    let all = (0..scene.surfels.len()).all(is_given);
    all.then(|| centers.iter().map(|&center| Place { center, ..Place::default() }).collect())
}

/// The place of a surfel with given slopes. The place's reach covers overlapping surfels up to one
/// radius away.
fn of_slopes(surfel: &Surfel, center: [f32; 2], slopes: [[f32; 3]; 2]) -> Place {
    let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    // Only the change within the surfel's plane counts.
    let normal = s.cross(t).normalize_or_zero();
    let gains = slopes.map(|slope| {
        let gain = DVec3::from_array(slope.map(f64::from));
        gain - gain.dot(normal) * normal
    });
    let slopes = gains.map(|gain| gain.as_vec3().to_array());
    let typical = (0.5 * (gains[0].length_squared() + gains[1].length_squared())).sqrt();
    Place {
        center,
        slopes,
        extent: gains.map(|gain| gain.dot(s).hypot(gain.dot(t)) as f32),
        reach: (typical * f64::from(surfel.radius())) as f32,
    }
}

/// The typical change of texture coordinates per unit length around a point. `steps` are those to
/// its neighbours, the nearest first: the offset in space and the difference of coordinates.
pub(super) fn typical_change(steps: &[(DVec3, DVec2)]) -> f64 {
    let mut changes: Vec<f64> = steps.iter().map(|(offset, gain)| gain.length() / offset.length()).collect();
    changes.sort_by(f64::total_cmp);
    changes.get(RANK.min(changes.len().saturating_sub(1))).copied().unwrap_or(0.0)
}

/// Whether a step crosses a seam, given the typical change around its start.
pub(super) fn jumps((offset, gain): &(DVec3, DVec2), typical: f64) -> bool {
    gain.length() / offset.length() > STRETCH * typical
}

/// The changes of u and v along the half-axes of an ellipse, by least squares over steps.
pub(super) fn slopes_along([s, t]: [DVec3; 2], steps: impl Iterator<Item = (DVec3, DVec2)>) -> DMat2 {
    // The sums of x x^T and of gain x^T, for x on the unit disk.
    let (mut squares, mut products) = (DMat2::ZERO, DMat2::ZERO);
    for (offset, gain) in steps {
        let x = DVec2::new(offset.dot(s) / s.length_squared(), offset.dot(t) / t.length_squared());
        squares += DMat2::from_cols(x * x.x, x * x.y);
        products += DMat2::from_cols(gain * x.x, gain * x.y);
    }
    let trace = squares.x_axis.x + squares.y_axis.y;
    let solvable = squares.determinant() > LEAST_SPREAD * trace * trace;
    if solvable { products * squares.inverse() } else { DMat2::ZERO }
}

/// Converts changes along half-axes to gradients per world unit.
pub(super) fn in_world(slopes: DMat2, [s, t]: [DVec3; 2]) -> [[f32; 3]; 2] {
    let (along_s, along_t) = (s / s.length_squared(), t / t.length_squared());
    [0, 1].map(|k| (slopes.x_axis[k] * along_s + slopes.y_axis[k] * along_t).as_vec3().to_array())
}

/// Calls `made` with the index of each point and the steps to its nearest neighbours among the
/// points with the same texture: the offset in space and the difference of coordinates in the
/// common plane. Points without a texture have neighbours among themselves.
///
/// If several points of a texture have one position, the smallest coordinates count, so that the
/// order of points does not matter.
pub(super) fn around<T: Clone + Default + Send>(
    (points, bounds): (&[[f64; 3]], &Bounds),
    places: &[[f32; 2]],
    atlas: &Atlas,
    made: impl Fn(usize, &[(DVec3, DVec2)]) -> T + Sync,
) -> Result<Vec<T>> {
    let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (index, place) in places.iter().enumerate() {
        members.entry(atlas.number(place.map(f64::from))).or_default().push(index);
    }
    let mut all = vec![T::default(); places.len()];
    for members in members.into_values() {
        let own: Vec<[f64; 3]> = members.iter().map(|&index| points[index]).collect();
        let distinct = DistinctPositions::new(&own, bounds, DVec3::ZERO)?;
        let mut known = vec![[f32::INFINITY; 2]; distinct.len()];
        for (&index, &position) in members.iter().zip(distinct.of_point()) {
            let (known, own) = (&mut known[position as usize], places[index]);
            if own[0].total_cmp(&known[0]).then(own[1].total_cmp(&known[1])).is_lt() {
                *known = own;
            }
        }
        let search = NeighbourSearch::new(&distinct, NEIGHBOURS);
        let of_point = |found: &mut Vec<Neighbour>, (&index, &position): (&usize, &u32)| {
            search.nearest(position, found);
            let exact = |place: [f32; 2]| DVec2::from_array(place.map(f64::from));
            let step = |other: &Neighbour| {
                let offset = (distinct.position(other.index) - distinct.position(position)) / distinct.scale();
                (offset, exact(known[other.index as usize]) - exact(places[index]))
            };
            made(index, &found.iter().map(step).collect::<Vec<_>>())
        };
        let of_members: Vec<T> = members.par_iter().zip(distinct.of_point()).map_init(Vec::new, of_point).collect();
        members.iter().zip(of_members).for_each(|(&index, made)| all[index] = made);
    }
    Ok(all)
}

/// The change of coordinates over each disk, by least squares over the neighbours that are not
/// across a seam. The reach is the typical change times the radius.
fn places(scene: &Scene, coordinates: &Coordinates, progress: &dyn Progress) -> Result<Vec<Place>> {
    let surfels = &scene.surfels;
    let positions: Vec<[f64; 3]> =
        (0..surfels.len()).into_par_iter().map(|index| scene.center(index).to_array()).collect();
    progress.begin("measuring texture coordinates", surfels.len() as u64);
    let Coordinates { centers, atlas, .. } = coordinates;
    let all = around((&positions, &scene.bounds()), centers, atlas, |index, steps| {
        progress.advance(1);
        place(&surfels[index], centers[index], steps)
    });
    progress.end();
    all
}

/// A surfel's place, from the steps to its neighbours: the offset in world units and the difference
/// of texture coordinates.
fn place(surfel: &Surfel, center: [f32; 2], steps: &[(DVec3, DVec2)]) -> Place {
    let typical = typical_change(steps);
    let axes = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    let slopes = slopes_along(axes, steps.iter().copied().filter(|step| !jumps(step, typical)));
    Place {
        center,
        slopes: in_world(slopes, axes),
        extent: [0, 1].map(|k| slopes.x_axis[k].hypot(slopes.y_axis[k]) as f32),
        reach: (typical * f64::from(surfel.radius())) as f32,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use glam::Vec3;

    use crate::scene::{Colors, Up};

    use super::*;

    #[test]
    fn slopes_and_reach_know_no_jump() {
        let at = |k: usize| Vec3::new((k % 12) as f32, (k / 12) as f32, 0.0);
        let surfels: Vec<Surfel> = (0..144).map(|k| Surfel::disk(at(k), Vec3::Z, 1.5)).collect();
        let colors = Colors::Constant([1.0; 4]);
        let scene =
            Scene { origin: DVec3::ZERO, surfels, low: vec![], colors, oriented: true, up: Up::Y, ..Scene::default() };
        let of = |jump: f32| {
            let centers: Vec<_> =
                (0..144).map(|k| [0.01 * at(k).x + if at(k).x > 5.5 { jump } else { 0.0 }, 0.02 * at(k).y]).collect();
            places(&scene, &Coordinates { centers, ..Coordinates::default() }, &()).unwrap()
        };
        for (k, place) in of(0.4).iter().enumerate() {
            let [u, v] = place.slopes.map(Vec3::from_array);
            assert!(u.distance(0.01 * Vec3::X) < 1e-6 && v.distance(0.02 * Vec3::Y) < 1e-6, "{k}: {u} {v}");
            assert!(place.reach <= 0.02 * 1.5 * 1.001 && place.reach >= 0.01 * 1.5 * 0.999, "{k}: {}", place.reach);
        }
        // A change that is steep but no jump is followed.
        let steep = of(0.01);
        assert!(steep.iter().any(|place| place.slopes[0][0] > 0.011));
    }
}
