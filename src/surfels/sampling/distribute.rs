//! How many samples each voxel gets.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// What the next sample in a voxel is worth.
#[derive(PartialEq)]
struct Bid {
    worth: f64,
    voxel: usize,
}

impl Eq for Bid {}

impl Ord for Bid {
    /// Of equal worth the voxel that comes first is served first.
    fn cmp(&self, other: &Self) -> Ordering {
        self.worth.total_cmp(&other.worth).then(other.voxel.cmp(&self.voxel))
    }
}

impl PartialOrd for Bid {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Hands out `count` samples (Tien 2008, section 3.2): each to the voxel whose priority is highest, which then falls.
///
/// The thesis leaves open to what it falls. Here a voxel of priority p with n samples bids `p / (2 n + 1)`, the rule by
/// which Webster and Sainte-Laguë round seats: quotas are proportional to priorities, and rounding favours neither
/// large voxels nor small ones. With fewer samples than voxels those of the highest priority get one each.
/// Priorities that are not positive get none, unless none is positive: then all are taken for equal.
pub(super) fn distribute(priorities: &[f64], count: usize) -> Vec<usize> {
    let usable = |priority: f64| if priority.is_finite() && priority > 0.0 { priority } else { 0.0 };
    let none = priorities.iter().all(|priority| usable(*priority) == 0.0);
    let of = |voxel: usize| if none { 1.0 } else { usable(priorities[voxel]) };
    let mut samples = vec![0; priorities.len()];
    let bids = (0..priorities.len()).map(|voxel| Bid { worth: of(voxel), voxel });
    let mut heap: BinaryHeap<Bid> = bids.filter(|bid| bid.worth > 0.0).collect();
    for _ in 0..count {
        let Some(mut highest) = heap.peek_mut() else { break };
        let voxel = highest.voxel;
        samples[voxel] += 1;
        highest.worth = of(voxel) / (2 * samples[voxel] + 1) as f64;
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotas_follow_priorities() {
        assert_eq!(distribute(&[1.0, 2.0, 5.0], 80), [10, 20, 50]);
        assert_eq!(distribute(&[3.0, 1.0, 2.0], 2), [1, 0, 1]);
        assert_eq!(distribute(&[1.0, 1.0, 1.0], 2), [1, 1, 0]);
        assert_eq!(distribute(&[0.0, f64::NAN, -1.0], 3), [1, 1, 1]);
        assert_eq!(distribute(&[0.0, f64::INFINITY, 2.0], 3), [0, 0, 3]);
        assert_eq!(distribute(&[], 3), Vec::<usize>::new());
        // Rounded to the nearest: 2.6 and 7.4.
        assert_eq!(distribute(&[0.26, 0.74], 10), [3, 7]);
    }
}
