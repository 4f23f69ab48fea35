//! Points that lie too far from all others to be of the surface.

use rayon::prelude::*;

use super::graph::NeighbourGraph;
use super::positions::DistinctPositions;

/// Which positions are no outliers: those whose mean distance to their neighbours is at most the mean of that over all
/// positions plus `deviations` of its standard deviations (Rusu et al. 2008, "Towards 3D point cloud based object maps
/// for household environments", section 3.1).
pub(crate) fn inliers(distinct: &DistinctPositions, graph: &NeighbourGraph, deviations: f64) -> Vec<bool> {
    let distances: Vec<f64> = (0..distinct.len() as u32)
        .into_par_iter()
        .map(|index| {
            let center = distinct.position(index);
            let near = graph.of(index);
            near.iter().map(|&other| center.distance(distinct.position(other))).sum::<f64>() / near.len().max(1) as f64
        })
        .collect();
    // One after the other, so that the sums' rounding is the same for any number of threads.
    let count = distances.len() as f64;
    let mean = distances.iter().sum::<f64>() / count;
    let variance = distances.iter().map(|distance| (distance - mean) * (distance - mean)).sum::<f64>() / count;
    let limit = mean + deviations * variance.sqrt();
    distances.par_iter().map(|distance| *distance <= limit).collect()
}
