//! What is below a node, wherever it is kept.

use glam::DVec3;

use super::octree::{Octree, Set};
use super::sums::Scales;
use crate::scene::hierarchy::{Node, NodeAndLow};
use crate::scene::{Cap, Scene, Surfel};

/// A surfel of a leaf.
#[derive(Clone, Copy)]
pub(super) struct Disk {
    pub surfel: Surfel,
    /// With all its digits.
    pub center: DVec3,
    pub cap: Cap,
}

impl Disk {
    /// One of a scene.
    pub fn of(scene: &Scene, index: usize) -> Self {
        let cap = scene.caps.get(index).copied().unwrap_or_default();
        Self { surfel: scene.surfels[index], center: scene.center(index), cap }
    }
}

/// What is known of all surfels of a scene.
#[derive(Clone, Copy)]
pub(super) struct Known {
    /// [`Scene::origin`].
    pub origin: DVec3,
    /// [`Scene::oriented`].
    pub oriented: bool,
    /// Centres have trailing parts.
    pub low: bool,
    pub scales: Scales,
}

impl Known {
    pub fn of(scene: &Scene) -> Self {
        let Scene { origin, oriented, .. } = *scene;
        Self { origin, oriented, low: !scene.low.is_empty(), scales: Scales::of(scene) }
    }
}

/// A node below another one.
pub(super) struct Child<'a, Key> {
    pub key: Key,
    pub node: &'a Node,
    /// What its f32 centre leaves out.
    pub low: [f32; 3],
    /// The surfels below it; of a node that does not come right below one that is being made it may be 0.
    pub surfels: u64,
}

/// A tree whose nodes are known below some that are being made.
pub(super) trait Below: Sync {
    /// What tells its nodes apart.
    type Key: Copy + Send + Sync;

    /// Whether a node has surfels and no children.
    fn is_leaf(&self, of: Self::Key) -> bool;

    /// Its children.
    fn children(&self, of: Self::Key, see: impl FnMut(Child<'_, Self::Key>));

    /// The surfels of a leaf.
    fn disks(&self, of: Self::Key, see: impl FnMut(Disk));
}

/// How a node is stored while the tree is made: with what its f32 centre leaves out, or without where that is nothing.
pub(super) trait Stored: Copy + Send + Sync + From<NodeAndLow> {
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

/// A tree in memory, of which the nodes below a level are known.
#[derive(Clone, Copy)]
pub(super) struct InMemory<'a, N> {
    pub scene: &'a Scene,
    pub tree: &'a Octree,
    /// Those from the first one on that is known.
    pub first: usize,
    pub nodes: &'a [N],
}

impl<N> InMemory<'_, N> {
    fn set(&self, number: u32) -> &Set {
        &self.tree.sets[number as usize]
    }
}

impl<N: Stored> Below for InMemory<'_, N> {
    /// The number of its set.
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
