//! Rows of branches: what they hold of nodes, and as the device sees them.

use glam::DVec3;

use super::Branch;
use crate::gpu::layout::{KIND_SHIFT, LEAF, TreeNode};
use crate::scene::hierarchy::{Hierarchy, Node};

/// The bits of [`TreeNode::below`] that say how many surfels or children there are.
pub(super) const COUNT_MASK: u32 = (1 << KIND_SHIFT) - 1;

/// What is below a row of a branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// [`TreeNode::first`].
    pub(super) first: u32,
    /// [`TreeNode::below`].
    pub(super) below: u32,
    /// Its node's children are in this branch, so that they may be judged together ([`TreeNode::children`]).
    pub(super) together: bool,
}

impl Branch {
    /// A row as the device sees it, of a branch of `tree`.
    pub fn row(&self, tree: &Hierarchy, index: usize) -> TreeNode {
        let (Row { first, below, together }, number) = (self.nodes[index], self.numbers[index]);
        let Node { surfel, radius, cone, .. } = tree.nodes[number as usize];
        let children = if together { children_of(tree, number) } else { ONE_BY_ONE };
        TreeNode { center: surfel.center, radius, first, below, children, cone }
    }

    /// The place in the scene of the surfel that is all of a row's node, if it is a leaf of one.
    pub fn only_surfel(&self, row: usize) -> Option<u32> {
        let Row { first, below, .. } = self.nodes[row];
        (below == LEAF << KIND_SHIFT | 1).then(|| self.surfels.start + first)
    }
}

/// Of a node whose children are judged one by one ([`TreeNode::children`]).
pub(super) const ONE_BY_ONE: f32 = -1.0;

/// Of an inner node that has the centres of all its children in its ball: the largest radius of a child, but of those that are one surfel. Of another
/// one its children are judged one by one.
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

    /// Of a file that somebody else wrote.
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
        // Large balls may stand out, centres may not.
        assert_eq!(of(1.0, 0.0), 9.0);
        assert_eq!(of(1.0, 1e-9), ONE_BY_ONE);
        assert_eq!(of(-1.1, 0.0), ONE_BY_ONE);
    }
}
