//! The structural similarity of two images (Wang, Bovik, Sheikh and Simoncelli 2004).

use rayon::prelude::*;

/// The side of a window, pixels.
const WINDOW: usize = 11;

/// The standard deviation of a window's Gaussian weights, pixels.
const SIGMA: f64 = 1.5;

/// `(K1 L)^2` and `(K2 L)^2` for values with the range L = 1.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Returns the mean of Eq. 13 over all windows that lie in the images, in [-1, 1]; None if no
/// window fits.
///
/// The images are rows from the top, `width` values each. A window with a NaN counts as -1.
pub(super) fn mean_ssim(a: &[f64], b: &[f64], width: usize) -> Option<f64> {
    let mean = |value: &(dyn Fn(usize) -> f64 + Sync)| {
        let values: Vec<f64> = (0..a.len()).map(value).collect();
        windowed(&values, width)
    };
    let (mean_a, mean_b) = (mean(&|i| a[i]), mean(&|i| b[i]));
    let (mean_aa, mean_bb, mean_ab) = (mean(&|i| a[i] * a[i]), mean(&|i| b[i] * b[i]), mean(&|i| a[i] * b[i]));
    let windows = mean_a.len();
    let similarity = |i: usize| {
        let (a, b) = (mean_a[i], mean_b[i]);
        let (variance_a, variance_b, covariance) = (mean_aa[i] - a * a, mean_bb[i] - b * b, mean_ab[i] - a * b);
        let similarity =
            (2.0 * a * b + C1) * (2.0 * covariance + C2) / ((a * a + b * b + C1) * (variance_a + variance_b + C2));
        if similarity.is_nan() { -1.0 } else { similarity }
    };
    (windows > 0).then(|| (0..windows).map(similarity).sum::<f64>() / windows as f64)
}

/// The weighted mean over each window. The weights are separable, so rows are summed first, then
/// columns.
fn windowed(values: &[f64], width: usize) -> Vec<f64> {
    let weights: [f64; WINDOW] = std::array::from_fn(|k| {
        let from_middle = k as f64 - (WINDOW / 2) as f64;
        (-0.5 * (from_middle / SIGMA).powi(2)).exp()
    });
    let total: f64 = weights.iter().sum();
    let weighted = |values: &mut dyn Iterator<Item = f64>| {
        values.zip(&weights).map(|(value, weight)| value * weight).sum::<f64>() / total
    };
    let across: Vec<Vec<f64>> = values
        .par_chunks(width.max(1))
        .map(|row| row.windows(WINDOW).map(|window| weighted(&mut window.iter().copied())).collect())
        .collect();
    across
        .par_windows(WINDOW)
        .flat_map_iter(|rows| {
            (0..rows[0].len()).map(move |x| weighted(&mut rows.iter().map(|row| row[x]))).collect::<Vec<_>>()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn flat_images_differ_by_luminance_alone() {
        let (a, b) = (vec![0.25; 20 * 15], vec![0.75; 20 * 15]);
        let expected = (2.0 * 0.25 * 0.75 + C1) / (0.25 * 0.25 + 0.75 * 0.75 + C1);
        assert!((mean_ssim(&a, &b, 20).unwrap() - expected).abs() < 1e-12);
        assert!((mean_ssim(&a, &a, 20).unwrap() - 1.0).abs() < 1e-15);
        assert_eq!(mean_ssim(&a[..200], &b[..200], 20), None);
        assert_eq!(mean_ssim(&[], &[], 0), None);
    }

    #[test]
    fn one_window_is_what_the_definition_says() {
        let image = |seed: usize| (0..121).map(|i| ((i * i * seed + 7 * i) % 101) as f64 / 100.0).collect::<Vec<_>>();
        let (a, b) = (image(3), image(5));
        let weight = |i: usize| {
            let (x, y) = ((i % 11) as f64 - 5.0, (i / 11) as f64 - 5.0);
            (-(x * x + y * y) / (2.0 * 1.5 * 1.5)).exp()
        };
        let total: f64 = (0..121).map(weight).sum();
        let mean = |of: &dyn Fn(usize) -> f64| (0..121).map(|i| weight(i) * of(i)).sum::<f64>() / total;
        let (ma, mb) = (mean(&|i| a[i]), mean(&|i| b[i]));
        let (va, vb) = (mean(&|i| (a[i] - ma).powi(2)), mean(&|i| (b[i] - mb).powi(2)));
        let cov = mean(&|i| (a[i] - ma) * (b[i] - mb));
        let luminance = (2.0 * ma * mb + 1e-4) / (ma * ma + mb * mb + 1e-4);
        let structure = (2.0 * cov + 9e-4) / (va + vb + 9e-4);
        let expected = luminance * structure;
        assert!((mean_ssim(&a, &b, 11).unwrap() - expected).abs() < 1e-12);
        // The inverse of an image has the opposite structure.
        let inverse: Vec<f64> = a.iter().map(|v| 1.0 - v).collect();
        assert!(mean_ssim(&a, &inverse, 11).unwrap() < -0.9);
        assert_eq!(mean_ssim(&a, &vec![f64::NAN; 121], 11), Some(-1.0));
    }
}
