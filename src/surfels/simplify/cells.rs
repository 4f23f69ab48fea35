//! Surface elements: the piece of surface that each point stands for, and which points it borders on.
//!
//! The element of a point is its Voronoi cell in its own tangent plane. The cells tile the surface, so disks that contain
//! every cell leave no hole; the thesis takes `w = pi d²` (Eq. 1), which says how large an element is but not where it ends.
//! The points whose cells share an edge are the natural neighbours: the edges of the graph that splats grow along. Among the
//! k nearest they are those that no other neighbour hides, so the graph has no edge across a gap that points bridge.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::samples::Samples;
use crate::Progress;
use crate::surfels::neighbours::{Neighbour, NeighbourSearch};

/// Nearest neighbours that a cell is cut out by. The thesis takes 10, for its graph alone; more close more cells of a random
/// sampling, and the rest is cut out by [`MORE_NEIGHBOURS`].
const NEIGHBOURS: usize = 16;

/// The same where [`NEIGHBOURS`] leave a cell open: unevenly spaced points, or another sheet among them.
const MORE_NEIGHBOURS: usize = 64;

/// The neighbours that the local spacing is taken from: the square root of the area for each point. In a random sampling
/// the squared distance to the k-th neighbour is k / pi of that area on average.
const SPACING_NEIGHBOURS: usize = 16;

/// A cell that reaches farther than this many local spacings is open there: the surface ends. In a random sampling one
/// Voronoi vertex in ten million lies so far from its points.
const REACH: f64 = 2.5;

/// The cosine of the elevation over the tangent plane up to which a point is beside another: 60 degrees.
const STEEPEST: f64 = 0.5;

/// A crease is at least this part of the distance of two points from either: a cell has an area.
const NARROWEST: f64 = 0.01;

/// Corners of a cell that has no neighbours.
const OUTLINE: usize = 8;

/// The largest number of [pieces](Cells::pieces) in a cell: the bits of a mask.
pub(super) const MOST_PIECES: usize = 16;

/// All cells, and the graph of their neighbours.
pub(super) struct Cells {
    /// Where the corners of each cell begin; one more at the end.
    first_corner: Vec<usize>,
    /// Relative to the cell's point, in the basis of its tangent plane; counter-clockwise. Scaled units.
    corners: Vec<DVec2>,
    /// The distance of the farthest corner from the point.
    pub radii: Vec<f64>,
    /// The edges of each cell beyond which there is no neighbour, as bits like those of [`Cells::pieces`]: the surface ends
    /// there, or has a crease that the graph has no edge across.
    ends: Vec<u16>,
    /// How far such a cell goes on there from its point; zero for other cells.
    pub overhangs: Vec<f64>,
    first_neighbour: Vec<usize>,
    neighbours: Vec<u32>,
}

impl Cells {
    /// Creases are told from bends that `tolerance`, scaled units, allows.
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
            radii: Vec::with_capacity(samples.len()),
            ends: Vec::with_capacity(samples.len()),
            overhangs: Vec::with_capacity(samples.len()),
            first_neighbour: Vec::new(),
            neighbours: Vec::new(),
        };
        let mut edges: Vec<(u32, u32)> = Vec::new();
        let mut spacings = Vec::with_capacity(samples.len());
        for cell in chunks.iter().flatten() {
            cells.first_corner.push(cells.corners.len());
            cells.corners.extend(&cell.corners);
            cells.radii.push(cell.corners.iter().map(|corner| corner.length()).fold(0.0, f64::max));
            cells.ends.push(cell.ends);
            cells.overhangs.push(cell.overhang);
            spacings.push(cell.spacing);
        }
        cells.first_corner.push(cells.corners.len());
        for (index, cell) in chunks.iter().flatten().enumerate() {
            // Both ways: where dense points meet sparse ones, the sparse have neighbours that have nearer ones. But not if one is
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

    /// The pieces of a cell, as bits that say which of them: the triangles between its point and its edges.
    pub fn pieces(&self, index: u32) -> u16 {
        let pieces = self.corners(index).len().min(MOST_PIECES) as u32;
        ((1u32 << pieces) - 1) as u16
    }

    /// The unit directions, in the basis of the cell's tangent plane, in which it ends: across the edges that have no neighbour.
    pub fn ends(&self, index: u32) -> impl Iterator<Item = DVec2> {
        let (corners, ends) = (self.corners(index), self.ends[index as usize]);
        let open = (0..corners.len()).filter(move |&k| ends >> piece_of(k, corners.len()) & 1 == 1);
        open.filter_map(|k| (corners[k] - corners[(k + 1) % corners.len()]).perp().try_normalize())
    }

    /// Where the pieces of a cell lie among those of all.
    pub fn first_piece(&self, index: u32) -> usize {
        self.first_corner[index as usize]
    }

    /// Places for pieces, used or not.
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

/// Which piece the triangle of edge `k` belongs to: its own, unless a cell has more edges than a mask has bits.
pub(super) fn piece_of(k: usize, edges: usize) -> usize {
    if edges <= MOST_PIECES { k } else { k * MOST_PIECES / edges }
}

/// Two unit vectors that span the tangent plane of a point with unit normal `n`.
pub(super) fn tangent_basis(n: DVec3) -> [DVec3; 2] {
    let (s, t) = n.any_orthonormal_pair();
    [s, t]
}

struct Cell {
    corners: Vec<DVec2>,
    /// And how far they are.
    neighbours: Vec<(u32, f64)>,
    ends: u16,
    overhang: f64,
    spacing: f64,
}

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
        spacing = local_spacing(&borders);
        let polygon = Polygon::cut(REACH * spacing, &borders);
        neighbours = polygon.neighbours();
        if polygon.is_closed() {
            let overhang = polygon.farthest_at_end();
            return Cell { ends: polygon.ends(), corners: polygon.corners, neighbours, overhang, spacing };
        }
    }
    // Where the surface ends, it goes on as far as the surfel does.
    let overhang = samples.radii[index as usize];
    let polygon = Polygon::cut(overhang, &borders);
    Cell { ends: polygon.ends(), corners: polygon.corners, neighbours, overhang, spacing }
}

/// The local spacing; zero without neighbours.
fn local_spacing(borders: &[Border]) -> f64 {
    let nearest = || borders.iter().filter_map(|border| Some(border.neighbour?.1)).take(SPACING_NEIGHBOURS);
    let squares: f64 = nearest().map(|distance| distance * distance).sum();
    let count = nearest().count();
    let ranks = (count * (count + 1) / 2).max(1) as f64;
    (std::f64::consts::PI * squares / ranks).sqrt()
}

/// The line, in the tangent plane, where a cell borders on that of a neighbour.
struct Border {
    /// Unit.
    toward: DVec2,
    distance: f64,
    /// And how far it is. None for one beyond a right angle or a sharper one: the cell ends there, the graph has no edge.
    neighbour: Option<(u32, f64)>,
}

impl Border {
    /// Halfway to the neighbour, at half the distance in space: as if the surface were unrolled into the plane. Across a crease
    /// it is where the two tangent planes meet, however near to one of the points that is; else the cell of the nearer would
    /// reach past the crease, and that of the farther fall short of it.
    ///
    /// None for a neighbour on another side of the surface, or above or below more than beside, without a crease between:
    /// it bounds no cell.
    fn new(samples: &Samples, index: u32, neighbour: &Neighbour, tolerance: f64) -> Option<Self> {
        let offset = samples.positions.position(neighbour.index) - samples.positions.position(index);
        let [s, t] = tangent_basis(samples.normals[index as usize]);
        let in_plane = |v: DVec3| DVec2::new(v.dot(s), v.dot(t));
        let distance = neighbour.squared_distance.sqrt();
        let same_side = samples.same_side(index, neighbour.index);
        let linked = same_side.then_some((neighbour.index, distance));
        if let Some((toward, distance)) = crease(samples, index, neighbour.index, offset, tolerance) {
            return Some(Self { toward: in_plane(toward), distance, neighbour: linked });
        }
        let flat = in_plane(offset) / distance;
        let toward = flat.try_normalize().filter(|_| same_side && flat.length() > STEEPEST)?;
        Some(Self { toward, distance: 0.5 * distance, neighbour: linked })
    }
}

/// Where a crease runs between a point and another at `offset`: the unit direction from the point to it in the tangent plane, and
/// how far that is.
///
/// Each of the two then lies below the plane of the other, or each above it, together by more than a surface within the
/// tolerance bends; they face each other across the line where the planes meet, rather than along it; and each is within reach of
/// the other's surfel, as no outlier is.
fn crease(samples: &Samples, index: u32, other: u32, offset: DVec3, tolerance: f64) -> Option<(DVec3, f64)> {
    let radius = samples.radii[index as usize].min(samples.radii[other as usize]);
    if offset.length() > 2.0 * REACH * radius {
        return None;
    }
    let normal = samples.normals[index as usize];
    let agrees = samples.oriented || normal.dot(samples.normals[other as usize]) >= 0.0;
    let other = samples.normals[other as usize] * if agrees { 1.0 } else { -1.0 };
    // Of the other point over this one's plane, and of this one over the other's.
    let (height, back) = (offset.dot(normal), -offset.dot(other));
    if height * back < 0.0 || height.abs() + back.abs() <= 2.0 * tolerance {
        return None;
    }
    let slope = other - normal * other.dot(normal);
    let sine = slope.length();
    let toward = slope.try_normalize()? * if height + back < 0.0 { 1.0 } else { -1.0 };
    let along = offset.dot(normal.cross(toward));
    (along.abs() * sine <= height.abs() + back.abs())
        .then_some((toward, (back.abs() / sine).max(NARROWEST * offset.length())))
}

/// A convex polygon around the origin that remembers what cut each edge.
#[derive(Default)]
struct Polygon {
    corners: Vec<DVec2>,
    /// Of the edge from the corner of the same index to the next: the neighbour of the border. None for the outline.
    cut_by: Vec<Option<Option<(u32, f64)>>>,
}

impl Polygon {
    /// The outline, a regular polygon whose edges are `reach` away, cut by borders.
    fn cut(reach: f64, borders: &[Border]) -> Self {
        let mut polygon = Self { corners: Vec::with_capacity(12), cut_by: Vec::with_capacity(12) };
        let edge = std::f64::consts::SQRT_2 - 1.0;
        for (x, y) in [(1.0, -edge), (1.0, edge), (edge, 1.0), (-edge, 1.0)] {
            polygon.corners.push(DVec2::new(x, y) * reach);
        }
        for k in 0..OUTLINE / 2 {
            polygon.corners.push(-polygon.corners[k]);
        }
        polygon.cut_by = vec![None; OUTLINE];
        borders.iter().for_each(|border| polygon.clip(border));
        polygon
    }

    /// Keeps what is nearer than the border; the origin always is.
    fn clip(&mut self, border: &Border) {
        let beyond = |corner: DVec2| corner.dot(border.toward) - border.distance;
        if self.corners.iter().all(|&corner| beyond(corner) <= 0.0) {
            return;
        }
        let count = self.corners.len();
        let (mut corners, mut cut_by) = (Vec::with_capacity(count + 1), Vec::with_capacity(count + 1));
        for k in 0..count {
            let (from, to) = (self.corners[k], self.corners[(k + 1) % count]);
            let (a, b) = (beyond(from), beyond(to));
            let crossing = || from + (to - from) * (a / (a - b));
            if a <= 0.0 {
                corners.push(from);
                cut_by.push(self.cut_by[k]);
                if b > 0.0 {
                    corners.push(crossing());
                    cut_by.push(Some(border.neighbour));
                }
            } else if b <= 0.0 {
                corners.push(crossing());
                cut_by.push(self.cut_by[k]);
            }
        }
        *self = Self { corners, cut_by };
    }

    fn is_closed(&self) -> bool {
        !self.corners.is_empty() && self.cut_by.iter().all(Option::is_some)
    }

    /// Whether the edge has no neighbour: it is the outline's, or a crease's.
    fn is_end(&self, edge: usize) -> bool {
        self.cut_by[edge].flatten().is_none()
    }

    /// The edges without a neighbour as bits.
    fn ends(&self) -> u16 {
        let count = self.corners.len();
        (0..count).filter(|&k| self.is_end(k)).fold(0, |ends, k| ends | 1 << piece_of(k, count))
    }

    /// How far the corners are at edges without a neighbour; zero without such edges.
    fn farthest_at_end(&self) -> f64 {
        let count = self.corners.len();
        let ends = (0..count).filter(|&k| self.is_end(k)).flat_map(|k| [k, (k + 1) % count]);
        ends.map(|k| self.corners[k].length()).fold(0.0, f64::max)
    }

    fn neighbours(&self) -> Vec<(u32, f64)> {
        self.cut_by.iter().flatten().flatten().copied().collect()
    }
}
