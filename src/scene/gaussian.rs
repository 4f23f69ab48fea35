//! Surfels that are Gaussians, and the rules by which the method draws them that they come from.
//!
//! 2D Gaussian splatting (Huang et al., SIGGRAPH 2024) has surfels with two standard deviations, an opacity o and a colour that changes with
//! the view ([`Harmonics`](super::Harmonics)). Along a pixel's ray, with (u, v) the place on the surfel in standard deviations,
//!
//! `alpha = min(0.99, o exp(-rho^2 / 2))`, `rho^2 = min(u^2 + v^2, 2 d^2)`
//!
//! with d the distance of the pixel's centre from the surfel's image, pixels (section 4.2 of the paper, Eq. 11, and its code). Fragments
//! with an alpha below 1/255 are left out, and all from the one on that would let less than 1e-4 through. Colours are codes of sRGB as
//! displays take them, and are composited as they are: files are trained to give pictures in this way.
//!
//! epsplat draws that by three of its options, which a scene of Gaussians takes unless a caller says otherwise: the [`KERNEL`] over
//! disks of [`EXTENT`] standard deviations, [`LowPass::Gaussians`](super::LowPass::Gaussians) and
//! [`Composite::Gaussians`](super::Composite::Gaussians). Two rules of the method's code are not kept, as they are of its tiles and not of
//! its formulas: it sorts by the depth of centres, where here each fragment has its own, and it cuts a surfel at the box of three standard
//! deviations, rounded to tiles, where here it ends at an alpha of 1/255.

use super::Kernel;

/// The half-axes of a Gaussian's disk, standard deviations: at its rim one of opacity 1 has the alpha [`LEAST_ALPHA`], sqrt(2 ln 255).
pub const EXTENT: f64 = 3.329_042_969_130_445_5;

/// The falloff over that disk.
pub const KERNEL: Kernel = Kernel::Gaussian { sigma: 1.0 / EXTENT };

/// The low-pass is a Gaussian of this standard deviation, pixels: `exp(-d^2)`.
pub const LOW_PASS_SIGMA: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Fragments with less are left out.
pub const LEAST_ALPHA: f64 = 1.0 / 255.0;

/// No fragment has more.
pub const MOST_ALPHA: f64 = 0.99;

/// The fragment that would let less through, and all behind it, are left out.
pub const LEAST_SHOWN: f64 = 1e-4;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disk_ends_where_its_gaussian_is_left_out() {
        assert!(((-0.5 * EXTENT * EXTENT).exp() - LEAST_ALPHA).abs() < 1e-15);
        assert!((KERNEL.weight(1.0) - LEAST_ALPHA).abs() < 1e-15);
    }
}
