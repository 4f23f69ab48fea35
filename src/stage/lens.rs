//! How much a lens bends what is drawn straight.
//!
//! A splat is projected by a pinhole of its own, whose image errs by half the curvature of the lens
//! times the square of its size (`src/passes/homography.rs`), so only large splats err visibly.
//! Triangles are split until their edges are straight (`refined.rs`).

use std::f64::consts::PI;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use crate::scene::{Camera, Form, Scene, Surfel};

/// The error of an image, pixels, from which on it counts.
const VISIBLE: f64 = 1.0;

/// The number of surfels that err by more than [`VISIBLE`], and the largest error,
/// pixels.
#[derive(Clone, Copy, Default)]
struct Bent {
    count: u64,
    most: f64,
}

impl Bent {
    fn of(error: f64) -> Self {
        if error > VISIBLE { Self { count: 1, most: error } } else { Self::default() }
    }

    fn and(self, other: Self) -> Self {
        Self { count: self.count + other.count, most: self.most.max(other.most) }
    }
}

/// Returns a note for users if a lens bends the images of surfels in view by more than a pixel.
pub(super) fn note(scene: &Scene, camera: &Camera) -> Option<String> {
    camera.optics?;
    let eye = camera.eye - scene.origin;
    let seen = |relative: DVec3| camera.rotation * (relative - eye);
    let of_surfel = |(index, surfel): (usize, &Surfel)| {
        let axes = [surfel.s, surfel.t].map(|axis| camera.rotation * Vec3::from_array(axis).as_dvec3());
        Bent::of(of_disk(camera, seen(scene.center(index)), axes))
    };
    let surfels = scene.surfels.par_iter().enumerate().map(of_surfel).reduce(Bent::default, Bent::and);
    let (Bent { count, most }, all) = (surfels, scene.surfels.len());
    (count > 0).then(|| {
        format!(
            "this lens bends {count} of {all} surfels by more than a pixel, at most by {most:.1}, and they are drawn straight: \
             smaller ones bend less"
        )
    })
}

/// Whether an image point lies in the image.
fn is_inside(camera: &Camera, image: DVec2) -> bool {
    image.cmpge(DVec2::ZERO).all() && image.x <= camera.width.into() && image.y <= camera.height.into()
}

/// The latitude from which on a whole sphere is stretched so much that errors do not count,
/// radians.
const POLAR: f64 = 80.0 * PI / 180.0;

/// The error at the ends of a disk's half-axes; 0 for a disk whose centre is out of view or near a
/// pole of a sphere. Ends that the lens does not see, or sees beyond the border of a sphere, do not
/// count.
fn of_disk(camera: &Camera, p: DVec3, axes: [DVec3; 2]) -> f64 {
    let Some((image, _)) = camera.image(p).filter(|(image, _)| is_inside(camera, *image)) else { return 0.0 };
    let Some(sight) = camera.sight(p) else { return 0.0 };
    let is_sphere = camera.optics.is_some_and(|optics| optics.form == Form::Equirectangular);
    if is_sphere && sight.plane.y.abs() > POLAR {
        return 0.0;
    }
    let focal = DVec2::new(camera.fx, camera.fy);
    let end = |v: DVec3| {
        let own = image
            + focal * DVec2::new(sight.steps[0].dot(v), sight.steps[1].dot(v)) / (sight.depth + sight.axis.dot(v));
        let exact = camera.image(p + v).map(|(image, _)| image);
        exact.map_or(0.0, |exact| off(camera, exact, own))
    };
    axes.into_iter().flat_map(|axis| [end(axis), end(-axis)]).fold(0.0, f64::max)
}

/// The distance of two image points, 0 if a border of the image lies between them.
fn off(camera: &Camera, one: DVec2, other: DVec2) -> f64 {
    let apart = (one - other).length();
    if apart > 0.5 * f64::from(camera.width) { 0.0 } else { apart }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use glam::DMat3;

    use super::*;
    use crate::scene::Lens;

    #[test]
    fn large_disks_of_a_fisheye_are_counted_and_small_ones_are_not() {
        let camera = Camera::posed((400, 400), Lens::Fisheye(180.0), DVec3::ZERO, DMat3::IDENTITY, 0.01).unwrap();
        let scene = |radius: f32| {
            let place = Vec3::new(2.0, 0.5, 1.0);
            Scene { surfels: vec![Surfel::disk(place, -place.normalize(), radius); 3], ..Scene::default() }
        };
        assert!(note(&scene(0.02), &camera).is_none());
        let told = note(&scene(1.0), &camera).unwrap();
        assert!(told.starts_with("this lens bends 3 of 3 surfels by more than a pixel, at most by "), "{told}");
        let pinhole = Camera::posed((400, 400), Lens::Fov(90.0), DVec3::ZERO, DMat3::IDENTITY, 0.01).unwrap();
        assert!(note(&scene(1.0), &pinhole).is_none());
    }
}
