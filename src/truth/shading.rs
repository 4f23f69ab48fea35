//! Shading of exact surfaces, written independently of the renderer, so that a fault in the
//! renderer's shading shows as an error against the truth.

use glam::{DVec3, DVec4};

use crate::plan::Settings;
use crate::scene::options::HIGHLIGHT;
use crate::scene::{Light, Shading};

/// The linear colour that a point with colour `albedo` and unit `normal` sends toward the eye, seen
/// along `ray`.
///
/// A light of intensity I from the unit direction l gives the irradiance `E = I max(0, n . l)`. A
/// headlight, which is at the eye, gives `E = I |n . l|`. Lambert shading sends `albedo E`. Phong
/// shading adds [`HIGHLIGHT`]` E max(0, m . v)^shininess`, where v is the direction to the eye and
/// `m = 2 (n . l) n - l` the mirrored light.
pub(super) fn sent(albedo: DVec3, normal: DVec3, ray: DVec3, options: &Settings) -> DVec3 {
    if options.shading == Shading::Unlit {
        return albedo;
    }
    let eye = -ray / ray.length();
    let mut sent = DVec3::ZERO;
    for light in &options.lights {
        let (direction, received) = match *light {
            Light::Headlight { intensity } => (eye, f64::from(intensity) * normal.dot(eye).abs()),
            Light::Directional { toward, intensity } => {
                (toward.as_dvec3(), f64::from(intensity) * normal.dot(toward.as_dvec3()).max(0.0))
            }
        };
        sent += albedo * received;
        if options.shading == Shading::Phong {
            let mirrored = normal * (2.0 * normal.dot(direction)) - direction;
            sent += HIGHLIGHT * received * mirrored.dot(eye).max(0.0).powf(options.shininess.into());
        }
    }
    sent
}

/// Composites premultiplied `light` with `alpha` over a straight `background`; the result is
/// straight.
pub(super) fn in_front(light: DVec3, alpha: f64, background: [f32; 4]) -> [f32; 4] {
    let [r, g, b, opacity] = background.map(f64::from);
    let through = (1.0 - alpha) * opacity;
    let sum = light.extend(alpha) + DVec4::new(r, g, b, 1.0) * through;
    if sum.w > 0.0 { (sum.truncate() / sum.w).extend(sum.w).to_array().map(|c| c as f32) } else { [0.0; 4] }
}
