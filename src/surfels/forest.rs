//! Computes the minimum spanning forest of a graph whose links state whether their two ends have
//! the same sign. The links in the forest determine the sign of each node.
//!
//! Borůvka's algorithm: in each round, every tree takes its lightest link to another tree, until no
//! such link is left. The order of the links is total (weight, then index), so the forest is
//! unique, whatever the schedule. Signs are kept relative to the root of the tree, so no tree has
//! to be traversed afterwards.

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

/// A link between two nodes or trees.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    /// The nodes or trees at its two ends.
    pub ends: [u32; 2],
    /// The weight, shifted left by one bit; the lowest bit says whether the ends have opposite
    /// signs.
    weight: u32,
}

/// The number of bits of a weight.
const WEIGHT_BITS: u32 = 24;

impl Link {
    /// Creates a link. `weight` is in [0, 1] and rounded to a multiple of 2^-24.
    pub fn new(ends: [u32; 2], weight: f64, opposite: bool) -> Self {
        let rounded = (weight.clamp(0.0, 1.0) * f64::from((1u32 << WEIGHT_BITS) - 1)).round() as u32;
        Self { ends, weight: rounded << 1 | u32::from(opposite) }
    }

    fn opposite(self) -> bool {
        self.weight & 1 != 0
    }

    /// The sort key: links are ordered by weight, and links of equal weight by their index.
    fn key(self, place: usize) -> u64 {
        u64::from(self.weight >> 1) << PLACE_BITS | place as u64
    }
}

/// The number of bits left in a key for the link's index.
const PLACE_BITS: u32 = u64::BITS - WEIGHT_BITS;

/// The tree that contains a node, and whether the node's sign is opposite to that of the tree's
/// root.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Membership {
    /// The index of the tree.
    pub tree: u32,
    /// Whether the sign is opposite.
    pub opposite: bool,
}

impl Membership {
    /// The membership in the outer tree, where this tree is itself a node of `above`.
    pub fn within(self, above: &[Self]) -> Self {
        let outer = above[self.tree as usize];
        Self { tree: outer.tree, opposite: self.opposite ^ outer.opposite }
    }
}

/// Returns the membership of each of `nodes` nodes in the minimum spanning forest, and the number
/// of trees.
pub(crate) fn spanning_forest(nodes: usize, mut links: Vec<Link>) -> (Vec<Membership>, usize) {
    let mut members: Vec<Membership> =
        (0..nodes as u32).into_par_iter().map(|tree| Membership { tree, opposite: false }).collect();
    let mut levels = Vec::new();
    let mut trees = nodes;
    while !links.is_empty() {
        let (joined, count) = join(trees, &links);
        links = links
            .into_par_iter()
            .filter_map(|link| {
                let [a, b] = link.ends.map(|end| joined[end as usize]);
                let weight = link.weight ^ u32::from(a.opposite ^ b.opposite);
                (a.tree != b.tree).then_some(Link { ends: [a.tree, b.tree], weight })
            })
            .collect();
        levels.push(joined);
        trees = count;
    }
    members.par_iter_mut().for_each(|member| {
        *member = levels.iter().fold(*member, |member, level| member.within(level));
    });
    (members, trees)
}

/// One round: every tree joins the one at the other end of its lightest link. Returns the new
/// membership of each tree, and the new number of trees.
fn join(trees: usize, links: &[Link]) -> (Vec<Membership>, usize) {
    const NONE: u64 = u64::MAX;
    let lightest: Vec<AtomicU64> = (0..trees).into_par_iter().map(|_| AtomicU64::new(NONE)).collect();
    // A minimum does not depend on the order of the threads.
    links.par_iter().enumerate().for_each(|(place, link)| {
        let key = link.key(place);
        for end in link.ends {
            let slot = &lightest[end as usize];
            if key < slot.load(Ordering::Relaxed) {
                slot.fetch_min(key, Ordering::Relaxed);
            }
        }
    });
    let lightest: Vec<u64> = lightest.into_par_iter().map(AtomicU64::into_inner).collect();
    let mut parents: Vec<Membership> = (0..trees as u32)
        .into_par_iter()
        .map(|tree| {
            let itself = Membership { tree, opposite: false };
            let key = lightest[tree as usize];
            if key == NONE {
                return itself;
            }
            let link = links[(key & ((1 << PLACE_BITS) - 1)) as usize];
            let other = if link.ends[0] == tree { link.ends[1] } else { link.ends[0] };
            // As the order is total, the only cycles are two trees that chose the same link: the
            // first becomes their root.
            let is_root = lightest[other as usize] == key && tree < other;
            if is_root { itself } else { Membership { tree: other, opposite: link.opposite() } }
        })
        .collect();
    // Each step doubles the number of levels up to the parents, until all parents are roots.
    loop {
        let above: Vec<Membership> = parents.par_iter().map(|parent| parent.within(&parents)).collect();
        if above == parents {
            break;
        }
        parents = above;
    }
    let mut numbers = vec![0; trees];
    let mut count = 0;
    for (tree, number) in numbers.iter_mut().enumerate() {
        if parents[tree].tree as usize == tree {
            *number = count;
            count += 1;
        }
    }
    parents.par_iter_mut().for_each(|parent| parent.tree = numbers[parent.tree as usize]);
    (parents, count as usize)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The forest computed by Kruskal's algorithm: a label of each node's tree, and its sign.
    fn kruskal(nodes: usize, links: &[Link]) -> Vec<(usize, bool)> {
        let mut order: Vec<usize> = (0..links.len()).collect();
        order.sort_by_key(|&place| links[place].key(place));
        let mut tree: Vec<(usize, bool)> = (0..nodes).map(|node| (node, false)).collect();
        for link in order.into_iter().map(|place| links[place]) {
            let [(a, sign_a), (b, sign_b)] = link.ends.map(|end| tree[end as usize]);
            if a != b {
                let turned = sign_a ^ sign_b ^ link.opposite();
                tree.iter_mut().filter(|(label, _)| *label == b).for_each(|(label, sign)| {
                    *label = a;
                    *sign ^= turned;
                });
            }
        }
        tree
    }

    #[test]
    fn trees_and_signs_are_those_of_kruskal() {
        let mut state = 7u64;
        let mut below = |bound: u32| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as u32 % bound
        };
        for round in 0..200 {
            let nodes = 1 + below(60);
            let links: Vec<Link> = (0..below(150))
                .map(|_| Link::new([below(nodes), below(nodes)], f64::from(below(8)) / 7.0, below(2) == 1))
                .filter(|link| link.ends[0] != link.ends[1])
                .collect();
            let (members, trees) = spanning_forest(nodes as usize, links.clone());
            let expected = kruskal(nodes as usize, &links);
            let mut labels: Vec<usize> = expected.iter().map(|(label, _)| *label).collect();
            labels.sort_unstable();
            labels.dedup();
            assert_eq!(trees, labels.len(), "round {round}");
            for (i, j) in (0..nodes as usize).flat_map(|i| (0..i).map(move |j| (i, j))) {
                let together = expected[i].0 == expected[j].0;
                assert_eq!(members[i].tree == members[j].tree, together, "round {round}");
                // Signs around cycles are inconsistent here, so they show which links were taken.
                if together {
                    let sign = expected[i].1 ^ expected[j].1;
                    assert_eq!(members[i].opposite ^ members[j].opposite, sign, "round {round}");
                }
            }
        }
    }
}
