//! Where light is evaluated: per pixel, at the blended normal, or per splat, at its centre.
//!
//! Lit splat colours are blended as in paper 000 ("complete per-vertex illumination", section 5.3).
//! No normals are summed then.

use glam::DVec3;

use super::resolve::shade;
use super::splat::Splat;
use crate::plan::pass::Pass;
use crate::plan::{Settings, Sides};

/// The pass's files and constants.
pub const PASS: Pass = Pass {
    name: "lit",
    files: |needs| match needs.lit_splats {
        true => vec!["lit_splats.wgsl"],
        false => vec!["lit_pixels.wgsl"],
    },
    kernels: |_| Vec::new(),
    constants: |making| vec![("TURNS_LIT", u32::from(making.needs.sides == Sides::None).into())],
};

/// The f64 twin: the premultiplied colour of a splat, lit if splats are lit. `direction` points
/// from the eye to the splat's centre.
pub fn reference(premultiplied: [f64; 4], splat: &Splat, direction: DVec3, options: &Settings) -> [f64; 4] {
    let [r, g, b, alpha] = premultiplied;
    if !options.lights_splats() || alpha <= 0.0 {
        return premultiplied;
    }
    let lit = shade(DVec3::new(r, g, b) / alpha, splat.lit_normal(), -direction, options) * alpha;
    [lit.x, lit.y, lit.z, alpha]
}
