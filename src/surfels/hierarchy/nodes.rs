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

/// Sets that are made at once, by all threads.
const TOGETHER: usize = 1 << 16;

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
        let below = |child: u32| sums[child as usize - level[1]].as_deref().copied();
        let mut of_level = Vec::with_capacity(level[1] - level[0]);
        for start in (level[0]..level[1]).step_by(TOGETHER) {
            let range = start..level[1].min(start + TOGETHER);
            let numbers = || (range.start as u32..range.end as u32).into_par_iter();
            let (mut own, leaves): (Vec<_>, Vec<_>) = numbers().map(|number| sets.summed(number, below)).unzip();
            leaves.into_iter().flatten().for_each(|(number, made)| all[number as usize] = made);
            let inner: Vec<Option<Made>> =
                numbers().zip(&own).map(|(number, sums)| Some(sets.inner(number, sums.as_deref()?, &all))).collect();
            all[range.clone()].iter_mut().zip(inner).for_each(|(into, made)| *into = made.unwrap_or(*into));
            of_level.append(&mut own);
            progress.advance(range.len() as u64);
        }
        sums = of_level;
    }
    progress.end();
    let root = sums.first().and_then(|sums| sums.as_deref().copied()).unwrap_or_default();
    (all, root)
}

/// The sums of a set that is divided, and the nodes of the leaves right below it.
type Summed = (Option<Box<Sums>>, Vec<(u32, Made)>);

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

    /// A set with the nodes of the levels below it.
    fn made(&self, number: u32, sums: &Sums, nodes: &[Made]) -> Made {
        let lattice = &self.tree.lattices[self.tree.sets[number as usize].lattice as usize];
        let below = InMemory { scene: self.scene, tree: self.tree, nodes };
        bounds::node(number, sums, lattice, &below, self.known)
    }

    /// The node of a leaf.
    fn leaf(&self, number: u32, sums: &Sums) -> Made {
        let set = &self.tree.sets[number as usize];
        if set.range().len() == 1 {
            return bounds::of_one(self.scene, set.first as usize, sums, self.known);
        }
        let (node, low) = self.made(number, sums, &[]);
        (Node { first: set.first, count: set.range().len() as u32, ..node }, low)
    }

    /// The node of a set that is divided.
    fn inner(&self, number: u32, sums: &Sums, nodes: &[Made]) -> Made {
        let set = &self.tree.sets[number as usize];
        let (node, low) = self.made(number, sums, nodes);
        (Node { first: set.first_child, count: set.children, leaf: false, ..node }, low)
    }

    /// The sums of a set's children together (EQ 4), of which those that are divided are known; none of a leaf, whose sums are made where its
    /// parent's are. Of children on another lattice the moments are made anew on this one.
    fn summed(&self, number: u32, below: impl Fn(u32) -> Option<Sums>) -> Summed {
        let set = &self.tree.sets[number as usize];
        let (mut all, mut leaves) = (Sums::default(), Vec::new());
        for number in set.first_child..set.first_child + set.children {
            let child = &self.tree.sets[number as usize];
            let mut own = below(number).unwrap_or_else(|| {
                let own = self.of_points(child);
                leaves.push((number, self.leaf(number, &own)));
                own
            });
            if child.lattice != set.lattice {
                let lattice = &self.tree.lattices[set.lattice as usize];
                own.moments = Moments::of(child.range().map(|index| lattice.place(self.scene.center(index))));
            }
            all.add(&own);
        }
        ((!set.is_leaf()).then(|| Box::new(all)), leaves)
    }
}
