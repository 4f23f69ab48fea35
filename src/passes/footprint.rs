//! A splat at a pixel: coverage, depth and rho. The twin of `wgsl/project/footprint.wgsl`.

use glam::DVec2;

use super::lowpass::filtered;
use super::splat::{Intersection, Splat};
use super::{curved, facing};
use crate::plan::pass::Pass;
use crate::plan::{EpsilonForm, SceneNeeds, Sides};
use crate::scene::{Camera, Form, Kernel, KernelShape, LowPass, Projection};

/// The files of the footprint and its weight; kernels of other passes evaluate them.
pub const PASS: Pass = Pass {
    name: "footprint",
    files: |needs| {
        let mut files = camera_files(needs);
        files.extend([
            "footprint.wgsl",
            "side.wgsl",
            match needs.surface.shows_nearest() {
                true => "epsilon_none.wgsl",
                false => match needs.epsilon {
                    EpsilonForm::Depth => "epsilon_depth.wgsl",
                    EpsilonForm::Radius => "epsilon_radius.wgsl",
                    EpsilonForm::Ray => "epsilon_ray.wgsl",
                    EpsilonForm::All => "epsilon_all.wgsl",
                },
            },
        ]);
        if needs.weighs() {
            files.push("blend.wgsl");
            files.push(file_of(needs.kernel));
        }
        files
    },
    kernels: |_| Vec::new(),
    constants: |making| {
        let kernel = making.options.kernel;
        let mut constants =
            vec![("SIDES", u32::from(making.needs.sides == Sides::Nearest).into()), ("KERNEL_FLOOR", kernel.floor())];
        constants.extend(kernel_file(kernel).1);
        constants
    },
};

/// The WGSL files of the camera.
fn camera_files(needs: &SceneNeeds) -> Vec<&'static str> {
    match (needs.lens, needs.projection) {
        (None, Projection::Orthographic) => vec!["camera_orthographic.wgsl"],
        (None, Projection::Pinhole) => vec!["perspective.wgsl", "camera_pinhole.wgsl"],
        (Some(Form::Equirectangular), _) => {
            vec!["perspective.wgsl", "camera_lens.wgsl", "lens_sphere.wgsl", "angle.wgsl"]
        }
        (Some(Form::Fisheye), _) => {
            vec!["perspective.wgsl", "camera_lens.wgsl", "lens_fisheye.wgsl", "distortion.wgsl", "angle.wgsl"]
        }
        (Some(Form::Perspective), _) => {
            vec!["perspective.wgsl", "camera_lens.wgsl", "lens_perspective.wgsl", "distortion.wgsl"]
        }
    }
}

/// The WGSL file of a kernel's family.
fn file_of(shape: KernelShape) -> &'static str {
    match shape {
        KernelShape::Gaussian => "kernel_gaussian.wgsl",
        KernelShape::Ellipse => "kernel_ellipse.wgsl",
        KernelShape::Cone => "kernel_cone.wgsl",
        KernelShape::Constant => "kernel_constant.wgsl",
    }
}

/// The WGSL file of a kernel, and the override constants that hold its parameters.
pub(crate) fn kernel_file(kernel: Kernel) -> (&'static str, Vec<(&'static str, f64)>) {
    let constants = match kernel {
        Kernel::Gaussian { sigma } => vec![("KERNEL_FALL", 0.5 / (sigma * sigma))],
        Kernel::Ellipse { a, n, smooth } => {
            let step = if smooth { (-a).exp() } else { 0.0 };
            vec![("KERNEL_A", a), ("KERNEL_N", n), ("KERNEL_STEP", step)]
        }
        Kernel::Cone { power } => vec![("KERNEL_POWER", power)],
        Kernel::Constant => Vec::new(),
    };
    (file_of(kernel.shape()), constants)
}

/// Intersects the ray through the centre of pixel (x, y) with the splat's plane, or its low-pass.
///
/// Returns the intersection and the factor on the kernel's weight; `None` behind the camera, and
/// where its lens shows nothing.
pub fn footprint(splat: &Splat, camera: &Camera, low_pass: LowPass, x: u32, y: u32) -> Option<(Intersection, f64)> {
    if !camera.shows(f64::from(x) + 0.5, f64::from(y) + 0.5) {
        return None;
    }
    met(splat, camera, low_pass, x, y).map(|(at, gain)| (at, gain * splat.fade.weight()))
}

/// The same as [`footprint`], without the splat's fade.
fn met(splat: &Splat, camera: &Camera, low_pass: LowPass, x: u32, y: u32) -> Option<(Intersection, f64)> {
    let (dx, dy) = ((i64::from(x) - splat.anchor[0]) as f64, (i64::from(y) - splat.anchor[1]) as f64);
    if let Some(curve) = &splat.curve {
        let (cap, plane) = curved::meet(curve, splat, camera, DVec2::new(dx, dy));
        // Where the tangent plane is clipped, or shows a back that is culled, the cap itself may
        // still be visible.
        let shows = |(at, _): &(Intersection, f64)| at.inside >= 0.0 && !(curve.culls && at.away);
        let soft = filtered(splat, camera, low_pass, Some(cap), plane, (dx, dy));
        return soft.filter(|soft| soft.0.rho2 >= cap.rho2 || shows(soft)).or(Some((cap, 1.0)));
    }
    if let Some(point) = &splat.point {
        return Some((facing::meet(point, splat, camera, DVec2::new(dx, dy)), 1.0));
    }
    let at = |row: glam::DVec3| row.x * dx + (row.y * dy + row.z);
    let (a, b, c) = (at(splat.a), at(splat.b), at(splat.c));
    let (before, u, v, rho2, depth) = match camera.projection {
        Projection::Pinhole => (c > 0.0, a / c, b / c, (a * a + b * b) / (c * c), 1.0 / c),
        Projection::Orthographic => (true, a, b, a * a + b * b, c),
    };
    let inside = if before { splat.inside(u, v) } else { f64::INFINITY };
    let disk = before.then_some(Intersection { depth, rho2, inside, uv: DVec2::new(u, v), away: splat.away });
    filtered(splat, camera, low_pass, disk, (c, inside), (dx, dy))
}
