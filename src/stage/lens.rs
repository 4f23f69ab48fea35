//! How much a lens bends what is drawn straight.
//!
//! A splat is projected by a pinhole of its own, and the edges of triangles are straight between the
//! images of their corners. Both err by half the curvature of the lens times the square of their
//! size in the image (`src/passes/homography.rs`), so only large ones err visibly.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use crate::scene::{Camera, Scene, Surfel};

/// The error of an image, pixels, from which on it counts.
const VISIBLE: f64 = 1.0;

/// The number of surfels or triangles that err by more than [`VISIBLE`], and the largest error,
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

/// Returns a note for users if a lens bends the images of surfels or triangles in view by more than
/// a pixel, where they are drawn straight.
pub(super) fn note(scene: &Scene, camera: &Camera) -> Option<String> {
    camera.optics?;
    let eye = camera.eye - scene.origin;
    let seen = |relative: DVec3| camera.rotation * (relative - eye);
    let of_surfel = |(index, surfel): (usize, &Surfel)| {
        let axes = [surfel.s, surfel.t].map(|axis| camera.rotation * Vec3::from_array(axis).as_dvec3());
        Bent::of(of_disk(camera, seen(scene.center(index)), axes))
    };
    let surfels = scene.surfels.par_iter().enumerate().map(of_surfel).reduce(Bent::default, Bent::and);
    let place = |vertex: u32| seen(scene.triangles.place(vertex as usize));
    let of_triangle = |numbers: &[u32; 3]| Bent::of(of_edges(camera, numbers.map(place)));
    let triangles = scene.triangles.corners().par_iter().map(of_triangle).reduce(Bent::default, Bent::and);
    let sentence = |what: &str, bent: Bent, all: usize, remedy: &str| {
        let Bent { count, most } = bent;
        (count > 0).then(|| {
            format!(
                "this lens bends {count} of {all} {what} by more than a pixel, at most by {most:.1}, and they are drawn straight: \
                 {remedy} bend less"
            )
        })
    };
    let of_surfels = sentence("surfels", surfels, scene.surfels.len(), "smaller ones");
    let of_triangles = sentence("triangles", triangles, scene.triangles.len(), "shorter edges");
    let all: Vec<String> = of_surfels.into_iter().chain(of_triangles).collect();
    (!all.is_empty()).then(|| all.join("; "))
}

/// Whether an image point lies in the image.
fn is_inside(camera: &Camera, image: DVec2) -> bool {
    image.cmpge(DVec2::ZERO).all() && image.x <= camera.width.into() && image.y <= camera.height.into()
}

/// The error at the ends of a disk's half-axes; 0 for a disk whose centre is out of view. Ends that
/// the lens does not see, or sees beyond the border of a whole sphere, do not count.
fn of_disk(camera: &Camera, p: DVec3, axes: [DVec3; 2]) -> f64 {
    let Some((image, _)) = camera.image(p).filter(|(image, _)| is_inside(camera, *image)) else { return 0.0 };
    let Some(sight) = camera.sight(p) else { return 0.0 };
    let focal = DVec2::new(camera.fx, camera.fy);
    let end = |v: DVec3| {
        let own = image
            + focal * DVec2::new(sight.steps[0].dot(v), sight.steps[1].dot(v)) / (sight.depth + sight.axis.dot(v));
        let exact = camera.image(p + v).map(|(image, _)| image);
        exact.map_or(0.0, |exact| off(camera, exact, own))
    };
    axes.into_iter().flat_map(|axis| [end(axis), end(-axis)]).fold(0.0, f64::max)
}

/// The largest distance of the middle of an edge from the straight image of the edge; 0 for a
/// triangle of which a corner is out of view.
fn of_edges(camera: &Camera, corners: [DVec3; 3]) -> f64 {
    let Some(images) = all_of(corners.map(|corner| camera.image(corner))) else { return 0.0 };
    if !images.iter().any(|(image, _)| is_inside(camera, *image)) {
        return 0.0;
    }
    let edge = |k: usize| {
        let (a, b) = (images[k].0, images[(k + 1) % 3].0);
        let Some((middle, _)) = camera.image(0.5 * (corners[k] + corners[(k + 1) % 3])) else { return 0.0 };
        let along = b - a;
        if along == DVec2::ZERO { 0.0 } else { (middle - a).perp_dot(along).abs() / along.length() }
    };
    (0..3).map(edge).fold(0.0, f64::max)
}

fn all_of<T: Copy>(three: [Option<T>; 3]) -> Option<[T; 3]> {
    let [a, b, c] = three;
    Some([a?, b?, c?])
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
