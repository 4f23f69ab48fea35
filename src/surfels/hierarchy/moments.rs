//! The generic homogeneous covariance (Pajarola 2003, section 3.3): sums that add up along the
//! tree, from which the mean and the covariance of a node follow for any centre and axes.

use glam::DVec3;

use crate::surfels::eigen::Symmetric3;

/// The matrix M̄ = Σ p' p'ᵀ of EQ 1, p' = (p, 1), in lattice steps: ten exact whole numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Moments {
    pub count: u64,
    pub sum: [i64; 3],
    /// Sums of the products xx, yy, zz, xy, xz, yz.
    pub squares: [i128; 6],
}

/// The two coordinates of each of [`Moments::squares`].
const PAIRS: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]];

impl Moments {
    /// The moments of `places`.
    pub fn of(places: impl Iterator<Item = [i32; 3]>) -> Self {
        let mut all = Self::default();
        for place in places {
            let place = place.map(i64::from);
            all.count += 1;
            (0..3).for_each(|axis| all.sum[axis] += place[axis]);
            PAIRS.iter().zip(&mut all.squares).for_each(|(&[i, j], sum)| *sum += i128::from(place[i] * place[j]));
        }
        all
    }

    /// Adds the moments of another set of places (EQ 4).
    pub fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.sum.iter_mut().zip(other.sum).for_each(|(sum, other)| *sum += other);
        self.squares.iter_mut().zip(other.squares).for_each(|(sum, other)| *sum += other);
    }

    /// The mean place, lattice steps.
    pub fn mean(&self) -> DVec3 {
        DVec3::from_array(self.sum.map(|sum| sum as f64)) / self.count as f64
    }

    /// The covariance about the mean, square steps: EQ 2 with the mean for T,
    /// `(n Σ q_i q_j - Σ q_i Σ q_j) / n²`, whose numerator is exact.
    pub fn covariance(&self) -> Symmetric3 {
        let count = i128::from(self.count);
        let squared = (self.count as f64).powi(2);
        let [xx, yy, zz, xy, xz, yz] = std::array::from_fn(|k| {
            let [i, j] = PAIRS[k];
            let sums = i128::from(self.sum[i]) * i128::from(self.sum[j]);
            (count * self.squares[k] - sums) as f64 / squared
        });
        Symmetric3 { xx, yy, zz, xy, xz, yz }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn sums_of_parts_are_those_of_the_whole_and_far_ones_cancel_nothing() {
        let mut random = Random::stream(5, 0);
        // A small cloud at the lattice's far corner.
        let far = (1 << 30) - 4000;
        let places: Vec<[i32; 3]> =
            (0..1000).map(|_| std::array::from_fn(|_| far - (random.number() * 4000.0) as i32)).collect();
        let whole = Moments::of(places.iter().copied());
        let mut parts = Moments::default();
        places.chunks(77).for_each(|part| parts.add(&Moments::of(part.iter().copied())));
        assert_eq!(whole, parts);
        let near = Moments::of(places.iter().map(|place| place.map(|c| c - far)));
        assert_eq!(whole.covariance(), near.covariance());
        // By definition: EQ 1 about the mean.
        let mean = near.mean();
        let offset = |place: &[i32; 3]| DVec3::from_array(place.map(|c| f64::from(c - far))) - mean;
        let direct = places.iter().map(|place| offset(place).x * offset(place).y).sum::<f64>() / 1000.0;
        assert!((near.covariance().xy - direct).abs() < 1e-9 * near.covariance().xx, "{direct}");
        // The largest sums that fit.
        let most = Moments { count: 1 << 32, sum: [1 << 62; 3], squares: [1 << 92; 6] };
        assert_eq!(most.covariance().xx, 0.0);
    }
}
