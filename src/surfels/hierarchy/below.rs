//! The part of the tree below a node, in memory or in files.

use glam::DVec3;

use super::NodeBounds;
use super::octree::{Octree, Set};
use super::sums::Scales;
use crate::scene::hierarchy::{Node, NodeAndLow};
use crate::scene::{Cap, Scene, Surfel};

/// A surfel of a leaf.
#[derive(Clone, Copy)]
pub(super) struct Disk {
    pub surfel: Surfel,
    /// The centre of the surfel in f64, with its part beyond f32.
    pub center: DVec3,
    pub cap: Cap,
}

impl Disk {
    /// Surfel `index` of `scene`.
    pub fn of(scene: &Scene, index: usize) -> Self {
        let cap = scene.caps.get(index).copied().unwrap_or_default();
        Self { surfel: scene.surfels[index], center: scene.center(index), cap }
    }
}

/// Facts about all surfels of a scene.
#[derive(Clone, Copy)]
pub(super) struct Known {
    /// [`Scene::origin`].
    pub origin: DVec3,
    /// [`Scene::oriented`].
    pub oriented: bool,
    /// Whether centres have parts beyond f32 ([`Scene::low`]).
    pub low: bool,
    pub scales: Scales,
    pub bounds: NodeBounds,
}

impl Known {
    pub fn of(scene: &Scene, bounds: NodeBounds) -> Self {
        let Scene { origin, oriented, .. } = *scene;
        Self { origin, oriented, low: !scene.low.is_empty(), scales: Scales::of(scene), bounds }
    }
}

/// A child node.
pub(super) struct Child<'a, Key> {
    pub key: Key,
    pub node: &'a Node,
    /// The part of its centre beyond f32.
    pub low: [f32; 3],
    /// The number of surfels below the child. It is reliable only for direct children of the node
    /// that is being computed, else it may be 0.
    pub surfels: u64,
}

/// A tree that is being built from the leaves up: all nodes below the ones being computed are
/// finished.
pub(super) trait Below: Sync {
    /// Identifies a node.
    type Key: Copy + Send + Sync;

    /// Whether a node has surfels instead of children.
    fn is_leaf(&self, of: Self::Key) -> bool;

    /// Calls `see` with each child of a node.
    fn children(&self, of: Self::Key, see: impl FnMut(Child<'_, Self::Key>));

    /// Calls `see` with each surfel of a leaf.
    fn disks(&self, of: Self::Key, see: impl FnMut(Disk));
}

/// A node as it is stored while the tree is built: with the part of its centre beyond f32, or
/// without that part if no centre of the scene has one.
pub(super) trait Stored: Copy + Send + Sync + From<NodeAndLow> {
    /// The node, and the part of its centre beyond f32.
    fn told(&self) -> (&Node, [f32; 3]);
}

impl Stored for NodeAndLow {
    fn told(&self) -> (&Node, [f32; 3]) {
        (&self.0, self.1)
    }
}

impl Stored for Node {
    fn told(&self) -> (&Node, [f32; 3]) {
        (self, [0.0; 3])
    }
}

impl From<NodeAndLow> for Node {
    fn from((node, _): NodeAndLow) -> Self {
        node
    }
}

/// A tree in memory whose nodes below some level are finished.
#[derive(Clone, Copy)]
pub(super) struct InMemory<'a, N> {
    pub scene: &'a Scene,
    pub tree: &'a Octree,
    /// The index of the first finished node; `nodes` starts with it.
    pub first: usize,
    pub nodes: &'a [N],
}

impl<N> InMemory<'_, N> {
    fn set(&self, number: u32) -> &Set {
        &self.tree.sets[number as usize]
    }
}

impl<N: Stored> Below for InMemory<'_, N> {
    /// The index of the node's set.
    type Key = u32;

    fn is_leaf(&self, of: u32) -> bool {
        self.set(of).is_leaf()
    }

    fn children(&self, of: u32, mut see: impl FnMut(Child<'_, u32>)) {
        let set = self.set(of);
        for key in set.first_child..set.first_child + set.children {
            let (node, low) = self.nodes[key as usize - self.first].told();
            see(Child { key, node, low, surfels: self.set(key).range().len() as u64 });
        }
    }

    fn disks(&self, of: u32, mut see: impl FnMut(Disk)) {
        self.set(of).range().for_each(|index| see(Disk::of(self.scene, index)));
    }
}
