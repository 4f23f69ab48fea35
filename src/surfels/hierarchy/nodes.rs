//! From sets of points to nodes, from the deepest level up.

use rayon::prelude::*;

use super::below::{InMemory, Known};
use super::moments::Moments;
use super::octree::{Octree, Set};
use super::sums::Sums;
use super::{Made, bounds};
use crate::Progress;
use crate::scene::hierarchy::Node;
use crate::scene::{Cap, Scene, Surfel};

/// A node that is not made yet.
const NOTHING: Node = Node {
    surfel: Surfel { center: [0.0; 3], s: [0.0; 3], t: [0.0; 3] },
    cap: Cap::FLAT,
    color: [0.0; 4],
    radius: 0.0,
    cone: 0.0,
    first: 0,
    count: 0,
    leaf: true,
};

/// The nodes of a tree, whose points are in the order of `scene`, and the sums of its root.
pub(super) fn nodes(tree: &Octree, scene: &Scene, known: &Known, progress: &dyn Progress) -> (Vec<Made>, Sums) {
    let sets = Sets { tree, scene, known };
    if tree.sets[0].is_leaf() {
        let root = sets.of_points(&tree.sets[0]);
        return (vec![sets.leaf(0, &root)], root);
    }
    let mut all: Vec<Made> = vec![(NOTHING, [0.0; 3]); tree.sets.len()];
    // Those of the level below.
    let mut sums: Vec<Option<Box<Sums>>> = Vec::new();
    progress.begin("bounding nodes", tree.sets.len() as u64);
    for level in tree.levels.windows(2).rev() {
        let (here, lower) = all.split_at_mut(level[1]);
        let below = |child: u32| sums[child as usize - level[1]].as_deref().copied();
        // The children of the sets of a level follow each other.
        let mut children: Vec<&mut [Made]> = Vec::with_capacity(level[1] - level[0]);
        let mut rest = &mut *lower;
        for set in &tree.sets[level[0]..level[1]] {
            let (own, after) = rest.split_at_mut(set.children as usize);
            children.push(own);
            rest = after;
        }
        let numbers = || (level[0] as u32..level[1] as u32).into_par_iter();
        let summed = numbers().zip(children).map(|(number, children)| sets.summed(number, children, below));
        sums = summed.collect();
        let here = here[level[0]..].par_iter_mut().zip(numbers()).zip(&sums);
        here.for_each(|((node, number), sums)| {
            if let Some(sums) = sums {
                *node = sets.inner(number, sums, (level[1], lower));
            }
        });
        progress.advance((level[1] - level[0]) as u64);
    }
    progress.end();
    let root = sums.first().and_then(|sums| sums.as_deref().copied()).unwrap_or_default();
    (all, root)
}

/// What nodes are made of.
struct Sets<'a> {
    tree: &'a Octree,
    scene: &'a Scene,
    known: &'a Known,
}

impl Sets<'_> {
    /// The sums of a leaf.
    fn of_points(&self, set: &Set) -> Sums {
        Sums::of(&self.tree.elements[set.range()], self.scene, set.first as usize, &self.known.scales)
    }

    /// The node of a set, where those from number `nodes.0` on are known.
    fn made(&self, number: u32, sums: &Sums, (first, nodes): (usize, &[Made])) -> Made {
        let lattice = &self.tree.lattices[self.tree.sets[number as usize].lattice as usize];
        let below = InMemory { scene: self.scene, tree: self.tree, first, nodes };
        bounds::node(number, sums, lattice, &below, self.known)
    }

    /// The node of a leaf.
    fn leaf(&self, number: u32, sums: &Sums) -> Made {
        let set = &self.tree.sets[number as usize];
        if set.range().len() == 1 {
            return bounds::of_one(self.scene, set.first as usize, sums, self.known);
        }
        let (node, low) = self.made(number, sums, (0, &[]));
        (Node { first: set.first, count: set.range().len() as u32, ..node }, low)
    }

    /// The node of a set that is divided, where those from number `nodes.0` on are known.
    fn inner(&self, number: u32, sums: &Sums, nodes: (usize, &[Made])) -> Made {
        let set = &self.tree.sets[number as usize];
        let (node, low) = self.made(number, sums, nodes);
        (Node { first: set.first_child, count: set.children, leaf: false, ..node }, low)
    }

    /// The sums of a set's children together (EQ 4), of which those that are divided are known, and the nodes of the others; none of a leaf. Of children
    /// on another lattice the moments are made anew on this one.
    fn summed(&self, number: u32, nodes: &mut [Made], below: impl Fn(u32) -> Option<Sums>) -> Option<Box<Sums>> {
        let set = &self.tree.sets[number as usize];
        let mut all = Sums::default();
        for (number, node) in (set.first_child..).zip(nodes) {
            let child = &self.tree.sets[number as usize];
            let mut own = below(number).unwrap_or_else(|| {
                let own = self.of_points(child);
                *node = self.leaf(number, &own);
                own
            });
            if child.lattice != set.lattice {
                let lattice = &self.tree.lattices[set.lattice as usize];
                own.moments = Moments::of(child.range().map(|index| lattice.place(self.scene.center(index))));
            }
            all.add(&own);
        }
        (!set.is_leaf()).then(|| Box::new(all))
    }
}
