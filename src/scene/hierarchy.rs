//! Levels of detail: a tree whose nodes are surfels, each of which stands for all surfels below it.

use glam::DVec3;
use rayon::prelude::*;

use super::{Cap, Surfel};

/// The most surfels in a leaf, unless they all coincide (Pajarola 2003, section 3.2).
pub const FAN_OUT: usize = 8;

/// The deepest level of a tree; the root's is 0. A node there is a leaf, however many surfels it
/// has.
pub const DEEPEST: usize = 63;

/// A node of a [`Hierarchy`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// The ellipse that stands for the node's surfels: seen along its normal, it bounds their
    /// disks.
    pub surfel: Surfel,
    /// How the ellipse curves to follow its surfels.
    pub cap: Cap,
    /// The mean colour of the surfels: linear, straight alpha.
    pub color: [f32; 4],
    /// Radius of a sphere around the centre that holds the surfels and the node's own ellipse,
    /// world units. It is enlarged where the surfels lie off the node's cap: cuts measure nodes by
    /// it, and so divide such nodes sooner.
    pub radius: f32,
    /// The smallest cosine of the angle between the normals of the surfels and of the node; -1 if
    /// normals are not oriented.
    pub cone: f32,
    /// Index of the first child, or in a leaf of the first surfel in the scene.
    pub first: u32,
    /// The number of children, or in a leaf of surfels.
    pub count: u32,
    /// Whether the node has surfels instead of children.
    pub leaf: bool,
}

/// A node, and the part of its centre beyond f32, world units.
pub(crate) type NodeAndLow = (Node, [f32; 3]);

/// A point-octree over the surfels of a scene: the surfels of each node are divided at the mean of
/// their centres (Pajarola 2003, section 3.2).
///
/// The scene has its surfels in the order of the tree, so those below a node are contiguous. The
/// tree depends on the set of surfels alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hierarchy {
    /// The nodes, level by level from the root; the children of a node are contiguous.
    pub nodes: Vec<Node>,
    /// The part of each node's centre beyond f32, world units; empty if it is invisibly small for
    /// all surfels ([`Scene::low`](super::Scene::low)).
    pub low: Vec<[f32; 3]>,
}

/// The reason why nodes and surfels do not form a valid tree; the numbers are node indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The children of this node do not follow those of the node before it.
    Children(usize),
    /// The surfels of this leaf do not follow those of the leaf before it, in depth-first order.
    Elements(usize),
    /// This node has no children or surfels, or more than [`FAN_OUT`] children.
    Count(usize),
    /// There are more levels than [`DEEPEST`] allows.
    Depth,
    /// Some nodes have no parent, or some surfels are in no leaf.
    Loose,
}

impl Hierarchy {
    /// Checks that `nodes` and `elements` surfels form one tree.
    ///
    /// In level order, the children of each node must follow those of the node before it; in
    /// depth-first order, the surfels of each leaf must follow those of the leaf before it. So no
    /// node is below itself, and none has two parents.
    ///
    /// # Errors
    ///
    /// The first [`Fault`].
    pub fn check(nodes: &[Node], elements: usize) -> Result<(), Fault> {
        let mut next = 1;
        let (mut level_end, mut depth) = (1, 0);
        for (index, node) in nodes.iter().enumerate() {
            if index == level_end {
                (level_end, depth) = (next, depth + 1);
            }
            if index == level_end || depth > DEEPEST {
                return Err(if depth > DEEPEST { Fault::Depth } else { Fault::Loose });
            }
            if node.count == 0 || (!node.leaf && node.count as usize > FAN_OUT) {
                return Err(Fault::Count(index));
            }
            if !node.leaf {
                if node.first as usize != next {
                    return Err(Fault::Children(index));
                }
                next += node.count as usize;
            }
        }
        if next != nodes.len() {
            return Err(Fault::Loose);
        }
        Self::check_elements(nodes, elements)
    }

    /// Checks that the leaves, in depth-first order, hold all surfels in order.
    fn check_elements(nodes: &[Node], elements: usize) -> Result<(), Fault> {
        let (mut reached, mut open) = (0, vec![0]);
        while let Some(index) = open.pop() {
            let node: &Node = &nodes[index];
            if node.leaf {
                if node.first as usize != reached {
                    return Err(Fault::Elements(index));
                }
                reached += node.count as usize;
            } else {
                // Children have larger indices than their parent, so this loop ends.
                open.extend((node.first as usize..(node.first + node.count) as usize).rev());
            }
        }
        if reached == elements { Ok(()) } else { Err(Fault::Loose) }
    }

    /// Sets the ellipse of each leaf with one surfel to that surfel. Such a node may be drawn in
    /// place of its surfel, and a file of another program may have a different ellipse there.
    pub(crate) fn settle(&mut self, surfels: &[Surfel], low: &[[f32; 3]]) {
        let settled = |node: &mut Node| -> Option<[f32; 3]> {
            let place = (node.leaf && node.count == 1).then_some(node.first as usize)?;
            node.surfel = *surfels.get(place)?;
            Some(low.get(place).copied().unwrap_or_default())
        };
        let nodes = self.nodes.par_iter_mut().with_min_len(4096);
        if self.low.is_empty() {
            return nodes.for_each(|node| _ = settled(node));
        }
        nodes.zip(&mut self.low).for_each(|(node, low)| *low = settled(node).unwrap_or(*low));
    }

    /// The part of a node's centre beyond f32, world units.
    pub fn low(&self, index: u32) -> DVec3 {
        self.low.get(index as usize).map_or(DVec3::ZERO, |low| DVec3::from_array(low.map(f64::from)))
    }

    /// The number of levels.
    pub fn levels(&self) -> usize {
        let (mut levels, mut end, mut next, mut index) = (0, 1, 1, 0);
        while index < self.nodes.len() {
            for node in &self.nodes[index..end] {
                next += if node.leaf { 0 } else { node.count as usize };
            }
            (index, end, levels) = (end, next, levels + 1);
        }
        levels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(leaf: bool, first: u32, count: u32) -> Node {
        let surfel = Surfel { center: [0.0; 3], s: [1.0, 0.0, 0.0], t: [0.0, 1.0, 0.0] };
        Node { surfel, cap: Cap::FLAT, color: [1.0; 4], radius: 1.0, cone: 1.0, first, count, leaf }
    }

    #[test]
    fn leaves_of_one_surfel_are_settled() {
        let at = |x: f32| Surfel { center: [x, 2.0, 3.0], s: [0.0, 1.0, 0.0], t: [0.0, 0.0, x] };
        let nodes = vec![node(false, 1, 3), node(true, 0, 2), node(true, 2, 1), node(true, 0, 0)];
        let mut tree = Hierarchy { nodes: nodes.clone(), low: vec![[7.0; 3]; 4] };
        tree.settle(&[1.0, 2.0, 3.0].map(at), &[[0.1; 3], [0.2; 3], [0.3; 3]]);
        let settled = Node { surfel: at(3.0), ..nodes[2] };
        assert_eq!(tree.nodes, [nodes[0], nodes[1], settled, nodes[3]]);
        assert_eq!(tree.low, [[7.0; 3], [7.0; 3], [0.3; 3], [7.0; 3]]);
        // Without low parts of surfels, nodes get zero; a leaf whose surfels are absent stays as it
        // is.
        let mut tree = Hierarchy { nodes: nodes.clone(), low: vec![[7.0; 3]; 4] };
        tree.settle(&[at(1.0)], &[]);
        assert_eq!(tree.nodes, nodes);
        tree.settle(&[1.0, 2.0, 3.0].map(at), &[]);
        assert_eq!((tree.nodes[2], tree.low[2]), (settled, [0.0; 3]));
    }

    #[test]
    fn what_is_no_tree_is_told() {
        let inner = |first, count| node(false, first, count);
        let leaf = |first, count| node(true, first, count);
        let tree = vec![inner(1, 3), leaf(0, 2), inner(4, 2), leaf(6, 1), leaf(2, 3), leaf(5, 1)];
        assert_eq!(Hierarchy::check(&tree, 7), Ok(()));
        let hierarchy = Hierarchy { nodes: tree.clone(), low: vec![] };
        assert_eq!(hierarchy.levels(), 3);
        let changed = |index: usize, to: Node| {
            let mut other = tree.clone();
            other[index] = to;
            Hierarchy::check(&other, 7)
        };
        // Cycles, shared children, gaps, empty nodes and nodes with too many children.
        assert_eq!(changed(2, inner(0, 2)), Err(Fault::Children(2)));
        assert_eq!(changed(2, inner(1, 2)), Err(Fault::Children(2)));
        assert_eq!(changed(2, inner(u32::MAX, 2)), Err(Fault::Children(2)));
        assert_eq!(changed(2, inner(4, 3)), Err(Fault::Loose));
        assert_eq!(changed(2, inner(4, 1)), Err(Fault::Loose));
        assert_eq!(changed(2, inner(4, 9)), Err(Fault::Count(2)));
        assert_eq!(changed(4, leaf(2, 0)), Err(Fault::Count(4)));
        assert_eq!(changed(4, leaf(1, 3)), Err(Fault::Elements(4)));
        assert_eq!(changed(5, leaf(5, u32::MAX)), Err(Fault::Elements(3)));
        assert_eq!(Hierarchy::check(&tree, 8), Err(Fault::Loose));
        assert_eq!(Hierarchy::check(&[], 0), Err(Fault::Loose));
        assert_eq!(Hierarchy::check(&[leaf(0, 3)], 3), Ok(()));
        let chain: Vec<Node> = (1..=1_000_000).map(|child| inner(child, 1)).chain([leaf(0, 7)]).collect();
        assert_eq!(Hierarchy::check(&chain, 7), Err(Fault::Depth));
    }
}
