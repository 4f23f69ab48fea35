//! The low-pass for splats about as small as a pixel or smaller. Without one, a disk between pixel
//! centres is not drawn, and a far surface has holes and moire.
//!
//! All filters are ellipses centred on the splat, `rho^2 = |R x|^2` for x pixels from its centre:
//!
//! - **max** (Botsch et al. 2005, section 4.2): a circle of radius [`RADIUS`] beside the disk; the
//!   smaller rho counts. A splat then reaches the centre of the pixel that it lies in, so a surface
//!   sampled once per pixel has no holes.
//! - **gaussians** ([`gaussian`]): the same for the surfels of 2D Gaussian splatting. The circle
//!   holds a Gaussian of fixed standard deviation in pixels, and cuts it at as many deviations as
//!   the rim of the disk cuts the kernel's Gaussian.
//! - **ewa** (Zwicker et al. 2001): the disk's affine image J at its centre, convolved with the
//!   pixel's Gaussian: `Q = J J^T + blur I`, weight times `sqrt(|J J^T| / |Q|)`. Exact for a
//!   Gaussian kernel; other kernels are convolved as the Gaussian of the same variance.
//!
//! A filtered fragment has the depth of the disk's plane, clamped to the disk's own depths. Where
//! the filter takes over from the disk, the depths of filter and disk agree. Seen edge-on, the
//! plane's depth diverges, but the fragment's depth does not.

use glam::DVec2;

use super::conic;
use super::facing::Faced;
use super::splat::{Filter, Intersection, Splat};
use crate::plan::Settings;
use crate::plan::pass::Pass;
use crate::scene::{Camera, Kernel, LowPass, Projection, gaussian};

/// The radius of `max`, pixels: half a pixel's diagonal, and a little for rounding.
pub const RADIUS: f64 = 0.7072;

/// The variance of the pixel's Gaussian in `ewa`, pixels squared: that of the pixel's own square,
/// over which a mean of many rays averages. With Zwicker's wider Gaussians (standard deviations 0.5
/// and 0.36 were tried) the images of benches/lowpass.toml are 3 to 9 dB farther from 16 rays per
/// pixel.
pub const PIXEL_VARIANCE: f64 = 1.0 / 12.0;

/// The term that `ewa` adds to J J^T: `(pixel's sigma / kernel's sigma)^2`, pixels squared, but at
/// least the square of [`RADIUS`].
pub fn blur(options: &Settings) -> f64 {
    let sigma_2 = match options.kernel {
        Kernel::Gaussian { sigma } if options.own_kernel.is_none() => sigma * sigma,
        // The variance along one axis, by the midpoint rule.
        _ => {
            let moment = |power: i32| {
                let steps = 4096;
                let at = |i: i32| (f64::from(i) + 0.5) / f64::from(steps);
                (0..steps).map(|i| at(i).powi(power) * options.weight(at(i) * at(i))).sum::<f64>()
            };
            0.5 * moment(3) / moment(1)
        }
    };
    // For wide kernels the ratio is so small that the filter would end before the next pixel's
    // centre.
    (PIXEL_VARIANCE / sigma_2).max(RADIUS * RADIUS)
}

/// The low-pass's files and constants; kernels of other passes evaluate it.
pub const PASS: Pass = Pass {
    name: "lowpass",
    files: |needs| match needs.low_pass {
        LowPass::None => vec!["lowpass_none.wgsl"],
        LowPass::Max | LowPass::Gaussians => vec!["filter.wgsl", "lowpass_max.wgsl"],
        LowPass::Ewa => vec!["filter.wgsl", "lowpass_ewa.wgsl"],
    },
    kernels: |_| Vec::new(),
    constants: |making| match making.needs.low_pass {
        LowPass::None => Vec::new(),
        LowPass::Max | LowPass::Gaussians => vec![("FILTER_RADIUS", Design::of(making.options).radius)],
        LowPass::Ewa => vec![("FILTER_BLUR", blur(making.options))],
    },
};

/// The options that a projection uses, computed once per render: the low-pass with its size, and
/// how points face the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Design {
    /// The low-pass.
    pub low_pass: LowPass,
    /// The term that `ewa` adds to J J^T, pixels squared.
    pub blur: f64,
    /// The radius of `max` or `gaussians`, pixels.
    pub radius: f64,
    /// How points face the camera; `None` if surfels are drawn as disks.
    pub facing: Option<Faced>,
    /// The half-axes of the pixel's Gaussian, with which 3D Gaussians are convolved, samples.
    pub dilation: DVec2,
}

impl Design {
    /// The design that `options` ask for.
    pub fn of(options: &Settings) -> Self {
        let blur = if options.low_pass == LowPass::Ewa { blur(options) } else { 0.0 };
        let radius = match (options.low_pass, options.kernel) {
            (LowPass::Gaussians, Kernel::Gaussian { sigma }) => gaussian::LOW_PASS_SIGMA / sigma,
            _ => RADIUS,
        };
        Self {
            low_pass: options.low_pass,
            blur,
            radius,
            facing: options.facing.map(|facing| Faced::new(facing, options.samples)),
            dilation: conic::dilation(options),
        }
    }
}

/// The filter of a splat whose half-axes have the images `s` and `t`, pixels, about `center`.
pub fn filter(design: &Design, center: DVec2, s: DVec2, t: DVec2, depths: [f64; 2]) -> Option<Filter> {
    match design.low_pass {
        LowPass::None => None,
        LowPass::Max | LowPass::Gaussians => {
            let r = 1.0 / design.radius;
            Some(Filter { center, depths, r: [r, 0.0, r], extent: DVec2::splat(design.radius), gain: 1.0 })
        }
        LowPass::Ewa => {
            let blur = design.blur;
            let (xx, yy) = (s.x * s.x + t.x * t.x + blur, s.y * s.y + t.y * t.y + blur);
            let xy = s.x * s.y + t.x * t.y;
            let area = s.perp_dot(t);
            let determinant = area * area + blur * (s.length_squared() + t.length_squared()) + blur * blur;
            let r_xx = (yy / determinant).sqrt();
            Some(Filter {
                center,
                depths,
                r: [r_xx, -r_xx * xy / yy, 1.0 / yy.sqrt()],
                extent: DVec2::new(xx.sqrt(), yy.sqrt()),
                gain: (area.abs() / determinant.sqrt()).max(1e-9),
            })
        }
    }
}

/// Applies the low-pass to a splat at a pixel: returns the intersection and the factor on its
/// weight.
///
/// `plane` is the third row at the pixel: 1/z (pinhole) or z of the disk's plane. `inside` is how
/// far the plane's point at the pixel lies inside the disk's clip lines.
pub fn filtered(
    splat: &Splat,
    camera: &Camera,
    low_pass: LowPass,
    disk: Option<Intersection>,
    (plane, inside): (f64, f64),
    (dx, dy): (f64, f64),
) -> Option<(Intersection, f64)> {
    let Some(filter) = &splat.filter else { return disk.map(|disk| (disk, 1.0)) };
    let x = DVec2::new(dx, dy) - filter.center;
    let rho2 = (filter.r[0] * x.x + filter.r[1] * x.y).powi(2) + (filter.r[2] * x.y).powi(2);
    let [low, high] = filter.depths;
    let depth = match camera.projection {
        Projection::Pinhole => 1.0 / plane.clamp(1.0 / high, 1.0 / low),
        Projection::Orthographic => plane.clamp(low, high),
    };
    let round = Intersection { depth, rho2, inside, uv: DVec2::ZERO, away: splat.away };
    match (low_pass, disk) {
        (LowPass::Max | LowPass::Gaussians, Some(disk)) if rho2 > 1.0 || rho2 >= disk.rho2 => Some((disk, 1.0)),
        _ => Some((round, filter.gain)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_blur_is_the_ratio_of_variances() {
        let blur = |kernel| blur(&Settings { kernel, ..Settings::default() });
        assert!((blur(Kernel::Gaussian { sigma: 0.25 }) - 4.0 / 3.0).abs() < 1e-12);
        // A cone has variance 3/20 along each axis.
        assert!((blur(Kernel::Cone { power: 1.0 }) - 1.0 / (12.0 * 0.15)).abs() < 5e-3);
        // A disk of constant weight has variance 1/4, with which the filter would not reach the
        // next pixel's centre.
        assert_eq!(blur(Kernel::Constant), RADIUS * RADIUS);
    }

    #[test]
    fn ewa_adds_the_pixels_variance_and_keeps_the_volume() {
        let options = Settings {
            // With this sigma the blur is 1.
            kernel: Kernel::Gaussian { sigma: PIXEL_VARIANCE.sqrt() },
            low_pass: LowPass::Ewa,
            ..Settings::default()
        };
        let (s, t) = (DVec2::new(3.0, 1.0), DVec2::new(-0.5, 2.0));
        let Some(f) = filter(&Design::of(&options), DVec2::ZERO, s, t, [1.0, 1.0]) else { unreachable!() };
        // R^T R is the inverse of J J^T + I.
        let q = [s.x * s.x + t.x * t.x + 1.0, s.x * s.y + t.x * t.y, s.y * s.y + t.y * t.y + 1.0];
        let inverse = [f.r[0] * f.r[0], f.r[0] * f.r[1], f.r[1] * f.r[1] + f.r[2] * f.r[2]];
        assert!((inverse[0] * q[0] + inverse[1] * q[1] - 1.0).abs() < 1e-12);
        assert!((inverse[0] * q[1] + inverse[1] * q[2]).abs() < 1e-12);
        assert!((inverse[1] * q[1] + inverse[2] * q[2] - 1.0).abs() < 1e-12);
        // The integral of a Gaussian is proportional to the root of its determinant.
        let (before, after) = (s.perp_dot(t).abs(), (q[0] * q[2] - q[1] * q[1]).sqrt());
        assert!((f.gain * after - before).abs() < 1e-12);
    }
}
