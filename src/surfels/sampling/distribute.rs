//! The number of samples of each voxel.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// The bid of a voxel for the next sample.
#[derive(PartialEq)]
struct Bid {
    worth: f64,
    voxel: usize,
}

impl Eq for Bid {}

impl Ord for Bid {
    /// Among equal bids the voxel that comes first wins.
    fn cmp(&self, other: &Self) -> Ordering {
        self.worth.total_cmp(&other.worth).then(other.voxel.cmp(&self.voxel))
    }
}

impl PartialOrd for Bid {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Distributes `count` samples, each to the voxel of the highest priority, which then falls (Tien
/// 2008, section 3.2).
///
/// The thesis does not say by how much it falls. Here a voxel of priority p with n samples bids
/// `p / (n + u)`, with an offset u in (0, 1) of its own. A voxel whose fair share is f then gets f
/// rounded down, or up if the fraction of f exceeds u. The offsets are evenly spread, also among
/// neighbouring voxels, so the rounding is unbiased. With one u for all, a flat wall of equal
/// voxels of 4.4 samples each would get 4 everywhere, a tenth too few.
///
/// Voxels whose priority is not positive get no samples. If no priority is positive, all voxels
/// count as equal.
pub(super) fn distribute(priorities: &[f64], count: usize) -> Vec<usize> {
    distributed(priorities, vec![0; priorities.len()], count)
}

/// Distributes `count` more samples to voxels that have `samples`.
fn distributed(priorities: &[f64], mut samples: Vec<usize>, count: usize) -> Vec<usize> {
    let usable = |priority: f64| if priority.is_finite() && priority > 0.0 { priority } else { 0.0 };
    let none = priorities.iter().all(|priority| usable(*priority) == 0.0);
    let of = |voxel: usize| if none { 1.0 } else { usable(priorities[voxel]) };
    let worth = |voxel: usize, samples: usize| of(voxel) / (samples as f64 + offset(voxel));
    let bids = (0..priorities.len()).map(|voxel| Bid { worth: worth(voxel, samples[voxel]), voxel });
    let mut heap: BinaryHeap<Bid> = bids.filter(|bid| bid.worth > 0.0).collect();
    for _ in 0..count {
        let Some(mut highest) = heap.peek_mut() else { break };
        let voxel = highest.voxel;
        samples[voxel] += 1;
        highest.worth = worth(voxel, samples[voxel]);
    }
    samples
}

/// As [`distribute`], but each voxel with a positive priority gets a sample first. Fewer samples
/// than such voxels go to those of the highest priorities, one each (Tien 2008, section 3.2). The
/// thesis advises against it, as the other voxels get none.
///
/// Among voxels of equal priority, those with a sample are evenly spread.
pub(super) fn distribute_by_rank(priorities: &[f64], count: usize) -> Vec<usize> {
    let usable = |voxel: &usize| priorities[*voxel].is_finite() && priorities[*voxel] > 0.0;
    let mut ranked: Vec<usize> = (0..priorities.len()).filter(usable).collect();
    if count >= ranked.len() {
        let first = (0..priorities.len()).map(|voxel| usize::from(usable(&voxel))).collect();
        return distributed(priorities, first, count - ranked.len());
    }
    ranked.sort_by(|a, b| {
        let spread = |voxel: usize| offset(voxel);
        priorities[*b].total_cmp(&priorities[*a]).then(spread(*a).total_cmp(&spread(*b)))
    });
    let mut samples = vec![0; priorities.len()];
    ranked[..count].iter().for_each(|voxel| samples[*voxel] = 1);
    samples
}

/// Multiples of the golden ratio modulo 1 are evenly spread for any number of them.
fn offset(voxel: usize) -> f64 {
    ((voxel as f64 + 0.5) * 0.618_033_988_749_894_9).fract()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_few_samples_go_to_the_highest_priorities() {
        let priorities: Vec<f64> = (0..1250).map(|k| if k < 1000 { 1.0 } else { 4.0 }).collect();
        let of = |samples: Vec<usize>| [&samples[..1000], &samples[1000..]].map(|part| part.iter().sum::<usize>());
        assert_eq!(of(distribute_by_rank(&priorities, 250)), [0, 250]);
        assert_eq!(of(distribute_by_rank(&priorities, 100)), [0, 100]);
        assert_eq!(of(distribute_by_rank(&priorities, 400)), [150, 250]);
        // Shares of the priority's sum give half to each kind.
        let [low, high] = of(distribute(&priorities, 250));
        assert!(low.abs_diff(high) <= 4, "{low} {high}");
        // Enough samples are distributed as ever.
        assert_eq!(distribute_by_rank(&priorities, 6600), distribute(&priorities, 6600));
        assert_eq!(distribute_by_rank(&[0.0, 2.0, f64::NAN], 3), [0, 3, 0]);
        // As many as voxels leave none empty.
        assert_eq!(of(distribute_by_rank(&priorities, 1250)), [1000, 250]);
        assert!(distribute_by_rank(&priorities, 1300).iter().all(|samples| *samples > 0));
        assert!(distribute(&priorities, 1250).contains(&0));
        // Equal voxels in a row get samples evenly: no quarter has less than its share.
        let some = distribute_by_rank(&[1.0; 400], 100);
        assert!(some.chunks(100).all(|part| part.iter().sum::<usize>().abs_diff(25) <= 2), "{some:?}");
    }

    #[test]
    fn quotas_follow_priorities() {
        assert_eq!(distribute(&[1.0, 2.0, 5.0], 80), [10, 20, 50]);
        assert_eq!(distribute(&[3.0, 1.0, 2.0], 2), [1, 0, 1]);
        assert_eq!(distribute(&[1.0, 1.0, 1.0], 2).iter().sum::<usize>(), 2);
        assert_eq!(distribute(&[0.0, f64::NAN, -1.0], 3), [1, 1, 1]);
        assert_eq!(distribute(&[0.0, f64::INFINITY, 2.0], 3), [0, 0, 3]);
        assert_eq!(distribute(&[], 3), Vec::<usize>::new());
        assert!([[2, 8], [3, 7]].map(Vec::from).contains(&distribute(&[0.26, 0.74], 10)));
        // Many equal voxels get their fair share together, though each gets a whole number.
        let priorities: Vec<f64> = (0..1250).map(|k| if k < 1000 { 1.0 } else { 4.0 }).collect();
        let samples = distribute(&priorities, 6600);
        assert!(samples[..1000].iter().sum::<usize>().abs_diff(3300) <= 3, "{samples:?}");
        assert!(samples[..1000].iter().all(|n| [3, 4].contains(n)));
    }
}
