//! What is known of all surfels of a scene that holds a part of them.

use glam::DVec3;

use super::hierarchy::{Hierarchy, Node};
use super::{Bounds, Listed, Scene, core_and_box, framed_within};
use rayon::prelude::*;

/// A scene with levels of detail as it is when all of it is there. A picture of a part of it is that of the whole to the bit, and some of what pictures
/// follow from is told by all surfels alone: the unit of sums, the nearest depth, whether centres need trailing parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whole {
    /// Its surfels.
    pub surfels: u32,
    /// Its nodes.
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
    /// Of its nodes.
    pub levels: LevelFacts,
    /// What surfels have.
    pub has: Has,
}

/// What is known of the nodes of levels of detail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LevelFacts {
    /// The longest half-axis with the height of its cap, world units.
    pub largest_radius: f32,
    /// The longest shorter half-axis, world units.
    pub largest_shorter: f32,
    /// Some have caps.
    pub caps: bool,
}

impl LevelFacts {
    /// Those of `hierarchy`.
    pub fn of(hierarchy: &Hierarchy) -> Self {
        Self::of_nodes(hierarchy.nodes.par_iter().with_min_len(4096))
    }

    /// Those of some nodes.
    pub fn of_nodes<'a>(nodes: impl ParallelIterator<Item = &'a Node>) -> Self {
        nodes.fold(Self::default, Self::with).reduce(Self::default, Self::both)
    }

    /// Those of these nodes and of one more.
    fn with(self, node: &Node) -> Self {
        let radius = node.surfel.radius();
        // A cap is no higher than half the sum of its heights (and what rounding to f32 may add), so few are looked at closely.
        let most = f64::from(radius) + 0.500_001 * node.cap.0.iter().map(|height| f64::from(height.abs())).sum::<f64>();
        let may_be_largest = most > f64::from(self.largest_radius);
        let highest = if may_be_largest { node.cap.highest() as f32 } else { 0.0 };
        self.both(Self {
            largest_radius: radius + highest,
            largest_shorter: node.surfel.shorter(),
            caps: !node.cap.is_flat(),
        })
    }

    /// Those of these nodes and of others.
    #[must_use]
    pub fn both(self, other: Self) -> Self {
        Self {
            largest_radius: self.largest_radius.max(other.largest_radius),
            largest_shorter: self.largest_shorter.max(other.largest_shorter),
            caps: self.caps || other.caps,
        }
    }
}

/// Which of the lists that may be empty a scene has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    /// Which lists it has; where it holds a part of a scene, that has, though they are empty where it holds no surfel.
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
    /// That of a scene that has all of its surfels and of their nodes; None of one without nodes.
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

    /// Whether the surfels of a scene, which is not known to be a part of another, and its nodes, of which `levels` tells, are within what this says of all.
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

    /// Whether its origin is one that a scene with this body may have: f32 coordinates about it have the digits that they should.
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

    /// Nodes that are passed over are none of the largest, whatever their heights are and wherever threads begin.
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
