//! Eigenvectors of symmetric 3x3 matrices.

use std::ops::{Add, Mul};

use glam::DVec3;

/// The symmetric matrix `[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Symmetric3 {
    pub xx: f64,
    pub yy: f64,
    pub zz: f64,
    pub xy: f64,
    pub xz: f64,
    pub yz: f64,
}

impl Add for Symmetric3 {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            xx: self.xx + other.xx,
            yy: self.yy + other.yy,
            zz: self.zz + other.zz,
            xy: self.xy + other.xy,
            xz: self.xz + other.xz,
            yz: self.yz + other.yz,
        }
    }
}

impl Mul<f64> for Symmetric3 {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self {
            xx: self.xx * factor,
            yy: self.yy * factor,
            zz: self.zz * factor,
            xy: self.xy * factor,
            xz: self.xz * factor,
            yz: self.yz * factor,
        }
    }
}

impl Symmetric3 {
    pub const ZERO: Self = Self { xx: 0.0, yy: 0.0, zz: 0.0, xy: 0.0, xz: 0.0, yz: 0.0 };

    /// The sum of `v v^T` over the vectors.
    pub fn scatter(vectors: impl Iterator<Item = DVec3>) -> Self {
        let mut sum = Self::ZERO;
        for v in vectors {
            sum.xx += v.x * v.x;
            sum.yy += v.y * v.y;
            sum.zz += v.z * v.z;
            sum.xy += v.x * v.y;
            sum.xz += v.x * v.z;
            sum.yz += v.y * v.z;
        }
        sum
    }

    /// The product of the matrix and a vector.
    pub fn times(self, v: DVec3) -> DVec3 {
        let Self { xx, yy, zz, xy, xz, yz } = self;
        let [x, y, z] = v.to_array();
        DVec3::new(xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z)
    }

    /// Returns the eigenvalues in ascending order and their orthonormal eigenvectors, computed by
    /// cyclic Jacobi rotations (Golub and Van Loan, Matrix Computations, section 8.5).
    ///
    /// Only `+ - * / sqrt` are used, so every machine that follows IEEE 754 gets the same bits.
    /// Entries with magnitudes from 1e-150 to 1e150 (or zero) neither overflow nor underflow.
    pub fn eigen(self) -> ([f64; 3], [DVec3; 3]) {
        let [eigen] = eigen_of([self]);
        (eigen.values, [0, 1, 2].map(|i| eigen.vector(i)))
    }
}

/// The eigenvalues of a matrix in ascending order, and their eigenvectors.
#[derive(Clone, Copy)]
pub(crate) struct Eigen {
    pub values: [f64; 3],
    /// The eigenvectors, not normalised.
    vectors: [DVec3; 3],
}

impl Eigen {
    /// The unit eigenvector of value `i`.
    pub fn vector(&self, i: usize) -> DVec3 {
        self.vectors[i].normalize()
    }
}

/// Computes the eigenvectors of several matrices, to the bit as [`Symmetric3::eigen`] computes
/// those of each.
///
/// Every step of the rotations waits for roots and quotients of the step before; several matrices
/// share the wait.
pub(crate) fn eigen_of<const LANES: usize>(matrices: [Symmetric3; LANES]) -> [Eigen; LANES] {
    let largest = matrices.map(|m| {
        let largest = [m.xx, m.yy, m.zz, m.xy, m.xz, m.yz].iter().fold(0.0, |most: f64, e| most.max(e.abs()));
        if largest == 0.0 || !largest.is_finite() { None } else { Some(largest) }
    });
    let scaled = |entry: fn(&Symmetric3) -> f64| -> Lanes<LANES> {
        std::array::from_fn(|lane| largest[lane].map_or(0.0, |largest| entry(&matrices[lane]) / largest))
    };
    let diagonal = [scaled(|m| m.xx), scaled(|m| m.yy), scaled(|m| m.zz)];
    // Entry i is the off-diagonal one outside row i and column i.
    let off = [scaled(|m| m.yz), scaled(|m| m.xz), scaled(|m| m.xy)];
    let (diagonal, vectors) = rotated(diagonal, off);
    std::array::from_fn(|lane| {
        let Some(largest) = largest[lane] else {
            return Eigen { values: [0.0; 3], vectors: [DVec3::X, DVec3::Y, DVec3::Z] };
        };
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| diagonal[a][lane].total_cmp(&diagonal[b][lane]));
        let vector = |i: usize| DVec3::from_array(vectors[i].map(|axis| axis[lane]));
        Eigen { values: order.map(|i| diagonal[i][lane] * largest), vectors: order.map(vector) }
    })
}

/// One number for each matrix.
type Lanes<const LANES: usize> = [f64; LANES];

/// Diagonalises matrices with these entries on and off the diagonal; returns the diagonals and the
/// eigenvectors, not normalised.
fn rotated<const LANES: usize>(
    mut diagonal: [Lanes<LANES>; 3],
    mut off: [Lanes<LANES>; 3],
) -> ([Lanes<LANES>; 3], [[Lanes<LANES>; 3]; 3]) {
    let (zero, one) = ([0.0; LANES], [1.0; LANES]);
    let mut vectors = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
    // Convergence is quadratic: four or five sweeps suffice, and the bound is only a safeguard.
    for _ in 0..30 {
        let done: [bool; LANES] = std::array::from_fn(|lane| off.iter().all(|e| e[lane].abs() < 1e-300));
        if done == [true; LANES] {
            break;
        }
        for (p, q, r) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
            let entry = off[r];
            off[r] = zero;
            let keeps: [bool; LANES] = std::array::from_fn(|lane| {
                let [entry, p, q] = [entry[lane], diagonal[p][lane], diagonal[q][lane]].map(f64::abs);
                done[lane] | (entry <= f64::EPSILON * 1e-3 * (p * q).sqrt()) | (entry == 0.0)
            });
            if keeps == [true; LANES] {
                continue;
            }
            let (mut t, mut c, mut s) = (zero, zero, zero);
            for lane in 0..LANES {
                let theta = (diagonal[q][lane] - diagonal[p][lane]) / (2.0 * entry[lane]);
                // The square of a large theta may overflow to infinity; t then becomes zero, which
                // is its limit.
                t[lane] = 1f64.copysign(theta) / (theta.abs() + (theta * theta + 1.0).sqrt());
                c[lane] = 1.0 / (t[lane] * t[lane] + 1.0).sqrt();
                s[lane] = t[lane] * c[lane];
            }
            // A matrix that this rotation would not change keeps the bits of its numbers.
            let turned = |(mut a, mut b): (Lanes<LANES>, Lanes<LANES>)| {
                for lane in 0..LANES {
                    let to = (a[lane] * c[lane] - b[lane] * s[lane], a[lane] * s[lane] + b[lane] * c[lane]);
                    (a[lane], b[lane]) = if keeps[lane] { (a[lane], b[lane]) } else { to };
                }
                (a, b)
            };
            (off[q], off[p]) = turned((off[q], off[p]));
            let (mut of_p, mut of_q) = (vectors[p], vectors[q]);
            of_p.iter_mut().zip(&mut of_q).for_each(|(p, q)| (*p, *q) = turned((*p, *q)));
            (vectors[p], vectors[q]) = (of_p, of_q);
            for lane in 0..LANES {
                let (change, keeps) = (t[lane] * entry[lane], keeps[lane]);
                diagonal[p][lane] = if keeps { diagonal[p][lane] } else { diagonal[p][lane] - change };
                diagonal[q][lane] = if keeps { diagonal[q][lane] } else { diagonal[q][lane] + change };
            }
        }
    }
    (diagonal, vectors)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn product(m: &Symmetric3, v: DVec3) -> DVec3 {
        DVec3::new(
            m.xx * v.x + m.xy * v.y + m.xz * v.z,
            m.xy * v.x + m.yy * v.y + m.yz * v.z,
            m.xz * v.x + m.yz * v.y + m.zz * v.z,
        )
    }

    proptest! {
        #[test]
        fn eigenvectors_are_orthonormal_and_eigen(
            entries in prop::array::uniform6(prop_oneof![Just(0.0), -1.0..1.0f64, -1e-9..1e-9f64]),
            exponent in -149i32..149,
        ) {
            let scale = 10f64.powi(exponent);
            let [xx, yy, zz, xy, xz, yz] = entries.map(|e| e * scale);
            let matrix = Symmetric3 { xx, yy, zz, xy, xz, yz };
            let (values, vectors) = matrix.eigen();
            prop_assert!(values[0] <= values[1] && values[1] <= values[2]);
            for i in 0..3 {
                prop_assert!((vectors[i].length() - 1.0).abs() < 1e-14);
                prop_assert!(vectors[i].dot(vectors[(i + 1) % 3]).abs() < 1e-13);
                let error = (product(&matrix, vectors[i]) - vectors[i] * values[i]).length();
                prop_assert!(error <= 1e-13 * scale, "{error} {scale}");
            }
        }
    }

    #[test]
    fn a_thin_sheet_keeps_its_normal() {
        let normal = DVec3::new(1.0, 2.0, -2.0) / 3.0;
        let (a, b) = (DVec3::new(2.0, 1.0, 2.0) / 3.0, DVec3::new(2.0, -2.0, -1.0) / 3.0);
        for thickness in [0.0, 1e-9, 1e-4] {
            let points = [a, -a, b * 0.3, -b * 0.3, normal * thickness, -normal * thickness];
            let (_, vectors) = Symmetric3::scatter(points.into_iter()).eigen();
            assert!(vectors[0].cross(normal).length() < 1e-12);
        }
    }
}
