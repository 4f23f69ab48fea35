//! Error bounds of single fragments: their position, weight and attributes.
//! [`bounds`](super::bounds) has the derivation.

use glam::{DVec2, DVec3, Vec3};

use super::bounds::DIVISION;
use super::precision::{E as U, Precision};
use crate::passes::footprint::footprint;
use crate::passes::splat::Splat;
use crate::plan::Sides;
use crate::scene::{Camera, Clip, Kernel, LowPass, Scene};

/// A fragment of the twin, with the errors that the device may make.
#[derive(Clone, Copy)]
pub(super) struct Fragment {
    pub(super) depth: f64,
    /// Error of the depth, world units.
    pub(super) depth_error: f64,
    rho: f64,
    rho_error: f64,
    /// Signed distance to the lines that clip the disk: positive inside.
    inside: f64,
    inside_error: f64,
    /// Whether it shows the back of a surface that has sides.
    pub(super) back: bool,
    /// The normal that is lit.
    pub(super) normal: DVec3,
    pub(super) normal_error: f64,
}

impl Fragment {
    pub(super) fn weight(&self, kernel: Kernel) -> f64 {
        kernel.weight(self.rho * self.rho)
    }

    pub(super) fn hits(&self, camera: &Camera) -> bool {
        self.rho <= 1.0 && self.inside >= 0.0 && self.depth >= camera.near
    }

    pub(super) fn surely_hits(&self, camera: &Camera) -> bool {
        self.rho + self.rho_error <= 1.0
            && self.inside - self.inside_error >= 0.0
            && self.depth - self.depth_error >= camera.near * (1.0 + U)
    }

    pub(super) fn may_hit(&self, camera: &Camera) -> bool {
        // If an error is NaN, the fragment may hit.
        !(self.rho - self.rho_error > 1.0
            || self.inside + self.inside_error < 0.0
            || self.depth + self.depth_error < camera.near * (1.0 - U))
    }
}

/// Calls `visit` with the pixel's index for each fragment of each splat in the image.
pub(super) fn fragments(
    splats: &[Splat],
    scene: &Scene,
    (camera, sides): (&Camera, Sides),
    mut visit: impl FnMut(usize, &Splat, &Surface, &Fragment),
) {
    // If the last bit of a depth encodes the side, the depth errs by one unit in the last place.
    let of_side = if sides == Sides::Nearest { 2.0 * U } else { 0.0 };
    // A disk seen exactly edge-on has no rows and, without a low-pass, no fragments.
    let edge_on = |splat: &&Splat| splat.a.truncate() == DVec2::ZERO && splat.b == DVec3::ZERO;
    for splat in splats.iter().filter(|splat| splat.curve.is_some() || !edge_on(splat)) {
        let precision = Precision::of(splat, scene, camera);
        let surface = Surface::of(splat, scene);
        for y in splat.first[1]..=splat.last[1] {
            for x in splat.first[0]..=splat.last[0] {
                let Some(at) = footprint(splat, camera, LowPass::None, x, y).map(|(at, _)| at) else { continue };
                let bound = match (&splat.curve, &splat.point) {
                    (Some(curve), _) => precision.cap(curve, splat, (x, y), &at),
                    (None, Some(point)) => precision.point(point, splat, (x, y), &at),
                    (None, None) => precision.fragment(splat, x, y, &at),
                };
                let known = |error: f64| if error.is_nan() { f64::INFINITY } else { error };
                let rho = at.rho2.sqrt();
                let fragment = Fragment {
                    depth: at.depth,
                    depth_error: known((bound.depth + of_side) * at.depth.abs()),
                    rho,
                    rho_error: known(bound.rho),
                    inside: at.inside,
                    // For a cap, `inside` may be the distance by which the ray's other intersection
                    // misses.
                    inside_error: known(
                        line_error(&splat.clip, rho, bound.rho)
                            + splat.outline.map_or(0.0, |_| bound.rho + U * (50.0 * rho + 2.0))
                            + splat.curve.map_or(0.0, |_| bound.rho),
                    ),
                    back: splat.shows_back(&at),
                    normal: splat.normal_at(&at),
                    normal_error: surface.normal_error + turned_error(splat, bound.rho),
                };
                visit(y as usize * camera.width as usize + x as usize, splat, &surface, &fragment);
            }
        }
    }
}

/// Bounds the error of the distance inside the lines of `clip`, for a point that is `rho` from the
/// centre, with the error `rho_error`.
///
/// The distance changes by the line's length per unit of (u, v). The line is turned with the disk,
/// with a relative error of 6 u, and each of its products has an error of 4 u.
fn line_error(clip: &Clip, rho: f64, rho_error: f64) -> f64 {
    let of_line = |[x, y, z]: [f32; 3]| {
        let (length, z) = (f64::from(x).hypot(y.into()), f64::from(z).abs());
        length * rho_error + U * (10.0 * length * rho + 4.0 * z)
    };
    if clip.is_none() { 0.0 } else { of_line(clip.0[0]).max(of_line(clip.0[1])) }
}

/// Bounds the error of a cap's normal: the slopes times the error of (u, v), plus 30 u of the
/// slopes.
fn turned_error(splat: &Splat, rho_error: f64) -> f64 {
    splat.curve.map_or(0.0, |curve| curve.slopes.map(DVec3::length).iter().sum::<f64>() * (rho_error + 30.0 * U))
}

/// A surfel's attributes.
#[derive(Clone, Copy)]
pub(super) struct Surface {
    pub(super) color: [f64; 4],
    pub(super) normal_error: f64,
    pub(super) radius: f64,
}

impl Surface {
    fn of(splat: &Splat, scene: &Scene) -> Self {
        let index = splat.surfel as usize;
        let [r, g, b, a] = scene.colors.linear(index).map(f64::from);
        let surfel = &scene.surfels[index];
        let (s, t) = (Vec3::from_array(surfel.s).as_dvec3(), Vec3::from_array(surfel.t).as_dvec3());
        let skew = s.length() * t.length() / s.cross(t).length();
        Self {
            color: [r * a, g * a, b * a, a],
            normal_error: 6.0 * U * skew + 12.0 * U,
            radius: f64::from(surfel.shorter()),
        }
    }
}

/// Relative error of a power: 1.6 units in the last place (`wgsl/common/arithmetic.wgsl`).
const POWER: f64 = 3.2 * U;

/// Bounds the error of a fragment's weight.
pub(super) fn weight_error(kernel: Kernel, f: &Fragment) -> f64 {
    let psi = |rho: f64| kernel.weight(rho * rho);
    let weight = psi(f.rho);
    let moved = (psi((f.rho - f.rho_error).max(0.0)) - weight).max(weight - psi((f.rho + f.rho_error).min(1.0)));
    let exponential = |x: f64, power: f64| 2.0 * U * (1.4 + 0.7 * x) + x * power;
    let evaluated = match kernel {
        Kernel::Constant => 0.0,
        Kernel::Cone { power } => {
            let (height, error) = (1.0 - f.rho, DIVISION + U);
            let below = height.powf(power) - (height - error).max(0.0).powf(power);
            let raised = if power == 1.0 {
                0.0
            } else if [1.5, 2.0].contains(&power) {
                DIVISION + U
            } else {
                POWER
            };
            below.max((height + error).powf(power) - height.powf(power)) + (height + error).powf(power) * raised
        }
        Kernel::Gaussian { sigma } => weight * exponential(0.5 * f.rho * f.rho / (sigma * sigma), 3.0 * U),
        Kernel::Ellipse { a, n, smooth } => {
            // The kernel uses a root for n = 3, and products for 2 and 4.
            let power = if [2.0, 4.0].contains(&n) { 3.0 * U } else { POWER + 3.0 * U };
            let step = if smooth { (-a).exp() } else { 0.0 };
            let plain = weight * (1.0 - step) + step;
            (plain * exponential(a * f.rho.powf(n), power) + 2.0 * U * step) / (1.0 - step) + DIVISION * weight
        }
    };
    moved + evaluated
}
