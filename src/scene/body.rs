//! The body of a scene: the box of its points without the few strays that lie far from all others.
//!
//! A scanner that saw nothing may write a coordinate of zero, which in map coordinates lies a
//! thousand kilometres from the scene. If such a point counted, f32 coordinates would be relative
//! to the middle between the point and the scene, and the default view would show neither.

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::Bounds;
use super::apart::without_apart;
use crate::network::Carried;
use crate::random;

/// The approximate number of positions in the sample that determines the core.
const SAMPLED: usize = 1 << 13;

/// One in this many sampled positions may lie beyond each side of the core.
const CUT: usize = 64;

/// With fewer positions than this, none is a stray.
const FEWEST: usize = 16;

/// A position is a stray if it lies farther past a side of the core than this many times the core's
/// longest edge.
const FAR: f64 = 16.0;

/// The narrowest scene, world units: products of its half-axes and depths keep all digits of an
/// f32, as they are not subnormal.
pub(crate) const SMALLEST_SCENE: f64 = 1e-15;

/// Positions with a radius each, in memory or elsewhere.
pub(crate) trait Places: Sync {
    /// The number of positions.
    fn count(&self) -> usize;

    /// Folds all positions and radii in parallel: `add` starts from `nothing`, `join` merges two
    /// partial results, in any order. Other processes may hold some of the positions.
    fn fold<T: Carried>(
        &self,
        nothing: impl Fn() -> T + Sync + Send,
        add: impl Fn(T, DVec3, f64) -> T + Sync + Send,
        join: impl Fn(T, T) -> T + Sync + Send,
    ) -> T;
}

/// A count of positions, and the function that gives the position and radius of each index.
pub(crate) struct Listed<F>(pub usize, pub F);

impl<F: Fn(usize) -> (DVec3, f64) + Sync> Places for Listed<F> {
    fn count(&self) -> usize {
        self.0
    }

    fn fold<T: Carried>(
        &self,
        nothing: impl Fn() -> T + Sync + Send,
        add: impl Fn(T, DVec3, f64) -> T + Sync + Send,
        join: impl Fn(T, T) -> T + Sync + Send,
    ) -> T {
        let add = |all: T, index: usize| {
            let (position, radius) = self.1(index);
            add(all, position, radius)
        };
        (0..self.0).into_par_iter().with_min_len(1 << 14).fold(&nothing, add).reduce(&nothing, join)
    }
}

/// The body of `count` positions, and the number of strays outside it.
///
/// The result depends on the set of positions alone, not on their order: a hash of the coordinates
/// chooses a sample, and the core holds all of it but one position in 64 beyond each side.
/// Positions that are not finite are in no box.
pub(crate) fn body(count: usize, position: impl Fn(usize) -> DVec3 + Sync) -> (Bounds, u64) {
    body_of(&Listed(count, |index| (position(index), 0.0)))
}

/// As [`body`], for [`Places`].
fn body_of(places: &impl Places) -> (Bounds, u64) {
    let (core, all) = core_and_box(places);
    body_within(core, all, places)
}

/// As [`body`], for a known `core` and a known box `all` of all positions.
pub(crate) fn body_within(core: Option<Bounds>, all: Bounds, places: &impl Places) -> (Bounds, u64) {
    let Some(core) = core else { return (all, 0) };
    let far = FAR * core.extent().max_element();
    let (low, high) = (core.min - far, core.max + far);
    let holds = |p: DVec3| p.cmpge(low).all() && p.cmple(high).all();
    // If nearly all positions coincide, the core has no size to measure distances by.
    if far < FAR * SMALLEST_SCENE || all.is_empty() || holds(all.min) && holds(all.max) {
        return (all, 0);
    }
    box_of(places, holds)
}

/// The box that the default view shows, and the number of positions outside it: strays, and small
/// groups that lie [apart](super::apart) from the body.
pub(crate) fn framed(places: &impl Places) -> (Bounds, u64) {
    let (core, all) = core_and_box(places);
    let (_, framed, left_out) = framed_within(core, all, places);
    (framed, left_out)
}

/// The body, the box that the default view shows, and the number of positions outside that box, for
/// a known `core` and a known box `all` of all positions.
pub(crate) fn framed_within(core: Option<Bounds>, all: Bounds, places: &impl Places) -> (Bounds, Bounds, u64) {
    let (body, strays) = body_within(core, all, places);
    let Some(core) = core.filter(|core| core.extent().max_element() >= SMALLEST_SCENE && !body.is_empty()) else {
        return (body, body, strays);
    };
    let (bounds, apart) = without_apart((&core, &body), places);
    (body, bounds, strays + apart)
}

/// The box of the finite positions that are `wanted`, and the number of finite positions that are
/// not.
fn box_of(places: &impl Places, wanted: impl Fn(DVec3) -> bool + Sync + Send) -> (Bounds, u64) {
    let add = |(bounds, others): (Bounds, u64), p: DVec3, _| {
        let unwanted = p.is_finite() && !wanted(p);
        (if unwanted { bounds } else { bounds.with_point(p) }, others + u64::from(unwanted))
    };
    places.fold(|| (Bounds::EMPTY, 0), add, |a, b| (a.0.union(b.0), a.1 + b.1))
}

/// The core, or None if there are too few positions, and the box of all positions.
///
/// The core is the box between the quantiles of the sampled positions, axis by axis.
pub(crate) fn core_and_box(places: &impl Places) -> (Option<Bounds>, Bounds) {
    let add = |(mut sample, all): (Sample, Bounds), p: DVec3, _| {
        sample.add(p);
        (sample, all.with_point(p))
    };
    let nothing = || (Sample::of(places.count()), Bounds::EMPTY);
    let (sample, all) = places.fold(nothing, add, |a, b| (a.0.both(b.0), a.1.union(b.1)));
    (sample.core(), all)
}

/// A sample of the positions, chosen by a hash of their coordinates, so that it does not depend on
/// their order.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Sample {
    most: u64,
    chosen: Vec<DVec3>,
}

impl Sample {
    /// An empty sample of `count` positions.
    pub fn of(count: usize) -> Self {
        let share = SAMPLED as f64 / count.max(1) as f64;
        let most = if share < 1.0 { (share * 2f64.powi(64)) as u64 } else { u64::MAX };
        Self { most, chosen: Vec::new() }
    }

    /// Adds a position if its hash selects it.
    pub fn add(&mut self, p: DVec3) {
        if p.is_finite() && hash(p) <= self.most {
            self.chosen.push(p);
        }
    }

    /// The union of the samples of two parts.
    pub fn both(mut self, mut other: Self) -> Self {
        self.chosen.append(&mut other.chosen);
        // The point that a scanner writes for nothing may occur a million times; removing
        // duplicates bounds the memory.
        if self.chosen.len() > 4 * SAMPLED {
            self.sort();
        }
        self
    }

    fn sort(&mut self) {
        let bits = |p: &DVec3| p.to_array().map(f64::to_bits);
        self.chosen.sort_unstable_by_key(bits);
        self.chosen.dedup_by_key(|p| bits(p));
    }

    /// The box between the quantiles, axis by axis; None if there are fewer than [`FEWEST`]
    /// different positions.
    pub fn core(mut self) -> Option<Bounds> {
        self.sort();
        let sample = self.chosen;
        if sample.len() < FEWEST {
            return None;
        }
        let cut = (sample.len() / CUT).max(1);
        let mut core = Bounds::EMPTY;
        for axis in 0..3 {
            let mut along: Vec<f64> = sample.iter().map(|p| p[axis]).collect();
            along.sort_unstable_by(f64::total_cmp);
            (core.min[axis], core.max[axis]) = (along[cut], along[along.len() - 1 - cut]);
        }
        Some(core)
    }
}

/// Hashes the coordinates' bits to 64 bits (the finaliser of SplitMix64 for each).
fn hash(p: DVec3) -> u64 {
    p.to_array().into_iter().fold(0, |mixed, x| random::mixed((mixed ^ (x + 0.0).to_bits()).wrapping_add(random::STEP)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a sphere of radius 5 at UTM coordinates.
    fn ball(count: usize) -> Vec<DVec3> {
        (0..count)
            .map(|k| {
                let [x, y, z] = [0.618_034, 0.754_878, 0.569_840].map(|step| (k as f64 * step).fract() - 0.5);
                DVec3::new(x, y, z).normalize() * 5.0 + DVec3::new(7e5, 6.26e6, 0.0)
            })
            .collect()
    }

    fn of(points: &[DVec3]) -> (Bounds, u64) {
        body(points.len(), |index| points[index])
    }

    #[test]
    fn strays_are_left_out_whatever_the_order() {
        for count in [100, 5000, 100_000] {
            let clean = ball(count);
            let (alone, none) = of(&clean);
            assert_eq!(none, 0);
            let mut points = clean;
            points.extend([DVec3::ZERO, DVec3::splat(1e12)]);
            // One in ten points is the zero that a scanner writes where it saw nothing.
            points.extend(vec![DVec3::ZERO; count / 10]);
            points.push(DVec3::NAN);
            assert_eq!(of(&points), (alone, 2 + count as u64 / 10), "{count}");
            points.reverse();
            assert_eq!(of(&points), (alone, 2 + count as u64 / 10), "{count}");
        }
    }

    #[test]
    fn clusters_few_points_and_one_place_have_no_strays() {
        let mut two = ball(1000);
        two.extend(ball(1000).iter().map(|p| *p + 1e6));
        let (both, strays) = of(&two);
        assert_eq!(strays, 0);
        assert!(both.extent().min_element() > 1e6);
        let few = [DVec3::ZERO, DVec3::ONE, DVec3::splat(1e9)];
        assert_eq!(of(&few), (Bounds { min: DVec3::ZERO, max: DVec3::splat(1e9) }, 0));
        assert_eq!(of(&[DVec3::ONE; 50]).1, 0);
        assert_eq!(of(&[]), (Bounds::EMPTY, 0));
    }
}
