//! Stage 1, its start: leaves out batches of surfels that cannot be visible, before they are
//! projected.
//!
//! The order of the surfels makes each [`BATCH`](crate::gpu::layout::BATCH) of them a
//! neighbourhood, with a bounding ball. Among the batches in view, those nearer than the middle of
//! the scene are projected and drawn first ([`Part::Near`]). Each tile of pixels then stores the
//! farthest of its nearest depths. A later batch ([`Part::Far`]) is hidden if it lies behind that
//! depth, by more than epsilon, in all tiles that it may touch. Most of the back of a closed
//! surface is hidden in this way.
//!
//! **No image depends on culling.** Take a fragment of a batch that is left out. Its depth z is
//! beyond the deepest that is accepted at its pixel for the nearest depth so far, and the true
//! nearest depth is no farther. So the fragment is neither nearest nor accepted. Both comparisons
//! allow for rounding: a kernel's depth differs from that of the disk by some units of 2^-24
//! divided by the cosine between ray and normal, and the margin is a thousandth.
//!
//! There are no normal cones: a surfel is seen from both sides, so that a surface with a border has
//! no holes.
//!
//! Batches that are left out take no memory: the splats of the listed batches are stored in slots,
//! one batch after the other, and [`Look::Slots`](crate::plan::steps::Look::Slots) reads from the
//! device how many there are.

use glam::{DVec2, DVec3, Vec3};

use super::lowpass::Design;
use crate::gpu::layout::{LIST_FAR, QUEUE_START};
use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Over, Part, Run, Stage};
use crate::scene::{Camera, LowPass, Projection, Surfel};

/// The bounding ball of disks, each with its centre and the height of its cap: centre x, y, z and
/// radius, world units relative to the scene's origin.
pub(crate) fn ball<'a>(surfels: impl Iterator<Item = (DVec3, &'a Surfel, f64)> + Clone) -> [f32; 4] {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (center, ..) in surfels.clone() {
        (low, high) = (low.min(center), high.max(center));
    }
    let middle = (low + (high - low) * 0.5).as_vec3();
    let far =
        |(center, surfel, height): (DVec3, &Surfel, f64)| center.distance(middle.as_dvec3()) + reach(surfel) + height;
    let radius = surfels.map(far).fold(0.0, f64::max);
    // The factor covers the rounding of these lengths and of the conversion to f32.
    middle.extend((radius * (1.0 + 1e-6)) as f32).to_array()
}

/// The longer half-axis of the ellipse of s and t, which need not be perpendicular: the larger
/// singular value of [s t].
fn reach(surfel: &Surfel) -> f64 {
    let [s, t] = [surfel.s, surfel.t].map(|axis| Vec3::from_array(axis).as_dvec3());
    let (sum, difference) = (s.length_squared() + t.length_squared(), s.length_squared() - t.length_squared());
    (0.5 * (sum + difference.hypot(2.0 * s.dot(t)))).sqrt()
}

/// How far a low-pass may reach past its disk, pixels.
pub fn filter_reach(design: &Design) -> f64 {
    match design.low_pass {
        LowPass::None => 0.0,
        LowPass::Max | LowPass::Gaussians => design.radius,
        LowPass::Ewa => design.blur.sqrt(),
    }
}

/// The f64 twin of `ball_extent` and `pixels_of`: the first and the last image point, pixels, that
/// disks in a ball can touch.
///
/// `center` is in camera space; lengths are in world units. `None` for a ball that reaches the near
/// depth.
pub fn reference(center: DVec3, radius: f64, camera: &Camera, filter_reach: f64) -> Option<[DVec2; 2]> {
    let focal = DVec2::new(camera.fx, camera.fy);
    let principal = DVec2::new(camera.cx, camera.cy);
    let nearest = center.z - radius;
    if nearest <= camera.near {
        return None;
    }
    let (image, extent) = match camera.projection {
        Projection::Pinhole => {
            let ratio = center.truncate() / center.z;
            let turned = (DVec2::ONE + ratio * ratio).map(f64::sqrt) * radius / nearest;
            (ratio * focal + principal, (turned + turned * turned) * focal)
        }
        Projection::Orthographic => (center.truncate() * focal + principal, radius * focal),
    };
    let extent = extent + filter_reach + 2.0;
    Some([image - extent, image + extent])
}

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "cull",
    files: |needs| match (needs.cull, needs.levels) {
        _ if needs.twice() => vec!["cull_twice.wgsl", "around.wgsl"],
        (true, true) => vec!["ball.wgsl", "cull.wgsl", "around_absent.wgsl"],
        (true, false) => vec!["ball.wgsl", "cull.wgsl", "balls_own.wgsl", "around_absent.wgsl"],
        (false, true) => vec!["ball.wgsl", "cull_absent.wgsl", "around_absent.wgsl"],
        (false, false) => vec!["cull_absent.wgsl", "around_absent.wgsl"],
    },
    kernels: |needs| if needs.cull { vec![CULL_NEAR, CULL_FAR] } else { Vec::new() },
    constants: |making| match making.needs.cull || making.needs.levels {
        true => vec![("FILTER_REACH", filter_reach(&Design::of(making.options)))],
        false => Vec::new(),
    },
};

const CULL_NEAR: Kernel = Kernel::new("cull_near");
const CULL_FAR: Kernel = Kernel::new("cull_far");

/// The stage that lists the batches of every page that are in `part`.
///
/// `part` is [`Part::Near`] first, then, once the near batches have nearest depths, [`Part::Far`].
pub fn steps(band: usize, part: Part) -> Stage {
    let near = part == Part::Near;
    let kernel = if near { CULL_NEAR } else { CULL_FAR };
    // Resets three counts: batches listed, far batches among them, and batches that are not near.
    // Far batches are listed after the near ones.
    let counts = [("drawn", 1), ("drawn", u64::from(LIST_FAR) + 1), ("rest", 0)];
    let mut clears: Vec<_> = counts.into_iter().map(|(list, word)| Clear::of(list, word, 1)).collect();
    clears.push(Clear::of("queue", 0, QUEUE_START.into()));
    let stage = Stage::new("project", band, vec![Run { kernel, over: Over::Batches }]);
    if near { stage.after(clears) } else { stage }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::passes::project;
    use crate::plan::Settings;
    use crate::scene::Lens;
    use glam::DMat3;
    use proptest::prelude::*;

    fn camera(orthographic: bool) -> Camera {
        let lens = if orthographic { Lens::OrthographicHeight(4.0) } else { Lens::Fov(70.0) };
        Camera::posed((640, 480), lens, DVec3::ZERO, DMat3::IDENTITY, 0.05).unwrap()
    }

    /// Whether the image of a ball holds all pixels that `surfel` may touch.
    fn holds([low, high]: [DVec2; 2], surfel: &Surfel, camera: &Camera, design: &Design) -> bool {
        let center = Vec3::from_array(surfel.center).as_dvec3();
        project::reference((0, surfel, None), center - camera.eye, camera, design).is_none_or(|splat| {
            (0..2).all(|k| low[k] <= f64::from(splat.first[k]) && f64::from(splat.last[k]) <= high[k])
        })
    }

    proptest! {
        #[test]
        fn disks_within_a_ball_touch_its_pixels_only(
            at in prop::array::uniform3(-1.0..1.0f64),
            depth in 0.2..5.0f64,
            disks in prop::collection::vec((prop::array::uniform9(-1.0..1.0f32), 0.001..0.3f32), 1..6),
            low_pass in prop::sample::select(vec![LowPass::None, LowPass::Max, LowPass::Ewa]),
            orthographic: bool,
        ) {
            let camera = camera(orthographic);
            let center = DVec3::new(at[0], at[1], at[2] * 0.1 + 1.0) * depth;
            let surfels: Vec<_> = disks
                .iter()
                .map(|(v, size)| Surfel {
                    center: (center.as_vec3() + Vec3::from_slice(&v[..3]) * *size).to_array(),
                    s: (Vec3::from_slice(&v[3..6]) * *size).to_array(),
                    t: (Vec3::from_slice(&v[6..]) * *size).to_array(),
                })
                .collect();
            let [x, y, z, radius] = ball(surfels.iter().map(|surfel| (Vec3::from_array(surfel.center).as_dvec3(), surfel, 0.0))).map(f64::from);
            let design = Design::of(&Settings { low_pass, ..Settings::default() });
            if let Some(pixels) = reference(DVec3::new(x, y, z), radius, &camera, filter_reach(&design)) {
                for surfel in &surfels {
                    prop_assert!(holds(pixels, surfel, &camera, &design), "{pixels:?} does not hold {surfel:?}");
                }
            }
        }
    }

    #[test]
    fn a_ball_too_small_does_not_hold_its_disk() {
        let (camera, center) = (camera(false), DVec3::new(0.5, 0.2, 2.0));
        let design = Design::of(&Settings::default());
        let disk = Surfel::disk(center.as_vec3(), Vec3::Z, 0.2);
        let of_radius = |radius| reference(center, radius, &camera, 0.0).unwrap();
        assert!(holds(of_radius(0.2), &disk, &camera, &design));
        assert!(!holds(of_radius(0.15), &disk, &camera, &design));
    }

    #[test]
    fn skewed_half_axes_reach_as_far_as_their_ellipse() {
        let skewed = Surfel { center: [0.0; 3], s: [1.0, 0.0, 0.0], t: [0.9, 0.1, 0.0] };
        let farthest = (0..10_000)
            .map(|i| f64::from(i) * 1e-4 * std::f64::consts::TAU)
            .map(|angle| DVec2::new(angle.cos() + 0.9 * angle.sin(), 0.1 * angle.sin()).length())
            .fold(0.0, f64::max);
        assert!((reach(&skewed) - farthest).abs() < 1e-6, "{} is not {farthest}", reach(&skewed));
        assert!(f64::from(skewed.radius()) < 0.9 * farthest, "the longer half-axis would do");
    }
}
