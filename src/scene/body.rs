//! The body of a scene: the box of its points without those few that stray far from all others.
//!
//! A coordinate of zero where a scanner saw nothing lies a thousand kilometres from a scene in map coordinates. Where such a
//! point counted, f32 coordinates would be relative to the middle of the two, and the default view would show neither.

use glam::DVec3;
use rayon::prelude::*;

use super::Bounds;
use super::apart::without_apart;
use crate::random;

/// Positions that are looked at for the core, about.
const SAMPLED: usize = 1 << 13;

/// One in so many of them may lie beyond each side of the core.
const CUT: usize = 64;

/// Of fewer positions none strays.
const FEWEST: usize = 16;

/// A position strays if it lies farther past a side of the core than so many times the core's longest edge.
const FAR: f64 = 16.0;

/// The narrowest scene, world units, whose half-axes and depths have products that an f32 holds to the last digit.
pub(crate) const SMALLEST_SCENE: f64 = 1e-15;

/// The box of `count` positions without those that stray, and how many do. It depends on the set of positions alone, on no order:
/// the core, which holds all but one in 64 beyond each side, is that of a sample chosen by the coordinates' own bits. Positions
/// that are not finite are in no box.
pub(crate) fn body(count: usize, position: impl Fn(usize) -> DVec3 + Sync) -> (Bounds, u64) {
    body_around(core(count, &position), count, &position)
}

/// The same, where the core is known.
fn body_around(core: Option<Bounds>, count: usize, position: &(impl Fn(usize) -> DVec3 + Sync)) -> (Bounds, u64) {
    let all = box_of(count, position, |_| true).0;
    let Some(core) = core else { return (all, 0) };
    let far = FAR * core.extent().max_element();
    let (low, high) = (core.min - far, core.max + far);
    let holds = |p: DVec3| p.cmpge(low).all() && p.cmple(high).all();
    // Nearly all at one place is no core to go by.
    if far < FAR * SMALLEST_SCENE || all.is_empty() || holds(all.min) && holds(all.max) {
        return (all, 0);
    }
    box_of(count, position, holds)
}

/// The box of what the default view shows of `count` points, each with its radius, and how many are not in it: those that stray
/// from the body, and those few that lie [apart](super::apart) from it.
pub(crate) fn framed(count: usize, at: impl Fn(usize) -> (DVec3, f64) + Sync) -> (Bounds, u64) {
    let (_, framed, left_out) = body_and_framed(count, at);
    (framed, left_out)
}

/// The body, the box of what the default view shows, and how many are not in that.
pub(crate) fn body_and_framed(count: usize, at: impl Fn(usize) -> (DVec3, f64) + Sync) -> (Bounds, Bounds, u64) {
    let core = core(count, &|index| at(index).0);
    let (body, strays) = body_around(core, count, &|index| at(index).0);
    let Some(core) = core.filter(|core| core.extent().max_element() >= SMALLEST_SCENE && !body.is_empty()) else {
        return (body, body, strays);
    };
    let (bounds, apart) = without_apart((&core, &body), count, at);
    (body, bounds, strays + apart)
}

/// The box of the finite positions that are wanted, and how many are not.
fn box_of(
    count: usize,
    position: &(impl Fn(usize) -> DVec3 + Sync),
    wanted: impl Fn(DVec3) -> bool + Sync,
) -> (Bounds, u64) {
    let add = |(bounds, others): (Bounds, u64), index: usize| {
        let p = position(index);
        let unwanted = p.is_finite() && !wanted(p);
        (if unwanted { bounds } else { bounds.with_point(p) }, others + u64::from(unwanted))
    };
    let join = |a: (Bounds, u64), b: (Bounds, u64)| (a.0.union(b.0), a.1 + b.1);
    (0..count).into_par_iter().with_min_len(4096).fold(|| (Bounds::EMPTY, 0), add).reduce(|| (Bounds::EMPTY, 0), join)
}

/// The box between the quantiles of the sampled positions, axis by axis; none if there are too few.
fn core(count: usize, position: &(impl Fn(usize) -> DVec3 + Sync)) -> Option<Bounds> {
    let share = SAMPLED as f64 / count.max(1) as f64;
    let most = if share < 1.0 { (share * 2f64.powi(64)) as u64 } else { u64::MAX };
    let chosen = |index| Some(position(index)).filter(|p| p.is_finite() && hash(*p) <= most);
    let mut sample: Vec<DVec3> = (0..count).into_par_iter().with_min_len(4096).filter_map(chosen).collect();
    // What a scanner writes for nothing may be there a million times; it is one position.
    let bits = |p: &DVec3| p.to_array().map(f64::to_bits);
    sample.sort_unstable_by_key(bits);
    sample.dedup_by_key(|p| bits(p));
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

/// Spreads the bits of the coordinates over a word (the finaliser of SplitMix64 for each).
fn hash(p: DVec3) -> u64 {
    p.to_array().into_iter().fold(0, |mixed, x| random::mixed((mixed ^ (x + 0.0).to_bits()).wrapping_add(random::STEP)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a ball of radius 5 at UTM coordinates.
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
            // As often as a scanner writes nothing.
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
