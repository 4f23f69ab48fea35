//! Triangles for a lens that is no pinhole: edges that it would bend visibly are halved, because
//! edges are drawn straight between the images of their ends.
//!
//! Whether an edge is halved depends on its ends alone, so both triangles of an edge agree and no
//! crack opens. Attributes are linear over a triangle, so halves have the same.
//!
//! A triangle is split until no edge bends, however often that is, but into a limited number of
//! parts ([`MOST_PARTS`]); a note counts the triangles that reach the limit.

use std::collections::VecDeque;

use glam::DVec3;
use rayon::prelude::*;

use crate::scene::{Camera, Form, Optics, Scene, Triangle};

/// The largest distance of a point of an edge from its straight image, pixels.
const STRAIGHT: f64 = 0.25;

/// The largest relative error of the depth of a point of an edge. The depths of its ends are
/// interpolated as those of a pinhole.
const LEVEL: f64 = 1e-3;

/// The largest length of an edge that ends beyond the lens's image, pixels.
const AT_BORDER: f64 = 4.0;

/// The most parts of all triangles together that bend, and the fewest that each of them may have.
const MOST_PARTS: usize = 1 << 21;
const LEAST_PARTS: usize = 64;

/// A scene with triangles for the lens of a camera.
pub(super) struct Refined {
    pub scene: Scene,
    /// The number of triangles that bend although they have as many parts as they may.
    bent: usize,
    /// The number of triangles before they were split.
    all: usize,
}

impl Refined {
    /// Returns a note for users if triangles still bend.
    pub(super) fn note(&self) -> Option<String> {
        let Self { bent, all, .. } = self;
        (*bent > 0).then(|| {
            format!(
                "this lens bends {bent} of {all} triangles so much that {MOST_PARTS} parts do not follow it: \
                 the picture has gaps or wrong depths there"
            )
        })
    }
}

/// Returns the scene with triangles for the lens of `camera`; `None` if its own will do.
pub(super) fn refined(scene: &Scene, camera: &Camera) -> Option<Refined> {
    refined_within(scene, camera, MOST_PARTS)
}

fn refined_within(scene: &Scene, camera: &Camera, most: usize) -> Option<Refined> {
    let optics = camera.optics.as_ref()?;
    // A whole sphere shows no triangles.
    if optics.form == Form::Equirectangular {
        return None;
    }
    let view = View { camera, optics, eye: camera.eye - scene.origin };
    let all = &scene.triangles;
    let places = |triangle: usize| all.corners()[triangle].map(|vertex| all.place(vertex as usize));
    let is_bent = |triangle: &usize| view.cut(&places(*triangle)).contains(&true);
    let bending = (0..all.len()).into_par_iter().filter(is_bent).count();
    if bending == 0 {
        return None;
    }
    let share = (most / bending).max(LEAST_PARTS.min(most));
    let split = |triangle: usize| (view.split(all.triangle(triangle), share), triangle as u32);
    let split: Vec<((Vec<Triangle>, bool), u32)> = (0..all.len()).into_par_iter().map(split).collect();
    let bent = split.iter().filter(|((_, bends), _)| *bends).count();
    let (parts, whole): (Vec<Triangle>, Vec<u32>) =
        split.into_iter().flat_map(|((parts, _), of)| parts.into_iter().map(move |part| (part, of))).unzip();
    let (triangles, places) = all.with(&parts);
    // Parts keep the names of their faces.
    let mut provenance = scene.provenance.clone();
    let face = |place: u32| scene.provenance.of_triangle(whole[place as usize]);
    provenance.set_faces(places.into_iter().map(face).collect());
    Some(Refined { scene: Scene { triangles, provenance, ..scene.clone() }, bent, all: all.len() })
}

struct View<'a> {
    camera: &'a Camera,
    optics: &'a Optics,
    /// The eye relative to the scene's origin.
    eye: DVec3,
}

impl View<'_> {
    fn seen(&self, places: &[DVec3; 3]) -> [DVec3; 3] {
        places.map(|place| self.camera.rotation * (place - self.eye))
    }

    /// Whether all points between points of camera space lie before the near depth. The part of
    /// space before it is convex.
    fn is_before(&self, points: &[DVec3]) -> bool {
        points.iter().all(|point| self.camera.depth(*point) < self.camera.near)
    }

    /// Whether each edge (0 to 1, 1 to 2, 2 to 0) has to be halved. All are if the triangle covers
    /// the image and no edge of it comes near.
    fn cut(&self, places: &[DVec3; 3]) -> [bool; 3] {
        let seen = self.seen(places);
        let bent = std::array::from_fn(|k| self.bends(seen[k], seen[(k + 1) % 3]));
        let unseen = || seen.iter().all(|corner| self.camera.corner(*corner).is_none());
        if bent.contains(&true) || !unseen() || self.is_before(&seen) {
            return bent;
        }
        [is_around_axis(seen); 3]
    }

    /// Whether the edge between two points of camera space has to be halved.
    fn bends(&self, a: DVec3, b: DVec3) -> bool {
        if self.is_before(&[a, b]) {
            return false;
        }
        let images = [a, b].map(|end| self.camera.corner(end));
        let is_long = || {
            let along = b - a;
            let share = (-a.dot(along) / along.length_squared()).clamp(0.0, 1.0);
            let angle = along.length() / (a + along * share).length();
            angle * self.camera.fx.max(self.camera.fy) > AT_BORDER
        };
        let [Some((a_image, a_depth)), Some((b_image, b_depth))] = images else {
            let is_near = images.iter().any(Option::is_some) || self.optics.is_near_segment(a, b);
            return is_near && is_long();
        };
        let along = b_image - a_image;
        let length = along.length();
        // The device interpolates 1 / depth along the straight image. `share` is that of the image.
        let is_off = |share: f64| {
            let there = share * a_depth / ((1.0 - share) * b_depth + share * a_depth);
            let Some((image, depth)) = self.camera.corner(a.lerp(b, there)) else { return true };
            let is_curved = (image - a_image).perp_dot(along).abs() > STRAIGHT * length;
            let share = (image - a_image).dot(along) / along.length_squared();
            let drawn = 1.0 / ((1.0 - share) / a_depth + share / b_depth);
            let is_level = (drawn - depth).abs() <= LEVEL * depth;
            is_curved || !is_level
        };
        length > STRAIGHT && [0.25, 0.5, 0.75].into_iter().any(is_off)
    }

    /// The parts of a triangle of which a corner has an image, at most `most`, and whether some of
    /// them still bend.
    fn split(&self, triangle: Triangle, most: usize) -> (Vec<Triangle>, bool) {
        let (mut parts, mut rest, mut bends) = (Vec::new(), VecDeque::from([triangle]), false);
        // The largest parts come first, so a limit is met by parts of about one size.
        while let Some(part) = rest.pop_front() {
            let places = part.corners.map(DVec3::from_array);
            let cut = self.cut(&places);
            let is_full = parts.len() + rest.len() >= most;
            if cut.contains(&true) && !is_full {
                rest.extend(halves(&part, cut));
                continue;
            }
            bends |= cut.contains(&true);
            if self.seen(&places).iter().any(|corner| self.camera.corner(*corner).is_some()) {
                parts.push(part);
            }
        }
        (parts, bends)
    }
}

/// Whether the axis of the camera, in front of the eye, passes through a triangle of camera space.
fn is_around_axis([a, b, c]: [DVec3; 3]) -> bool {
    let sides = [b.cross(c).z, c.cross(a).z, a.cross(b).z];
    let volume = a.dot(b.cross(c));
    // Comparisons with NaN are false.
    volume != 0.0 && sides.into_iter().all(|side| side * volume > 0.0)
}

/// The parts of a triangle whose edges (0 to 1, 1 to 2, 2 to 0) are halved as `cut` says; at least
/// one is.
fn halves(triangle: &Triangle, cut: [bool; 3]) -> Vec<Triangle> {
    let count = cut.iter().filter(|halved| **halved).count();
    // The corners from the first edge on that starts a run of halved edges.
    let first = match count {
        1 => cut.iter().position(|halved| *halved),
        2 => cut.iter().position(|halved| !*halved).map(|whole| whole + 1),
        _ => None,
    };
    let all = corners(triangle);
    let [a, b, c] = std::array::from_fn(|k| all[(first.unwrap_or(0) + k) % 3]);
    let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
    let parts = match count {
        1 => vec![[a, ab, c], [ab, b, c]],
        2 => vec![[ab, b, bc], [a, ab, bc], [a, bc, c]],
        _ => vec![[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]],
    };
    parts.into_iter().map(|corners| of_corners(corners, triangle)).collect()
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
        let fine = refined(&wall(), &fisheye).unwrap().scene.triangles;
        let places = |triangle: usize| fine.corners()[triangle].map(|vertex| fine.place(vertex as usize));
        let view = View { camera: &fisheye, optics: fisheye.optics.as_ref().unwrap(), eye: DVec3::ZERO };
        let area = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
        let sum: f64 = (0..fine.len()).map(|triangle| area(places(triangle))).sum();
        assert!((sum - 16.0).abs() < 1e-5 && fine.len() > 100, "{sum} {}", fine.len());
        assert!((0..fine.len()).all(|triangle| !view.cut(&places(triangle)).contains(&true)));
    }

    #[test]
    fn triangles_that_no_number_of_parts_straightens_are_counted() {
        let fisheye = Camera::posed((200, 200), Lens::Fisheye(180.0), DVec3::ZERO, DMat3::IDENTITY, 0.01).unwrap();
        let few = refined_within(&wall(), &fisheye, 20).unwrap();
        // Each of the two may have 20 parts, and the last halving makes up to three more.
        assert!(few.scene.triangles.len() <= 46, "{}", few.scene.triangles.len());
        assert!(few.note().unwrap().starts_with("this lens bends 2 of 2 triangles so much that "));
        assert_eq!(refined(&wall(), &fisheye).unwrap().note(), None);
    }

    /// The number of parts grows with the logarithm of a triangle's size, also if it passes through
    /// the eye. A lens that nearly sees the direction behind it needs many more: that direction is
    /// a circle in its image.
    #[test]
    fn the_number_of_parts_is_that_of_what_is_in_view() {
        for lens in [Lens::Fisheye(120.0), Lens::Fisheye(180.0)] {
            let camera = Camera::posed((200, 200), lens, DVec3::ZERO, DMat3::IDENTITY, 0.01).unwrap();
            for height in [1.0, 0.0] {
                let parts = |size: f64| {
                    let corner = |x: f64, z: f64| [x * size, height, z * size];
                    let corners = [corner(-1.0, -1.0), corner(2.0, -0.9), corner(-0.8, 2.0)];
                    let colors = [[0.5, 0.5, 0.5, 1.0]; 3];
                    let triangle = Triangle { corners, normals: None, colors, texture: None };
                    let scene = Scene { triangles: Triangles::new(&[triangle]), ..Scene::default() };
                    let refined = refined(&scene, &camera).unwrap();
                    assert_eq!(refined.note(), None);
                    refined.scene.triangles.len()
                };
                let counts = [10.0, 1e3, 1e5].map(parts);
                eprintln!("{lens:?} at {height}: {counts:?} parts");
                assert!(counts[2] < 4 * counts[0] + 20_000, "{lens:?} at {height}: {counts:?}");
            }
        }
    }
}
