//! The largest radius that a disk may have, given the disks of its neighbours.

use rayon::prelude::*;

use super::RADIUS_NEIGHBOURS;
use crate::surfels::estimate::{LARGEST_MEDIAN_RATIO, median, median_of_few};
use crate::surfels::graph::NeighbourGraph;

/// Returns the largest radius of each position's disk, in the unit of `radii`.
///
/// It is `factor` times the median of the neighbours' radii and, unless `factor` is infinite, at
/// most [`LARGEST_MEDIAN_RATIO`] times the median of all radii, and at most the result of `lone`
/// for the position. A position whose radius is zero has no limit from its neighbours and is left
/// out of all medians.
///
/// Points at a boundary and outliers have neighbours only on one side or far away, and therefore
/// large radii. Their neighbours, if surrounded by points, have smaller radii, which limit them.
/// The limit is local, so density may vary from place to place.
pub(crate) fn local_limits(
    graph: &NeighbourGraph,
    radii: &[f64],
    factor: f64,
    lone: impl Fn(u32) -> Option<f64> + Sync,
) -> Vec<f64> {
    let mut any: Vec<f64> = radii.par_iter().copied().filter(|radius| *radius > 0.0).collect();
    let ratio = if factor.is_finite() { LARGEST_MEDIAN_RATIO } else { factor };
    let global = median(&mut any).map_or(f64::INFINITY, |median| median * ratio);
    let of_near = |index: u32| {
        let mut near = [0.0; RADIUS_NEIGHBOURS];
        let of_near = graph.of(index).iter().take(RADIUS_NEIGHBOURS).map(|&other| radii[other as usize]);
        let of_near = of_near.filter(|radius| *radius > 0.0);
        let count = near.iter_mut().zip(of_near).map(|(slot, radius)| *slot = radius).count();
        if count == near.len() { Some(median_of_few(near)) } else { median(&mut near[..count]) }
    };
    (0..radii.len() as u32)
        .into_par_iter()
        .map(|index| {
            let near = if radii[index as usize] > 0.0 { of_near(index) } else { None };
            let own = if factor.is_finite() && radii[index as usize] > 0.0 { lone(index) } else { None };
            near.map_or(f64::INFINITY, |median| median * factor).min(global).min(own.unwrap_or(f64::INFINITY))
        })
        .collect()
}
