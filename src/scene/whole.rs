//! Facts about a whole scene with levels of detail, for a scene that holds only a part of it.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::hierarchy::{Hierarchy, Node};
use super::{Bounds, Listed, Scene, core_and_box, framed_within};
use rayon::prelude::*;

/// Facts about all surfels and nodes of a scene with levels of detail.
///
/// A picture rendered from a part of the scene equals that of the whole to the bit. Some of the
/// quantities that it depends on follow from all surfels together: the unit of the sums, the near
/// depth, and whether centres need trailing digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whole {
    /// The number of surfels.
    pub surfels: u32,
    /// The number of octree nodes.
    pub nodes: u32,
    /// [`Scene::origin`].
    pub origin: DVec3,
    /// [`Scene::bounds`].
    pub bounds: Bounds,
    /// The box of [`Scene::body`].
    pub body: Bounds,
    /// [`Scene::core`].
    pub core: Bounds,
    /// The box of [`Scene::framed`].
    pub framed: Bounds,
    /// [`Scene::color_range`].
    pub color: ([f32; 4], [f32; 4]),
    /// [`Scene::largest_radius`].
    pub largest_radius: f32,
    /// [`Scene::largest_shorter`].
    pub largest_shorter: f32,
    /// The facts about all nodes.
    pub levels: LevelFacts,
    /// The optional lists that its surfels have.
    pub has: Has,
}

/// Facts about the octree nodes of the levels of detail.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LevelFacts {
    /// The largest sum of a node's longer half-axis and the height of its cap, world units.
    pub largest_radius: f32,
    /// The largest of the nodes' shorter half-axes, world units.
    pub largest_shorter: f32,
    /// Whether any node has a cap.
    pub caps: bool,
}

impl LevelFacts {
    /// The facts about all nodes of `hierarchy`.
    pub fn of(hierarchy: &Hierarchy) -> Self {
        Self::of_nodes(hierarchy.nodes.par_iter().with_min_len(4096))
    }

    /// The facts about `nodes`.
    pub fn of_nodes<'a>(nodes: impl ParallelIterator<Item = &'a Node>) -> Self {
        nodes.fold(Self::default, Self::with).reduce(Self::default, Self::both)
    }

    /// The facts with one more node.
    fn with(self, node: &Node) -> Self {
        let radius = node.surfel.radius();
        // A cap's height is at most half the sum of its coefficients' magnitudes, up to f32
        // rounding. This bound saves the square root for most nodes.
        let most = f64::from(radius) + 0.500_001 * node.cap.0.iter().map(|height| f64::from(height.abs())).sum::<f64>();
        let may_be_largest = most > f64::from(self.largest_radius);
        let highest = if may_be_largest { node.cap.highest() as f32 } else { 0.0 };
        self.both(Self {
            largest_radius: radius + highest,
            largest_shorter: node.surfel.shorter(),
            caps: !node.cap.is_flat(),
        })
    }

    /// The facts about the nodes of `self` and of `other` together.
    #[must_use]
    pub fn both(self, other: Self) -> Self {
        Self {
            largest_radius: self.largest_radius.max(other.largest_radius),
            largest_shorter: self.largest_shorter.max(other.largest_shorter),
            caps: self.caps || other.caps,
        }
    }
}

/// Whether each optional list of a scene has entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Has {
    /// [`Scene::low`].
    pub low: bool,
    /// [`Scene::clips`].
    pub clips: bool,
    /// [`Scene::caps`].
    pub caps: bool,
    /// [`Scene::normals`].
    pub normals: bool,
}

impl Scene {
    /// The lists that the scene has. For a part of a scene they are those of the whole scene, even
    /// if the part's own lists are empty.
    pub fn has(&self) -> Has {
        let own = Has {
            low: !self.low.is_empty(),
            clips: !self.clips.is_empty(),
            caps: !self.caps.is_empty(),
            normals: !self.normals.is_empty(),
        };
        self.part_of.as_ref().map_or(own, |whole| whole.has)
    }
}

impl Whole {
    /// The facts about a scene that holds all of its surfels and nodes; None for a scene without
    /// levels of detail.
    pub fn of(scene: &Scene) -> Option<Self> {
        let hierarchy = scene.hierarchy.as_deref()?;
        let places = Listed(scene.places(), |index| scene.place(index));
        let (core, bounds) = core_and_box(&places);
        let (body, framed, _) = framed_within(core, bounds, &places);
        Some(Self {
            surfels: scene.surfels.len().try_into().ok()?,
            nodes: hierarchy.nodes.len().try_into().ok()?,
            origin: scene.origin,
            bounds,
            body,
            core: scene.core(),
            framed,
            color: scene.color_range(),
            largest_radius: scene.largest_radius(),
            largest_shorter: scene.largest_shorter(),
            levels: LevelFacts::of(hierarchy),
            has: scene.has(),
        })
    }

    /// Whether the surfels of `part` and nodes with these `levels` stay within the bounds stated
    /// here. `part` must not have [`Scene::part_of`] set.
    pub fn holds(&self, part: &Scene, levels: LevelFacts) -> bool {
        let (own, (low, high)) = (part.bounds(), part.color_range());
        let least = |all: [f32; 4], own: [f32; 4]| all.iter().zip(own).all(|(all, own)| *all <= own);
        let nodes = levels.largest_radius <= self.levels.largest_radius
            && levels.largest_shorter <= self.levels.largest_shorter
            && (self.levels.caps || !levels.caps);
        let surfels = part.surfels.is_empty() || least(self.color.0, low) && least(high, self.color.1);
        nodes
            && surfels
            && (own.is_empty() || self.bounds.union(own) == self.bounds)
            && part.largest_radius() <= self.largest_radius
            && part.largest_shorter() <= self.largest_shorter
    }

    /// Whether the default view depends on the median of all radii, because disks exceed the box of
    /// their centres ([`Camera::framing`](super::Camera::framing)).
    pub fn is_framed_by_radii(&self) -> bool {
        let half = 0.5 * self.framed.extent().length();
        half > 0.0 && f64::from(self.largest_radius) > half
    }

    /// Whether f32 coordinates about this origin are precise enough: the body reaches at most 4
    /// times its longest edge from it.
    pub fn is_near(&self) -> bool {
        let Bounds { min, max } = self.body;
        let most = 4.0 * (max - min).max_element();
        let finite = self.origin.is_finite() && min.is_finite() && max.is_finite() && min.cmple(max).all();
        finite && (most == 0.0 || min.abs().max(max.abs()).max_element() <= most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::scene::{Cap, Surfel};

    /// Skipped nodes never include the largest one, whatever the heights and wherever the threads
    /// start.
    #[test]
    fn the_largest_node_is_found() {
        let mut random = Random::stream(7, 0);
        let mut number = |most: f32| (random.number() as f32 - 0.5) * most;
        let nodes: Vec<Node> = (0..20_000)
            .map(|k| {
                let scale = [1e-30, 1.0, 1e-3, 1e12][k % 4];
                let [s, t] = [0, 1].map(|_| [0; 3].map(|_| number(scale)));
                let cap = Cap([0; 3].map(|_| number(scale * [0.0, 1e-6, 1.0, 5.0][k / 4 % 4])));
                let surfel = Surfel { center: [0.0; 3], s, t };
                Node { surfel, cap, color: [1.0; 4], radius: 1.0, cone: 1.0, first: 0, count: 1, leaf: true }
            })
            .collect();
        for first in 0..4 {
            let nodes: Vec<Node> = nodes.iter().skip(first).step_by(4).copied().collect();
            let largest = nodes.iter().map(|node| node.surfel.radius() + node.cap.highest() as f32).fold(0.0, f32::max);
            let shorter = nodes.iter().map(|node| node.surfel.shorter()).fold(0.0, f32::max);
            let facts = LevelFacts::of_nodes(nodes.par_iter());
            assert_eq!(facts, LevelFacts { largest_radius: largest, largest_shorter: shorter, caps: true });
        }
    }
}
