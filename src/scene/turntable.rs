//! Cameras on a circle around the scene, all of which have the whole scene in view.

use std::f64::consts::TAU;
use std::num::NonZeroU32;

use glam::{DQuat, DVec3};

use super::framing::{FILL, FILL_OF_DISKS, Framing, Of, directions, image};
use super::side::unit;
use super::{Camera, Lens, Scene, Side};
use crate::error::Result;

/// The most directions from which the distance of the cameras is found. Between them the margin of
/// the image suffices.
const MOST_DIRECTIONS: u32 = 72;

impl Camera {
    /// Returns `count` cameras on a circle around the up axis through the centre of the scene's
    /// body, evenly spaced.
    ///
    /// All look at that centre from the same distance, the least at which each has the whole body
    /// in view. The first looks as [`Camera::framing_from`] does; the others follow
    /// counter-clockwise, seen from above.
    ///
    /// # Errors
    ///
    /// As [`Camera::framing_from`].
    pub fn turntable(
        size: (u32, u32),
        lens: Lens,
        scene: &Scene,
        near: f64,
        (side, up): (Option<Side>, Option<DVec3>),
        count: NonZeroU32,
    ) -> Result<Vec<Self>> {
        let (pinhole, image) = image(size, lens)?;
        let (forward, top) = directions(side, up, scene)?;
        let (axis, top) = (unit(up.unwrap_or(scene.up.axis()), "up")?, unit(top, "up")?);
        let turned = |step: u32, of: u32| {
            let turn = DQuat::from_axis_angle(axis, TAU * f64::from(step) / f64::from(of));
            (turn * forward, turn * top)
        };
        let looks = count.get().min(MOST_DIRECTIONS);
        let framings = (0..looks).map(|step| Framing::new((scene, &()), pinhole, image, turned(step, looks)));
        let distance = framings.map(|framing| framing.distance()).fold(0.0, f64::max);
        let center = scene.origin + scene.framed().0.center();
        let camera = |step: u32| {
            let (forward, top) = turned(step, count.get());
            Self::look_at(size, lens, center - forward * distance, center, Some(top), scene.up, near)
        };
        (0..count.get()).map(camera).collect()
    }
}

impl Framing<'_> {
    /// The least distance from the centre of the body at which a camera that looks at it has the
    /// whole body in view, world units. The principal point is the image's centre.
    fn distance(&self) -> f64 {
        if !self.pinhole {
            return 2.0 * self.radius;
        }
        let least = |of: Of, halves: [f64; 2]| {
            let [x, y] = halves;
            let planes = [DVec3::new(1.0, 0.0, -x), DVec3::new(-1.0, 0.0, -x), DVec3::new(0.0, 1.0, -y)];
            let planes = [planes[0], planes[1], planes[2], DVec3::new(0.0, -1.0, -y), DVec3::NEG_Z];
            let [left, right, above, below, front] =
                self.largest(of, |disk| planes.map(|plane| disk.farthest(plane).dot(plane)));
            (left.max(right) / x).max(above.max(below) / y).max(front + self.clearance)
        };
        let centers = least(Of::Centers, self.image.map(|[_, half, _]| FILL * half));
        centers.max(least(Of::Disks, self.image.map(|[_, half, free]| free.min(FILL_OF_DISKS * half))))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::{Surfel, Up};

    /// Every corner of a long box stays in view, and fills the image from at least one side.
    #[test]
    fn the_scene_stays_in_view_all_around() {
        let at = |x: f32, y: f32, z: f32| Surfel::disk(glam::Vec3::new(x, y, z), glam::Vec3::Z, 0.001);
        let surfels: Vec<_> =
            (0..8).map(|k| at(9.0 * (k & 1) as f32, 3.0 * (k >> 1 & 1) as f32, 2.0 * (k >> 2) as f32)).collect();
        let origin = DVec3::new(4e5, 5e6, 0.0);
        let center = origin + DVec3::new(4.5, 1.5, 1.0);
        for up in [Up::Z, Up::Y] {
            let scene = Scene { origin, surfels: surfels.clone(), up, ..Scene::default() };
            let count = NonZeroU32::new(12).unwrap();
            let cameras = Camera::turntable((320, 200), Lens::Fov(45.0), &scene, 1e-3, (None, None), count).unwrap();
            assert_eq!(cameras.len(), 12);
            let mut largest: f64 = 0.0;
            for camera in &cameras {
                for surfel in &scene.surfels {
                    let p = camera.to_camera(origin + glam::Vec3::from_array(surfel.center).as_dvec3());
                    let x = (camera.fx * p.x / p.z).abs() / 160.0;
                    let y = (camera.fy * p.y / p.z).abs() / 100.0;
                    assert!(p.z > 0.0 && x < 1.0 && y < 1.0, "{x} {y}");
                    largest = largest.max(x).max(y);
                }
            }
            assert!(largest > 0.94, "{largest}");
            // The eyes lie on a circle: the same height, the same distance, 30 degrees apart.
            let arms: Vec<DVec3> = cameras.iter().map(|camera| camera.eye - center).collect();
            for pair in arms.windows(2) {
                assert!((pair[0].length() / pair[1].length() - 1.0).abs() < 1e-9);
                assert!(((pair[0] - pair[1]).dot(up.axis())).abs() < 1e-6);
                let [a, b] = [pair[0], pair[1]].map(|arm| arm.reject_from_normalized(up.axis()).normalize());
                assert!((a.dot(b) - 30f64.to_radians().cos()).abs() < 1e-9);
                assert!(a.cross(b).dot(up.axis()) > 0.0, "counter-clockwise");
            }
        }
    }
}
