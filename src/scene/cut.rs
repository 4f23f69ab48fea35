//! Cuts of levels of detail: surfels and nodes that stand for all, each surfel once, or once in each of the cuts that fade into each other.

use std::ops::Range;

use rayon::prelude::*;

use super::color::srgb8;
use super::fade::STEPS;
use super::hierarchy::{Hierarchy, Node};
use super::{Cap, Clip, Colors, Fade, Scene, Surfel};

/// What is drawn of a tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cut {
    /// Nodes, by their numbers, which ascend, and how much there is of each.
    pub nodes: Vec<(u32, Fade)>,
    /// Surfels of leaves, in the order of the tree, and how much there is of each.
    pub surfels: Vec<(Range<u32>, Fade)>,
}

/// What becomes of a node.
pub(crate) enum Fate {
    /// Nothing below it is drawn.
    Unseen,
    /// In so many cuts, of those that fade into each other the first, its children or its surfels are drawn; in the others it stands for them.
    Divided(u8),
}

impl Fate {
    /// It stands for what is below it.
    pub const DRAWN: Self = Self::Divided(0);
    /// Its children, or its surfels.
    pub const DIVIDED: Self = Self::Divided(STEPS);
}

impl Cut {
    /// From the root down by what becomes of each node that is come to; None if it has more than `most` surfels and nodes.
    pub(crate) fn of(hierarchy: &Hierarchy, most: u64, fate: impl Fn(u32) -> Fate + Sync) -> Option<Self> {
        let (mut cut, mut drawn) = (Self::default(), 0);
        // Nodes that are come to, in how many cuts.
        let mut frontier: Vec<(u32, u8)> = vec![(0, STEPS)];
        while !frontier.is_empty() {
            let fates: Vec<Fate> = frontier.par_iter().with_min_len(256).map(|&(index, _)| fate(index)).collect();
            let mut below = Vec::new();
            for ((index, to), fate) in frontier.into_iter().zip(fates) {
                let Node { first, count, leaf, .. } = hierarchy.nodes[index as usize];
                let Fate::Divided(divided) = fate else { continue };
                let from = match count {
                    // One surfel is itself, with its lines and its cap.
                    1 if leaf => to,
                    // Where the surfels of a part of a tree are not there, no picture divides their leaf.
                    0 => 0,
                    _ => divided.min(to),
                };
                if from < to {
                    cut.nodes.push((index, Fade { from, to }));
                }
                if from > 0 && leaf {
                    cut.surfels.push((first..first + count, Fade { from: 0, to: from }));
                } else if from > 0 {
                    below.extend((first..first + count).map(|child| (child, from)));
                }
                drawn += u64::from(from < to) + if from > 0 && leaf { u64::from(count) } else { 0 };
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

    /// Nodes whose [`radius`](super::hierarchy::Node::radius) is smaller than `length`, world units, wherever they are seen from, and the surfels
    /// of leaves that are not.
    pub fn by_length(hierarchy: &Hierarchy, length: f64) -> Self {
        let fate = |index: u32| {
            let short = f64::from(hierarchy.nodes[index as usize].radius) < length;
            if short { Fate::DRAWN } else { Fate::DIVIDED }
        };
        Self::of(hierarchy, u64::MAX, fate).unwrap_or_default()
    }

    /// How many surfels are drawn.
    pub fn len(&self) -> usize {
        self.nodes.len() + self.surfels.iter().map(|(range, _)| range.len()).sum::<usize>()
    }

    /// Whether nothing is drawn.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The surfels of leaves and then the nodes, as a scene like `scene`, which they are cut from. Nodes end at no lines, and are flat unless they have
    /// their `caps`.
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
            // One for all, and others have no levels of detail.
            Colors::Constant(_) | Colors::Textured(_) | Colors::Harmonics(_) => {}
        }
        cut
    }
}
