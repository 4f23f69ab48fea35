//! The simplified scene as points of a file.

use super::SplatShape;
use crate::io::Points;
use crate::scene::{Atlas, Colors, Scene, Surfel};
use crate::surfels::Coordinates;

/// Returns the surfels of `scene` as points with these texture coordinates. `scene` is the result
/// of a simplification with splats of this shape.
pub fn points(scene: &Scene, coordinates: Coordinates, shape: SplatShape) -> Points {
    let surfels = &scene.surfels;
    let Coordinates { centers, slopes, atlas } = coordinates;
    let exact = || centers.iter().map(|center| center.map(f64::from));
    let own = |place: [f64; 2]| atlas.own(place).map(|turns| turns as f32);
    let number = |place: [f64; 2]| Some(atlas.number(place)).filter(|number| *number < atlas.textures);
    let normal = |surfel: &Surfel| surfel.normal().normalize_or_zero().to_array();
    // Clip lines and caps are relative to half-axes.
    let half_axes = shape != SplatShape::Disk || !scene.clips.is_empty();
    Points {
        positions: (0..surfels.len()).map(|index| (scene.origin + scene.center(index)).to_array()).collect(),
        normals: (!half_axes).then(|| surfels.iter().map(normal).collect()),
        radii: (!half_axes).then(|| surfels.iter().map(|surfel| surfel.radius()).collect()),
        axes: half_axes.then(|| surfels.iter().map(|surfel| [surfel.s, surfel.t]).collect()),
        clips: (!scene.clips.is_empty()).then(|| scene.clips.clone()),
        caps: (!scene.caps.is_empty()).then(|| scene.caps.clone()),
        colors: match &scene.colors {
            Colors::Constant(color) => Some(Colors::Linear(vec![*color; surfels.len()])),
            colors => Some(colors.clone()),
        },
        texture: (!centers.is_empty()).then(|| exact().map(own).collect()),
        texture_numbers: (atlas != Atlas::ONE)
            .then(|| exact().map(|place| number(place).unwrap_or(u32::MAX)).collect()),
        texture_slopes: Some(slopes).filter(|slopes| !slopes.is_empty()),
        up: Some(scene.up),
        closed: scene.closed,
        ..Points::default()
    }
}
