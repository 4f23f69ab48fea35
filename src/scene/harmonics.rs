//! View-dependent colours: real spherical harmonics, as in files of Gaussian surfels.
//!
//! A surfel seen along the unit direction d, from the eye to its centre, has the straight colour
//!
//! `c(d) = max(0, c_0 + sum over l of 1..=degree, |m| <= l of k_lm Y_lm(d))`
//!
//! with a vector k_lm of red, green and blue for each Y_lm. Signs and order are those of the 3DGS
//! code (Kerbl et al. 2023): m from -l to l, with the Condon-Shortley factor `(-1)^m`. The Y_lm are
//! orthonormal.

use std::f64::consts::PI;

use glam::DVec3;

/// The highest degree in files.
pub const MOST_DEGREE: u32 = 3;

/// The number of Y_lm of degrees 1 to `degree`.
pub const fn terms_of(degree: u32) -> usize {
    ((degree + 1) * (degree + 1) - 1) as usize
}

/// The Y_lm of degrees 1 to 3 in a unit direction. The twin of
/// `wgsl/accumulate/color_harmonics.wgsl`.
pub fn basis(DVec3 { x, y, z }: DVec3) -> [f64; terms_of(MOST_DEGREE)] {
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let root = |square: f64| (square / PI).sqrt();
    let first = root(3.0 / 4.0);
    let second = root(15.0 / 4.0);
    let (third, between, last) = (root(21.0 / 32.0), root(105.0 / 4.0), root(35.0 / 32.0));
    [
        -first * y,
        first * z,
        -first * x,
        second * x * y,
        -second * y * z,
        root(5.0 / 16.0) * (2.0 * zz - xx - yy),
        -second * x * z,
        0.5 * second * (xx - yy),
        -last * y * (3.0 * xx - yy),
        between * x * y * z,
        -third * y * (4.0 * zz - xx - yy),
        root(7.0 / 16.0) * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -third * x * (4.0 * zz - xx - yy),
        0.5 * between * z * (xx - yy),
        -last * x * (xx - 3.0 * yy),
    ]
}

/// The harmonic colours of all surfels of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Harmonics {
    /// c_0 of each surfel, and straight alpha.
    colors: Vec<[f32; 4]>,
    degree: u32,
    /// k_lm of each surfel: [`terms_of`] the degree times red, green and blue.
    terms: Vec<f32>,
}

impl Harmonics {
    /// Harmonics of degree 1 to [`MOST_DEGREE`]; None if the number of `terms` does not match the
    /// number of colours and the degree.
    pub fn new(colors: Vec<[f32; 4]>, degree: u32, terms: Vec<f32>) -> Option<Self> {
        let fits = (1..=MOST_DEGREE).contains(&degree) && terms.len() == colors.len() * 3 * terms_of(degree);
        fits.then_some(Self { colors, degree, terms })
    }

    /// The highest degree.
    pub fn degree(&self) -> u32 {
        self.degree
    }

    /// c_0 of each surfel, and straight alpha.
    pub fn colors(&self) -> &[[f32; 4]] {
        &self.colors
    }

    /// k_lm of surfel `index`: red, green and blue of one term after the other.
    pub fn terms(&self, index: usize) -> &[f32] {
        let each = 3 * terms_of(self.degree);
        &self.terms[index * each..(index + 1) * each]
    }

    /// The straight colour of surfel `index` seen along a unit `direction` from the eye.
    pub fn seen(&self, index: usize, direction: DVec3) -> [f64; 4] {
        let [r, g, b, alpha] = self.colors[index].map(f64::from);
        let mut color = [r, g, b];
        for (terms, value) in self.terms(index).as_chunks::<3>().0.iter().zip(basis(direction)) {
            color.iter_mut().zip(terms).for_each(|(sum, term)| *sum += f64::from(*term) * value);
        }
        let [r, g, b] = color.map(|c| c.max(0.0));
        [r, g, b, alpha]
    }

    /// An upper bound of the straight colours of surfel `index` over all directions.
    ///
    /// By the Cauchy-Schwarz inequality and `sum over m of Y_lm(d)^2 = (2 l + 1) / 4 pi` (Unsold's
    /// theorem), degree l adds at most `|k_l| sqrt((2 l + 1) / 4 pi)`. The bound is rounded up.
    pub fn most(&self, index: usize) -> [f32; 4] {
        let [r, g, b, alpha] = self.colors[index];
        let mut most = [r, g, b].map(f64::from);
        let terms = self.terms(index).as_chunks::<3>().0;
        for degree in 1..=self.degree {
            let of_degree = &terms[terms_of(degree - 1)..terms_of(degree)];
            let highest = (f64::from(2 * degree + 1) / (4.0 * PI)).sqrt();
            for (k, sum) in most.iter_mut().enumerate() {
                *sum += highest * of_degree.iter().map(|term| f64::from(term[k]).powi(2)).sum::<f64>().sqrt();
            }
        }
        // Covers the rounding of an f32 sum in any order.
        let [r, g, b] = most.map(|c| (c.max(0.0) * (1.0 + 1e-5)) as f32);
        [r, g, b, alpha]
    }

    /// The harmonics of the surfels at `indices`.
    pub fn taken(&self, indices: &[usize]) -> Self {
        Self {
            colors: indices.iter().map(|&index| self.colors[index]).collect(),
            degree: self.degree,
            terms: indices.iter().flat_map(|&index| self.terms(index)).copied().collect(),
        }
    }

    /// Returns the colours, the degree and the terms.
    pub fn into_parts(self) -> (Vec<[f32; 4]>, u32, Vec<f32>) {
        (self.colors, self.degree, self.terms)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Directions that cover the sphere evenly: a mean over them is the integral, for polynomials
    /// to 1e-3.
    fn directions(count: u32) -> impl Iterator<Item = DVec3> {
        (0..count).map(move |k| {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
            let (sin, cos) = (f64::from(k) * 2.399963229728653).sin_cos();
            DVec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z)
        })
    }

    #[test]
    fn the_basis_is_orthonormal_and_each_degree_has_one_length() {
        let count = 200_000;
        let mut products = [[0.0; 15]; 15];
        for direction in directions(count) {
            let values = basis(direction);
            for (row, a) in products.iter_mut().zip(values) {
                row.iter_mut().zip(values).for_each(|(sum, b)| *sum += a * b * 4.0 * PI / f64::from(count));
            }
            for degree in 1..=MOST_DEGREE {
                let length: f64 = values[terms_of(degree - 1)..terms_of(degree)].iter().map(|v| v * v).sum();
                assert!((length - f64::from(2 * degree + 1) / (4.0 * PI)).abs() < 1e-12);
            }
        }
        for (i, row) in products.iter().enumerate() {
            for (k, product) in row.iter().enumerate() {
                assert!((product - f64::from(u8::from(i == k))).abs() < 1e-4, "{i} {k}: {product}");
            }
        }
    }

    /// Compares with the numbers that the 3DGS code has for these factors.
    #[test]
    fn the_signs_are_those_of_files() {
        let axis = |x: f64, y: f64, z: f64| basis(DVec3::new(x, y, z).normalize());
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        near(axis(0.0, 1.0, 0.0)[0], -0.4886025119029199);
        near(axis(0.0, 0.0, 1.0)[1], 0.4886025119029199);
        near(axis(1.0, 0.0, 0.0)[2], -0.4886025119029199);
        near(axis(1.0, 1.0, 0.0)[3], 1.0925484305920792 / 2.0);
        near(axis(0.0, 1.0, 1.0)[4], -1.0925484305920792 / 2.0);
        near(axis(0.0, 0.0, 1.0)[5], 2.0 * 0.31539156525252005);
        near(axis(1.0, 0.0, 1.0)[6], -1.0925484305920792 / 2.0);
        near(axis(1.0, 0.0, 0.0)[7], 0.5462742152960396);
        near(axis(0.0, 1.0, 0.0)[8], 0.5900435899266435);
        near(axis(1.0, 1.0, 1.0)[9], 2.890611442640554 / 27f64.sqrt());
        near(axis(0.0, 1.0, 0.0)[10], 0.4570457994644658);
        near(axis(0.0, 0.0, 1.0)[11], 2.0 * 0.3731763325901154);
        near(axis(1.0, 0.0, 0.0)[12], 0.4570457994644658);
        near(axis(1.0, 0.0, 1.0)[13], 1.445305721320277 / 8f64.sqrt());
        near(axis(1.0, 0.0, 0.0)[14], -0.5900435899266435);
    }

    #[test]
    fn no_side_exceeds_the_bound_and_none_is_below_black() {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 11) as f64 / (1u64 << 52) as f64 - 1.0) as f32
        };
        let colors = (0..50).map(|_| [next(), next(), next(), 0.5]).collect();
        let terms = (0..50 * 45).map(|_| next()).collect();
        let harmonics = Harmonics::new(colors, 3, terms).unwrap();
        for index in 0..50 {
            let most = harmonics.most(index).map(f64::from);
            for direction in directions(200) {
                let seen = harmonics.seen(index, direction);
                assert!(seen.iter().zip(most).all(|(seen, most)| (0.0..=most).contains(seen)), "{seen:?} {most:?}");
            }
        }
        assert!(Harmonics::new(vec![[0.0; 4]], 3, vec![0.0; 44]).is_none());
        assert!(Harmonics::new(vec![[0.0; 4]], 4, vec![0.0; 72]).is_none());
        let two = harmonics.taken(&[7, 3]);
        assert_eq!((two.colors()[1], two.terms(1)), (harmonics.colors()[3], harmonics.terms(3)));
    }
}
