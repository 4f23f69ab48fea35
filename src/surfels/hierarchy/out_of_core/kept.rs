//! The part of the tree that is finished: subtrees, whose surfels and nodes are stored in files,
//! and the nodes above them.

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::super::below::{Below, Child, Disk};
use super::super::{Made, Octree};
use super::pages::Pages;
use super::sources::{Failed, PIECE};
use super::survey::Survey;
use crate::Result;
use crate::io::ply::{ColorProperties, KeptNodes, Nodes, Properties, Rows};
use crate::scene::color::DEFAULT_COLOR;
use crate::scene::hierarchy::Node;
use crate::scene::scene::core_step;
use crate::scene::{Colors, LevelFacts, Sample, Scene};

/// Identifies a node of the tree.
#[derive(Clone, Copy)]
pub(super) enum Key {
    /// A node above subtrees, by its index in [`Kept::parts`].
    Above(u32),
    /// A node of the subtree whose first node is number `subtree`. Its children, or in a leaf its
    /// surfels, are `count` stored rows from `first` on.
    Within { leaf: bool, first: u64, count: u32, subtree: u64 },
}

/// A finished node, and the number of surfels below it.
pub(super) struct Branch {
    pub key: Key,
    pub made: Made,
    pub surfels: u64,
}

/// A connected part of the tree.
pub(super) enum Part {
    /// A node above subtrees.
    Above { depth: usize, children: Vec<Branch>, made: Made },
    /// A subtree.
    Subtree {
        /// The level of its root within the tree.
        depth: usize,
        /// The number of its first stored node.
        first: u64,
        /// The start of each of its levels relative to `first`, and the end.
        levels: Vec<usize>,
    },
}

/// All finished parts of the tree.
pub(super) struct Kept<'a> {
    survey: &'a Survey,
    /// The surfels, in the order of the tree.
    pub surfels: Rows,
    pub nodes: KeptNodes,
    /// The finished parts in depth-first order, children before parents. Parts that have nodes on
    /// the same level are in the order of that level.
    pub parts: Vec<Part>,
    /// The format of nodes in the file.
    pub kind: Nodes,
    pub levels: LevelFacts,
    /// A sample of centres, from which the body of the scene is found. `sampled` holds the centres
    /// from which its core is found.
    pub sample: Sample,
    pub sampled: Vec<[f32; 3]>,
    /// Caches of surfels and of nodes.
    surfel_pages: Pages<Scene>,
    node_pages: Pages<Vec<Made>>,
    /// The first error of reading these files.
    failed: Failed,
}

impl<'a> Kept<'a> {
    /// Creates temporary files in `folder`, without surfels and nodes.
    pub fn new(survey: &'a Survey, folder: &Path, path: &Path) -> Result<Self> {
        let surfels = Rows::temporary(folder, properties(survey), path)?;
        let nodes = KeptNodes::new(folder, path)?;
        let kind = Nodes::none(survey.known.origin, matches!(survey.empty.colors, Colors::Srgb8(_)));
        let levels = LevelFacts::default();
        let (surfel_pages, node_pages) = (Pages::new(), Pages::new());
        let sample = Sample::of(survey.preparation.surfels as usize);
        let (parts, sampled, failed) = (Vec::new(), Vec::new(), Failed::default());
        Ok(Self { survey, surfels, nodes, parts, kind, levels, sample, sampled, surfel_pages, node_pages, failed })
    }

    /// Stores a subtree. `scene` has its surfels in the order of the tree.
    pub fn subtree(&mut self, depth: usize, tree: &Octree, scene: &Scene, mut nodes: Vec<Made>) -> Result<Branch> {
        let (surfels, first) = (self.surfels.count(), self.nodes.count());
        let pieces: Vec<Range<usize>> = (0..scene.surfels.len())
            .step_by(PIECE as usize)
            .map(|start| start..scene.surfels.len().min(start + PIECE as usize))
            .collect();
        for pieces in pieces.chunks(rayon::current_num_threads()) {
            let rows = &self.surfels;
            let encoded: Vec<Vec<u8>> = pieces.par_iter().map(|piece| rows.encoded(scene, piece.clone())).collect();
            encoded.iter().try_for_each(|bytes| self.surfels.append(bytes))?;
        }
        for (node, _) in nodes.iter_mut().filter(|(node, _)| node.leaf) {
            // There are fewer than 2^32 surfels in all.
            node.first += surfels as u32;
        }
        (0..scene.surfels.len()).for_each(|index| self.sample.add(scene.center(index)));
        let step = core_step(self.survey.preparation.surfels as usize);
        let next = surfels.next_multiple_of(step as u64) - surfels;
        self.sampled.extend(scene.surfels.iter().skip(next as usize).step_by(step).map(|surfel| surfel.center));
        self.nodes.append(&nodes)?;
        self.told(&nodes);
        self.parts.push(Part::Subtree { depth, first, levels: tree.levels.clone() });
        let key = within(&nodes[0].0, first);
        Ok(Branch { key, made: nodes[0], surfels: scene.surfels.len() as u64 })
    }

    /// Adds a node above some branches. `make` computes it, from its key and from the stored nodes
    /// and surfels below it.
    pub fn above(
        &mut self,
        depth: usize,
        children: Vec<Branch>,
        make: impl FnOnce(&Self, Key) -> Made,
    ) -> Result<Branch> {
        let number = self.parts.len();
        let surfels = children.iter().map(|branch| branch.surfels).sum();
        let nothing = children[0].made;
        self.parts.push(Part::Above { depth, children, made: nothing });
        let key = Key::Above(number as u32);
        let made = make(self, key);
        self.failed.check()?;
        self.told(&[made]);
        if let Part::Above { made: own, .. } = &mut self.parts[number] {
            *own = made;
        }
        Ok(Branch { key, made, surfels })
    }

    /// Records the facts about new nodes that the file's header needs.
    fn told(&mut self, nodes: &[Made]) {
        let none = Nodes::none(self.survey.known.origin, false);
        let kind = nodes.par_iter().fold(|| none, |all, (node, low)| all.with(node, *low)).reduce(|| none, Nodes::both);
        self.kind = self.kind.both(kind);
        self.levels = self.levels.both(LevelFacts::of_nodes(nodes.par_iter().map(|(node, _)| node)));
    }

    /// Reads a range of the stored surfels as a part of the scene.
    pub fn part(&self, numbers: Range<u64>) -> Result<Scene> {
        let points = self.surfels.points(&self.surfels.bytes(numbers)?)?;
        self.survey.part_again(points).ok_or_else(|| self.surfels.malformed("a surfel has no position or half-axes"))
    }
}

/// The key of a node of the subtree whose first node is number `subtree`.
fn within(node: &Node, subtree: u64) -> Key {
    let first = if node.leaf { node.first.into() } else { subtree + u64::from(node.first) };
    Key::Within { leaf: node.leaf, first, count: node.count, subtree }
}

/// The PLY properties with which surfels are written.
pub(super) fn properties(survey: &Survey) -> Properties {
    let Scene { oriented, closed, up, .. } = survey.empty;
    Properties {
        double_coordinates: survey.double,
        normals: true,
        radii: true,
        axes: true,
        clips: survey.has.clips,
        caps: survey.has.caps,
        colors: match survey.empty.colors {
            Colors::Constant(DEFAULT_COLOR) => ColorProperties::Absent,
            Colors::Srgb8(_) if survey.opaque => ColorProperties::Srgb8,
            Colors::Srgb8(_) => ColorProperties::Srgb8Alpha,
            _ => ColorProperties::Linear,
        },
        up: Some(up),
        unsided: !oriented,
        closed,
        ..Properties::default()
    }
}

impl Below for Kept<'_> {
    type Key = Key;

    fn is_leaf(&self, of: Key) -> bool {
        matches!(of, Key::Within { leaf: true, .. })
    }

    fn children(&self, of: Key, mut see: impl FnMut(Child<'_, Key>)) {
        match of {
            Key::Above(number) => {
                let Part::Above { children, .. } = &self.parts[number as usize] else { return };
                for Branch { key, made, surfels } in children {
                    see(Child { key: *key, node: &made.0, low: made.1, surfels: *surfels });
                }
            }
            Key::Within { first, count, subtree, .. } => {
                let wanted = (first..first + u64::from(count), self.nodes.count());
                let seen = self.node_pages.each(
                    wanted,
                    |rows| self.nodes.read(rows),
                    |nodes, of| {
                        for (node, low) in &nodes[of] {
                            see(Child { key: within(node, subtree), node, low: *low, surfels: 0 });
                        }
                    },
                );
                self.failed.noted(seen);
            }
        }
    }

    fn disks(&self, of: Key, mut see: impl FnMut(Disk)) {
        let Key::Within { first, count, .. } = of else { return };
        let wanted = (first..first + u64::from(count), self.surfels.count());
        let disks = |scene: &Scene, of: Range<usize>| of.for_each(|index| see(Disk::of(scene, index)));
        self.failed.noted(self.surfel_pages.each(wanted, |rows| self.part(rows), disks));
    }
}
