//! A scene with levels of detail, as it is kept in a file.

use rayon::prelude::*;

use crate::io::{Points, Tree};
use crate::scene::color::DEFAULT_COLOR;
use crate::scene::{Colors, Scene, Whole};

/// The surfels of a scene as points in the order of its tree, if it has one, with that.
pub fn points(scene: &Scene) -> Points {
    let surfels = &scene.surfels;
    let coded = matches!(scene.colors, Colors::Srgb8(_));
    Points {
        positions: (0..surfels.len())
            .into_par_iter()
            .map(|index| (scene.origin + scene.center(index)).to_array())
            .collect(),
        normals: (!scene.normals.is_empty()).then(|| scene.normals.clone()),
        axes: Some(surfels.par_iter().map(|surfel| [surfel.s, surfel.t]).collect()),
        clips: (!scene.clips.is_empty()).then(|| scene.clips.clone()),
        caps: (!scene.caps.is_empty()).then(|| scene.caps.clone()),
        colors: match &scene.colors {
            Colors::Constant(DEFAULT_COLOR) => None,
            Colors::Constant(color) => Some(Colors::Linear(vec![*color; surfels.len()])),
            colors => Some(colors.clone()),
        },
        tree: scene.hierarchy.as_ref().map(|hierarchy| Tree::of(hierarchy, scene.origin, coded)),
        whole: Whole::of(scene).map(Box::new),
        unsided: !scene.oriented,
        up: Some(scene.up),
        closed: scene.closed,
        ..Points::default()
    }
}
