//! Splat growing: the largest disk around a point that the tolerance allows.
//!
//! A disk grows from its point outward along the graph, in the order of distance in the tangent
//! plane. It ends before the next point would spread the heights of the points inside over more
//! than twice the tolerance. The disk then moves along its normal to the middle of these heights,
//! so that no point inside is farther from it than the tolerance. The points inside are the
//! conquered set; the points seen but not yet reached are the confront set. (Thesis section 4.2,
//! after Wu and Kobbelt 2004.)

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::{DMat3, DVec2, DVec3};

use super::SplatShape;
use super::cells::{Cells, piece_of, tangent_basis};
use super::ended::Ended;
use super::paraboloid::Paraboloid;
use super::samples::Samples;

/// The largest ratio of the half-axes of an ellipse. Up to `SMALLEST_RATIO`, the splat stays a
/// disk.
const LARGEST_RATIO: f64 = 4.0;
const SMALLEST_RATIO: f64 = 1.1;

/// How often a cap is fitted to the points that it holds and grown again: this many times as a
/// circle, then as often as an ellipse.
const FITS: usize = 3;

/// The cosine of the largest angle between the normals of a cap and of its points: 37 degrees.
const STEEPEST: f64 = 0.8;

/// A disk, ellipse or cap that grew around a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Splat {
    /// The point it grew from.
    pub point: u32,
    /// The unit normal: that of the point, except for a cap.
    pub normal: DVec3,
    /// The distance of its centre from that point along the normal, scaled units.
    pub shift: f64,
    /// Half-axes, perpendicular to each other and to the normal, scaled units.
    pub axes: [DVec3; 2],
    /// How it curves.
    pub bend: Paraboloid,
    /// The largest distance of a point inside from the splat, scaled units. It exceeds the
    /// tolerance only if the splat was [enlarged](Grower::grow_over_cell) beyond what it grew to.
    pub deviation: f64,
}

/// The pieces of a cell that a splat covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cover {
    pub cell: u32,
    /// The pieces that lie entirely in the splat, as bits; at least one.
    pub pieces: u16,
}

/// The distance of a point in a splat's plane, in units of the half-axes, so that the splat is a
/// circle. It is stored as the bits of the f64, which sort as the numbers do if none is negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Distance(u64);

impl Distance {
    fn new(distance: f64) -> Self {
        Self(distance.to_bits())
    }

    fn get(self) -> f64 {
        f64::from_bits(self.0)
    }
}

/// A point inside the splat.
#[derive(Clone, Copy)]
struct Conquered {
    point: u32,
    distance: f64,
    height: f64,
}

/// Grows splats, one at a time; each thread has its own.
pub(super) struct Grower<'a> {
    samples: &'a Samples,
    cells: &'a Cells,
    /// Scaled units.
    tolerance: f64,
    shape: SplatShape,
    /// Normal and curvature of the growing splat.
    normal: DVec3,
    bend: Paraboloid,
    confront: BinaryHeap<Reverse<(Distance, u32)>>,
    conquered: Vec<Conquered>,
    /// For each point, the number of the last splat that has seen it.
    seen: Vec<u32>,
    /// The number of the growing splat.
    number: u32,
}

impl<'a> Grower<'a> {
    /// Creates a grower; `tolerance` is in scaled units.
    pub fn new(samples: &'a Samples, cells: &'a Cells, tolerance: f64, shape: SplatShape) -> Self {
        let seen = vec![0; samples.len()];
        Self {
            samples,
            cells,
            tolerance,
            shape,
            normal: DVec3::Z,
            bend: Paraboloid::FLAT,
            confront: BinaryHeap::new(),
            conquered: Vec::new(),
            seen,
            number: 0,
        }
    }

    /// Grows a splat from `point` and appends the pieces that it covers to `covers`, in the order
    /// of cells.
    pub fn grow(&mut self, point: u32, covers: &mut Vec<Cover>) -> Splat {
        let first = covers.len();
        self.normal = self.samples.normals[point as usize];
        let disk = self.grow_shape(point, self.circle(), false, covers);
        if self.shape == SplatShape::Cap {
            return self.grow_cap(disk, first, covers);
        }
        let Some(axes) = (self.shape == SplatShape::Ellipse).then(|| self.principal_axes(point)).flatten() else {
            return disk;
        };
        let middle = covers.len();
        let ellipse = self.grow_shape(point, axes, false, covers);
        if self.area(&covers[middle..]) > self.area(&covers[first..middle]) {
            covers.drain(first..middle);
            ellipse
        } else {
            covers.truncate(middle);
            disk
        }
    }

    /// Grows caps around the point of `disk`, whose covers start at index `first`, each from the
    /// points that the last one holds: circles, then ellipses along the principal curvatures.
    /// Returns the splat that covers the largest area, which may be the disk, and leaves only its
    /// covers in the list.
    fn grow_cap(&mut self, disk: Splat, first: usize, covers: &mut Vec<Cover>) -> Splat {
        let (point, mut best, mut kept) = (disk.point, disk, first);
        for turn in 0..2 * FITS {
            let next = covers.len();
            let Some((_, normal)) = self.bend_of(point) else { break };
            if normal.dot(self.samples.normals[point as usize]) < STEEPEST {
                break;
            }
            self.normal = normal;
            let Some((bend, _)) = self.bend_of(point) else { break };
            let shape = if turn < FITS { Some(self.circle()) } else { self.principal_axes(point) };
            let Some(shape) = shape else { break };
            self.bend = bend;
            let cap = self.grow_shape(point, shape, false, covers);
            if self.area(&covers[next..]) > self.area(&covers[kept..next]) {
                (best, kept) = (cap, next);
            } else {
                covers.truncate(next);
            }
        }
        self.bend = Paraboloid::FLAT;
        covers.drain(first..kept);
        best
    }

    fn area(&self, covers: &[Cover]) -> f64 {
        covers.iter().map(|cover| self.cells.area(cover.cell, cover.pieces)).sum()
    }

    /// The paraboloid around `point` through the conquered and confront sets of the splat that grew
    /// last, and the unit normal with which it would fit best.
    fn bend_of(&self, point: u32) -> Option<(Paraboloid, DVec3)> {
        let (center, normal) = (self.samples.positions.position(point), self.normal);
        let [s, t] = tangent_basis(normal);
        let around = self.confront.iter().map(|Reverse((_, point))| *point);
        let faces = |other: &u32| self.samples.normals[*other as usize].dot(normal).abs() > STEEPEST;
        let points = self.conquered.iter().map(|conquered| conquered.point).chain(around.filter(faces));
        let points = points.map(|other| {
            let offset = self.samples.positions.position(other) - center;
            DVec3::new(offset.dot(s), offset.dot(t), offset.dot(normal))
        });
        let bend = Paraboloid::through(points.clone())?;
        let tilt = bend.tilt(points)?;
        Some((bend, (normal - s * tilt.x - t * tilt.y).normalize()))
    }

    /// The height over the growing splat, whose normal is `normal`, of a point at `offset` from the
    /// splat's point.
    fn over(&self, normal: DVec3, offset: DVec3) -> f64 {
        if self.bend.is_flat() {
            return offset.dot(normal);
        }
        let [s, t] = tangent_basis(normal);
        self.bend.over(DVec2::new(offset.dot(s), offset.dot(t)), offset.dot(normal))
    }

    /// Whether the growing splat, from `point`, may hold `other`.
    fn holds(&self, point: u32, other: u32) -> bool {
        let next = self.samples.normals[other as usize];
        self.samples.same_side(point, other) && (self.bend.is_flat() || self.normal.dot(next).abs() > STEEPEST)
    }

    /// As [`Self::grow`], for a disk that is at least large enough to cover the point's own cell.
    /// Another point inside may then lie beyond the tolerance; the disk covers nothing of the cells
    /// of such points.
    pub fn grow_over_cell(&mut self, point: u32, covers: &mut Vec<Cover>) -> Splat {
        self.normal = self.samples.normals[point as usize];
        self.grow_shape(point, self.circle(), true, covers)
    }

    /// Half-axes of unit length.
    fn circle(&self) -> [DVec3; 2] {
        tangent_basis(self.normal)
    }

    /// Half-axes, of product 1, along which the surface bends equally far from the tangent plane.
    /// They lie along the principal curvatures, and are proportional to the inverse square roots of
    /// the curvatures' magnitudes.
    ///
    /// They follow from the least-squares paraboloid through the conquered and confront sets of the
    /// splat that grew last, which must be around `point`. None for nearly a circle.
    fn principal_axes(&self, point: u32) -> Option<[DVec3; 2]> {
        let (center, normal) = (self.samples.positions.position(point), self.normal);
        let [s, t] = tangent_basis(normal);
        let inside = self.conquered.iter().map(|conquered| conquered.point);
        let around = self.confront.iter().map(|Reverse((_, point))| *point);
        let offsets =
            || inside.clone().chain(around.clone()).map(|point| self.samples.positions.position(point) - center);
        let reach = offsets().map(|offset| offset.length()).fold(0.0, f64::max);
        let (mut matrix, mut heights) = (DMat3::ZERO, DVec3::ZERO);
        for offset in offsets() {
            let offset = offset / reach;
            let (u, v) = (offset.dot(s), offset.dot(t));
            let row = DVec3::new(u * u, u * v, v * v);
            matrix += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
            heights += row * offset.dot(normal);
        }
        let quadric = matrix.inverse() * heights;
        let (mean, half_difference) = (0.5 * (quadric.x + quadric.z), 0.5 * (quadric.x - quadric.z));
        let deviation = half_difference.hypot(0.5 * quadric.y);
        let (strong, weak) = (mean.abs() + deviation, (mean.abs() - deviation).abs());
        // A singular matrix or a plane determines no ellipse.
        if !quadric.is_finite() || strong <= SMALLEST_RATIO * SMALLEST_RATIO * weak {
            return None;
        }
        let ratio = (strong / weak).sqrt().min(LARGEST_RATIO);
        // The direction of the larger curvature is that of the larger eigenvalue if the mean of
        // both eigenvalues is positive, else the perpendicular direction of the smaller one.
        let angle = 0.5 * (0.5 * quadric.y).atan2(half_difference);
        let along = s * angle.cos() + t * angle.sin();
        let across = normal.cross(along);
        let [strong, weak] = if mean >= 0.0 { [along, across] } else { [across, -along] };
        let stretch = ratio.sqrt();
        // Right-handed with the normal: weak x (normal x weak) = normal.
        Some([weak * stretch, normal.cross(weak).dot(strong).signum() * strong / stretch])
    }

    /// Grows a splat whose half-axes are multiples of `shape`; distances and radii are in units of
    /// `shape`. With `over_cell`, it is enlarged to cover the point's own cell.
    fn grow_shape(&mut self, point: u32, shape: [DVec3; 2], over_cell: bool, covers: &mut Vec<Cover>) -> Splat {
        let mut radius = self.conquer(point, shape);
        let normal = self.normal;
        let center = self.samples.positions.position(point);
        let inverse = shape.map(|axis| axis / axis.length_squared());
        let flat = |p: DVec3| DVec2::new(p.dot(inverse[0]), p.dot(inverse[1]));
        if over_cell {
            // Computed exactly as in `covered_pieces`, so that rounding leaves out no corner.
            let [s, t] = tangent_basis(normal);
            let corners = self.cells.corners(point).iter();
            radius = corners.map(|corner| flat(s * corner.x + t * corner.y).length()).fold(radius, f64::max);
        }
        let (low, high) = self.heights();
        let shift = 0.5 * (low + high);
        let confront = self.confront.iter().map(|Reverse((distance, point))| (distance.get(), *point));
        let deviation = confront
            .filter(|(distance, _)| *distance < radius)
            .map(|(_, point)| (self.over(normal, self.samples.positions.position(point) - center) - shift).abs())
            .fold(0.5 * (high - low), f64::max);
        let first = covers.len();
        for conquered in &self.conquered {
            let pieces = self.covered_pieces(conquered, center, flat, radius);
            if pieces != 0 {
                covers.push(Cover { cell: conquered.point, pieces });
            }
        }
        covers[first..].sort_unstable_by_key(|cover| cover.cell);
        Splat { point, normal, shift, axes: shape.map(|axis| axis * radius), bend: self.bend, deviation }
    }

    /// The range of heights of the points inside, over the tangent plane or the paraboloid.
    fn heights(&self) -> (f64, f64) {
        self.conquered.iter().fold((0.0, 0.0), |(low, high): (f64, f64), c| (low.min(c.height), high.max(c.height)))
    }

    /// Fills the conquered set and returns the radius, in units of `shape`.
    fn conquer(&mut self, point: u32, shape: [DVec3; 2]) -> f64 {
        self.confront.clear();
        self.conquered.clear();
        if self.number == u32::MAX {
            self.seen.fill(0);
            self.number = 0;
        }
        self.number += 1;
        let normal = self.normal;
        let center = self.samples.positions.position(point);
        let inverse = shape.map(|axis| axis / axis.length_squared());
        let shortest = shape[0].length().min(shape[1].length());
        let (mut low, mut high) = (0f64, 0f64);
        // The largest radius that the ends of the surface found so far allow.
        let mut end = f64::INFINITY;
        let mut lines = Vec::with_capacity(2);
        self.seen[point as usize] = self.number;
        self.confront.push(Reverse((Distance::new(0.0), point)));
        while let Some(Reverse((distance, next))) = self.confront.pop() {
            let distance = distance.get();
            if distance >= end {
                self.conquered.retain(|conquered| conquered.distance <= end);
                return end;
            }
            let offset = self.samples.positions.position(next) - center;
            let height = self.over(normal, offset);
            (low, high) = (low.min(height), high.max(height));
            if high - low > 2.0 * self.tolerance {
                // A path along the graph may lead back inward: points farther out than this one are
                // not inside.
                self.conquered.retain(|conquered| conquered.distance < distance);
                self.confront.push(Reverse((Distance::new(distance), next)));
                return distance;
            }
            if lines.iter().any(|line: &Ended| line.is_past(offset)) {
                // The surface goes around the end of a line. Clipping would have to keep this
                // point, and so would cut off nothing: growth ends here.
                self.conquered.retain(|conquered| conquered.distance < distance);
                return end.min(distance);
            }
            self.conquered.push(Conquered { point: next, distance, height });
            end = end.min(self.end_at(next, offset, shape, &mut lines));
            for &neighbour in self.cells.neighbours(next) {
                if self.seen[neighbour as usize] == self.number {
                    continue;
                }
                let offset = self.samples.positions.position(neighbour) - center;
                let reached = DVec2::new(offset.dot(inverse[0]), offset.dot(inverse[1])).length();
                if self.holds(point, neighbour) {
                    self.seen[neighbour as usize] = self.number;
                    self.confront.push(Reverse((Distance::new(reached), neighbour)));
                } else {
                    // The surface turns away, though not yet by more than the tolerance.
                    end = end.min(self.turn_at(neighbour, offset, shape).unwrap_or(reached).max(distance));
                }
            }
        }
        // The whole surface is inside: the disk ends with the farthest cell.
        let reach = self.conquered.iter().map(|c| c.distance + self.cells.radii[c.point as usize] / shortest);
        end.min(reach.fold(0.0, f64::max))
    }

    /// The largest radius of a splat of this shape that the ends of the cell of `next`, a point
    /// inside at `offset`, allow.
    ///
    /// The splat reaches past an end, in the direction of that end, by no more than the cell
    /// extends from its point. Up to two ends set no limit if no point inside lies past them: they
    /// are put into `lines`, and the splat is clipped there.
    fn end_at(&self, next: u32, offset: DVec3, shape: [DVec3; 2], lines: &mut Vec<Ended>) -> f64 {
        let overhang = self.cells.overhangs[next as usize];
        let [s, t] = tangent_basis(self.samples.normals[next as usize]);
        let mut least = f64::INFINITY;
        for ([from, to], edge) in self.cells.edges(next).filter(|(_, edge)| edge.is_end()) {
            let Some(across) = (from - to).perp().try_normalize() else { continue };
            let Some((toward, extent)) = along(s * across.x + t * across.y, shape) else { continue };
            if edge.is_sharp() && offset.dot(toward) >= 0.0 {
                let corners = [from, to].map(|corner| offset + s * corner.x + t * corner.y);
                if lines.iter().any(|line| line.stands_for(toward, corners)) {
                    continue;
                }
                let distance = corners[0].dot(toward).max(corners[1].dot(toward));
                let reach = if edge.is_exact() { self.tolerance } else { overhang };
                let ended = Ended { toward, distance, reach };
                if lines.len() < 2 && !self.is_any_past(next, offset, &ended) {
                    lines.push(ended);
                    continue;
                }
            }
            least = least.min((offset.dot(toward).max(0.0) + overhang) / extent);
        }
        least
    }

    /// Whether any conquered point lies past an end. The end is given relative to the splat's
    /// point, and so is `offset`, the position of the conquered point `next`.
    fn is_any_past(&self, next: u32, offset: DVec3, ended: &Ended) -> bool {
        let center = self.samples.positions.position(next) - offset;
        let mut points = self.conquered.iter().map(|conquered| self.samples.positions.position(conquered.point));
        points.any(|point| ended.is_past(point - center))
    }

    /// The largest radius before `next`, a point at `offset` that faces away from the splat: the
    /// surface turns in the direction in which that point faces, or against it. None if the point's
    /// normal is parallel to that of the splat.
    fn turn_at(&self, next: u32, offset: DVec3, shape: [DVec3; 2]) -> Option<f64> {
        let (toward, extent) = along(self.samples.normals[next as usize], shape)?;
        Some(offset.dot(toward).abs() / extent)
    }

    /// The pieces of a conquered point's cell that lie entirely within `radius`, as bits.
    fn covered_pieces(&self, of: &Conquered, center: DVec3, flat: impl Fn(DVec3) -> DVec2, radius: f64) -> u16 {
        if of.distance > radius {
            return 0;
        }
        let corners = self.cells.corners(of.point);
        let offset = self.samples.positions.position(of.point) - center;
        let [s, t] = tangent_basis(self.samples.normals[of.point as usize]);
        let inside = |corner: &DVec2| flat(offset + s * corner.x + t * corner.y).length() <= radius;
        let Some(last) = corners.last() else { return 0 };
        let mut pieces = self.cells.pieces(of.point);
        let mut before = (corners.len() - 1, inside(last));
        for (k, corner) in corners.iter().enumerate() {
            let now = inside(corner);
            if !(before.1 && now) {
                pieces &= !(1 << piece_of(before.0, corners.len()));
            }
            before = (k, now);
        }
        pieces
    }
}

/// The unit direction of `v` in the plane of an ellipse with perpendicular half-axes `shape`, and
/// the extent of the ellipse in that direction. None if `v` is perpendicular to the plane.
fn along(v: DVec3, shape: [DVec3; 2]) -> Option<(DVec3, f64)> {
    let normal = shape[0].cross(shape[1]).normalize();
    let toward = v.reject_from_normalized(normal).try_normalize()?;
    Some((toward, toward.dot(shape[0]).hypot(toward.dot(shape[1]))))
}
