//! Computes the nodes of sets of points, from the deepest level up.

use rayon::prelude::*;

use super::below::{InMemory, Known, Stored};
use super::moments::Moments;
use super::octree::{Octree, Set};
use super::sums::Sums;
use super::{Made, bounds};
use crate::Progress;
use crate::scene::hierarchy::Node;
use crate::scene::{Cap, Scene, Surfel};

/// A placeholder for a node that is not computed yet.
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

/// Computes the nodes of a tree, and the sums of its root. `places` has three coordinates for each
/// point, in the order of `scene`.
pub(super) fn nodes<N: Stored>(
    (tree, places): (&Octree, &[i32]),
    scene: &Scene,
    known: &Known,
    progress: &dyn Progress,
) -> (Vec<N>, Sums) {
    let sets = Sets { tree, places: places.as_chunks().0, scene, known };
    if tree.sets[0].is_leaf() {
        let root = sets.of_points(&tree.sets[0]);
        return (vec![sets.leaf(0, &root)], root);
    }
    let mut all: Vec<N> = vec![(NOTHING, [0.0; 3]).into(); tree.sets.len()];
    // Sums of the divided sets of the level below.
    let mut sums: Vec<Sums> = Vec::new();
    progress.begin("bounding nodes", tree.sets.len() as u64);
    for level in tree.levels.windows(2).rev() {
        let own = &tree.sets[level[0]..level[1]];
        let divided: Vec<u32> =
            (level[0] as u32..).zip(own).filter(|(_, set)| !set.is_leaf()).map(|(n, _)| n).collect();
        let (here, lower) = all.split_at_mut(level[1]);
        // The children of a level's sets are contiguous.
        let mut children: Vec<(&mut [N], &[Sums])> = Vec::with_capacity(divided.len());
        let (mut rest, mut below) = (&mut *lower, &sums[..]);
        for &number in &divided {
            let (nodes, after) = rest.split_at_mut(tree.sets[number as usize].children as usize);
            let (sums, others) = below.split_at(sets.children(number).filter(|child| !child.is_leaf()).count());
            children.push((nodes, sums));
            (rest, below) = (after, others);
        }
        let summed = divided.par_iter().zip(children).map(|(&number, children)| sets.summed(number, children));
        sums = summed.collect();
        let here = here[level[0]..].iter_mut().zip(own).filter(|(_, set)| !set.is_leaf()).map(|(node, _)| node);
        let here: Vec<&mut N> = here.collect();
        here.into_par_iter().zip(&divided).zip(&sums).for_each(|((node, &number), sums)| {
            *node = sets.inner(number, sums, (level[1], lower));
        });
        progress.advance((level[1] - level[0]) as u64);
    }
    progress.end();
    (all, sums.first().copied().unwrap_or_default())
}

/// The inputs from which nodes are computed.
struct Sets<'a> {
    tree: &'a Octree,
    places: &'a [[i32; 3]],
    scene: &'a Scene,
    known: &'a Known,
}

impl Sets<'_> {
    /// The child sets of a set.
    fn children(&self, number: u32) -> std::slice::Iter<'_, Set> {
        let set = &self.tree.sets[number as usize];
        self.tree.sets[set.first_child as usize..][..set.children as usize].iter()
    }

    /// The sums of a leaf.
    fn of_points(&self, set: &Set) -> Sums {
        Sums::of(&self.places[set.range()], self.scene, set.first as usize, &self.known.scales)
    }

    /// Computes the node of set `number`; `nodes` holds the finished nodes from index `first` on.
    fn made<N: Stored>(&self, number: u32, sums: &Sums, (first, nodes): (usize, &[N])) -> Made {
        let lattice = &self.tree.lattices[self.tree.sets[number as usize].lattice as usize];
        let below = InMemory { scene: self.scene, tree: self.tree, first, nodes };
        bounds::node(number, sums, lattice, &below, self.known)
    }

    /// Computes the node of a leaf.
    fn leaf<N: Stored>(&self, number: u32, sums: &Sums) -> N {
        let set = &self.tree.sets[number as usize];
        if set.range().len() == 1 {
            return bounds::of_one(self.scene, set.first as usize, sums, self.known).into();
        }
        let (node, low) = self.made::<N>(number, sums, (0, &[]));
        (Node { first: set.first, count: set.range().len() as u32, ..node }, low).into()
    }

    /// Computes the node of a divided set; `nodes.1` holds the finished nodes from index `nodes.0`
    /// on.
    fn inner<N: Stored>(&self, number: u32, sums: &Sums, nodes: (usize, &[N])) -> N {
        let set = &self.tree.sets[number as usize];
        let (node, low) = self.made(number, sums, nodes);
        (Node { first: set.first_child, count: set.children, leaf: false, ..node }, low).into()
    }

    /// Adds up the sums of the children of a set (EQ 4): those of divided children are `known`,
    /// those of leaves are computed here, and so are the nodes of leaves.
    ///
    /// The moments of a child on another lattice are computed again on the lattice of the set.
    fn summed<N: Stored>(&self, number: u32, (nodes, known): (&mut [N], &[Sums])) -> Sums {
        let set = &self.tree.sets[number as usize];
        let (mut all, mut known) = (Sums::default(), known.iter());
        for ((number, child), node) in (set.first_child..).zip(self.children(number)).zip(nodes) {
            let known = if child.is_leaf() { None } else { known.next().copied() };
            let mut own = known.unwrap_or_else(|| {
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
        all
    }
}
