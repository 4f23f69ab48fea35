//! Conversion of a mesh's vertices to points: normals and radii from the triangles around them.

use glam::{DVec3, Vec3};

use super::closed::is_closed;
use super::points::Faces;
use super::{Paint, Points};

/// Factor on the covering radius, because a blending kernel fades towards its rim.
const OVERLAP: f64 = 1.1;

/// Sums of normals and largest radii over the triangles around each vertex.
#[derive(Debug)]
pub(super) struct Triangles<'a> {
    positions: &'a [[f64; 3]],
    normals: Vec<DVec3>,
    radii: Vec<f64>,
    /// Whether a corner has a normal that points to its triangle's back.
    backward: bool,
}

impl<'a> Triangles<'a> {
    pub(super) fn new(positions: &'a [[f64; 3]]) -> Self {
        Self {
            positions,
            normals: vec![DVec3::ZERO; positions.len()],
            radii: vec![0.0; positions.len()],
            backward: false,
        }
    }

    /// Adds a triangle, given by its vertex indices. `named` are the normals that the file gives
    /// its corners, if it gives any.
    pub(super) fn add(&mut self, corners: [usize; 3], named: Option<[Option<[f64; 3]>; 3]>) {
        let [Some(a), Some(b), Some(c)] = corners.map(|corner| self.positions.get(corner).copied().map(DVec3::from))
        else {
            return;
        };
        // The length of this normal is twice the triangle's area, so triangles count by their area.
        let area_normal = (b - a).cross(c - a);
        let radius = covering_radius(a, b, c);
        for (index, corner) in corners.into_iter().enumerate() {
            let normal = match named {
                Some(named) => named[index].map_or(DVec3::ZERO, |normal| DVec3::from(normal).normalize_or_zero()),
                None => area_normal,
            };
            self.backward |= normal.dot(area_normal) < 0.0;
            if normal.is_finite() {
                self.normals[corner] += normal;
            }
            if let Some(radius) = radius {
                self.radii[corner] = self.radii[corner].max(radius);
            }
        }
    }

    /// Whether all given corner normals are on the front side of their triangles.
    pub(super) fn face_as_named(&self) -> bool {
        !self.backward
    }

    /// Returns the unit normal and the radius in world units of each vertex; zero if it has none.
    pub(super) fn finish(self) -> (Vec<[f32; 3]>, Vec<f32>) {
        let unit = |normal: DVec3| normal.normalize_or_zero().as_vec3().to_array();
        (
            self.normals.into_iter().map(unit).collect(),
            self.radii.into_iter().map(|radius| (OVERLAP * radius) as f32).collect(),
        )
    }
}

/// Makes `points` the vertices of a mesh with these triangles, colours and images. Vertices without
/// normals or radii get them from their triangles; corners have the normals that vertices have in
/// the file.
pub(super) fn give_faces(points: &mut Points, triangles: Vec<[u32; 3]>, paint: Option<Box<Paint>>) {
    let mut around = Triangles::new(&points.positions);
    triangles.iter().for_each(|corners| around.add(corners.map(|corner| corner as usize), None));
    let (normals, radii) = around.finish();
    let closed = is_closed(&points.positions, &triangles);
    points.closed = closed && points.normals.as_ref().is_none_or(|given| agree(given, &normals));
    let named = points.normals.as_ref().map(|given| corners(&triangles, given));
    points.normals.get_or_insert(normals);
    points.of_mesh = points.radii.is_none() && points.axes.is_none();
    points.radii.get_or_insert(radii);
    points.faces = Some(Faces { triangles, normals: named, paint });
}

/// The attribute of the vertex at each corner of the triangles.
pub(super) fn corners<T: Copy>(triangles: &[[u32; 3]], of_vertices: &[T]) -> Vec<[T; 3]> {
    triangles.iter().map(|corners| corners.map(|vertex| of_vertices[vertex as usize])).collect()
}

/// Whether each normal of `given` points to the same side as the vertex normal in `triangles`. A
/// zero normal agrees with both sides.
fn agree(given: &[[f32; 3]], triangles: &[[f32; 3]]) -> bool {
    let side = |(a, b): (&[f32; 3], &[f32; 3])| Vec3::from_array(*a).dot(Vec3::from_array(*b));
    given.iter().zip(triangles).map(side).all(|side| side >= 0.0)
}

/// The smallest radius with which disks at the three corners cover the triangle, world units. None
/// for a triangle without area.
///
/// In an acute triangle, the last point to be covered is the circumcentre. In a triangle that is
/// obtuse at C, the circumcentre lies outside. The last points to be covered are then on the
/// longest side, where the bisectors of the sides at C cross it: at distance b / (2 cos A) from A
/// and a / (2 cos B) from B.
pub(crate) fn covering_radius(p: DVec3, q: DVec3, r: DVec3) -> Option<f64> {
    let double_area = (q - p).cross(r - p).length();
    let mut sides = [p.distance(q), q.distance(r), r.distance(p)];
    sides.sort_by(f64::total_cmp);
    let [a, b, c] = sides;
    let radius = if a * a + b * b > c * c {
        a * b * c / (2.0 * double_area)
    } else {
        // By the law of cosines, 2 b c cos A = b² + c² - a².
        let at_a = b * b * c / (b * b + c * c - a * a);
        let at_b = a * a * c / (a * a + c * c - b * b);
        at_a.max(at_b)
    };
    (double_area > 0.0 && radius.is_finite() && radius > 0.0).then_some(radius)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    /// The largest distance of a point of the triangle from its nearest corner, by sampling.
    fn sampled(corners: [DVec3; 3]) -> f64 {
        let [a, b, c] = corners;
        let n = 400;
        let mut largest: f64 = 0.0;
        for i in 0..=n {
            for j in 0..=n - i {
                let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                let point = a + (b - a) * u + (c - a) * v;
                largest =
                    largest.max(corners.map(|corner| corner.distance(point)).into_iter().fold(f64::MAX, f64::min));
            }
        }
        largest
    }

    #[test]
    fn disks_of_the_covering_radius_just_cover() {
        let cases = [
            ([0.0, 0.0], [1.0, 0.0], [0.5, 0.8]),  // acute
            ([0.0, 0.0], [4.0, 0.0], [0.0, 3.0]),  // right
            ([0.0, 0.0], [5.0, 0.0], [2.0, 0.4]),  // obtuse
            ([0.0, 0.0], [5.0, 0.0], [-1.0, 0.3]), // obtuse, another corner
            ([0.0, 0.0], [5.0, 0.0], [4.9, 0.2]),
        ];
        for (a, b, c) in cases {
            let corners = [a, b, c].map(|[x, y]: [f64; 2]| DVec3::new(x, y, 2.0));
            let (radius, sampled) = (covering_radius(corners[0], corners[1], corners[2]).unwrap(), sampled(corners));
            assert!((radius - sampled).abs() < 0.01 * radius, "{radius} for {sampled} of {corners:?}");
        }
    }

    #[test]
    fn triangles_without_area_have_no_radius() {
        let (o, x, nan) = (DVec3::ZERO, DVec3::X, DVec3::NAN);
        for (a, b, c) in [(o, o, o), (o, x, x), (o, x, 2.0 * x), (o, x, nan), (o, x, DVec3::INFINITY)] {
            assert_eq!(covering_radius(a, b, c), None, "{a} {b} {c}");
        }
    }
}
