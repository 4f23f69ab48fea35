//! Surfels that are painted by a texture: how its coordinates change over their disks, and its mean there.

use std::sync::Arc;

use glam::{DMat2, DVec2, DVec3};
use rayon::prelude::*;

use super::build::{Coordinates, LARGEST_PLACE};
use super::neighbours::{Neighbour, NeighbourSearch};
use super::positions::DistinctPositions;
use crate::scene::{Atlas, Place, Scene, Surfel, Texture, Textured};
use crate::{Progress, Result};

/// Neighbours that tell how fast coordinates change: the first two rings of a square grid.
const NEIGHBOURS: usize = 8;

/// Those that are looked at where some may be in other textures, which tell nothing.
const AMONG_OTHERS: usize = 3 * NEIGHBOURS;

/// The change for each length, of those to the neighbours in order, that is typical. At a straight seam three of the first ring
/// lie on the other side, and five at its corner.
const RANK: usize = 2;

/// Changes of more than this many times the typical one are jumps across a seam: parameterisations stretch a surface less.
const STRETCH: f64 = 3.0;

/// Least squares with a smaller ratio of determinant to squared trace say nothing of one direction.
const LEAST_SPREAD: f64 = 1e-3;

/// Paints the surfels of `scene` with `textures` at their coordinates.
pub(super) fn painted(
    scene: &Scene,
    textures: Vec<Texture>,
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
    // Disks overlap: half of one at each side is about the surfel's own part of the surface.
    let color = |(index, place): (usize, &Place)| {
        let center = place.center.map(f64::from);
        let texture = textures.get(coordinates.atlas.number(center) as usize);
        texture.map_or_else(
            || scene.colors.linear(index),
            |texture| texture.mean_about(center, 0.5 * f64::from(place.reach)),
        )
    };
    let colors = places.par_iter().enumerate().map(color).collect();
    Textured::new(textures.into_iter().map(Arc::new).collect(), coordinates.atlas, places, colors)
}

/// Whether the slopes of a surfel were given and can be used: over its disk they gain no more than coordinates may be.
fn are_known((surfel, slopes): (&Surfel, &[[f32; 3]; 2])) -> bool {
    let all = slopes.as_flattened();
    all.iter().any(|gain| *gain != 0.0) && all.iter().all(|gain| gain.abs() * surfel.radius() <= LARGEST_PLACE)
}

/// Places whose slopes are all to be filled in, where every surfel has its own.
fn given(scene: &Scene, coordinates: &Coordinates) -> Option<Vec<Place>> {
    let known = scene.surfels.iter().zip(&coordinates.slopes).filter(|given| are_known(*given)).count();
    (known == scene.surfels.len()).then(|| vec![Place::default(); known])
}

/// The place of a surfel whose coordinates change so. It overlaps others that are as far off as it is large.
fn of_slopes(surfel: &Surfel, center: [f32; 2], slopes: [[f32; 3]; 2]) -> Place {
    let gains = slopes.map(|slope| DVec3::from_array(slope.map(f64::from)));
    let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    let typical = (0.5 * (gains[0].length_squared() + gains[1].length_squared())).sqrt();
    Place {
        center,
        slopes,
        extent: gains.map(|gain| gain.dot(s).hypot(gain.dot(t)) as f32),
        reach: (typical * f64::from(surfel.radius())) as f32,
    }
}

/// The change of coordinates for each length that is typical around a point, from steps to its neighbours in the order of their distance:
/// in space, and in the texture.
fn typical_change(steps: &[(DVec3, DVec2)]) -> f64 {
    let mut changes: Vec<f64> = steps.iter().map(|(offset, gain)| gain.length() / offset.length()).collect();
    changes.sort_by(f64::total_cmp);
    changes.get(RANK.min(changes.len().saturating_sub(1))).copied().unwrap_or(0.0)
}

/// Whether a seam lies before a step, by the typical change around its start.
pub(super) fn jumps((offset, gain): &(DVec3, DVec2), typical: f64) -> bool {
    gain.length() / offset.length() > STRETCH * typical
}

/// What u and v gain along the half-axes of an ellipse, by least squares over steps.
pub(super) fn slopes_along([s, t]: [DVec3; 2], steps: impl Iterator<Item = (DVec3, DVec2)>) -> DMat2 {
    // Sums of x x^T and of gain x^T, for x on the unit disk.
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

/// The same in world units.
pub(super) fn in_world(slopes: DMat2, [s, t]: [DVec3; 2]) -> [[f32; 3]; 2] {
    let (along_s, along_t) = (s / s.length_squared(), t / t.length_squared());
    [0, 1].map(|k| (slopes.x_axis[k] * along_s + slopes.y_axis[k] * along_t).as_vec3().to_array())
}

/// The texture coordinates of positions, in the plane of their textures: of several surfels at one the smallest, which any order gives. None
/// where surfels have none.
pub(super) struct Placed {
    pub(super) places: Vec<DVec2>,
    atlas: Atlas,
}

impl Placed {
    pub(super) fn new(positions: &DistinctPositions, coordinates: &Coordinates) -> Self {
        let Coordinates { centers, atlas, .. } = coordinates;
        let mut places = vec![[f32::INFINITY; 2]; if centers.is_empty() { 0 } else { positions.len() }];
        for (own, &position) in centers.iter().zip(positions.of_point()) {
            let known = &mut places[position as usize];
            if own[0].total_cmp(&known[0]).then(own[1].total_cmp(&known[1])).is_lt() {
                *known = *own;
            }
        }
        let places = places.into_iter().map(|place| DVec2::from_array(place.map(f64::from))).collect();
        Self { places, atlas: *atlas }
    }

    /// Whether two places are in one texture, or both in none.
    pub(super) fn are_in_one(&self, a: DVec2, b: DVec2) -> bool {
        self.atlas.number(a.to_array()) == self.atlas.number(b.to_array())
    }

    /// For the neighbours of [`Self::steps`].
    fn search<'a>(&self, positions: &'a DistinctPositions) -> NeighbourSearch<'a> {
        let several = self.atlas != Atlas::ONE;
        NeighbourSearch::new(positions, if several { AMONG_OTHERS } else { NEIGHBOURS })
    }

    /// The steps from a surfel at a position, whose place is `at`, to the nearest neighbours that are in the same texture: in space, scaled, and in
    /// the texture.
    fn steps(
        &self,
        positions: &DistinctPositions,
        found: &[Neighbour],
        (from, at): (u32, DVec2),
    ) -> Vec<(DVec3, DVec2)> {
        let others = found.iter().map(|other| (other.index, self.places[other.index as usize]));
        let step = |(other, place)| (positions.position(other) - positions.position(from), place - at);
        others.filter(|(_, place)| self.are_in_one(*place, at)).take(NEIGHBOURS).map(step).collect()
    }

    /// The typical change around each position, for a scaled unit.
    pub(super) fn changes(&self, positions: &DistinctPositions) -> Vec<f64> {
        if self.places.is_empty() {
            return Vec::new();
        }
        let search = self.search(positions);
        let change = |found: &mut Vec<Neighbour>, (index, at): (usize, &DVec2)| {
            search.nearest(index as u32, found);
            typical_change(&self.steps(positions, found, (index as u32, *at)))
        };
        self.places.par_iter().enumerate().map_init(Vec::new, change).collect()
    }
}

/// The change of coordinates over each disk, by least squares over those neighbours that no jump lies before. The reach is that of
/// the typical change over the radius.
fn places(scene: &Scene, coordinates: &Coordinates, progress: &dyn Progress) -> Result<Vec<Place>> {
    let surfels = &scene.surfels;
    let positions: Vec<[f64; 3]> =
        (0..surfels.len()).into_par_iter().map(|index| scene.center(index).to_array()).collect();
    let distinct = DistinctPositions::new(&positions, &scene.bounds(), DVec3::ZERO)?;
    let placed = Placed::new(&distinct, coordinates);
    progress.begin("measuring texture coordinates", surfels.len() as u64);
    let search = placed.search(&distinct);
    let of_surfel = |found: &mut Vec<Neighbour>, ((surfel, center), &position): ((&Surfel, &[f32; 2]), &u32)| {
        search.nearest(position, found);
        let at = DVec2::from_array(center.map(f64::from));
        let steps = placed.steps(&distinct, found, (position, at)).into_iter();
        let steps: Vec<_> = steps.map(|(offset, gain)| (offset / distinct.scale(), gain)).collect();
        progress.advance(1);
        place(surfel, *center, &steps)
    };
    let all =
        surfels.par_iter().zip(&coordinates.centers).zip(distinct.of_point()).map_init(Vec::new, of_surfel).collect();
    progress.end();
    Ok(all)
}

/// A surfel's place, from the steps to its neighbours: in world units, and in the texture.
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
        // What is no jump but steep is followed.
        let steep = of(0.01);
        assert!(steep.iter().any(|place| place.slopes[0][0] > 0.011));
    }
}
