//! The rows of a branch: the data that a branch stores per node, and its conversion to the device's
//! layout.

use glam::DVec3;

use super::Branch;
use crate::gpu::layout::{KIND_SHIFT, LEAF, TreeNode};
use crate::scene::hierarchy::{Hierarchy, Node};

/// The bits of [`TreeNode::below`] that hold the number of surfels or children.
pub(super) const COUNT_MASK: u32 = (1 << KIND_SHIFT) - 1;

/// The contents of a row of a branch: the surfels or children of its node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// [`TreeNode::first`].
    pub(super) first: u32,
    /// [`TreeNode::below`].
    pub(super) below: u32,
    /// Whether all children of the row's node are in the same branch, so that they may be judged
    /// together ([`TreeNode::children`]).
    pub(super) together: bool,
}

impl Branch {
    /// The device's layout of a row. `tree` is the tree of this branch.
    pub fn row(&self, tree: &Hierarchy, index: usize) -> TreeNode {
        let (Row { first, below, together }, number) = (self.nodes[index], self.numbers[index]);
        let Node { surfel, radius, cone, .. } = tree.nodes[number as usize];
        let children = if together { children_of(tree, number) } else { ONE_BY_ONE };
        TreeNode { center: surfel.center, radius, first, below, children, cone }
    }

    /// The index in the scene of the surfel of a row that is a leaf of one surfel; else `None`.
    pub fn only_surfel(&self, row: usize) -> Option<u32> {
        let Row { first, below, .. } = self.nodes[row];
        (below == LEAF << KIND_SHIFT | 1).then(|| self.surfels.start + first)
    }
}

/// The value of [`TreeNode::children`] for a node whose children are judged one by one.
pub(super) const ONE_BY_ONE: f32 = -1.0;

/// The largest ball radius of an inner node's children; leaves of one surfel do not count.
///
/// Returns [`ONE_BY_ONE`] if the centre of some child lies outside the node's ball.
fn children_of(tree: &Hierarchy, number: u32) -> f32 {
    let node = &tree.nodes[number as usize];
    let center = |number: u32| {
        let Node { surfel, .. } = &tree.nodes[number as usize];
        DVec3::from_array(surfel.center.map(f64::from)) + tree.low(number)
    };
    let (middle, all) = (center(number), f64::from(node.radius));
    let mut largest = 0f32;
    for child in node.first..node.first + node.count {
        let Node { radius, count, leaf, .. } = tree.nodes[child as usize];
        if center(child).distance_squared(middle) > all * all {
            return ONE_BY_ONE;
        }
        if !(leaf && count == 1) {
            largest = largest.max(radius);
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::{Cap, Surfel};

    /// The tree of a file that other software wrote.
    #[test]
    fn children_outside_their_parents_ball_are_judged_one_by_one() {
        let node = |x: f32, radius: f32, (first, count): (u32, u32), leaf: bool| Node {
            surfel: Surfel::disk(Vec3::X * x, Vec3::Z, radius),
            cap: Cap::FLAT,
            color: [1.0; 4],
            radius,
            cone: 1.0,
            first,
            count,
            leaf,
        };
        let of = |x: f32, low: f32| {
            let nodes = vec![node(0.0, 1.0, (1, 2), false), node(x, 9.0, (0, 2), true), node(0.0, 4.0, (2, 1), true)];
            let low = vec![[0.0; 3], [low, 0.0, 0.0], [0.0; 3]];
            let tree = Hierarchy { nodes, low };
            children_of(&tree, 0)
        };
        // Children's balls may stick out, their centres may not.
        assert_eq!(of(1.0, 0.0), 9.0);
        assert_eq!(of(1.0, 1e-9), ONE_BY_ONE);
        assert_eq!(of(-1.1, 0.0), ONE_BY_ONE);
    }
}
