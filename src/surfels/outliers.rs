//! Leaves out outliers: points that lie too far from all others to belong to the surface.

use rayon::prelude::*;

use super::estimate::NORMAL_NEIGHBOURS;
use super::gather::Gathered;
use super::graph::NeighbourGraph;
use super::positions::DistinctPositions;
use crate::Progress;

/// Relative tolerance, larger than the rounding error of the mean of all distances.
const ROUNDING: f64 = 1e-9;

/// Leaves out the points whose mean distance to their neighbours exceeds the mean over all
/// positions by more than `deviations` standard deviations. Returns the number of these points.
pub(crate) fn drop_outliers(
    gathered: &mut Gathered,
    distinct: &mut DistinctPositions,
    deviations: f64,
    progress: &dyn Progress,
) -> u64 {
    let mut distances = vec![0.0; distinct.len()];
    NeighbourGraph::visit(
        (distinct, NORMAL_NEIGHBOURS, 0),
        |_| true,
        &mut distances,
        progress,
        |_, near| {
            near.iter().map(|neighbour| neighbour.squared_distance.sqrt()).sum::<f64>() / near.len().max(1) as f64
        },
    );
    let inside = inliers(&distances, deviations);
    let keep: Vec<bool> = distinct.of_point().iter().map(|&position| inside[position as usize]).collect();
    let dropped = keep.iter().filter(|keep| !**keep).count() as u64;
    if dropped > 0 {
        gathered.retain(&keep);
        distinct.retain(&inside);
    }
    dropped
}

/// Whether each position is an inlier: its mean distance to its neighbours is at most the mean over
/// all positions plus `deviations` standard deviations (Rusu et al. 2008, "Towards 3D point cloud
/// based object maps for household environments", section 3.1).
///
/// Rounding may put the mean of equal distances below each of them. The tolerance [`ROUNDING`]
/// keeps their positions inliers.
fn inliers(distances: &[f64], deviations: f64) -> Vec<bool> {
    // Serial sums, so that their rounding is the same for any number of threads.
    let count = distances.len() as f64;
    let mean = distances.iter().sum::<f64>() / count;
    let variance = distances.iter().map(|distance| (distance - mean) * (distance - mean)).sum::<f64>() / count;
    let limit = (mean + deviations * variance.sqrt()) * (1.0 + ROUNDING);
    distances.par_iter().map(|distance| *distance <= limit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_distances_are_no_outliers() {
        for count in 1..=200usize {
            for distance in [0.1, 0.3, 1.0 / 3.0, 1e-30, 1e30] {
                for deviations in [0.0, 0.5, 3.0] {
                    assert!(inliers(&vec![distance; count], deviations).into_iter().all(|inside| inside));
                }
            }
        }
        let mut distances = vec![1.0; 50];
        distances.push(20.0);
        assert_eq!(inliers(&distances, 3.0).iter().filter(|inside| !**inside).count(), 1);
    }
}
