//! Builds surfels from points that lack no attribute. The result is that of
//! [`build`](super::build()), but each part of the points can be built separately.

use glam::DVec3;
use rayon::prelude::*;

use super::Preparation;
use super::build::{Given, own_normal};
use super::gather::gather;
use crate::Error;
use crate::io::Points;
use crate::scene::whole::Has;
use crate::scene::{Cap, Clip, Colors, Scene};

/// The points that were added to a scene.
#[derive(Default)]
pub(super) struct Added {
    /// World coordinates of the points that became surfels.
    pub positions: Vec<[f64; 3]>,
    /// The counts of their preparation.
    pub preparation: Preparation,
}

/// Adds the surfels of the usable points of `inputs` to a scene, relative to its origin, with the
/// optional lists in `has`. Returns None if a point lacks an attribute that would have to be
/// estimated.
///
/// Colours are added if the scene has a list of the same kind.
pub(super) fn add(scene: &mut Scene, inputs: Vec<Points>, has: Has) -> Option<Added> {
    let points = inputs.iter().map(|input| input.positions.len() as u64).sum();
    let gathered = match gather(inputs) {
        Err(Error::EmptyScene(_)) => {
            let preparation = Preparation { points, dropped_non_finite: points, ..Preparation::default() };
            return Some(Added { positions: Vec::new(), preparation });
        }
        gathered => gathered.ok()?,
    };
    let given = Given(&gathered);
    let count = gathered.points.positions.len();
    if (0..count).into_par_iter().any(|i| given.lacks_normal(i) || given.lacks_radius(i)) {
        return None;
    }
    let surfels = given.surfels(None, scene.origin);
    let each = |has: bool| if has { 0..count } else { 0..0 };
    let relative = |i: usize| DVec3::from_array(gathered.points.positions[i]) - scene.origin;
    let rest = |i: usize| (relative(i) - DVec3::from_array(surfels[i].center.map(f64::from))).as_vec3().to_array();
    let cap = |(i, cap): (usize, Cap)| cap.usable(surfels[i].radius().into());
    let clips = gathered.points.clips.iter().flatten().copied().filter(|_| has.clips);
    scene.low.extend(each(has.low).map(rest));
    scene.clips.extend(clips.map(Clip::usable));
    scene.caps.extend(given.caps().into_iter().enumerate().filter(|_| has.caps).map(cap));
    scene.normals.extend(each(has.normals).map(|i| own_normal(&given, i, &surfels[i])));
    let (points, preparation) = (gathered.points, gathered.preparation);
    match (&mut scene.colors, points.colors) {
        (Colors::Srgb8(all), Some(Colors::Srgb8(own))) => all.extend(own),
        (Colors::Linear(all), Some(Colors::Linear(own))) => all.extend(own),
        _ => {}
    }
    scene.surfels.extend(surfels);
    Some(Added { positions: points.positions, preparation })
}

/// Appends the surfels of `part` to `scene`.
pub(super) fn append(scene: &mut Scene, mut part: Scene) {
    scene.surfels.append(&mut part.surfels);
    scene.low.append(&mut part.low);
    scene.clips.append(&mut part.clips);
    scene.caps.append(&mut part.caps);
    scene.normals.append(&mut part.normals);
    match (&mut scene.colors, part.colors) {
        (Colors::Srgb8(all), Colors::Srgb8(mut own)) => all.append(&mut own),
        (Colors::Linear(all), Colors::Linear(mut own)) => all.append(&mut own),
        // One colour for all surfels.
        _ => {}
    }
}
