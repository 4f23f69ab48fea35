//! Cuts of levels of detail: surfels and nodes that stand for all, each surfel once.

use std::ops::Range;

use rayon::prelude::*;

use super::color::srgb8;
use super::hierarchy::{Hierarchy, Node};
use super::{Cap, Clip, Colors, Scene, Surfel};

/// What is drawn of a tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cut {
    /// Nodes, by their numbers, which ascend.
    pub nodes: Vec<u32>,
    /// Surfels of leaves, in the order of the tree.
    pub surfels: Vec<Range<u32>>,
}

/// What becomes of a node.
pub(crate) enum Fate {
    /// Nothing below it is drawn.
    Unseen,
    /// It stands for what is below it.
    Drawn,
    /// Its children, or its surfels.
    Divided,
}

impl Cut {
    /// From the root down by what becomes of each node that is come to; None if it has more than `most` surfels and nodes.
    pub(crate) fn of(hierarchy: &Hierarchy, most: u64, fate: impl Fn(u32) -> Fate + Sync) -> Option<Self> {
        let (mut cut, mut drawn) = (Self::default(), 0);
        let mut frontier: Vec<u32> = vec![0];
        while !frontier.is_empty() {
            let fates: Vec<Fate> = frontier.par_iter().with_min_len(256).map(|&index| fate(index)).collect();
            let mut below = Vec::new();
            for (index, fate) in frontier.into_iter().zip(fates) {
                let Node { first, count, leaf, .. } = hierarchy.nodes[index as usize];
                drawn += match fate {
                    Fate::Drawn => 1,
                    Fate::Divided if leaf => u64::from(count),
                    _ => 0,
                };
                if drawn > most {
                    return None;
                }
                match fate {
                    Fate::Unseen => {}
                    // One surfel is itself, with its lines and its cap.
                    Fate::Drawn if leaf && count == 1 => cut.surfels.push(first..first + 1),
                    Fate::Drawn => cut.nodes.push(index),
                    Fate::Divided if leaf => cut.surfels.push(first..first + count),
                    Fate::Divided => below.extend(first..first + count),
                }
            }
            frontier = below;
        }
        cut.nodes.sort_unstable();
        cut.surfels.sort_unstable_by_key(|range| range.start);
        Some(cut)
    }

    /// Nodes whose longest half-axis is shorter than `length`, world units, wherever they are seen from, and the surfels of leaves that are not.
    pub fn by_length(hierarchy: &Hierarchy, length: f64) -> Self {
        let fate = |index: u32| {
            let short = f64::from(hierarchy.nodes[index as usize].surfel.radius()) < length;
            if short { Fate::Drawn } else { Fate::Divided }
        };
        Self::of(hierarchy, u64::MAX, fate).unwrap_or_default()
    }

    /// How many surfels are drawn.
    pub fn len(&self) -> usize {
        self.nodes.len() + self.surfels.iter().map(|range| range.len()).sum::<usize>()
    }

    /// Whether nothing is drawn.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The surfels of leaves and then the nodes, as a scene like `scene`, which they are cut from. Nodes end at no lines and are flat.
    pub fn scene(&self, scene: &Scene, hierarchy: &Hierarchy) -> Scene {
        let indices: Vec<u32> = self.surfels.iter().flat_map(Clone::clone).collect();
        let nodes = || self.nodes.iter().map(|&index| &hierarchy.nodes[index as usize]);
        let mut cut = scene.taken(&indices);
        cut.surfels.extend(nodes().map(|node| node.surfel));
        let count = cut.surfels.len();
        if !scene.low.is_empty() {
            cut.low.extend(self.nodes.iter().map(|&index| hierarchy.low[index as usize]));
        }
        if !scene.clips.is_empty() {
            cut.clips.resize(count, Clip::NONE);
        }
        if !scene.caps.is_empty() {
            cut.caps.resize(count, Cap::FLAT);
        }
        let plane = |surfel: &Surfel| surfel.normal().normalize_or_zero().to_array();
        if !scene.normals.is_empty() {
            cut.normals.extend(nodes().map(|node| plane(&node.surfel)));
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
