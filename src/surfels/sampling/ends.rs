//! Where the surface ends, at borders and sharp edges, and the lines at which disks end there (Zwicker et al. 2004, *Perspective
//! Accurate Splatting*, section 5).

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

/// How much larger a box of the tree is than its side, in diagonals of the surface: more than the rounding of f32.
const PADDING: f64 = 1e-6;

/// A side that lies farther above or below a disk than so many of its longer half-axes is one of another part of the surface.
const HIGHEST: f64 = 0.5;

/// The cosine of the angle between two triangles past which their common side is an end: 20 degrees.
const EDGE: f64 = 0.939_692_620_785_908_4;

/// The part of how far a disk should stand out past an end by the two triangles there that it must stand out by the whole surface, where
/// it is farthest past it: else the end is one of the roughness that disks do not follow, or of a slit narrower than the disk.
const CONFIRMED: f64 = 0.5;

/// A disk's cell lies so many times nearer to its plane than the disk stands out, or the end is one of that roughness too.
const ROUGH: f64 = 4.0;

/// A side of a triangle past which the surface does not go on.
struct End {
    /// From the one to the other the triangle is on the left, seen from outside. Relative to the surface's centre, world units.
    side: [DVec3; 2],
    /// Of the triangle, unit.
    normal: DVec3,
    /// How far a plane that goes on past it leaves the surface, for each unit: the sine of the angle by which that turns away, and 1
    /// where it turns by more than a right angle, or ends.
    leaves: f64,
}

/// All ends of a surface.
pub(super) struct Ends {
    /// All triangles; none where there are no ends.
    surface: Option<TriangleTree>,
    ends: Vec<End>,
    /// Of each triangle, a number that those have that the surface goes on to without an end between.
    pub patches: Vec<u32>,
    tree: Bvh2,
    padding: f64,
    /// World coordinates of the surface's centre.
    center: DVec3,
    /// How far disks may stand out past them, world units.
    tolerance: f64,
}

/// A disk, and the corners of the cell that it must cover, relative to its centre. World units.
pub(super) struct Covering<'a> {
    pub center: DVec3,
    /// Half-axes, the longer one first; their cross product is along the normal.
    pub axes: [DVec3; 2],
    pub cell: &'a [DVec3],
}

impl Ends {
    /// Vertices at one position are one: many files repeat them where only normals or texture coordinates differ.
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
        // The builder takes no empty list in all of its steps.
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

    /// How far a point is from the surface.
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

    /// The lines that cut most from a disk of what stands out past ends, and nothing from its cell.
    ///
    /// A line runs along an end, or as far outside as the cell's farthest corner beyond it: at an end that bends around the
    /// disk's cell the line through one of its sides would cut off what lies in the cell past the next.
    pub fn clip(&self, disk: &Covering<'_>) -> Clip {
        let [s, t] = disk.axes;
        let normal = s.normalize().cross(t.normalize());
        let (radius, least_radius) = (s.length(), t.length());
        let flat = |d: DVec3| DVec2::new(d.dot(s) / s.length_squared(), d.dot(t) / t.length_squared());
        let rough = disk.cell.iter().map(|corner| corner.dot(normal).abs()).fold(0.0, f64::max);
        let least = self.tolerance.max(ROUGH * rough);
        let cell = hull(disk.cell.iter().map(|corner| flat(*corner)).collect());
        // How far apart two lines of this direction are in the plane whose offsets differ by 1.
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
            // Moved out it leaves out less.
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
    /// The corner that it begins at, and that and the next as numbers of positions.
    place: usize,
    ends: [u32; 2],
}

impl Side {
    fn ordered(&self) -> [u32; 2] {
        let [a, b] = self.ends;
        [a.min(b), a.max(b)]
    }
}

/// How far a plane that goes on past these sides of triangles, which have the same ends, leaves the surface, for each unit; None if
/// they are two between which it goes on.
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
