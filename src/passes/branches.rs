//! Stage 0 with levels of detail: cuts the tree into branches that fit a device's buffers.
//!
//! A branch consists of neighbouring subtrees of one tree, whose surfels are consecutive. If there
//! are several branches, the first one has no surfels: it has the nodes above the other branches,
//! and its lowest nodes lead to the roots of those branches. The adapter determines which nodes
//! share a branch, but whether a node is drawn does not depend on its branch.

mod row;
mod small;

use std::collections::HashMap;
use std::ops::Range;

use rayon::prelude::*;

use self::row::COUNT_MASK;
pub use self::row::Row;
use self::small::Small;
use crate::gpu::layout::{INNER, KIND_SHIFT, LEAF, OTHER_BRANCH, PART_OF_LEAF};
use crate::scene::hierarchy::{Hierarchy, Node};

/// The most surfels of one leaf whose numbers one invocation copies. Larger leaves have parts.
const MOST_OF_LEAF: u32 = 4096;

/// Neighbouring subtrees of a tree, laid out for a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Branch {
    /// The range of the branch's surfels in the scene.
    pub surfels: Range<u32>,
    /// The branch's rows, roots first and level by level.
    pub nodes: Vec<Row>,
    /// For each row, the number of its node in the tree.
    pub numbers: Vec<u32>,
    /// The number of roots.
    pub roots: u32,
    /// The number of the first root, counted over all branches except the first.
    pub first_root: u32,
    /// Whether the branch starts at the root of the tree.
    pub whole: bool,
    /// The number of levels.
    pub levels: u32,
    /// The number of top levels that one workgroup can judge within its node and loop limits.
    pub small_levels: u32,
}

/// The item that a row of a branch represents.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Item {
    /// A node, with everything below it.
    Node(u32),
    /// Some surfels of a leaf that has more than [`MOST_OF_LEAF`]. The leaf becomes an inner node
    /// above its parts and is judged once, for all of them.
    Part { leaf: u32, first: u32, count: u32 },
    /// A root of another branch, by its number.
    Other { root: u32, node: u32 },
}

/// The place of a node that is in another branch.
#[derive(Clone, Copy)]
struct Elsewhere {
    /// The number of the root that is the node, or of the root that is the node's first part.
    root: u32,
    /// Whether the node is a leaf in parts, each of which is a root.
    in_parts: bool,
}

/// The parts of a leaf with more than [`MOST_OF_LEAF`] surfels; none for other nodes.
fn parts(number: u32, node: &Node) -> impl Iterator<Item = Item> + use<> {
    let Node { first, count, leaf, .. } = *node;
    let end = if leaf && count > MOST_OF_LEAF { first + count } else { first };
    (first..end).step_by(MOST_OF_LEAF as usize).map(move |first| Item::Part {
        leaf: number,
        first,
        count: MOST_OF_LEAF.min(end - first),
    })
}

/// The branches of a tree, each of at most `most` surfels and nodes together; `most` must be at
/// least a few thousand.
pub fn branches(tree: &Hierarchy, most: u64) -> Vec<Branch> {
    let (rows, surfels) = rows_of(tree);
    if rows <= most {
        let crowded = rows > tree.nodes.len() as u64 + u64::from(surfels);
        return vec![if crowded { of_root(tree, surfels) } else { as_it_is(tree, surfels) }];
    }
    let subtrees = subtrees(tree, &sizes(tree), most);
    let mut roots: HashMap<u32, Elsewhere> = HashMap::new();
    for (root, (item, ..)) in (0..).zip(&subtrees) {
        let (node, in_parts) = match *item {
            Item::Node(node) | Item::Other { node, .. } => (node, false),
            Item::Part { leaf, .. } => (leaf, true),
        };
        roots.entry(node).or_insert(Elsewhere { root, in_parts });
    }
    let top = Branch { whole: true, ..laid_out(tree, (&[Item::Node(0)], 0), 0..0, |node| roots.get(&node).copied()) };
    let mut all = vec![top];
    let (mut first, mut surfel) = (0, 0);
    while first < subtrees.len() {
        let (mut end, mut size, mut surfels) = (first, 0, 0);
        while end < subtrees.len() && (end == first || size + subtrees[end].1 <= most) {
            (size, surfels) = (size + subtrees[end].1, surfels + subtrees[end].2);
            end += 1;
        }
        let items: Vec<Item> = subtrees[first..end].iter().map(|(item, ..)| *item).collect();
        let branch = laid_out(tree, (&items, (size - u64::from(surfels)) as usize), surfel..surfel + surfels, |_| None);
        all.push(Branch { first_root: first as u32, ..branch });
        (first, surfel) = (end, surfel + surfels);
    }
    all
}

/// The single branch of a whole tree.
fn of_root(tree: &Hierarchy, surfels: u32) -> Branch {
    Branch { whole: true, ..laid_out(tree, (&[Item::Node(0)], tree.nodes.len()), 0..surfels, |_| None) }
}

/// The single branch of a tree without leaves in parts: its rows are the tree's nodes, in the same
/// order.
///
/// All threads make the rows; a view of 3,000,000 nodes then takes 0.98 times as long.
fn as_it_is(tree: &Hierarchy, surfels: u32) -> Branch {
    let row = |node: &Node| {
        let kind = if node.leaf { LEAF } else { INNER };
        Row { first: node.first, below: node.count | kind << KIND_SHIFT, together: !node.leaf }
    };
    let nodes: Vec<Row> = tree.nodes.par_iter().with_min_len(4096).map(row).collect();
    let (mut level, mut levels, mut small) = (0..1.min(nodes.len()), 0, Small::of(1));
    while !level.is_empty() {
        small.add(&nodes[level.clone()]);
        // The children of the last node that has children end the next level.
        let last = nodes[level.clone()].iter().rfind(|row| row.together);
        let end = last.map_or(level.end, |row| (row.first + (row.below & COUNT_MASK)) as usize);
        (level, levels) = (level.end..end, levels + 1);
    }
    let numbers = (0..nodes.len() as u32).collect();
    let small_levels = small.levels;
    Branch { surfels: 0..surfels, nodes, numbers, roots: 1, first_root: 0, whole: true, levels, small_levels }
}

/// The size of a tree: the number of its rows and surfels together, and of its surfels alone.
fn rows_of(tree: &Hierarchy) -> (u64, u32) {
    let of = |(number, node): (usize, &Node)| {
        let surfels = if node.leaf { node.count } else { 0 };
        (1 + u64::from(surfels) + parts(number as u32, node).count() as u64, surfels)
    };
    let sum = |(a, b): (u64, u32), (c, d): (u64, u32)| (a + c, b + d);
    tree.nodes.par_iter().enumerate().with_min_len(4096).map(of).reduce(|| (0, 0), sum)
}

/// For each node, the size of its subtree: surfels and rows together, the node's own row included.
fn sizes(tree: &Hierarchy) -> Vec<u64> {
    let mut sizes = vec![0u64; tree.nodes.len()];
    // Children have larger numbers than their parents.
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        sizes[index] = 1 + match node.leaf {
            true => u64::from(node.count) + parts(index as u32, node).count() as u64,
            false => sizes[node.first as usize..(node.first + node.count) as usize].iter().sum(),
        };
    }
    sizes
}

/// The largest subtrees of size at most `most`, from left to right, each with its size and its
/// number of surfels.
fn subtrees(tree: &Hierarchy, sizes: &[u64], most: u64) -> Vec<(Item, u64, u32)> {
    let (mut found, mut open) = (Vec::new(), vec![0u32]);
    while let Some(index) = open.pop() {
        let node = &tree.nodes[index as usize];
        if sizes[index as usize] <= most {
            found.push((Item::Node(index), sizes[index as usize], 0));
        } else if node.leaf {
            found.extend(parts(index, node).map(|part| (part, 1, 0)));
        } else {
            open.extend((node.first..node.first + node.count).rev());
        }
    }
    for (item, size, surfels) in &mut found {
        match *item {
            Item::Part { count, .. } => (*size, *surfels) = (1 + u64::from(count), count),
            Item::Node(index) => *surfels = surfels_of(tree, index),
            Item::Other { .. } => {}
        }
    }
    found
}

/// The number of surfels below a node: from those of its leftmost leaf to those of its rightmost.
fn surfels_of(tree: &Hierarchy, index: u32) -> u32 {
    let end_of = |last: bool| {
        let mut node = &tree.nodes[index as usize];
        while !node.leaf {
            node = &tree.nodes[(node.first + if last { node.count - 1 } else { 0 }) as usize];
        }
        node
    };
    let (first, last) = (end_of(false), end_of(true));
    last.first + last.count - first.first
}

/// Lays out the branch that consists of the subtrees below `roots`; `surfels` is the range of their
/// surfels.
///
/// `room` is the expected number of nodes, for allocation. Nodes that are `elsewhere` lead to roots
/// of other branches.
fn laid_out(
    tree: &Hierarchy,
    (roots, room): (&[Item], usize),
    surfels: Range<u32>,
    elsewhere: impl Fn(u32) -> Option<Elsewhere>,
) -> Branch {
    let (nodes, numbers) = (Vec::with_capacity(room), Vec::with_capacity(room));
    let mut rows = Rows { tree, elsewhere, surfels, nodes, numbers };
    roots.iter().for_each(|root| rows.push(*root));
    let (mut level, mut levels, mut small) = (0..rows.nodes.len(), 0, Small::of(roots.len() as u64));
    while !level.is_empty() {
        level.clone().for_each(|row| rows.push_below(row));
        small.add(&rows.nodes[level.clone()]);
        (level, levels) = (level.end..rows.nodes.len(), levels + 1);
    }
    let small_levels = small.levels;
    let Rows { surfels, nodes, numbers, .. } = rows;
    Branch { surfels, nodes, numbers, roots: roots.len() as u32, first_root: 0, whole: false, levels, small_levels }
}

/// The rows of a branch while they are made, level by level.
struct Rows<'a, E> {
    tree: &'a Hierarchy,
    elsewhere: E,
    surfels: Range<u32>,
    nodes: Vec<Row>,
    numbers: Vec<u32>,
}

impl<E: Fn(u32) -> Option<Elsewhere>> Rows<'_, E> {
    /// Adds the row of an item, without the rows below it.
    fn push(&mut self, item: Item) {
        let (number, kind, first, count) = match item {
            Item::Part { leaf, first, count } => (leaf, PART_OF_LEAF, first - self.surfels.start, count),
            Item::Other { root, node } => (node, OTHER_BRANCH, root, 1),
            Item::Node(number) => {
                let node = &self.tree.nodes[number as usize];
                match (self.elsewhere)(number) {
                    Some(Elsewhere { root, in_parts: false }) => (number, OTHER_BRANCH, root, 1),
                    None if node.leaf && node.count <= MOST_OF_LEAF => {
                        (number, LEAF, node.first - self.surfels.start, node.count)
                    }
                    // A leaf in parts becomes an inner node above them.
                    _ => (number, INNER, 0, 0),
                }
            }
        };
        let below = count | kind << KIND_SHIFT;
        self.nodes.push(Row { first, below, together: false });
        self.numbers.push(number);
    }

    /// Adds the rows of the children or parts of an inner node.
    fn push_below(&mut self, row: usize) {
        if self.nodes[row].below >> KIND_SHIFT != INNER {
            return;
        }
        let (number, tree, first) = (self.numbers[row], self.tree, self.nodes.len());
        let node = &tree.nodes[number as usize];
        let all = node.first..node.first + node.count;
        if !node.leaf {
            if all.clone().all(|child| (self.elsewhere)(child).is_none()) {
                self.nodes[row].together = true;
            }
            all.for_each(|child| self.push(Item::Node(child)));
        } else if let Some(Elsewhere { root, .. }) = (self.elsewhere)(number) {
            (root..).zip(parts(number, node)).for_each(|(root, _)| self.push(Item::Other { root, node: number }));
        } else {
            parts(number, node).for_each(|part| self.push(part));
        }
        let count = (self.nodes.len() - first) as u32;
        let own = &mut self.nodes[row];
        (own.first, own.below) = (first as u32, own.below | count);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use glam::Vec3;

    use super::row::ONE_BY_ONE;
    use super::small::{MOST_ROUNDS, rounds_of};
    use super::*;
    use crate::gpu::layout::{JUDGED, WORKGROUP};
    use crate::scene::{Scene, Surfel};
    use crate::surfels::hierarchy;

    /// The surfels that get copies.
    const CROWDED: [usize; 5] = [0, 1, 2, 20, 40];

    /// A tree of `count` surfels on a spiral, with `copies` more of each of [`CROWDED`].
    fn tree(count: usize, copies: usize) -> Hierarchy {
        let at = |k: usize| {
            let (sine, cosine) = (k as f32 * 2.4).sin_cos();
            Vec3::new(cosine, sine, 1.0) * (k as f32).sqrt()
        };
        let crowds = CROWDED.into_iter().flat_map(|k| vec![at(k); copies]);
        let places = (0..count).map(at).chain(crowds);
        let surfels = places.map(|place| Surfel::disk(place, Vec3::Z, 0.5)).collect();
        let scene = Scene { surfels, ..Scene::default() };
        hierarchy::build(scene, &()).unwrap().1.as_ref().clone()
    }

    fn kind(node: &Row) -> (u32, u32) {
        (node.below >> KIND_SHIFT, node.below & COUNT_MASK)
    }

    /// Collects the surfels below a row of a branch, by their places in the scene. Checks that rows
    /// that lead to other branches name the right nodes.
    fn below(branches: &[Branch], (branch, row): (usize, u32), depth: u32, into: &mut Vec<u32>) {
        let of = &branches[branch];
        assert!(depth < 2 * of.levels + branches[0].levels);
        let node = &of.nodes[row as usize];
        match kind(node) {
            (LEAF | PART_OF_LEAF, count) => {
                into.extend((node.first..node.first + count).map(|place| of.surfels.start + place))
            }
            (OTHER_BRANCH, _) => {
                let holds = |b: &Branch| !b.whole && (b.first_root..b.first_root + b.roots).contains(&node.first);
                let other = branches.iter().position(holds).unwrap();
                let root = node.first - branches[other].first_root;
                assert_eq!(branches[other].numbers[root as usize], of.numbers[row as usize]);
                below(branches, (other, root), depth + 1, into);
            }
            (_, count) => {
                (node.first..node.first + count).for_each(|child| below(branches, (branch, child), depth + 1, into))
            }
        }
    }

    /// For each level of a branch, its number of nodes and the most surfels or children of one of
    /// them.
    fn levels_of(branch: &Branch) -> Vec<(usize, u32)> {
        let (mut levels, mut level) = (Vec::new(), &branch.nodes[..branch.roots as usize]);
        let mut end = level.len();
        while !level.is_empty() {
            levels.push((level.len(), level.iter().map(|node| kind(node).1).max().unwrap()));
            let children = |node: &Row| if kind(node).0 == INNER { kind(node).1 as usize } else { 0 };
            let next = level.iter().map(children).sum::<usize>();
            (level, end) = (&branch.nodes[end..end + next], end + next);
        }
        levels
    }

    /// Checks an inner node's bound on its children's radii. The node has a bound unless a child is
    /// in another branch or in parts.
    fn family(tree: &Hierarchy, branch: &Branch, index: usize) {
        let (node, children) = (branch.nodes[index], branch.row(tree, index).children);
        let rows = node.first as usize..(node.first + kind(&node).1) as usize;
        let of = |row: usize| kind(&branch.nodes[row]);
        // A leaf whose parts are roots of other branches is an inner node above the parts.
        let crowds = |row: usize| {
            let leaf = tree.nodes[branch.numbers[row] as usize].leaf;
            leaf && of(row).0 == INNER && of(branch.nodes[row].first as usize).0 == OTHER_BRANCH
        };
        let here = rows.clone().all(|row| [INNER, LEAF].contains(&of(row).0) && !crowds(row));
        let balls = rows.filter(|row| of(*row) != (LEAF, 1)).map(|row| branch.row(tree, row).radius);
        assert_eq!(children, if here { balls.fold(0.0, f32::max) } else { ONE_BY_ONE });
    }

    #[test]
    fn branches_have_every_surfel_once_and_fit() {
        let (mut large, mut crowded) = (false, false);
        for (count, copies, most) in [
            (1, 0, 10_000),
            (3000, 0, 10_000),
            (3000, 0, 500),
            (3000, 20_000, 6000),
            (50, 9000, 1 << 20),
            (20_000, 0, 1 << 20),
        ] {
            let tree = tree(count, copies);
            let all = branches(&tree, most);
            let surfels = count + CROWDED.len() * copies;
            let alone = all.len() == 1 && copies == 0;
            assert!(!alone || all[0] == of_root(&tree, surfels as u32));
            assert!(all[0].whole && all.iter().skip(1).all(|branch| !branch.whole));
            assert!(all.len() == 1 || all[0].surfels.is_empty());
            let fits = |branch: &Branch| (branch.surfels.len() + branch.nodes.len()) as u64 <= most;
            // The first branch fits, because few nodes lie above the roots of other branches.
            assert!(all.iter().all(fits), "{count} {copies}");
            let mut found = Vec::new();
            below(&all, (0, 0), 0, &mut found);
            assert!(found.iter().copied().eq(0..surfels as u32), "{count} {copies}");
            let leaves = all
                .iter()
                .flat_map(|branch| &branch.nodes)
                .map(kind)
                .filter(|(kind, _)| [LEAF, PART_OF_LEAF].contains(kind));
            assert!(leaves.map(|(_, count)| count).max().unwrap() <= MOST_OF_LEAF);
            for branch in &all {
                let inner = (0..branch.nodes.len()).filter(|row| kind(&branch.nodes[*row]).0 == INNER);
                inner.for_each(|row| family(&tree, branch, row));
                let levels = levels_of(branch);
                assert_eq!(branch.levels as usize, levels.len());
                let (small, others) = levels.split_at(branch.small_levels as usize);
                assert!(small.iter().all(|(nodes, _)| *nodes <= (JUDGED * WORKGROUP) as usize));
                let rounds = |levels: &[(usize, u32)]| levels.iter().map(|(_, below)| rounds_of(*below)).sum::<u64>();
                assert!(rounds(small) + u64::from(branch.roots) < MOST_ROUNDS);
                // No further level is small.
                match others.first() {
                    Some((nodes, _)) if *nodes > (JUDGED * WORKGROUP) as usize => large = true,
                    Some((_, below)) => {
                        assert!(rounds(small) + rounds_of(*below) + u64::from(branch.roots) >= MOST_ROUNDS);
                        crowded = true;
                    }
                    None => {}
                }
            }
            if most == 500 {
                assert!(all.len() > 6 && all.len() < 30, "{}", all.len());
                let nodes: usize = all.iter().map(|branch| branch.nodes.len()).sum();
                let others = all[0].nodes.iter().filter(|node| kind(node).0 == OTHER_BRANCH).count();
                assert_eq!(nodes - others, tree.nodes.len());
            }
        }
        assert!(large && crowded);
    }
}
