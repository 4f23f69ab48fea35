//! The ends of a surface, at borders and sharp edges, and the clip lines of disks there (Zwicker et
//! al. 2004, *Perspective Accurate Splatting*, section 5).

use std::time::Duration;

use glam::{DVec2, DVec3};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use rayon::prelude::*;

use super::surface::MeshSurface;
use super::voronoi::SIDE;
use crate::error::Result;
use crate::io::closed::distinct;
use crate::scene::Clip;
use crate::sets::Sets;
use crate::surfels::lines::{self, Line, hull, nearest_share};
use crate::surfels::mesh::{MARGIN, TOLERANCE};
use crate::truth::TriangleTree;

/// The margin of a box of the tree around its side, in diagonals of the surface: more than the
/// rounding of f32.
const PADDING: f64 = 1e-6;

/// A side that lies farther above or below a disk than this many of its longer half-axes belongs to
/// another part of the surface.
const HIGHEST: f64 = 0.5;

/// The cosine of 20 degrees: the common side of two triangles at a larger angle is an end.
const EDGE: f64 = 0.939_692_620_785_908_4;

/// A disk's tip past an end must be far enough from the whole surface: at least this fraction of
/// the distance that the end's two triangles predict. Otherwise the end belongs to roughness that
/// disks do not follow, or to a slit narrower than the disk.
const CONFIRMED: f64 = 0.5;

/// A disk must stand out past an end by this many times the largest height of its cell's corners
/// over its plane. Otherwise the end belongs to roughness that disks do not follow.
const ROUGH: f64 = 4.0;

/// A side of a triangle past which the surface does not continue.
struct End {
    /// From the first corner to the second, with the triangle on the left as seen from outside.
    /// Relative to the surface's centre, world units.
    side: [DVec3; 2],
    /// Unit normal of the triangle.
    normal: DVec3,
    /// The distance from the surface that a plane gains per unit of length past this side: the sine
    /// of the angle by which the surface turns away, or 1 where it turns by more than a right
    /// angle, or stops.
    leaves: f64,
}

/// All ends of a surface.
pub(super) struct Ends {
    /// All triangles; None if there are no ends.
    surface: Option<TriangleTree>,
    ends: Vec<End>,
    /// The patch number of each triangle; two triangles have the same number if the surface
    /// continues from one to the other without an end between them.
    pub patches: Vec<u32>,
    tree: Bvh2,
    padding: f64,
    /// The surface's centre, world coordinates.
    center: DVec3,
    /// The distance by which disks may stand out past ends, world units.
    tolerance: f64,
}

/// A disk and the corners of the cell that it must cover, relative to the disk's centre. World
/// units.
pub(super) struct Covering<'a> {
    pub center: DVec3,
    /// Half-axes, the longer one first; s x t is along the normal.
    pub axes: [DVec3; 2],
    pub cell: &'a [DVec3],
}

impl Ends {
    /// Finds the ends of a surface. Vertices at one position are merged, as many files repeat a
    /// vertex where only its normals or texture coordinates differ.
    pub fn new(surface: &MeshSurface<'_>) -> Result<Self> {
        let vertices = distinct(&surface.mesh.positions);
        let mut sides: Vec<Side> = Vec::with_capacity(3 * surface.triangles.len());
        for (triangle, facet) in (0u32..).zip(&surface.triangles) {
            let corners = surface.mesh.triangles[facet.index].map(|corner| vertices[corner as usize]);
            sides.extend([0, 1, 2].map(|place| Side {
                triangle,
                place,
                ends: [corners[place], corners[(place + 1) % 3]],
            }));
        }
        sides.par_sort_unstable_by_key(|side| (side.ordered(), side.triangle, side.place));
        let facet = |side: &Side| &surface.triangles[side.triangle as usize];
        let (mut patches, mut ends) = (Sets::new(surface.triangles.len()), Vec::new());
        for sides in sides.chunk_by(|a, b| a.ordered() == b.ordered()) {
            match leaves(sides, |side| facet(side).normal) {
                None => sides.iter().for_each(|side| patches.unite(sides[0].triangle, side.triangle)),
                Some(leaves) => ends.extend(sides.iter().map(|side| {
                    let corners = [side.place, side.place + 1].map(|place| facet(side).corners[place % 3]);
                    End { side: corners, normal: facet(side).normal, leaves }
                })),
            }
        }
        let diagonal = surface.bounds.extent().length();
        let padding = PADDING * diagonal;
        let boxes: Vec<Aabb> = ends.iter().map(|end| around(&end.side, padding)).collect();
        // Not every step of the builder accepts an empty list.
        let tree = match boxes.is_empty() {
            true => Bvh2::default(),
            false => build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Duration::default()),
        };
        Ok(Self {
            patches: patches.all(),
            surface: if ends.is_empty() { None } else { Some(TriangleTree::new(surface.mesh)?) },
            center: surface.center,
            ends,
            tree,
            padding,
            tolerance: TOLERANCE * diagonal,
        })
    }

    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Whether any end is near enough to the disk to cut it.
    pub fn are_near(&self, center: DVec3, radius: f64) -> bool {
        !self.near(center, radius).is_empty()
    }

    /// The distance of a point from the surface, world units.
    fn distance(&self, point: DVec3) -> f64 {
        self.surface.as_ref().map_or(0.0, |surface| surface.distance(self.center + point))
    }

    fn near(&self, center: DVec3, radius: f64) -> Vec<&End> {
        let mut found = Vec::new();
        self.tree.aabb_traverse(around(&[center - radius, center + radius], self.padding), |tree, node| {
            let node = &tree.nodes[node as usize];
            let entries = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            found.extend(tree.primitive_indices[entries].iter().map(|end| &self.ends[*end as usize]));
            true
        });
        found
    }

    /// The clip lines that remove most of the disk's area past ends, and nothing of its cell.
    ///
    /// A line runs along an end, or farther out where the cell's corners reach beyond the end.
    /// Where an end bends around the cell, a line along one of its sides would cut off the part of
    /// the cell past the next side.
    pub fn clip(&self, disk: &Covering<'_>) -> Clip {
        let [s, t] = disk.axes;
        let normal = s.normalize().cross(t.normalize());
        let (radius, least_radius) = (s.length(), t.length());
        let flat = |d: DVec3| DVec2::new(d.dot(s) / s.length_squared(), d.dot(t) / t.length_squared());
        let rough = disk.cell.iter().map(|corner| corner.dot(normal).abs()).fold(0.0, f64::max);
        let least = self.tolerance.max(ROUGH * rough);
        let cell = hull(disk.cell.iter().map(|corner| flat(*corner)).collect());
        // The distance in the plane between two lines of this direction whose offsets differ by 1.
        let across = |line: &Line| 1.0 / DVec2::new(line.inward.x / radius, line.inward.y / least_radius).length();
        let past = |line: &Line, leaves: f64| (1.0 + line.offset) * across(line) * leaves;
        let line = |end: &End| {
            let [from, to] = end.side.map(|corner| corner - disk.center);
            let (p, q) = (flat(from), flat(to));
            let nearest = nearest_share(p, q);
            let is_near =
                p.lerp(q, nearest).length() < 1.0 && from.lerp(to, nearest).dot(normal).abs() <= HIGHEST * radius;
            if !is_near || end.normal.dot(normal) <= SIDE {
                return None;
            }
            // A line that is moved outward cuts off less, so this test can reject it early.
            let line = Line::through(p, q).filter(|line| past(line, end.leaves) > least)?;
            let margin = (MARGIN * least_radius + rough) / across(&line);
            let line = line.keeping(&cell, margin);
            (past(&line, end.leaves) > least).then_some((line, end.leaves))
        };
        let mut lines = lines::apart(self.near(disk.center, radius).into_iter().filter_map(line).collect());
        lines.retain(|(line, leaves)| {
            let farthest = disk.center - (s * line.inward.x + t * line.inward.y);
            self.distance(farthest) > CONFIRMED * past(line, *leaves)
        });
        lines::clip(lines.into_iter().map(|(line, _)| line).collect())
    }
}

/// A side of a triangle.
struct Side {
    triangle: u32,
    /// The corner that it starts at, 0 to 2; `ends` has the position numbers of that corner and the
    /// next.
    place: usize,
    ends: [u32; 2],
}

impl Side {
    fn ordered(&self) -> [u32; 2] {
        let [a, b] = self.ends;
        [a.min(b), a.max(b)]
    }
}

/// The distance from the surface that a plane gains per unit of length past these sides of
/// triangles, which have the same end points. None if there are two sides and the surface continues
/// from one triangle to the other.
fn leaves(sides: &[Side], normal: impl Fn(&Side) -> DVec3) -> Option<f64> {
    let [one, other] = sides else { return Some(1.0) };
    if one.ends == other.ends {
        return Some(1.0);
    }
    let cosine = normal(one).dot(normal(other));
    (cosine <= EDGE).then(|| if cosine > 0.0 { (1.0 - cosine * cosine).sqrt() } else { 1.0 })
}

fn around(corners: &[DVec3; 2], padding: f64) -> Aabb {
    let corner = |at: DVec3| at.as_vec3a();
    Aabb::new(corner(corners[0].min(corners[1]) - padding), corner(corners[0].max(corners[1]) + padding))
}
