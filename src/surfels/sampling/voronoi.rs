//! The part of the surface that is nearest to each sample, exactly: the Voronoi diagram of the samples, restricted to the
//! triangles (Yan et al. 2009, "Isotropic remeshing with fast and exact computation of restricted Voronoi diagram").
//!
//! In a triangle the cell of a sample is a convex polygon: the triangle, cut by planes halfway to other samples. From one cell
//! the next are those across the cuts.
//!
//! Where a surface has a sharp edge, or is thin, the nearest sample may be one of another side, whose disk is seen edge-on from
//! where the triangle is seen best: however large, it covers nothing there. So a triangle is shared among the samples of its own
//! side alone, and of those to which the surface goes on from it without an edge, as long as there are some near enough.

use std::collections::HashSet;

use glam::DVec3;
use rayon::prelude::*;

use super::surface::{Facet, MeshSurface};
use crate::progress::Progress;
use crate::surfels::graph::NeighbourGraph;
use crate::surfels::neighbours::{Neighbour, NeighbourSearch};
use crate::surfels::positions::DistinctPositions;

/// Neighbours that a cell is cut by at first, and among which a sample of a triangle's own side mostly is. All that matter are
/// among them unless a triangle reaches far past the samples around, or these are spaced unevenly.
const NEIGHBOURS: usize = 16;

/// The same at the tip of a sharp corner, where samples of all sides crowd: one of its own side is among so many,
const MANY: usize = 64;

/// and at most so many times as far as the last of those. Others are of another part of the surface.
const FARTHER: f64 = 1.5;

/// A sample must be nearer by this part of the distance to cut off a corner: rounding decides nothing.
const NEARER: f64 = 1e-9;

/// The cosine of the angle between two triangles up to which they are on one side of the surface: 55 degrees, more than there is
/// between neighbours on a scan that is rough, less than at the edges of regular bodies.
pub(super) const SIDE: f64 = 0.5736;

/// The samples, and what their cells are cut out with.
pub(super) struct Voronoi<'a> {
    surface: &'a MeshSurface<'a>,
    distinct: &'a DistinctPositions,
    /// The triangle that each position lies in.
    triangles: &'a [u32],
    /// Of each triangle, which others the surface goes on to.
    patches: &'a [u32],
    graph: NeighbourGraph,
    one: NeighbourSearch<'a>,
    several: NeighbourSearch<'a>,
    many: NeighbourSearch<'a>,
}

impl<'a> Voronoi<'a> {
    pub fn new(
        surface: &'a MeshSurface<'a>,
        distinct: &'a DistinctPositions,
        triangles: &'a [u32],
        patches: &'a [u32],
        progress: &dyn Progress,
    ) -> Self {
        let graph = NeighbourGraph::new(distinct, NEIGHBOURS, progress);
        let [one, several, many] = [1, NEIGHBOURS, MANY].map(|count| NeighbourSearch::new(distinct, count));
        Self { surface, distinct, triangles, patches, graph, one, several, many }
    }

    /// Where a sample is, world units relative to the surface's centre.
    pub fn position(&self, sample: u32) -> DVec3 {
        self.distinct.position(sample) / self.scale()
    }

    /// Scaled units for each of the world's.
    pub fn scale(&self) -> f64 {
        self.distinct.scale()
    }

    /// Whether a triangle is on the side of the surface that a sample is on.
    pub fn is_of_side(&self, sample: u32, triangle: &Facet) -> bool {
        self.facet(sample).dot(triangle.normal) > SIDE
    }

    /// The unit normal of the triangle that a sample lies in.
    pub fn facet(&self, sample: u32) -> DVec3 {
        self.surface.triangles[self.triangles[sample as usize] as usize].normal
    }

    /// What `measure` says of each part of a cell, and whose cell that is; in the order of triangles. A part lies in one triangle
    /// and is told by its corners relative to the sample, scaled units.
    pub fn measure<T: Send>(
        &self,
        progress: &dyn Progress,
        measure: impl Fn(u32, &Facet, &[DVec3]) -> T + Sync,
    ) -> Vec<(u32, T)> {
        progress.begin("measuring cells", self.surface.triangles.len() as u64);
        let in_triangle = |scratch: &mut Scratch, (index, triangle): (usize, &Facet)| {
            progress.advance(1);
            let patch = self.patches[index];
            let on_patch = |sample: u32| self.patches[self.triangles[sample as usize] as usize] == patch;
            let of_side = |sample: u32| self.is_of_side(sample, triangle);
            let near = [&self.one, &self.several];
            let parts = self.parts(triangle, |sample| on_patch(sample) && of_side(sample), &near, scratch);
            let parts =
                parts.or_else(|| self.parts(triangle, of_side, &[&self.one, &self.several, &self.many], scratch));
            let parts = parts.or_else(|| self.parts(triangle, |_| true, &near, scratch)).unwrap_or_default();
            let measured = |(sample, mut corners): (u32, Vec<DVec3>)| {
                corners.iter_mut().for_each(|corner| *corner -= self.distinct.position(sample));
                (sample, measure(sample, triangle, &corners))
            };
            parts.into_iter().map(measured).collect::<Vec<_>>()
        };
        let measured = self.surface.triangles.par_iter().enumerate().map_init(Scratch::default, in_triangle);
        let measured = measured.flatten_iter().collect();
        progress.end();
        measured
    }

    /// The parts of a triangle that are nearest to each of those samples that may have some. None where there is no such
    /// sample among the nearest ones.
    fn parts(
        &self,
        triangle: &Facet,
        may: impl Fn(u32) -> bool,
        searches: &[&NeighbourSearch<'_>],
        Scratch { found, seen, open }: &mut Scratch,
    ) -> Option<Vec<(u32, Vec<DVec3>)>> {
        let corners = triangle.corners.map(|corner| corner * self.distinct.scale());
        let mut nearest_to = |at: DVec3| {
            let mut farthest = f64::INFINITY;
            for search in searches {
                search.nearest_to(at, found);
                if let Some(nearest) = found.iter().find(|neighbour| may(neighbour.index)) {
                    return (nearest.squared_distance <= farthest).then_some(nearest.index);
                }
                if let [_, .., last] = found.as_slice() {
                    farthest = last.squared_distance * FARTHER * FARTHER;
                }
            }
            None
        };
        let mut parts = Vec::new();
        seen.clear();
        open.clear();
        open.push(nearest_to((corners[0] + corners[1] + corners[2]) / 3.0)?);
        seen.extend(&*open);
        while let Some(sample) = open.pop() {
            let center = self.distinct.position(sample);
            let mut cell = Polygon { corners: corners.to_vec(), cut_by: vec![None; 3] };
            let mut is_whole = false;
            for &other in self.graph.of(sample) {
                let position = self.distinct.position(other);
                // What lies twice as far as the farthest corner, or farther, is not nearer to any.
                is_whole = position.distance(center) >= 2.0 * cell.reach(center);
                if is_whole || cell.corners.is_empty() {
                    break;
                }
                if may(other) {
                    cell.cut(center, position, other);
                }
            }
            // All corners of a convex polygon are in a convex cell where the polygon is.
            while !is_whole && !cell.corners.is_empty() {
                let mut beyond = None;
                for &corner in &cell.corners {
                    let other = nearest_to(corner)?;
                    let distance = self.distinct.position(other).distance(corner);
                    if other != sample && distance < corner.distance(center) * (1.0 - NEARER) {
                        beyond = Some(other);
                        break;
                    }
                }
                // A cut that rounding makes none is none.
                is_whole = !beyond.is_some_and(|other| cell.cut(center, self.distinct.position(other), other));
            }
            open.extend(cell.cut_by.iter().flatten().filter(|other| seen.insert(**other)));
            parts.push((sample, cell.corners));
        }
        Some(parts)
    }
}

/// What one triangle after the other is cut in.
#[derive(Default)]
struct Scratch {
    found: Vec<Neighbour>,
    /// The samples whose cells were cut out, or shall be.
    seen: HashSet<u32>,
    open: Vec<u32>,
}

/// A convex polygon in a triangle's plane.
struct Polygon {
    corners: Vec<DVec3>,
    /// Of the edge from the corner of the same index to the next: the sample beyond it. None for the triangle's own.
    cut_by: Vec<Option<u32>>,
}

impl Polygon {
    /// The distance of the farthest corner.
    fn reach(&self, center: DVec3) -> f64 {
        self.corners.iter().map(|corner| corner.distance(center)).fold(0.0, f64::max)
    }

    /// Keeps what is nearer to `center` than to `position`, where the sample `other` is. Tells whether that is less.
    fn cut(&mut self, center: DVec3, position: DVec3, other: u32) -> bool {
        let (middle, across) = (0.5 * (center + position), position - center);
        let beyond: Vec<f64> = self.corners.iter().map(|corner| (corner - middle).dot(across)).collect();
        if beyond.iter().all(|beyond| *beyond <= 0.0) {
            return false;
        }
        let count = self.corners.len();
        let (mut corners, mut cut_by) = (Vec::with_capacity(count + 1), Vec::with_capacity(count + 1));
        for k in 0..count {
            let next = (k + 1) % count;
            let (a, b) = (beyond[k], beyond[next]);
            let crossing = || self.corners[k] + (self.corners[next] - self.corners[k]) * (a / (a - b));
            if a <= 0.0 {
                corners.push(self.corners[k]);
                cut_by.push(self.cut_by[k]);
                if b > 0.0 {
                    corners.push(crossing());
                    cut_by.push(Some(other));
                }
            } else if b <= 0.0 {
                corners.push(crossing());
                cut_by.push(self.cut_by[k]);
            }
        }
        *self = Self { corners, cut_by };
        true
    }
}
