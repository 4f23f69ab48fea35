//! How large a disk may be beside its neighbours' disks.

use rayon::prelude::*;

use super::RADIUS_NEIGHBOURS;
use crate::surfels::estimate::{LARGEST_MEDIAN_RATIO, median};
use crate::surfels::graph::NeighbourGraph;

/// The largest radius of each position's disk: `factor` times the median of its neighbours' radii, and, unless it is infinite, never more
/// than [`LARGEST_MEDIAN_RATIO`] times that of all, in the unit of `radii`. Where a radius is zero, the position has none, and says
/// nothing of others.
///
/// No disk is larger than `lone` says of its position, unless `factor` is infinite.
///
/// At a boundary and around an outlier, points have neighbours on one side only, or far away, and so large radii; their
/// neighbours' do not, wherever those have points around them. Densities that differ from place to place do not matter.
pub(crate) fn local_limits(
    graph: &NeighbourGraph,
    radii: &[f64],
    factor: f64,
    lone: impl Fn(u32) -> Option<f64> + Sync,
) -> Vec<f64> {
    let mut any: Vec<f64> = radii.par_iter().copied().filter(|radius| *radius > 0.0).collect();
    let ratio = if factor.is_finite() { LARGEST_MEDIAN_RATIO } else { factor };
    let global = median(&mut any).map_or(f64::INFINITY, |median| median * ratio);
    (0..radii.len() as u32)
        .into_par_iter()
        .map_init(Vec::new, |near, index| {
            near.clear();
            if radii[index as usize] > 0.0 {
                let of_near = graph.of(index).iter().take(RADIUS_NEIGHBOURS).map(|&other| radii[other as usize]);
                near.extend(of_near.filter(|radius| *radius > 0.0));
            }
            let own = if factor.is_finite() && radii[index as usize] > 0.0 { lone(index) } else { None };
            median(near).map_or(f64::INFINITY, |median| median * factor).min(global).min(own.unwrap_or(f64::INFINITY))
        })
        .collect()
}
