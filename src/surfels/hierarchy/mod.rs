//! Levels of detail of a scene: a point-octree whose nodes are surfels (Pajarola 2003, section 3; [`Hierarchy`]).
//!
//! Sets of points are divided at their mean (`octree`); of what is below it each node has sums that are whole numbers (`sums`, `moments`), from which its
//! centre, normal, colour and shape follow, and then the least ellipse of that shape that bounds all surfels below (`bounds`).
//! Everything is a sum of whole numbers, a minimum or a maximum, so a tree depends on the set of surfels alone, and not on their order or on the number of threads.

mod bounds;
mod curvature;
mod lattice;
mod moments;
mod octree;
mod points;
mod sums;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use self::bounds::Below;
use self::moments::Moments;
use self::octree::{Element, Octree, Set};
pub use self::points::points;
use self::sums::{Scales, Sums};
use crate::scene::hierarchy::Node;
use crate::scene::{Cap, Colors, Hierarchy, Scene, Surfel, by_content};
use crate::{Error, Progress, Result};

/// The scene with levels of detail, which are told too, and its surfels in the order of the tree.
///
/// # Errors
///
/// [`Error::Usage`] for a scene without surfels, with 2^32 or more, of Gaussians, or painted by textures.
pub fn build(scene: Scene, progress: &dyn Progress) -> Result<(Scene, Arc<Hierarchy>)> {
    let Ok(count) = u32::try_from(scene.surfels.len()) else {
        return Err(Error::Usage(format!("a tree has at most 2^32 - 1 surfels, not {}", scene.surfels.len())));
    };
    if count == 0 {
        return Err(Error::Usage("a scene without surfels has no levels of detail".into()));
    }
    if scene.encoded || matches!(scene.colors, Colors::Textured(_) | Colors::Harmonics(_)) {
        return Err(Error::Usage(
            "levels of detail are of surfels with a colour each: Gaussians, and surfels that a texture paints, have none yet".into(),
        ));
    }
    let scene = as_in_a_file(scene);
    progress.begin("dividing points", count.into());
    let mut tree = Octree::grow(count, |index| scene.center(index as usize), |points| progress.advance(points));
    progress.end();
    in_order(&mut tree, &scene);
    let order: Vec<u32> = tree.elements.iter().map(|element| element.index).collect();
    let scene = scene.taken(&order);
    drop(order);
    let hierarchy = Arc::new(nodes(&tree, &scene, progress));
    Ok((Scene { hierarchy: Some(hierarchy.clone()), ..scene }, hierarchy))
}

/// The scene with the centres that a file in world coordinates gives back.
fn as_in_a_file(mut scene: Scene) -> Scene {
    let origin = scene.origin;
    let written = |index: usize| (origin + scene.center(index)) - origin;
    let centers: Vec<DVec3> = (0..scene.surfels.len()).into_par_iter().map(written).collect();
    scene.surfels.par_iter_mut().zip(&centers).for_each(|(surfel, center)| surfel.center = center.as_vec3().to_array());
    let rest = |(low, (surfel, center)): (&mut [f32; 3], (&Surfel, &DVec3))| {
        *low = (center - DVec3::from_array(surfel.center.map(f64::from))).as_vec3().to_array();
    };
    scene.low.par_iter_mut().zip(scene.surfels.par_iter().zip(&centers)).for_each(rest);
    scene
}

/// Puts the points of each leaf in an order of their own.
fn in_order(tree: &mut Octree, scene: &Scene) {
    let mut leaves: Vec<&Set> = tree.sets.iter().filter(|set| set.is_leaf()).collect();
    leaves.par_sort_unstable_by_key(|set| set.first);
    let mut rest = &mut tree.elements[..];
    let mut slices: Vec<&mut [Element]> = Vec::with_capacity(leaves.len());
    for leaf in leaves {
        let (own, after) = rest.split_at_mut(leaf.range().len());
        slices.push(own);
        rest = after;
    }
    slices.into_par_iter().for_each(|own| {
        // What compares as equal is the same, and then any order is.
        let content = |a: &Element, b: &Element| by_content(scene, a.index as usize, b.index as usize);
        own.sort_unstable_by(|a, b| a.place.cmp(&b.place).then_with(|| content(a, b)));
    });
}

/// A node, and what its f32 centre leaves out.
type Made = (Node, [f32; 3]);

/// The nodes of a tree, whose points are in the order of `scene`: from the deepest level up.
fn nodes(tree: &Octree, scene: &Scene, progress: &dyn Progress) -> Hierarchy {
    let scale = Scales::of(scene);
    let nothing = Surfel { center: [0.0; 3], s: [0.0; 3], t: [0.0; 3] };
    let nothing = Node {
        surfel: nothing,
        color: [0.0; 4],
        radius: 0.0,
        cone: 0.0,
        cap: Cap::FLAT,
        first: 0,
        count: 0,
        leaf: true,
    };
    let mut all: Vec<Made> = vec![(nothing, [0.0; 3]); tree.sets.len()];
    let mut below: Vec<Option<Box<Sums>>> = Vec::new();
    progress.begin("bounding nodes", tree.sets.len() as u64);
    let told = AtomicU64::new(0);
    for level in tree.levels.windows(2).rev() {
        let made: Vec<_> = tree.sets[level[0]..level[1]]
            .par_iter()
            .map(|set| {
                let sums = sums_of(tree, set, level[1], &below, scene, &scale);
                let (mut node, low) = bounds::node(scene, set, &sums, Below { tree, nodes: &all }, &scale);
                if !set.is_leaf() {
                    (node.first, node.count, node.leaf) = (set.first_child, set.children, false);
                }
                if told.fetch_add(1, Ordering::Relaxed) % 1024 == 1023 {
                    progress.advance(1024);
                }
                // A leaf's are made again where they are wanted.
                ((node, low), (!set.is_leaf()).then(|| Box::new(sums)))
            })
            .collect();
        let (of_level, own): (Vec<Made>, Vec<_>) = made.into_iter().unzip();
        all[level[0]..level[1]].copy_from_slice(&of_level);
        below = own;
    }
    progress.end();
    let low = if scene.low.is_empty() { Vec::new() } else { all.iter().map(|(_, low)| *low).collect() };
    Hierarchy { nodes: all.into_iter().map(|(node, _)| node).collect(), low }
}

/// The sums of a set: of a leaf those of its points, else those of its children (EQ 4), of which `below` has some from set `first` on. Of
/// children on another lattice the moments are made anew on this one.
fn sums_of(tree: &Octree, set: &Set, first: usize, below: &[Option<Box<Sums>>], scene: &Scene, scale: &Scales) -> Sums {
    let of_points = |set: &Set| Sums::of(&tree.elements[set.range()], scene, set.first as usize, scale);
    if set.is_leaf() {
        return of_points(set);
    }
    let mut all = Sums::default();
    for number in set.first_child..set.first_child + set.children {
        let child = &tree.sets[number as usize];
        let known = &below[number as usize - first];
        let mut sums = known.as_deref().copied().unwrap_or_else(|| of_points(child));
        if child.lattice != set.lattice {
            let own = &tree.lattices[set.lattice as usize];
            sums.moments = Moments::of(child.range().map(|index| own.place(scene.center(index))));
        }
        all.add(&sums);
    }
    all
}
