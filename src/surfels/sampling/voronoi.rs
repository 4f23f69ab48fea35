//! The exact Voronoi diagram of the samples restricted to the surface: for each sample, the part of
//! the triangles that is nearest to it (Yan et al. 2009, "Isotropic remeshing with fast and exact
//! computation of restricted Voronoi diagram").
//!
//! Within a triangle the cell of a sample is a convex polygon: the triangle, cut by the bisector
//! planes to other samples. Starting from one cell, the search continues with the samples across
//! its cuts.
//!
//! At a sharp edge or on a thin surface, the nearest sample may be on another side. Its disk is
//! edge-on in the views that see the triangle best, and covers nothing there, however large it is.
//! So a triangle is divided only among samples on its own side to which the surface continues
//! without an edge, as long as some of these are near enough.

use std::collections::HashSet;

use glam::DVec3;
use rayon::prelude::*;

use super::surface::{Facet, MeshSurface};
use crate::progress::Progress;
use crate::surfels::graph::NeighbourGraph;
use crate::surfels::neighbours::{Neighbour, NeighbourSearch};
use crate::surfels::positions::DistinctPositions;

/// The number of neighbours that cut a cell at first, and among which a sample on a triangle's own
/// side is usually found. They include all that matter unless a triangle reaches far past the
/// samples around it, or samples are spaced unevenly.
const NEIGHBOURS: usize = 16;

/// The number of neighbours searched at the tip of a sharp corner, where samples of all sides
/// crowd.
const MANY: usize = 64;

/// A sample among [`MANY`] counts only within this many times the distance of the last of
/// [`NEIGHBOURS`]. Farther ones belong to another part of the surface.
const FARTHER: f64 = 1.5;

/// A sample must be nearer by this fraction of the distance to cut off a corner, so that rounding
/// decides nothing.
const NEARER: f64 = 1e-9;

/// The cosine of 55 degrees: two triangles at a smaller angle are on one side of the surface. The
/// angle is larger than those between neighbours on a rough scan, and smaller than those at the
/// edges of regular bodies.
pub(super) const SIDE: f64 = 0.5736;

/// The samples, and the searches that cut out their cells.
pub(super) struct Voronoi<'a> {
    surface: &'a MeshSurface<'a>,
    distinct: &'a DistinctPositions,
    /// The triangle that each position lies in.
    triangles: &'a [u32],
    /// The patch number of each triangle; equal for triangles between which the surface continues
    /// without an end.
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

    /// The position of a sample, world units relative to the surface's centre.
    pub fn position(&self, sample: u32) -> DVec3 {
        self.distinct.position(sample) / self.scale()
    }

    /// Scaled units per world unit.
    pub fn scale(&self) -> f64 {
        self.distinct.scale()
    }

    /// Whether a triangle is on the same side of the surface as a sample.
    pub fn is_of_side(&self, sample: u32, triangle: &Facet) -> bool {
        self.facet(sample).dot(triangle.normal) > SIDE
    }

    /// The unit normal of the triangle that a sample lies in.
    pub fn facet(&self, sample: u32) -> DVec3 {
        self.surface.triangles[self.triangles[sample as usize] as usize].normal
    }

    /// Returns the result of `measure` for each part of each cell, with the cell's sample, in the
    /// order of triangles.
    ///
    /// A part lies in one triangle. `measure` gets its sample, its triangle, and its corners
    /// relative to the sample in scaled units.
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

    /// Divides a triangle among the samples that `may` have a part. None if there is no such sample
    /// among the nearest ones.
    fn parts(
        &self,
        triangle: &Facet,
        may: impl Fn(u32) -> bool,
        searches: &[&NeighbourSearch<'_>],
        Scratch { found, seen, open, last }: &mut Scratch,
    ) -> Option<Vec<(u32, Vec<DVec3>)>> {
        let corners = triangle.corners.map(|corner| corner * self.distinct.scale());
        let mut nearest_to = |at: DVec3, from: u32| {
            let mut farthest = f64::INFINITY;
            for search in searches {
                search.nearest_to(at, from, found);
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
        *last = nearest_to((corners[0] + corners[1] + corners[2]) / 3.0, *last)?;
        open.push(*last);
        seen.extend(&*open);
        while let Some(sample) = open.pop() {
            let center = self.distinct.position(sample);
            let mut cell = Polygon { corners: corners.to_vec(), cut_by: vec![None; 3] };
            let mut is_whole = false;
            for &other in self.graph.of(sample) {
                let position = self.distinct.position(other);
                // A sample at least twice as far as the farthest corner takes no point from the
                // cell.
                is_whole = position.distance(center) >= 2.0 * cell.reach(center);
                if is_whole || cell.corners.is_empty() {
                    break;
                }
                if may(other) {
                    cell.cut(center, position, other);
                }
            }
            // A convex polygon lies in a convex cell exactly if all its corners do.
            while !is_whole && !cell.corners.is_empty() {
                let mut beyond = None;
                for &corner in &cell.corners {
                    let other = nearest_to(corner, sample)?;
                    let distance = self.distinct.position(other).distance(corner);
                    if other != sample && distance < corner.distance(center) * (1.0 - NEARER) {
                        beyond = Some(other);
                        break;
                    }
                }
                // If rounding makes the cut remove nothing, the cell is done.
                is_whole = !beyond.is_some_and(|other| cell.cut(center, self.distinct.position(other), other));
            }
            open.extend(cell.cut_by.iter().flatten().filter(|other| seen.insert(**other)));
            parts.push((sample, cell.corners));
        }
        Some(parts)
    }
}

/// Buffers that are reused from triangle to triangle.
#[derive(Default)]
struct Scratch {
    found: Vec<Neighbour>,
    /// The samples whose cells are done or in `open`.
    seen: HashSet<u32>,
    open: Vec<u32>,
    /// The sample nearest to the middle of the triangle before, which often is beside the next one.
    last: u32,
}

/// A convex polygon in a triangle's plane.
struct Polygon {
    corners: Vec<DVec3>,
    /// The sample beyond the edge from the corner of the same index to the next; None for the
    /// triangle's own edges.
    cut_by: Vec<Option<u32>>,
}

impl Polygon {
    /// The largest distance of a corner from `center`.
    fn reach(&self, center: DVec3) -> f64 {
        self.corners.iter().map(|corner| corner.distance(center)).fold(0.0, f64::max)
    }

    /// Removes the part that is nearer to the sample `other` at `position` than to `center`.
    /// Returns whether there was such a part.
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
