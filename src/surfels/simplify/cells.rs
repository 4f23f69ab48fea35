//! Surface elements: the piece of surface that each point stands for, and the points whose elements
//! border on it.
//!
//! The element of a point is its Voronoi cell in its own tangent plane. The cells tile the surface,
//! so disks that contain every cell leave no hole; the thesis takes `w = pi d²` (Eq. 1), which is
//! the size of an element but not its boundary. Points whose cells share an edge are natural
//! neighbours. They are linked in the graph along which splats grow. Of the k nearest points, only
//! those are natural neighbours that no other neighbour hides, so no link skips the points between
//! its ends.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::borders::{Border, Edge, Polygon};
use super::samples::Samples;
use crate::Progress;
use crate::surfels::neighbours::{Neighbour, NeighbourSearch};

/// The number of nearest neighbours that bound a cell. The thesis takes 10, for its graph alone; 16
/// neighbours close more cells of a random sampling, and cells that stay open take
/// [`MORE_NEIGHBOURS`].
const NEIGHBOURS: usize = 16;

/// The number of neighbours where [`NEIGHBOURS`] leave a cell open: at unevenly spaced points, or
/// near another sheet.
const MORE_NEIGHBOURS: usize = 64;

/// The number of neighbours that determine the local spacing, the square root of the area per
/// point. In a random sampling the squared distance to the k-th neighbour is k / pi of that area on
/// average.
const SPACING_NEIGHBOURS: usize = 16;

/// A cell that extends farther than this many local spacings is open there: the surface ends. In a
/// random sampling one Voronoi vertex in ten million lies so far from its points.
const REACH: f64 = 2.5;

/// The largest number of [pieces](Cells::pieces) in a cell: the bits of a mask.
pub(super) const MOST_PIECES: usize = 16;

/// All cells, and the graph of their neighbours.
pub(super) struct Cells {
    /// The index of the first corner of each cell, and a final entry: the number of corners.
    first_corner: Vec<usize>,
    /// The corners relative to the cell's point, in the basis of its tangent plane;
    /// counter-clockwise, scaled units.
    corners: Vec<DVec2>,
    /// The edge from each corner to the next.
    edges: Vec<Edge>,
    /// The distance of the farthest corner from the point, scaled units.
    pub radii: Vec<f64>,
    /// How far a cell extends from its point to its [ends](Edge::is_end), scaled units; zero
    /// without ends.
    pub overhangs: Vec<f64>,
    first_neighbour: Vec<usize>,
    neighbours: Vec<u32>,
}

impl Cells {
    /// Computes all cells. Creases are bends that exceed `tolerance`, scaled units.
    pub fn new(samples: &Samples, tolerance: f64, progress: &dyn Progress) -> Self {
        const CHUNK: usize = 2048;
        progress.begin("finding neighbours", samples.len() as u64);
        let few = NeighbourSearch::new(&samples.positions, NEIGHBOURS);
        let many = NeighbourSearch::new(&samples.positions, MORE_NEIGHBOURS);
        let count = samples.len() as u32;
        let chunks: Vec<Vec<Cell>> = (0..count.div_ceil(CHUNK as u32))
            .into_par_iter()
            .map_init(Vec::new, |found, chunk| {
                let first = chunk * CHUNK as u32;
                let range = first..count.min(first + CHUNK as u32);
                progress.advance(range.len() as u64);
                range.map(|index| cell(samples, index, tolerance, &few, &many, found)).collect()
            })
            .collect();
        let mut cells = Self {
            first_corner: Vec::with_capacity(samples.len() + 1),
            corners: Vec::new(),
            edges: Vec::new(),
            radii: Vec::with_capacity(samples.len()),
            overhangs: Vec::with_capacity(samples.len()),
            first_neighbour: Vec::new(),
            neighbours: Vec::new(),
        };
        let mut edges: Vec<(u32, u32)> = Vec::new();
        let mut spacings = Vec::with_capacity(samples.len());
        for cell in chunks.iter().flatten() {
            cells.first_corner.push(cells.corners.len());
            cells.corners.extend(&cell.corners);
            cells.edges.extend(&cell.edges);
            cells.radii.push(cell.corners.iter().map(|corner| corner.length()).fold(0.0, f64::max));
            cells.overhangs.push(cell.overhang);
            spacings.push(cell.spacing);
        }
        cells.first_corner.push(cells.corners.len());
        for (index, cell) in chunks.iter().flatten().enumerate() {
            // Edges go both ways: where dense points meet sparse ones, a dense point is a neighbour
            // of a sparse one, but has nearer neighbours itself. There is no edge if one point is
            // out of the other's reach: an outlier is no neighbour of a surface.
            let near = |&&(other, distance): &&(u32, f64)| {
                distance <= 2.0 * REACH * f64::min(cell.spacing, spacings[other as usize])
            };
            let of_cell = cell.neighbours.iter().filter(near);
            edges.extend(of_cell.flat_map(|&(other, _)| [(index as u32, other), (other, index as u32)]));
        }
        edges.par_sort_unstable();
        edges.dedup();
        cells.first_neighbour = vec![0; samples.len() + 1];
        for &(from, _) in &edges {
            cells.first_neighbour[from as usize + 1] += 1;
        }
        for index in 0..samples.len() {
            cells.first_neighbour[index + 1] += cells.first_neighbour[index];
        }
        cells.neighbours = edges.into_iter().map(|(_, to)| to).collect();
        progress.end();
        cells
    }

    /// The corners of a cell.
    pub fn corners(&self, index: u32) -> &[DVec2] {
        let [first, end] = [index as usize, index as usize + 1].map(|i| self.first_corner[i]);
        &self.corners[first..end]
    }

    /// Points whose cells border on that of `index`.
    pub fn neighbours(&self, index: u32) -> &[u32] {
        let [first, end] = [index as usize, index as usize + 1].map(|i| self.first_neighbour[i]);
        &self.neighbours[first..end]
    }

    /// The pieces of a cell, the triangles between its point and its edges, as bits.
    pub fn pieces(&self, index: u32) -> u16 {
        let pieces = self.corners(index).len().min(MOST_PIECES) as u32;
        ((1u32 << pieces) - 1) as u16
    }

    /// The edges of a cell, each from corner to corner, counter-clockwise.
    pub fn edges(&self, index: u32) -> impl Iterator<Item = ([DVec2; 2], Edge)> {
        let (corners, first) = (self.corners(index), self.first_corner[index as usize]);
        let ends = move |k: usize| [corners[k], corners[(k + 1) % corners.len()]];
        (0..corners.len()).map(move |k| (ends(k), self.edges[first + k]))
    }

    /// The corners of some pieces of a cell, except the cell's point.
    pub fn corners_of(&self, index: u32, pieces: u16) -> impl Iterator<Item = DVec2> {
        let corners = self.corners(index);
        let edges = (0..corners.len()).filter(move |k| pieces >> piece_of(*k, corners.len()) & 1 == 1);
        edges.flat_map(move |k| [corners[k], corners[(k + 1) % corners.len()]])
    }

    /// The index of a cell's first piece among the pieces of all cells.
    pub fn first_piece(&self, index: u32) -> usize {
        self.first_corner[index as usize]
    }

    /// The number of indices of pieces, used or not.
    pub fn piece_places(&self) -> usize {
        self.corners.len()
    }

    /// The area of some pieces of a cell, square scaled units.
    pub fn area(&self, index: u32, pieces: u16) -> f64 {
        let corners = self.corners(index);
        (0..corners.len())
            .filter(|&k| pieces >> piece_of(k, corners.len()) & 1 == 1)
            .map(|k| 0.5 * corners[k].perp_dot(corners[(k + 1) % corners.len()]))
            .sum()
    }
}

/// The piece to which the triangle of edge `k` belongs: its own, unless the cell has more edges
/// than a mask has bits.
pub(super) fn piece_of(k: usize, edges: usize) -> usize {
    if edges <= MOST_PIECES { k } else { k * MOST_PIECES / edges }
}

/// Two unit vectors that span the tangent plane of a point with unit normal `n`.
pub(super) fn tangent_basis(n: DVec3) -> [DVec3; 2] {
    let (s, t) = n.any_orthonormal_pair();
    [s, t]
}

/// The cell of one point.
struct Cell {
    corners: Vec<DVec2>,
    /// Neighbours, and their distances.
    neighbours: Vec<(u32, f64)>,
    edges: Vec<Edge>,
    overhang: f64,
    spacing: f64,
}

/// Computes the cell of point `index`: from `few` neighbours, or from `many` if these leave it
/// open.
fn cell(
    samples: &Samples,
    index: u32,
    tolerance: f64,
    few: &NeighbourSearch<'_>,
    many: &NeighbourSearch<'_>,
    found: &mut Vec<Neighbour>,
) -> Cell {
    let mut borders = Vec::new();
    let (mut neighbours, mut spacing) = (Vec::new(), 0.0);
    for search in [few, many] {
        search.nearest(index, found);
        borders.clear();
        borders.extend(found.iter().filter_map(|neighbour| Border::new(samples, index, neighbour, tolerance)));
        let radius = samples.radii[index as usize];
        for line in &samples.lines[index as usize] {
            let mut line = Border::of_line(samples, index, line);
            borders.retain(|border| !line.stands_for(border, radius, |other| samples.are_smooth(index, other)));
            borders.push(line);
        }
        spacing = local_spacing(&borders);
        let polygon = Polygon::cut(REACH * spacing, &borders);
        neighbours = polygon.neighbours();
        if polygon.is_closed() {
            let overhang = polygon.farthest_at_end();
            return Cell { edges: polygon.edges(), corners: polygon.corners, neighbours, overhang, spacing };
        }
    }
    // Where the surface ends, the cell extends as far as the surfel does.
    let overhang = samples.radii[index as usize];
    let polygon = Polygon::cut(overhang, &borders);
    Cell { edges: polygon.edges(), corners: polygon.corners, neighbours, overhang, spacing }
}

/// The local spacing, `sqrt(pi Σ d_k² / Σ k)` over distances to the k-th nearest neighbours; zero
/// without neighbours.
fn local_spacing(borders: &[Border]) -> f64 {
    let nearest = || borders.iter().filter_map(|border| Some(border.beyond.neighbour()?.1)).take(SPACING_NEIGHBOURS);
    let squares: f64 = nearest().map(|distance| distance * distance).sum();
    let count = nearest().count();
    let ranks = (count * (count + 1) / 2).max(1) as f64;
    (std::f64::consts::PI * squares / ranks).sqrt()
}
