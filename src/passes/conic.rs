//! 3D Gaussians (Kerbl et al. 2023): their images, by the affine approximation of Zwicker et al.
//! 2001 (EWA volume splatting).
//!
//! With W the rotation into camera space, Sigma the covariance of a Gaussian, and J the Jacobian of
//! the projection at the Gaussian's centre, its image has the covariance
//!
//! `Sigma' = J W Sigma W^T J^T + 0.3 I`, pixels squared.
//!
//! All of it has the depth of the centre. In J, x/z and y/z are limited to 1.3 times the tangent of
//! half the angle of view, as the method's code does, so that Gaussians far beside the image do not
//! become long streaks. Where the principal point is not the middle of the image, the limits lie as
//! far outside the image: at 0.15 times its width or height.
//!
//! The plane through the centre parallel to the image is projected by a scale alone. In it, the
//! Gaussian is therefore an ellipse, and a surfel like others from then on: the half-axes are the
//! columns of the Cholesky factor of Sigma', taken to that plane. Gaussians of one scene have the
//! same [`EXTENT`](crate::scene::gaussian::EXTENT) as Gaussian surfels, in standard deviations.
//!
//! The twin of `wgsl/project/axes_conic.wgsl`.

use glam::{DVec2, DVec3};

use crate::plan::Settings;
use crate::plan::pass::Pass;
use crate::scene::{Camera, Kernel, LowPass, Projection, gaussian};

/// How far outside the image the slope of a Gaussian's ray is limited, in widths or heights of the
/// image.
const BESIDE: f64 = 0.15;

/// The pass's constants; none without 3D Gaussians. Its file is chosen by
/// [`facing`](super::facing).
pub const PASS: Pass = Pass {
    name: "conic",
    files: |_| Vec::new(),
    kernels: |_| Vec::new(),
    constants: |making| match making.needs.solid {
        true => {
            let dilation = dilation(making.options);
            vec![("DILATION_ACROSS", dilation.x), ("DILATION_DOWN", dilation.y)]
        }
        false => Vec::new(),
    },
};

/// The half-axes of the pixel's Gaussian, in samples: as many standard deviations as the disks of
/// Gaussians have. 0 with other low-passes than [`LowPass::Gaussians`].
pub fn dilation(options: &Settings) -> DVec2 {
    let (LowPass::Gaussians, Kernel::Gaussian { sigma }) = (options.low_pass, options.kernel) else {
        return DVec2::ZERO;
    };
    let samples = DVec2::new(options.samples.across.into(), options.samples.down.into());
    samples * gaussian::SOLID_VARIANCE.sqrt() / sigma
}

/// X/Z and Y/Z at `p`, limited to a little more than the image; 0 for an orthographic camera.
fn slope_in_view(p: DVec3, camera: &Camera) -> DVec2 {
    if camera.projection == Projection::Orthographic {
        return DVec2::ZERO;
    }
    let (focal, principal) = (DVec2::new(camera.fx, camera.fy), DVec2::new(camera.cx, camera.cy));
    let size = DVec2::new(camera.width.into(), camera.height.into());
    let [low, high] = [size * -BESIDE, size * (1.0 + BESIDE)].map(|limit| (limit - principal) / focal);
    (p.truncate() / p.z).max(low).min(high)
}

/// The half-axes, in camera space, of the image of a Gaussian in the plane of its centre.
///
/// `p` is the centre and `axes` are the three half-axes, in camera space, world units. The pixels
/// of `camera` are the samples, of which the pixel's Gaussian has the half-axes `dilation`.
pub fn half_axes(p: DVec3, axes: [DVec3; 3], camera: &Camera, dilation: DVec2) -> [DVec3; 2] {
    let slope = slope_in_view(p, camera);
    let widening = if camera.projection == Projection::Pinhole { p.z } else { 1.0 };
    let pixel = dilation * widening / DVec2::new(camera.fx, camera.fy);
    let [a, b, c] = axes.map(|axis| axis.truncate() - slope * axis.z);
    let (x, y) = (DVec3::new(a.x, b.x, c.x), DVec3::new(a.y, b.y, c.y));
    let (across, down) = (pixel.x * pixel.x, pixel.y * pixel.y);
    let (xx, yy) = (x.length_squared(), y.length_squared());
    let determinant = x.cross(y).length_squared() + yy * across + xx * down + across * down;
    let width = (xx + across).sqrt();
    [DVec3::Y * (determinant.sqrt() / width), DVec3::new(width, x.dot(y) / width, 0.0)]
}
