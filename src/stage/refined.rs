//! Triangles for a lens that is no pinhole: edges that it would bend visibly are halved, because
//! edges are drawn straight between the images of their ends.
//!
//! Whether an edge is halved depends on its ends alone, so both triangles of an edge agree and no
//! crack opens. Attributes are linear over a triangle, so halves have the same.

use glam::DVec3;
use rayon::prelude::*;

use crate::scene::{Camera, Scene, Triangle};

/// The largest distance of the middle of an edge from its straight image, pixels.
const STRAIGHT: f64 = 0.25;

/// The largest relative error of the depth of the middle of an edge. A distance is not linear along
/// an edge, and is interpolated as if it were.
const LEVEL: f64 = 1e-3;

/// The largest length of an edge that ends beyond the lens's image, pixels.
const AT_BORDER: f64 = 4.0;

/// The largest angle of an edge with both ends beyond the lens's image, radians.
const BEYOND: f64 = 0.2;

/// The most times that an edge is halved.
const MOST_LEVELS: u32 = 10;

/// Returns the scene with triangles for the lens of `camera`; `None` if its own will do.
pub(super) fn refined(scene: &Scene, camera: &Camera) -> Option<Scene> {
    camera.optics?;
    let eye = camera.eye - scene.origin;
    let view = View { camera, eye };
    let all = &scene.triangles;
    let places = |triangle: usize| all.corners()[triangle].map(|vertex| all.place(vertex as usize));
    let is_bent = |triangle: usize| view.bent(&places(triangle)).contains(&true);
    if !(0..all.len()).into_par_iter().any(is_bent) {
        return None;
    }
    let parts = (0..all.len()).into_par_iter().flat_map_iter(|triangle| {
        let mut parts = Vec::new();
        view.split(all.triangle(triangle), MOST_LEVELS, &mut parts);
        parts.into_iter().map(move |part| (part, triangle as u32))
    });
    let (parts, whole): (Vec<Triangle>, Vec<u32>) = parts.unzip();
    let (triangles, places) = all.with(&parts);
    // Parts keep the names of their faces.
    let mut provenance = scene.provenance.clone();
    let face = |place: u32| scene.provenance.of_triangle(whole[place as usize]);
    provenance.set_faces(places.into_iter().map(face).collect());
    Some(Scene { triangles, provenance, ..scene.clone() })
}

struct View<'a> {
    camera: &'a Camera,
    /// The eye relative to the scene's origin.
    eye: DVec3,
}

impl View<'_> {
    /// Whether each edge (0 to 1, 1 to 2, 2 to 0) has to be halved.
    fn bent(&self, places: &[DVec3; 3]) -> [bool; 3] {
        let seen = places.map(|place| self.camera.rotation * (place - self.eye));
        std::array::from_fn(|k| self.bends(seen[k], seen[(k + 1) % 3]))
    }

    /// Whether the edge between two points of camera space has to be halved.
    fn bends(&self, a: DVec3, b: DVec3) -> bool {
        let images = [a, b].map(|end| self.camera.corner(end));
        let angle = |()| {
            let along = b - a;
            let share = (-a.dot(along) / along.length_squared()).clamp(0.0, 1.0);
            along.length() / (a + along * share).length()
        };
        match images {
            [Some((a_image, a_depth)), Some((b_image, b_depth))] => {
                let Some((middle, depth)) = self.camera.corner(0.5 * (a + b)) else { return true };
                let along = b_image - a_image;
                let length = along.length();
                let is_curved = (middle - a_image).perp_dot(along).abs() > STRAIGHT * length;
                let is_off = (0.5 * (a_depth + b_depth) - depth).abs() > LEVEL * depth;
                length > STRAIGHT && (is_curved || is_off)
            }
            [None, None] => angle(()) > BEYOND,
            _ => angle(()) * self.camera.fx.max(self.camera.fy) > AT_BORDER,
        }
    }

    /// Adds the parts of a triangle of which a corner has an image.
    fn split(&self, triangle: Triangle, levels: u32, parts: &mut Vec<Triangle>) {
        let places = triangle.corners.map(DVec3::from_array);
        let bent = if levels > 0 { self.bent(&places) } else { [false; 3] };
        let mut add = |corners: [Corner; 3]| {
            let part = of_corners(corners, &triangle);
            self.split(part, levels - 1, parts);
        };
        let of = corners(&triangle);
        // The corners from the first edge on that starts a run of halved edges.
        let first = match bent.iter().filter(|bends| **bends).count() {
            0 => {
                let seen = |place: &DVec3| self.camera.corner(self.camera.rotation * (*place - self.eye)).is_some();
                if places.iter().any(seen) {
                    parts.push(triangle);
                }
                return;
            }
            1 => bent.iter().position(|bends| *bends),
            2 => bent.iter().position(|bends| !*bends).map(|whole| whole + 1),
            _ => Some(0),
        };
        let at = |k: usize| of[(first.unwrap_or(0) + k) % 3];
        let [a, b, c] = [at(0), at(1), at(2)];
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        match bent.iter().filter(|bends| **bends).count() {
            1 => [[a, ab, c], [ab, b, c]].into_iter().for_each(&mut add),
            2 => [[ab, b, bc], [a, ab, bc], [a, bc, c]].into_iter().for_each(&mut add),
            _ => [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]].into_iter().for_each(&mut add),
        }
    }
}

/// A corner with its normal, colour and place in a texture.
type Corner = ([f64; 3], [f32; 3], [f32; 4], [f32; 2]);

fn corners(triangle: &Triangle) -> [Corner; 3] {
    let (normals, places) =
        (triangle.normals.unwrap_or_default(), triangle.texture.map_or_else(Default::default, |of| of.1));
    std::array::from_fn(|k| (triangle.corners[k], normals[k], triangle.colors[k], places[k]))
}

fn of_corners(of: [Corner; 3], whole: &Triangle) -> Triangle {
    Triangle {
        corners: of.map(|corner| corner.0),
        normals: whole.normals.map(|_| of.map(|corner| corner.1)),
        colors: of.map(|corner| corner.2),
        texture: whole.texture.map(|(number, _)| (number, of.map(|corner| corner.3))),
    }
}

fn middle(a: Corner, b: Corner) -> Corner {
    let mean = |k: f32, l: f32| 0.5 * k + 0.5 * l;
    (
        std::array::from_fn(|k| 0.5 * (a.0[k] + b.0[k])),
        std::array::from_fn(|k| mean(a.1[k], b.1[k])),
        std::array::from_fn(|k| mean(a.2[k], b.2[k])),
        std::array::from_fn(|k| mean(a.3[k], b.3[k])),
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use glam::DMat3;

    use super::*;
    use crate::scene::{Lens, Triangles};

    /// A wall of two triangles, 4 units wide, at one unit from the eye.
    fn wall() -> Scene {
        let corner = |x: f64, y: f64| [x, y, 1.0];
        let one = |corners: [[f64; 3]; 3]| Triangle {
            corners,
            normals: None,
            colors: [[0.5, 0.5, 0.5, 1.0]; 3],
            texture: None,
        };
        let [a, b, c, d] = [corner(-2.0, -2.0), corner(2.0, -2.0), corner(2.0, 2.0), corner(-2.0, 2.0)];
        Scene { triangles: Triangles::new(&[one([a, b, c]), one([a, c, d])]), ..Scene::default() }
    }

    #[test]
    fn a_wall_is_split_until_its_edges_are_straight_and_keeps_its_area() {
        let camera = |lens| Camera::posed((200, 200), lens, DVec3::ZERO, DMat3::IDENTITY, 0.01).unwrap();
        assert!(refined(&wall(), &camera(Lens::Fov(90.0))).is_none());
        let fisheye = camera(Lens::Fisheye(180.0));
        let fine = refined(&wall(), &fisheye).unwrap().triangles;
        let places = |triangle: usize| fine.corners()[triangle].map(|vertex| fine.place(vertex as usize));
        let view = View { camera: &fisheye, eye: DVec3::ZERO };
        let area = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
        let sum: f64 = (0..fine.len()).map(|triangle| area(places(triangle))).sum();
        assert!((sum - 16.0).abs() < 1e-5 && fine.len() > 100, "{sum} {}", fine.len());
        assert!((0..fine.len()).all(|triangle| !view.bent(&places(triangle)).contains(&true)));
    }
}
