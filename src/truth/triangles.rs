//! Ray casting of triangle meshes.
//!
//! The mesh is translated and scaled into the unit ball. A tree of f32 boxes (the crate obvhs)
//! finds candidates: boxes are padded by more than the rounding of its ray test, so no candidate is
//! missed. Each candidate is then decided in f64 with the edge functions of Woop, Benthin and Wald
//! 2013, in coordinates across the ray. Two triangles compute their common edge from the same two
//! points, so no ray slips between them.

use std::time::Duration;

use glam::{DVec2, DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::{Ray, RayHit};

use super::Hit;
use super::nearest::{nearest, triangle_squared_distance};
use crate::error::Result;
use crate::io::{Material, Mesh};
use crate::scene::{Bounds, CUT};
use crate::surfels::LARGEST_COORDINATE;

/// The padding of each box, in radii of the mesh. A ray starts within 2 radii of the centre and is
/// followed for 3 radii, so its f32 origin, direction and box distances err by less than 2e-6 of a
/// radius.
pub(super) const PADDING: f32 = 8e-6;

/// The distance from a ray's f32 start to its point nearest to the mesh's centre, radii.
const STAND_OFF: f64 = 2.0;

/// The triangles of a mesh in a bounding volume hierarchy.
#[derive(Clone)]
pub struct TriangleTree {
    tree: Bvh2,
    triangles: Vec<Triangle>,
    /// The centre of the mesh's bounding box, world coordinates.
    center: DVec3,
    /// Half the diagonal of that box, world units.
    radius: f64,
    /// The mesh without positions and normals, for its colours.
    paint: Box<Mesh>,
    /// The least alpha that shows of the image of each material; 0 if all of it does.
    least_alphas: Vec<f32>,
}

/// A triangle that has an area.
#[derive(Clone, Debug)]
struct Triangle {
    /// In units of the mesh's radius, relative to its centre.
    corners: [DVec3; 3],
    /// Unit normal of the triangle's plane.
    normal: DVec3,
    /// Unit normals of the corners; zero where missing.
    normals: [DVec3; 3],
    /// The triangle's index in the mesh.
    index: usize,
}

impl TriangleTree {
    /// Builds the tree. It leaves out triangles that no ray meets: those without an area, or with a
    /// coordinate that is not finite or exceeds [`LARGEST_COORDINATE`].
    ///
    /// # Errors
    ///
    /// As [`Mesh::check`].
    pub fn new(mesh: &Mesh) -> Result<Self> {
        mesh.check()?;
        let corner = |vertex: u32| DVec3::from(mesh.positions[vertex as usize]);
        let finite = |triangle: &[u32; 3]| {
            triangle.iter().all(|&vertex| corner(vertex).abs().cmple(DVec3::splat(LARGEST_COORDINATE)).all())
        };
        let used = mesh.triangles.iter().filter(|triangle| finite(triangle)).flatten();
        let bounds = used.fold(Bounds::EMPTY, |bounds, &vertex| bounds.with_point(corner(vertex)));
        let (center, radius) = (bounds.center(), 0.5 * bounds.extent().length());
        let mut triangles = Vec::new();
        for (index, vertices) in mesh.triangles.iter().enumerate().filter(|(_, triangle)| finite(triangle)) {
            let corners = vertices.map(|vertex| (corner(vertex) - center) / radius);
            let [a, b, c] = corners;
            let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
            let unit = |n: [f32; 3]| DVec3::from(n.map(f64::from)).normalize_or_zero();
            let normals = mesh.normals.as_ref().map_or([DVec3::ZERO; 3], |normals| normals[index].map(unit));
            triangles.push(Triangle { corners, normal, normals, index });
        }
        let boxes: Vec<Aabb> = triangles.iter().map(padded_box).collect();
        // Not every step of the builder accepts an empty list.
        let tree = if boxes.is_empty() {
            Bvh2::default()
        } else {
            build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Duration::default())
        };
        let paint = Mesh {
            triangles: mesh.triangles.clone(),
            colors: mesh.colors.clone(),
            face_colors: mesh.face_colors.clone(),
            texture: mesh.texture.clone(),
            materials: mesh.materials.clone(),
            material: mesh.material.clone(),
            ..Mesh::default()
        };
        let of_material = |material: &Material| material.texture.as_ref().map_or(0.0, |image| image.least_alpha());
        let least_alphas = mesh.materials.iter().map(of_material).collect();
        Ok(Self { tree, triangles, center, radius, paint: Box::new(paint), least_alphas })
    }

    /// The centre of the mesh's bounding box, world coordinates.
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// Half the diagonal of the mesh's bounding box, world units; 0 for an empty mesh.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The number of triangles that have an area.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether no triangle has an area.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// The distance of `point` from the nearest triangle, world units; +inf if there is none.
    pub fn distance(&self, point: DVec3) -> f64 {
        let point = (point - self.center) / self.radius;
        let squared = |index: usize| triangle_squared_distance(point, &self.triangles[index].corners);
        nearest(&self.tree, point, squared).0.sqrt() * self.radius
    }

    /// The first intersection at a distance greater than `beyond`; see
    /// [`Surface::first_hit`](super::Surface::first_hit).
    pub(crate) fn first_hit(&self, start: DVec3, direction: DVec3, beyond: f64) -> Option<Hit> {
        let line = Line::new((start - self.center) / self.radius, direction)?;
        let along = |distance: f64| distance * direction.length() / self.radius - line.shift;
        let after = along(beyond);
        let f32_start = line.nearest - line.direction * STAND_OFF;
        let ray = Ray::new_inf(f32_start.as_vec3().into(), line.direction.as_vec3().into());
        let mut first: Option<(f64, usize, DVec3)> = None;
        self.tree.ray_traverse(ray, &mut RayHit::none(), |_, entry| {
            let index = self.tree.primitive_indices[entry] as usize;
            let Some((t, weights)) = line.meets(&self.triangles[index].corners) else { return f32::INFINITY };
            if !self.shows(index, weights) || t <= after || first.is_some_and(|(nearest, ..)| t >= nearest) {
                return f32::INFINITY;
            }
            first = Some((t, index, weights));
            // The padding of the boxes exceeds this rounding, so no nearer triangle is missed.
            (t + STAND_OFF) as f32
        });
        let (t, index, weights) = first?;
        let triangle = &self.triangles[index];
        let mut color = self.paint.color_at(triangle.index, weights);
        if self.least_alpha(triangle.index) == CUT {
            // A cut-out is opaque where it shows.
            color[3] = self.paint.material_of(triangle.index).map_or(1.0, |material| material.diffuse[3]);
        }
        Some(Hit {
            distance: (t + line.shift) * self.radius / direction.length(),
            normal: triangle.normal_at(weights),
            facet: triangle.normal,
            color,
        })
    }

    /// The least alpha that shows of the image of the mesh's triangle with this index.
    fn least_alpha(&self, index: usize) -> f32 {
        let material = self.paint.material.as_ref().and_then(|of| of.get(index));
        material.and_then(|of| self.least_alphas.get(*of as usize)).copied().unwrap_or(0.0)
    }

    /// Whether a triangle is there at the point with these weights: not where its image is
    /// transparent.
    fn shows(&self, triangle: usize, weights: DVec3) -> bool {
        let index = self.triangles[triangle].index;
        let least = self.least_alpha(index);
        least == 0.0 || self.paint.image_at(index, weights).is_none_or(|texel| texel[3] >= least)
    }
}

fn padded_box(triangle: &Triangle) -> Aabb {
    let points = triangle.corners.map(|corner| Vec3A::from(corner.as_vec3()));
    let tight = Aabb::from_points(&points);
    Aabb::new(tight.min - PADDING, tight.max + PADDING)
}

impl Triangle {
    /// The interpolated normal of the corners, or that of the plane if corner normals are missing
    /// or cancel.
    fn normal_at(&self, weights: DVec3) -> DVec3 {
        let [a, b, c] = self.normals;
        (a * weights.x + b * weights.y + c * weights.z).try_normalize().unwrap_or(self.normal)
    }
}

/// The line of a ray, in units of the mesh's radius, relative to its centre.
struct Line {
    /// The line's point nearest to the centre. Intersections are computed from this point, so that
    /// with a distant eye only the distance loses digits.
    nearest: DVec3,
    /// The unit direction.
    direction: DVec3,
    /// The distance from the ray's start to `nearest`.
    shift: f64,
    /// Two unit directions perpendicular to the line and to each other.
    across: [DVec3; 2],
}

impl Line {
    /// Creates the line of a ray; None if it cannot meet the unit ball.
    fn new(start: DVec3, direction: DVec3) -> Option<Self> {
        let direction = direction.try_normalize()?;
        let shift = -start.dot(direction);
        let nearest = start + direction * shift;
        // The corners of the bounding box may lie on the ball.
        let reaches = nearest.length_squared() <= 1.0 + 1e-6;
        let (right, down) = direction.any_orthonormal_pair();
        reaches.then_some(Self { nearest, direction, shift, across: [right, down] })
    }

    /// The intersection with a triangle: its distance from `nearest`, and the weights of the
    /// corners.
    fn meets(&self, corners: &[DVec3; 3]) -> Option<(f64, DVec3)> {
        let corners = corners.map(|corner| corner - self.nearest);
        let [a, b, c] = corners.map(|corner| DVec2::new(corner.dot(self.across[0]), corner.dot(self.across[1])));
        let edges = DVec3::new(b.perp_dot(c), c.perp_dot(a), a.perp_dot(b));
        let inside = edges.cmpge(DVec3::ZERO).all() || edges.cmple(DVec3::ZERO).all();
        let sum = edges.element_sum();
        if !inside || sum == 0.0 {
            return None;
        }
        let weights = edges / sum;
        let [a, b, c] = corners.map(|corner| corner.dot(self.direction));
        Some((weights.dot(DVec3::new(a, b, c)), weights))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Vectors with components in [-1, 1): the fractional parts of multiples of square roots.
    fn vectors(root: f64) -> impl Iterator<Item = DVec3> {
        let number = move |k: u32| 2.0 * (f64::from(k) * root.sqrt()).fract() - 1.0;
        (1..).map(move |k| DVec3::new(number(7 * k), number(7 * k + 3), number(11 * k + 5)))
    }

    #[test]
    fn the_tree_finds_what_looking_at_every_triangle_finds() {
        // Large triangles and some below the rounding of f32, intersecting each other; some are
        // flat along an axis, so that their boxes have no thickness.
        let (at, across) = (vectors(2.0), vectors(3.0));
        let mut mesh = Mesh::default();
        for (k, (at, across)) in at.zip(across).take(400).enumerate() {
            let size = [1.0, 0.1, 1e-4, 1e-7][k % 4];
            let turned = DVec3::new(across.y, -across.z, across.x);
            let flat = if k % 3 == 0 { DVec3::new(1.0, 1.0, 0.0) } else { DVec3::ONE };
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([at, at + size * across * flat, at + size * turned * flat].map(|p| p.to_array()));
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        let tree = TriangleTree::new(&mesh).unwrap();
        assert_eq!((tree.len(), tree.is_empty()), (400, false));
        let mut met = 0;
        for (k, target) in vectors(7.0).take(4000).enumerate() {
            // A third of the rays run along an axis, as for an orthographic camera, another third
            // to the middle of a triangle.
            let triangle = mesh.triangles[k % 400].map(|vertex| DVec3::from(mesh.positions[vertex as usize]));
            let middle = triangle.iter().sum::<DVec3>() / 3.0;
            let eye = if k % 5 == 0 { DVec3::new(1e5, 2e5, -1e5) } else { 4.0 * vectors(5.0).nth(k % 50).unwrap() };
            let (start, direction) = match k % 3 {
                0 => (middle - 3.0 * DVec3::AXES[k % 9 / 3], DVec3::AXES[k % 9 / 3]),
                1 => (eye, middle - eye),
                _ => (eye, target - eye),
            };
            let mut beyond = 0.0;
            for _ in 0..3 {
                let line = Line::new((start - tree.center) / tree.radius, direction);
                let distance = |t: f64, shift: f64| (t + shift) * tree.radius / direction.length();
                let hits = line.iter().flat_map(|line| {
                    let all = tree.triangles.iter().filter_map(|triangle| line.meets(&triangle.corners));
                    all.map(|(t, _)| distance(t, line.shift))
                });
                let expected = hits.filter(|&t| t > beyond).fold(f64::INFINITY, f64::min);
                let found = tree.first_hit(start, direction, beyond).map_or(f64::INFINITY, |hit| hit.distance);
                assert_eq!(found, expected, "ray {k}");
                if !found.is_finite() {
                    break;
                }
                met += 1;
                beyond = found * (1.0 + 1e-12);
            }
        }
        assert!(met > 5000, "{met}");
    }
}
