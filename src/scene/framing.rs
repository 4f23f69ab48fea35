//! The view chosen when nobody chose one.

use glam::DVec3;
use rayon::prelude::*;

use super::camera::check_size;
use super::{Camera, Lens, Projection, Scene, Up};
use crate::error::Result;

/// Part of the way from the principal point to the image's edge that the scene fills.
const FILL: f64 = 0.95;

/// Rounds of centring; each leaves about the square of the share of depth in the distance.
const ROUNDS: usize = 4;

impl Camera {
    /// A camera that shows all surfel centres of `scene` as large as the image holds them, with a margin of 5 %, and
    /// centred: from the front, a little from the right and above (z-up scenes, which tend to be terrain, from steeper).
    ///
    /// An orthographic lens keeps its scale, so it may show less.
    pub fn framing((width, height): (u32, u32), lens: Lens, scene: &Scene, near: f64) -> Result<Self> {
        check_size(width, height)?;
        let (projection, [fx, fy, cx, cy]) = lens.intrinsics(width, height)?;
        let forward = forward(scene.up);
        let right = forward.cross(scene.up.axis()).normalize();
        let down = forward.cross(right);
        let bounds = scene.bounds();
        let center = bounds.center();
        // A scene of one place has no extent but its surfels'.
        let half = 0.5 * bounds.extent().length();
        let (radius, clearance) = if half > 0.0 {
            (half, 0.05 * half)
        } else {
            let radius = f64::from(scene.largest_radius());
            (radius, 3.0 * radius)
        };
        let local = |p: DVec3| DVec3::new((p - center).dot(right), (p - center).dot(down), (p - center).dot(forward));
        // The image's middle and half its width, as X/Z (pinhole) or X (orthographic), and so for its height.
        let interval = |size: u32, principal: f64, f: f64| {
            let size = f64::from(size);
            ((0.5 * size - principal) / f, FILL * 0.5 * size / f)
        };
        let ((mid_x, half_x), (mid_y, half_y)) = (interval(width, cx, fx), interval(height, cy, fy));
        let pinhole = projection == Projection::Pinhole;
        let mut eye = DVec3::new(0.0, 0.0, -2.0 * radius);
        if pinhole {
            // The eye must keep every point between four planes, X - x <= (mid + half) (Z - z) and so on: the foremost
            // such eye between the pair of planes that leaves it less room.
            let [left, right, above, below, front] = largest(scene, |p| {
                let p = local(p);
                [
                    p.x - (mid_x + half_x) * p.z,
                    (mid_x - half_x) * p.z - p.x,
                    p.y - (mid_y + half_y) * p.z,
                    (mid_y - half_y) * p.z - p.y,
                    -p.z,
                ]
            });
            let z = -((left + right) / (2.0 * half_x)).max((above + below) / (2.0 * half_y)).max(front + clearance);
            eye = DVec3::new(0.5 * (left - right) + mid_x * z, 0.5 * (above - below) + mid_y * z, z);
        }
        for _ in 0..ROUNDS {
            let reach = largest(scene, |p| {
                let d = local(p) - eye;
                let depth = if pinhole { d.z } else { 1.0 };
                [d.x / depth, -d.x / depth, d.y / depth, -d.y / depth]
            });
            let depth = if pinhole { -eye.z } else { 1.0 };
            eye.x += (0.5 * (reach[0] - reach[1]) - mid_x) * depth;
            eye.y += (0.5 * (reach[2] - reach[3]) - mid_y) * depth;
        }
        let world = scene.origin + center + right * eye.x + down * eye.y + forward * eye.z;
        Self::look_at((width, height), lens, world, world + forward * radius, None, scene.up, near)
    }
}

/// The default direction of view.
fn forward(up: Up) -> DVec3 {
    match up {
        Up::Y => -DVec3::new(0.45, 0.35, 1.0),
        Up::Z => DVec3::new(-0.15, 1.0, -1.2),
    }
    .normalize()
}

/// The largest of each of some functions over the surfel centres: whatever their order, the same.
fn largest<const N: usize>(scene: &Scene, f: impl Fn(DVec3) -> [f64; N] + Sync) -> [f64; N] {
    let join = |a: [f64; N], b: [f64; N]| std::array::from_fn(|k| a[k].max(b[k]));
    let values = scene.surfels.par_iter().map(|s| f(glam::Vec3::from_array(s.center).as_dvec3()));
    values.reduce(|| [f64::NEG_INFINITY; N], join)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::{Colors, Surfel};

    #[test]
    fn every_point_is_in_the_image_and_the_scene_fills_and_centres_it() {
        let mut surfels = Vec::new();
        for corner in 0..8u32 {
            let pick = |bit: u32, low: f32, high: f32| if corner >> bit & 1 == 0 { low } else { high };
            let center = glam::Vec3::new(pick(0, -3.0, 9.0), pick(1, 2.0, 4.0), pick(2, 1.0, 1.5));
            surfels.push(Surfel::disk(center, glam::Vec3::Z, 0.1));
        }
        let colors = Colors::Constant([1.0; 4]);
        for (up, size) in [(Up::Y, (640, 480)), (Up::Z, (100, 900)), (Up::Z, (1024, 64))] {
            let scene = Scene {
                origin: DVec3::new(4e5, 5e6, 0.0),
                surfels: surfels.clone(),
                low: vec![],
                colors: colors.clone(),
                oriented: true,
                up,
            };
            let off = Lens::Intrinsics([700.0, 700.0, -200.0, 1500.0]);
            for lens in [Lens::Fov(45.0), off] {
                let camera = Camera::framing(size, lens, &scene, 1e-3).unwrap();
                let (mut low, mut high) = (glam::DVec2::INFINITY, glam::DVec2::NEG_INFINITY);
                for surfel in &scene.surfels {
                    let p = camera.to_camera(scene.origin + glam::Vec3::from_array(surfel.center).as_dvec3());
                    let depth = if camera.projection == Projection::Pinhole { p.z } else { 1.0 };
                    assert!(p.z > camera.near);
                    let image =
                        glam::DVec2::new(camera.fx * p.x / depth + camera.cx, camera.fy * p.y / depth + camera.cy);
                    (low, high) = (low.min(image), high.max(image));
                }
                let size = glam::DVec2::new(f64::from(size.0), f64::from(size.1));
                let filled = (high - low) / size;
                assert!(filled.max_element() > 0.9499 && filled.max_element() < 0.96, "{filled}");
                let off = ((low + high) * 0.5 / size - 0.5).abs();
                assert!(off.max_element() < 0.03, "{off}");
            }
        }
    }

    #[test]
    fn one_point_is_framed_by_its_radius() {
        let surfels = vec![Surfel::disk(glam::Vec3::ONE, glam::Vec3::Z, 0.5)];
        let scene = Scene {
            origin: DVec3::ZERO,
            surfels,
            low: vec![],
            colors: Colors::Constant([1.0; 4]),
            oriented: true,
            up: Up::Y,
        };
        let camera = Camera::framing((64, 64), Lens::Fov(45.0), &scene, 1e-6).unwrap();
        let p = camera.to_camera(DVec3::ONE);
        assert!(p.truncate().length() < 1e-9 && (p.z - 1.5).abs() < 1e-6, "{p}");
    }
}
