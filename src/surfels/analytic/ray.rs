//! The intersection of a ray with an analytic surface.

use glam::{DVec3, Vec3Swizzles};

use super::{SHELLS, Shape, TORUS_MAJOR, TORUS_MINOR};

/// Returns the smallest t > 0 for which `origin + t * direction` lies on the surface; None if there
/// is none, or the direction has no length.
///
/// t is in units of the direction's length, and accurate to about 1e-12 relative to the distance
/// from the scene, except where the ray grazes the surface within rounding.
pub fn depth_along_ray(shape: Shape, origin: DVec3, direction: DVec3) -> Option<f64> {
    let length = direction.length();
    if !(length.is_normal() && origin.is_finite()) {
        return None;
    }
    let direction = direction / length;
    // Intersections are computed relative to the ray's point nearest to the scene's centre, so a
    // distant eye costs digits only in the final t.
    let shift = -origin.dot(direction);
    let nearest = origin + direction * shift;
    let first = |t: f64| t + shift > 0.0;
    let t = match shape {
        Shape::Sphere => {
            let half_chord = (1.0 - nearest.length_squared()).sqrt();
            [-half_chord, half_chord].into_iter().find(|&t| first(t))
        }
        Shape::Torus => torus_crossings(nearest, direction).into_iter().find(|&t| first(t)),
        Shape::Plane | Shape::Checkerboard | Shape::Text => square(nearest, direction).filter(|&t| first(t)),
        Shape::Crossing => {
            // Exchanging x and z maps the square at x = 0 to the one at z = 0.
            let both = [square(nearest, direction), square(nearest.zyx(), direction.zyx())];
            both.into_iter().flatten().filter(|&t| first(t)).min_by(f64::total_cmp)
        }
        Shape::Shells => {
            let half = SHELLS.map(|radius| (radius * radius - nearest.length_squared()).sqrt());
            half.into_iter().flat_map(|half| [-half, half]).filter(|&t| first(t)).min_by(f64::total_cmp)
        }
    }?;
    Some((t + shift) / length)
}

/// The t at which the line crosses the square [-1, 1] x [-1, 1] at z = 0.
fn square(start: DVec3, direction: DVec3) -> Option<f64> {
    let t = -start.z / direction.z;
    let hit = start + direction * t;
    (t.is_finite() && hit.x.abs() <= 1.0 && hit.y.abs() <= 1.0).then_some(t)
}

/// All t at which the line `start + t * direction` crosses the torus, ascending. `start` is the
/// line's point nearest to the world origin, `direction` a unit vector.
///
/// With q = |p|^2 + R^2 - r^2 the torus is q^2 = 4 R^2 (x^2 + y^2), a quartic in t. The roots of
/// the quartic's derivative, found in the same way, separate the roots of the quartic. So no root
/// is lost, and no initial guess is needed. Up to three Newton steps on the signed distance then
/// remove the rounding error of the coefficients.
fn torus_crossings(start: DVec3, direction: DVec3) -> Vec<f64> {
    let reach = TORUS_MAJOR + TORUS_MINOR;
    let half_chord_squared = reach * reach - start.length_squared();
    if half_chord_squared < 0.0 || half_chord_squared.is_nan() {
        return Vec::new();
    }
    // A little beyond the bounding sphere, where the torus certainly is not.
    let limit = half_chord_squared.sqrt() + 1e-6;
    // |p|^2 = |start|^2 + t^2, as the linear term vanishes at the nearest point.
    let k = start.length_squared() + TORUS_MAJOR * TORUS_MAJOR - TORUS_MINOR * TORUS_MINOR;
    let flat = 4.0 * TORUS_MAJOR * TORUS_MAJOR;
    let (s, d) = (start.truncate(), direction.truncate());
    let quartic =
        [k * k - flat * s.length_squared(), -2.0 * flat * s.dot(d), 2.0 * k - flat * d.length_squared(), 0.0, 1.0];
    let mut crossings = Vec::new();
    roots(&quartic, -limit, limit, &mut crossings);
    for t in &mut crossings {
        for _ in 0..3 {
            let p = start + direction * *t;
            let step = Shape::Torus.distance(p) / Shape::Torus.normal(p).dot(direction);
            // Near a grazing point the step is meaningless, and the bracketed root is more
            // accurate.
            if step.is_nan() || step.abs() > 1e-6 {
                break;
            }
            *t -= step;
        }
    }
    crossings.sort_by(f64::total_cmp);
    crossings
}

/// Finds the roots at which the polynomial (coefficients in ascending powers) changes sign between
/// `low` and `high`, ascending. Each is accurate to about the last bit of a number as large as the
/// interval.
fn roots(polynomial: &[f64], low: f64, high: f64, found: &mut Vec<f64>) {
    let value = |of: &[f64], t: f64| of.iter().rev().fold(0.0, |sum, c| sum * t + c);
    let derivative: Vec<f64> = polynomial.iter().zip(0u32..).skip(1).map(|(c, power)| c * f64::from(power)).collect();
    let mut turns = Vec::new();
    if polynomial.len() > 2 {
        roots(&derivative, low, high, &mut turns);
    }
    turns.push(high);
    let least = (high - low) * (-54f64).exp2();
    let mut from = low;
    for to in turns {
        let (mut a, mut b) = (from, to);
        let rising = value(polynomial, b) > 0.0;
        if (value(polynomial, a) > 0.0) != rising {
            // Newton's method in a bracket, which is halved where Newton would leave it or a step
            // exceeds half the last one.
            let (mut t, mut step) = (0.5 * (a + b), b - a);
            while step > least {
                let at = value(polynomial, t);
                if (at > 0.0) == rising {
                    b = t
                } else {
                    a = t
                }
                let newton = t - at / value(&derivative, t);
                let next =
                    if newton > a && newton < b && (newton - t).abs() < 0.5 * step { newton } else { 0.5 * (a + b) };
                step = (next - t).abs();
                t = next;
            }
            found.push(t);
        }
        from = to;
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::generate;
    use super::*;

    #[test]
    fn convex_shapes_are_met_at_the_samples_that_face_the_eye() {
        for shape in [Shape::Sphere, Shape::Plane, Shape::Checkerboard, Shape::Text] {
            for eye in [DVec3::new(0.3, -2.0, 3.0), DVec3::new(1.0, 2.0, 40.0)] {
                let mut met = 0;
                for sample in generate(shape, 2000) {
                    let p = DVec3::from_array(sample.position);
                    let normal = DVec3::from_array(sample.normal.map(f64::from));
                    if (eye - p).normalize().dot(normal) > 0.01 {
                        let t = depth_along_ray(shape, eye, p - eye).unwrap();
                        assert!((t - 1.0).abs() < 1e-12, "{shape:?} {p} {t}");
                        let scaled = depth_along_ray(shape, eye, (p - eye).normalize()).unwrap();
                        assert!((scaled - eye.distance(p)).abs() < 1e-11);
                        met += 1;
                    }
                }
                assert!(met > 500);
            }
        }
    }

    #[test]
    fn torus_is_met_where_it_is_and_not_later() {
        let mut behind = 0;
        for eye in [
            DVec3::new(2.0, 2.5, 1.5),
            DVec3::new(0.0, 0.0, 0.05),
            DVec3::new(0.9, 0.0, 0.1),
            DVec3::new(-30.0, 1.0, 0.2),
        ] {
            for sample in generate(Shape::Torus, 3000) {
                let p = DVec3::from_array(sample.position);
                let direction = (p - eye).normalize();
                let normal = DVec3::from_array(sample.normal.map(f64::from));
                if normal.dot(direction).abs() < 0.02 {
                    continue;
                }
                let t = depth_along_ray(Shape::Torus, eye, direction).unwrap();
                let truth = eye.distance(p);
                assert!(Shape::Torus.distance(eye + direction * t).abs() < 1e-13 * (1.0 + truth), "{eye} {p}");
                assert!(t < truth + 1e-12 * (1.0 + truth));
                if t < truth - 1e-9 {
                    behind += 1;
                }
                // Sphere tracing with the signed distance cannot step over the surface, so it finds
                // the same first hit.
                let inside = Shape::Torus.distance(eye) < 0.0;
                let mut traced = 0.0;
                for _ in 0..5000 {
                    traced += Shape::Torus.distance(eye + direction * traced) * if inside { -1.0 } else { 1.0 };
                }
                assert!(
                    (traced - t).abs() < 1e-9
                        || traced < t + 1e-9 && Shape::Torus.distance(eye + direction * traced).abs() > 1e-12
                );
            }
        }
        assert!(behind > 1000);
    }

    #[test]
    fn rays_meet_each_shell_and_both_squares() {
        // Each search continues just behind the last hit.
        let met = |shape: Shape, start: DVec3, direction: DVec3| {
            let (mut all, mut at) = (Vec::new(), 0.0);
            while let Some(t) = depth_along_ray(shape, start + direction * at, direction) {
                at += t;
                all.push(at);
                at += 1e-9;
            }
            all
        };
        let near = |found: Vec<f64>, expected: &[f64]| {
            assert_eq!(found.len(), expected.len(), "{found:?}");
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7), "{found:?}");
        };
        near(met(Shape::Shells, DVec3::X * 2.0, -DVec3::X), &[1.0, 1.25, 1.5, 1.75, 2.25, 2.5, 2.75, 3.0]);
        near(met(Shape::Shells, DVec3::new(0.6, 0.0, 2.0), -DVec3::Z), &[1.2, 1.55, 2.45, 2.8]);
        let slanted = DVec3::new(1.0, 0.0, -1.0);
        near(met(Shape::Crossing, DVec3::new(-0.75, 0.2, 1.0), slanted), &[0.75, 1.0]);
        near(met(Shape::Crossing, DVec3::new(0.5, 0.2, 2.0), -DVec3::Z), &[2.0]);
    }

    #[test]
    fn rays_that_miss() {
        for (shape, _, _) in Shape::ALL {
            assert_eq!(depth_along_ray(shape, DVec3::new(0.0, 0.0, 3.0), DVec3::Z), None);
            assert_eq!(depth_along_ray(shape, DVec3::new(0.0, 0.0, 3.0), DVec3::X), None);
            assert_eq!(depth_along_ray(shape, DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO), None);
            assert_eq!(depth_along_ray(shape, DVec3::new(3.0, 0.0, 3.0), DVec3::new(0.0, 0.0, -1.0)), None);
            assert_eq!(depth_along_ray(shape, DVec3::NAN, DVec3::X), None);
        }
        assert_eq!(depth_along_ray(Shape::Torus, DVec3::new(0.1, 0.2, 5.0), -DVec3::Z), None);
    }

    #[test]
    fn from_inside_the_far_wall_is_met() {
        assert_eq!(depth_along_ray(Shape::Sphere, DVec3::ZERO, DVec3::X * 2.0), Some(0.5));
        let t = depth_along_ray(Shape::Torus, DVec3::X, DVec3::Z).unwrap();
        assert!((t - TORUS_MINOR).abs() < 1e-15);
        let far = depth_along_ray(Shape::Torus, DVec3::new(1e6, 0.0, 0.0), -DVec3::X).unwrap();
        assert!((far - (1e6 - 1.4)).abs() < 1e-9);
    }
}
