//! Gaussian surfels, and the rules by which 2D Gaussian splatting draws them.
//!
//! Surfels of 2D Gaussian splatting (Huang et al., SIGGRAPH 2024) have two standard deviations, an
//! opacity o and a view-dependent colour ([`Harmonics`](super::Harmonics)). Along a pixel's ray,
//! with (u, v) the position on the surfel in standard deviations,
//!
//! `alpha = min(0.99, o exp(-rho^2 / 2))`, `rho^2 = min(u^2 + v^2, 2 d^2)`
//!
//! with d the distance of the pixel's centre from the image of the surfel's centre, pixels (section
//! 4.2 of the paper, Eq. 11, and its code). Fragments with an alpha below 1/255 are left out. So is
//! the first fragment that would lower the transmittance below 1e-4, with all behind it. Colours
//! are sRGB codes and are composited as they are, because files are trained to give pictures in
//! this way.
//!
//! epsplat expresses this by three of its options, which a scene of Gaussians uses by default: the
//! [`KERNEL`] over disks of [`EXTENT`] standard deviations,
//! [`LowPass::Gaussians`](super::LowPass::Gaussians) and
//! [`Composite::Gaussians`](super::Composite::Gaussians). Two rules of the original code are not
//! followed, as they come from its tiles and not from its formulas. It sorts surfels by the depth
//! of their centres; here each fragment has its own depth. It cuts a surfel at a box of three
//! standard deviations, rounded to tiles; here a surfel ends at an alpha of 1/255.
//!
//! Kernels get the constants below as overrides ([`sorted`](crate::passes::sorted)).

use super::Kernel;

/// The half-axes of a Gaussian's disk, in standard deviations: sqrt(2 ln 255), so that a Gaussian
/// of opacity 1 has the alpha [`LEAST_ALPHA`] at the rim.
pub const EXTENT: f64 = 3.329_042_969_130_445_5;

/// The kernel over that disk.
pub const KERNEL: Kernel = Kernel::Gaussian { sigma: 1.0 / EXTENT };

/// Standard deviation of the low-pass Gaussian `exp(-d^2)`, pixels.
pub const LOW_PASS_SIGMA: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The variance that the image of a 3D Gaussian gains, pixels squared
/// ([`conic`](crate::passes::conic)).
pub const SOLID_VARIANCE: f64 = 0.3;

/// Fragments with a lower alpha are left out.
pub const LEAST_ALPHA: f64 = 1.0 / 255.0;

/// The largest alpha of a fragment.
pub const MOST_ALPHA: f64 = 0.99;

/// The first fragment that would lower the transmittance below this is left out, with all behind
/// it.
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
