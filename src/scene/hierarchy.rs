//! Levels of detail: a tree of surfels, each of which stands for all below it.

use glam::DVec3;
use rayon::prelude::*;

use super::{Cap, Surfel};

/// The most surfels of a leaf that do not all lie at one position (Pajarola 2003, section 3.2).
pub const FAN_OUT: usize = 8;

/// The deepest level of a tree, the root's being 0: a node there is a leaf, however many surfels it has.
pub const DEEPEST: usize = 63;

/// A node of a [`Hierarchy`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// The ellipse that stands for its surfels: it bounds their disks, seen along its normal.
    pub surfel: Surfel,
    /// How it curves as they do.
    pub cap: Cap,
    /// Their mean colour, linear, straight alpha.
    pub color: [f32; 4],
    /// A sphere of this radius around the centre holds them and the node itself, world units. It is larger than that where they do not lie on the node's
    /// cap, as cuts measure by it.
    pub radius: f32,
    /// The smallest cosine of the angle between a normal of theirs and its own; -1 where normals have no side.
    pub cone: f32,
    /// Its first child, or in a leaf the first of its surfels in the scene.
    pub first: u32,
    /// How many of these it has.
    pub count: u32,
    /// It has surfels and no children.
    pub leaf: bool,
}

/// A node, and what its f32 centre leaves out, world units.
pub(crate) type NodeAndLow = (Node, [f32; 3]);

/// A point-octree over the surfels of a scene: each node's are divided at the mean of their centres (Pajarola 2003, section 3.2). The scene has
/// them in the order of the tree: those below a node follow each other. It depends on the set of surfels alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hierarchy {
    /// Level by level from the root on; the children of a node follow each other.
    pub nodes: Vec<Node>,
    /// What the f32 centres of nodes leave out, world units: one for each node, or none at all where surfels' leave out nothing that shows.
    pub low: Vec<[f32; 3]>,
}

/// What is wrong with a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A node's children are not those that follow.
    Children(usize),
    /// A leaf's surfels are not those that follow, in the order in which leaves are come to from the root.
    Elements(usize),
    /// A node has none of what it should have, or more than it can have.
    Count(usize),
    /// There are more levels than [`DEEPEST`] allows.
    Depth,
    /// Some nodes belong to no other, or some surfels to no leaf.
    Loose,
}

impl Hierarchy {
    /// Whether nodes and `elements` surfels make one tree: level by level each node's children are the next ones, and from left to right each
    /// leaf's surfels. So no node is below itself, and none is below two.
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

    /// The leaves from left to right have all surfels in their order.
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
                // Children have larger numbers, so this ends.
                open.extend((node.first as usize..(node.first + node.count) as usize).rev());
            }
        }
        if reached == elements { Ok(()) } else { Err(Fault::Loose) }
    }

    /// Gives each leaf of one surfel that surfel's ellipse: it is drawn for it, and other programs may have written another one.
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

    /// What the f32 centre of a node leaves out, world units.
    pub fn low(&self, index: u32) -> DVec3 {
        self.low.get(index as usize).map_or(DVec3::ZERO, |low| DVec3::from_array(low.map(f64::from)))
    }

    /// How many levels there are.
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
        // Where surfels leave out nothing nodes do not either, and what has no surfels has none.
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
        // Cycles, shared children, gaps, empty and overfull nodes.
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
