//! Cuts through levels of detail: surfels and nodes that together stand for each surfel once, or
//! once in each of several cuts that fade into each other.

use std::ops::Range;

use rayon::prelude::*;

use super::color::srgb8;
use super::fade::STEPS;
use super::hierarchy::{Hierarchy, Node};
use super::{Cap, Clip, Colors, Fade, Scene, Surfel};

/// The nodes and surfels of a tree that are drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cut {
    /// Node indices, ascending, and the fade of each node.
    pub nodes: Vec<(u32, Fade)>,
    /// Ranges of surfels in leaves, in the order of the tree, and the fade of each range.
    pub surfels: Vec<(Range<u32>, Fade)>,
}

/// The treatment of a node in a cut.
pub(crate) enum Fate {
    /// Neither the node nor anything below it is drawn.
    Unseen,
    /// In this many of the fading cuts, counted from the first, the node's children or surfels are
    /// drawn. In the other cuts the node is drawn in their place.
    Divided(u8),
}

impl Fate {
    /// The node is drawn in all cuts.
    pub const DRAWN: Self = Self::Divided(0);
    /// The node's children or surfels are drawn in all cuts.
    pub const DIVIDED: Self = Self::Divided(STEPS);
}

impl Cut {
    /// Builds the cut from the root down by the `fate` of each node that is reached, without the
    /// surfels of leaves that are `out`. None if it has more than `most` surfels and nodes.
    pub(crate) fn of(
        hierarchy: &Hierarchy,
        most: u64,
        fate: impl Fn(u32) -> Fate + Sync,
        out: impl Fn(&Node, u32) -> bool,
    ) -> Option<Self> {
        let (mut cut, mut drawn) = (Self::default(), 0);
        // Nodes that are reached, and in how many of the cuts.
        let mut frontier: Vec<(u32, u8)> = vec![(0, STEPS)];
        while !frontier.is_empty() {
            let fates: Vec<Fate> = frontier.par_iter().with_min_len(256).map(|&(index, _)| fate(index)).collect();
            let mut below = Vec::new();
            for ((index, to), fate) in frontier.into_iter().zip(fates) {
                let node = &hierarchy.nodes[index as usize];
                let Node { first, count, leaf, .. } = *node;
                let Fate::Divided(divided) = fate else { continue };
                if leaf && count == 1 && out(node, first) {
                    continue;
                }
                let from = match count {
                    // A leaf of one surfel is drawn as the surfel, which may have clip lines and a
                    // cap.
                    1 if leaf => to,
                    // In a part of a scene the surfels of a leaf may be absent; views of the part
                    // never divide such a leaf.
                    0 => 0,
                    _ => divided.min(to),
                };
                if from < to {
                    cut.nodes.push((index, Fade { from, to }));
                }
                drawn += u64::from(from < to);
                if from > 0 && leaf {
                    let known = cut.surfels.len();
                    let kept = first..first + count;
                    add(&mut cut.surfels, kept, Fade { from: 0, to: from }, |surfel| !out(node, surfel));
                    drawn += cut.surfels[known..].iter().map(|(range, _)| range.len() as u64).sum::<u64>();
                } else if from > 0 {
                    below.extend((first..first + count).map(|child| (child, from)));
                }
                if drawn > most {
                    return None;
                }
            }
            frontier = below;
        }
        cut.nodes.sort_unstable_by_key(|(index, _)| *index);
        cut.surfels.sort_unstable_by_key(|(range, _)| range.start);
        Some(cut)
    }

    /// The cut independent of the view: nodes whose [`radius`](super::hierarchy::Node::radius) is
    /// less than `length`, world units, and surfels of leaves with a larger radius.
    pub fn by_length(hierarchy: &Hierarchy, length: f64) -> Self {
        let fate = |index: u32| {
            let short = f64::from(hierarchy.nodes[index as usize].radius) < length;
            if short { Fate::DRAWN } else { Fate::DIVIDED }
        };
        Self::of(hierarchy, u64::MAX, fate, |_, _| false).unwrap_or_default()
    }

    /// The number of surfels and nodes that are drawn.
    pub fn len(&self) -> usize {
        self.nodes.len() + self.surfels.iter().map(|(range, _)| range.len()).sum::<usize>()
    }

    /// Whether nothing is drawn.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The cut as a scene with the other attributes of `scene`, from which it was made: first the
    /// surfels of leaves, then the nodes.
    ///
    /// Nodes have no clip lines, and are flat unless `caps` is set.
    pub fn scene(&self, scene: &Scene, hierarchy: &Hierarchy, caps: bool) -> Scene {
        let indices: Vec<u32> = self.surfels.iter().flat_map(|(range, _)| range.clone()).collect();
        let nodes = || self.nodes.iter().map(|&(index, _)| &hierarchy.nodes[index as usize]);
        let mut cut = scene.taken(&indices);
        cut.surfels.extend(nodes().map(|node| node.surfel));
        let count = cut.surfels.len();
        let has = scene.has();
        if has.low {
            cut.low.extend(self.nodes.iter().map(|&(index, _)| hierarchy.low[index as usize]));
        }
        if has.clips {
            cut.clips.resize(count, Clip::NONE);
        }
        let curved = caps && nodes().any(|node| !node.cap.is_flat());
        if curved || has.caps {
            cut.caps.resize(count - self.nodes.len(), Cap::FLAT);
            cut.caps.extend(nodes().map(|node| if caps { node.cap } else { Cap::FLAT }));
        }
        let plane = |surfel: &Surfel| surfel.normal().normalize_or_zero().to_array();
        if has.normals {
            cut.normals.extend(nodes().map(|node| plane(&node.surfel)));
        }
        let of_surfels = self.surfels.iter().flat_map(|(range, fade)| std::iter::repeat_n(*fade, range.len()));
        cut.fades = of_surfels.chain(self.nodes.iter().map(|(_, fade)| *fade)).collect();
        if cut.fades.iter().all(|fade| *fade == Fade::WHOLE) {
            cut.fades.clear();
        }
        match &mut cut.colors {
            Colors::Srgb8(codes) => codes.extend(nodes().map(|node| srgb8(node.color))),
            Colors::Linear(colors) => colors.extend(nodes().map(|node| node.color)),
            // `Constant` has one colour for all. Scenes with textures or harmonics have no levels
            // of detail.
            Colors::Constant(_) | Colors::Textured(_) | Colors::Harmonics(_) => {}
        }
        cut
    }
}

/// Adds those of `surfels` that are `kept` to `ranges`, as few ranges.
fn add(ranges: &mut Vec<(Range<u32>, Fade)>, surfels: Range<u32>, fade: Fade, kept: impl Fn(u32) -> bool) {
    let first = ranges.len();
    for surfel in surfels.filter(|surfel| kept(*surfel)) {
        match ranges[first..].last_mut() {
            Some((range, _)) if range.end == surfel => range.end += 1,
            _ => ranges.push((surfel..surfel + 1, fade)),
        }
    }
}
