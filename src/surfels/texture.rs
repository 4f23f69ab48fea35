//! Surfels that are painted by a texture: how its coordinates change over their disks, and its mean there.

use std::sync::Arc;

use glam::{DMat2, DVec2, DVec3};
use rayon::prelude::*;

use super::neighbours::{Neighbour, NeighbourSearch};
use super::positions::DistinctPositions;
use crate::scene::{Place, Scene, Surfel, Texture, Textured};
use crate::{Progress, Result};

/// Neighbours that tell how fast coordinates change: the first two rings of a square grid.
const NEIGHBOURS: usize = 8;

/// The change for each length, of those to the neighbours in order, that is typical. At a straight seam three of the first ring
/// lie on the other side, and five at its corner.
const RANK: usize = 2;

/// Changes of more than this many times the typical one are jumps across a seam: parameterisations stretch a surface less.
const STRETCH: f64 = 3.0;

/// Least squares with a smaller ratio of determinant to squared trace say nothing of one direction.
const LEAST_SPREAD: f64 = 1e-3;

/// Paints the surfels of `scene` with `texture` at the coordinates `centers`, one for each.
pub(super) fn painted(
    scene: &Scene,
    texture: Arc<Texture>,
    centers: &[[f32; 2]],
    progress: &dyn Progress,
) -> Result<Textured> {
    let places = places(scene, centers, progress)?;
    // Disks overlap: half of one at each side is about the surfel's own part of the surface.
    let color = |place: &Place| texture.mean_about(place.center.map(f64::from), 0.5 * f64::from(place.reach));
    let colors = places.par_iter().map(color).collect();
    Textured::new(texture, places, colors)
}

/// The change of coordinates over each disk, by least squares over those neighbours that no jump lies before. The reach is that of
/// the typical change over the radius.
fn places(scene: &Scene, centers: &[[f32; 2]], progress: &dyn Progress) -> Result<Vec<Place>> {
    let surfels = &scene.surfels;
    let positions: Vec<[f64; 3]> =
        (0..surfels.len()).into_par_iter().map(|index| scene.center(index).to_array()).collect();
    let distinct = DistinctPositions::new(&positions, &scene.bounds(), DVec3::ZERO)?;
    // Of surfels at one position, which may lie on both sides of a seam, the smallest coordinates: any order gives the same.
    let mut of_position = vec![[f32::INFINITY; 2]; distinct.len()];
    for (center, &position) in centers.iter().zip(distinct.of_point()) {
        let known = &mut of_position[position as usize];
        if center[0].total_cmp(&known[0]).then(center[1].total_cmp(&known[1])).is_lt() {
            *known = *center;
        }
    }
    progress.begin("measuring texture coordinates", surfels.len() as u64);
    let search = NeighbourSearch::new(&distinct, NEIGHBOURS);
    let of_surfel = |found: &mut Vec<Neighbour>, ((surfel, center), &position): ((&Surfel, &[f32; 2]), &u32)| {
        search.nearest(position, found);
        let at = DVec2::from_array(center.map(f64::from));
        let steps = found.iter().map(|other| {
            let offset = (distinct.position(other.index) - distinct.position(position)) / distinct.scale();
            (offset, DVec2::from_array(of_position[other.index as usize].map(f64::from)) - at)
        });
        let steps: Vec<(DVec3, DVec2)> = steps.collect();
        progress.advance(1);
        place(surfel, *center, &steps)
    };
    let all = surfels.par_iter().zip(centers).zip(distinct.of_point()).map_init(Vec::new, of_surfel).collect();
    progress.end();
    Ok(all)
}

/// A surfel's place, from the steps to its neighbours: in world units, and in the texture.
fn place(surfel: &Surfel, center: [f32; 2], steps: &[(DVec3, DVec2)]) -> Place {
    let change = |(offset, gain): &(DVec3, DVec2)| gain.length() / offset.length();
    let mut changes: Vec<f64> = steps.iter().map(change).collect();
    changes.sort_by(f64::total_cmp);
    let typical = changes.get(RANK.min(changes.len().saturating_sub(1))).copied().unwrap_or(0.0);
    let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    // Sums of x x^T and of gain x^T, for x on the unit disk.
    let (mut squares, mut products) = (DMat2::ZERO, DMat2::ZERO);
    for (offset, gain) in steps.iter().filter(|step| change(step) <= STRETCH * typical) {
        let x = DVec2::new(offset.dot(s) / s.length_squared(), offset.dot(t) / t.length_squared());
        squares += DMat2::from_cols(x * x.x, x * x.y);
        products += DMat2::from_cols(*gain * x.x, *gain * x.y);
    }
    let trace = squares.x_axis.x + squares.y_axis.y;
    let solvable = squares.determinant() > LEAST_SPREAD * trace * trace;
    let slopes = if solvable { products * squares.inverse() } else { DMat2::ZERO };
    // From the unit disk to world units.
    let (along_s, along_t) = (s / s.length_squared(), t / t.length_squared());
    let in_world = |k: usize| (slopes.x_axis[k] * along_s + slopes.y_axis[k] * along_t).as_vec3().to_array();
    Place {
        center,
        slopes: [0, 1].map(in_world),
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
            places(&scene, &centers, &()).unwrap()
        };
        for (k, place) in of(0.4).iter().enumerate() {
            let [u, v] = place.slopes.map(Vec3::from_array);
            assert!(u.distance(0.01 * Vec3::X) < 1e-6 && v.distance(0.02 * Vec3::Y) < 1e-6, "{k}: {u} {v}");
            assert!(place.reach <= 0.02 * 1.5 * 1.001 && place.reach >= 0.01 * 1.5 * 0.999, "{k}: {}", place.reach);
        }
        // What is no jump but steep is followed.
        let steep = of(0.01);
        assert!(steep.iter().any(|place| place.slopes[0][0] > 0.011));
    }
}
