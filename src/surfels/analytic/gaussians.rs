//! Generated surfaces as Gaussian surfels, whose spherical harmonics approximate shading by a light
//! at the eye.
//!
//! A surface of albedo a, seen along d with the unit normal n, has the colour `a (0.25 + 0.75 c) +
//! 0.3 c^8` with `c = max(0, -d . n)`. It is expanded in spherical harmonics up to degree 3: `c^s =
//! sum over l of A_l sum over m of Y_lm(n) Y_lm(-d)`. By Funk and Hecke, `A_l = 2 pi` times the
//! integral over t from 0 to 1 of `t^s P_l(t)`, where P_l is Legendre's polynomial.

use std::f64::consts::PI;

use glam::DVec3;

use super::{RADIUS_IN_SPACINGS, Sample, Shape, generate};
use crate::io::Points;
use crate::random;
use crate::scene::gaussian::EXTENT;
use crate::scene::harmonics::{MOST_DEGREE, basis, terms_of};
use crate::scene::{Colors, Harmonics};

/// The standard deviation in units of the mean spacing; neighbours overlap.
const DEVIATION_IN_SPACINGS: f64 = 0.6;

/// Generates `count` Gaussians, evenly spaced on the surface, with opacities from 0.1 to 0.95 that
/// look random. The result is always the same. Colours are sRGB-encoded.
pub fn gaussians(shape: Shape, count: u64) -> Points {
    let (mut positions, mut axes, mut colors, mut terms) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (index, sample) in generate(shape, count).enumerate() {
        let Sample { position, normal, radius, color } = sample;
        let normal = DVec3::from_array(normal.map(f64::from));
        let [s, t] = <[DVec3; 2]>::from(normal.any_orthonormal_pair());
        let half_axis = EXTENT * DEVIATION_IN_SPACINGS / RADIUS_IN_SPACINGS * f64::from(radius);
        positions.push(position);
        // s x t is along the normal.
        axes.push([s, t].map(|unit| (unit * half_axis).as_vec3().to_array()));
        let alpha = 0.1 + 0.85 * scrambled(index as u64);
        let albedo = color.map(|code| f64::from(code) / 255.0);
        let of_degree = |degree: usize| albedo.map(|albedo| 0.75 * albedo * lobe(1, degree) + 0.3 * lobe(8, degree));
        let lit = of_degree(0).map(|light| light / (4.0 * PI));
        let [r, g, b] = [0, 1, 2].map(|k| (0.25 * albedo[k] + lit[k]) as f32);
        colors.push([r, g, b, alpha as f32]);
        let values = basis(-normal);
        for degree in 1..=MOST_DEGREE {
            let factors = of_degree(degree as usize);
            for value in &values[terms_of(degree - 1)..terms_of(degree)] {
                terms.extend(factors.map(|factor| (factor * value) as f32));
            }
        }
    }
    Points {
        positions,
        axes: Some(axes),
        colors: Harmonics::new(colors, MOST_DEGREE, terms).map(Colors::Harmonics),
        encoded: true,
        up: Some(shape.up()),
        ..Points::default()
    }
}

/// A hash of the index in [0, 1). Multiples of an irrational number would correlate with the
/// lattice of the positions.
fn scrambled(index: u64) -> f64 {
    (random::mixed((index + 1).wrapping_mul(random::STEP)) >> 11) as f64 / (1u64 << 53) as f64
}

/// The coefficient A_l of `c^s`.
fn lobe(s: u32, l: usize) -> f64 {
    let power = |k: u32| 1.0 / f64::from(s + 1 + k);
    2.0 * PI
        * match l {
            0 => power(0),
            1 => power(1),
            2 => 0.5 * (3.0 * power(2) - power(0)),
            _ => 0.5 * (5.0 * power(3) - 3.0 * power(1)),
        }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// The expansion is close to the formula at all angles.
    #[test]
    fn a_light_beside_the_eye_is_what_harmonics_tell_of_it() {
        let points = gaussians(Shape::Sphere, 500);
        let Some(Colors::Harmonics(harmonics)) = &points.colors else { unreachable!() };
        for (index, sample) in generate(Shape::Sphere, 500).enumerate() {
            let normal = DVec3::from_array(sample.normal.map(f64::from));
            let across = normal.any_orthonormal_vector();
            for angle in [0.0f64, 0.4, 0.8, 1.2, 2.0, 3.0] {
                let seen = harmonics.seen(index, -(angle.cos() * normal + angle.sin() * across));
                let facing = angle.cos().max(0.0);
                for (seen, code) in seen.iter().zip(sample.color) {
                    let exact = f64::from(code) / 255.0 * (0.25 + 0.75 * facing) + 0.3 * facing.powi(8);
                    assert!((seen - exact).abs() < 0.12, "{angle}: {seen} {exact}");
                }
            }
            let [s, t] = points.axes.as_ref().unwrap()[index].map(|axis| DVec3::from_array(axis.map(f64::from)));
            assert!(s.cross(t).normalize().distance(normal) < 1e-6);
        }
    }
}
