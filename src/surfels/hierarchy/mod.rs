//! Builds levels of detail: a point-octree whose nodes are surfels (Pajarola 2003, section 3;
//! [`Hierarchy`]).
//!
//! Sets of points are divided at their mean (`octree`). Each node has whole-number sums over the
//! surfels below it (`sums`, `moments`), which determine its centre, normal, colour and shape. Its
//! ellipse is the smallest of that shape that bounds all surfels below (`bounds`, `rims`). All
//! results are sums of whole numbers, minima or maxima, so a tree depends on the set of surfels
//! alone, not on their order or on the number of threads.

mod below;
mod bounds;
mod curvature;
mod lattice;
mod moments;
mod nodes;
mod octree;
pub mod out_of_core;
mod rims;
mod sums;
#[cfg(test)]
mod tests;

use std::str::FromStr;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use self::below::Known;
use self::octree::{Element, Octree, Set};
use crate::scene::hierarchy::NodeAndLow as Made;
use crate::scene::{Colors, Hierarchy, Scene, by_content};
use crate::{Error, Progress, Result};

/// Builds the levels of detail of `scene`. Returns the scene, with its surfels in the order of the
/// tree, and its hierarchy.
///
/// # Errors
///
/// [`Error::Usage`] if the scene has no surfels, 2^32 or more, Gaussians, or surfels that are
/// painted by textures.
pub fn build(scene: Scene, progress: &dyn Progress) -> Result<(Scene, Arc<Hierarchy>)> {
    build_with(scene, NodeBounds::Rims, progress)
}

/// The parts of the disks below that the ellipse of a node bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NodeBounds {
    /// The rims of the disks below the node, on the node's cap. Its shape is that of the covariance
    /// of the disks.
    #[default]
    Rims,
    /// The squares about the disks below the node, on the node's plane; nodes are flat, and their
    /// spheres are as small as possible. Its shape is that of the covariance of the disks' centres.
    /// This is Pajarola 2003, section 3.4, to the letter.
    Squares,
    /// As [`Squares`](Self::Squares), with normals that lean outward by the node's cone at the rim,
    /// up to 60 degrees (Pajarola 2003, section 5.2). The disk bends as its normals say; in the
    /// paper it stays flat.
    Cones,
}

impl NodeBounds {
    /// Whether nodes bound squares on their planes.
    fn of_squares(self) -> bool {
        self != Self::Rims
    }
}

impl FromStr for NodeBounds {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "rims" => Ok(Self::Rims),
            "squares" => Ok(Self::Squares),
            "cones" => Ok(Self::Cones),
            _ => Err(Error::Usage(format!("nodes bound rims, squares or cones, not {text:?}"))),
        }
    }
}

/// As [`build`], with nodes that bound what `bounds` says.
///
/// # Errors
///
/// As [`build`].
pub fn build_with(scene: Scene, bounds: NodeBounds, progress: &dyn Progress) -> Result<(Scene, Arc<Hierarchy>)> {
    let Ok(count) = u32::try_from(scene.surfels.len()) else {
        return Err(Error::Usage(format!("a tree has at most 2^32 - 1 surfels, not {}", scene.surfels.len())));
    };
    if count == 0 {
        return Err(Error::Usage("a scene without surfels has no levels of detail".into()));
    }
    if scene.encoded || matches!(scene.colors, Colors::Textured(_) | Colors::Harmonics(_)) {
        return Err(Error::Usage(
            "levels of detail need a colour for each surfel: Gaussians and textured surfels are not supported".into(),
        ));
    }
    let scene = scene_as_in_a_file(scene);
    progress.begin("dividing points", count.into());
    let (tree, points) = Octree::grow(count, |index| scene.center(index as usize), |points| progress.advance(points));
    progress.end();
    let (scene, places) = sorted(&tree, points, scene);
    let (tree, known) = ((&tree, &places[..]), Known::of(&scene, bounds));
    let hierarchy = if known.low {
        let (made, _) = nodes::nodes::<Made>(tree, &scene, &known, progress);
        let (nodes, low) = made.into_iter().unzip();
        Hierarchy { nodes, low }
    } else {
        Hierarchy { nodes: nodes::nodes(tree, &scene, &known, progress).0, low: Vec::new() }
    };
    let hierarchy = Arc::new(hierarchy);
    Ok((Scene { hierarchy: Some(hierarchy.clone()), ..scene }, hierarchy))
}

/// Puts the scene in the order of the tree, whose points are `points`. Returns the scene with the
/// lattice coordinates (places) of the points.
fn sorted(tree: &Octree, mut points: Vec<Element>, scene: Scene) -> (Scene, Vec<i32>) {
    in_order(tree, &mut points, &scene);
    let order: Vec<u32> = points.par_iter().map(|element| element.index).collect();
    let places = octree::places(points);
    (scene.into_order(&order), places)
}

/// Splits a centre into its f32 value and the remainder.
fn split(center: DVec3) -> [[f32; 3]; 2] {
    let short = center.as_vec3();
    [short, (center - short.as_dvec3()).as_vec3()].map(|part| part.to_array())
}

/// The centre after a round trip through world coordinates, as in a file.
fn as_in_a_file(origin: DVec3, center: DVec3) -> DVec3 {
    (origin + center) - origin
}

/// The scene after a round trip of its centres through world coordinates, as in a file.
fn scene_as_in_a_file(mut scene: Scene) -> Scene {
    let origin = scene.origin;
    let places = (0..scene.surfels.len()).into_par_iter().map(|index| split(as_in_a_file(origin, scene.center(index))));
    let places: Vec<[[f32; 3]; 2]> = places.collect();
    scene.surfels.par_iter_mut().zip(&places).for_each(|(surfel, [short, _])| surfel.center = *short);
    scene.low.par_iter_mut().zip(&places).for_each(|(low, [_, rest])| *low = *rest);
    scene
}

/// Sorts the points of each leaf by place and content, so that their order does not depend on the
/// order of the scene's surfels.
fn in_order(tree: &Octree, points: &mut [Element], scene: &Scene) {
    let mut leaves: Vec<&Set> = tree.sets.iter().filter(|set| set.is_leaf()).collect();
    leaves.par_sort_unstable_by_key(|set| set.first);
    let mut rest = points;
    let mut slices: Vec<&mut [Element]> = Vec::with_capacity(leaves.len());
    for leaf in leaves {
        let (own, after) = rest.split_at_mut(leaf.range().len());
        slices.push(own);
        rest = after;
    }
    slices.into_par_iter().for_each(|own| {
        // Surfels that compare as equal are identical, so their order does not show.
        let content = |a: &Element, b: &Element| by_content(scene, a.index as usize, b.index as usize);
        own.sort_unstable_by(|a, b| a.place.cmp(&b.place).then_with(|| content(a, b)));
    });
}
