//! Measures whether the surfels of a scene leave gaps in its surface.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::estimate::median;
use super::gaps::Cell;
use super::graph::NeighbourGraph;
use super::neighbours::Neighbour;
use super::positions::DistinctPositions;
use super::sizes::{Surroundings, surroundings};
use crate::scene::{Clip, Scene, Surfel};
use crate::{Progress, Result};

/// The number of neighbours among which gaps are searched. In random samples, 16 neighbours do not
/// bound wide gaps. In oblique views, points at other heights are projected between the neighbours.
const NEIGHBOURS: usize = 64;

/// In oblique views, the neighbours bound the cell only within a smaller radius: this fraction of
/// the radius that holds in the surfel's plane.
const KNOWN_ASLANT: f64 = 0.7;

/// The least cosine between the normals of two surfels of the same side: 60 degrees.
const SAME_SIDE: f64 = 0.5;

/// Relative rounding tolerance: a disk that misses a gap by less than this still closes it.
const ROUNDING: f64 = 1e-5;

/// The angle between an oblique line of sight and a surfel's plane, degrees.
pub const ASLANT: f64 = 10.0;

/// At most this many positions are examined along oblique lines of sight; a cloud with more is
/// sampled regularly.
const MOST_ASLANT: usize = 50_000;

/// The number of oblique lines of sight, evenly distributed around a surfel's normal.
const SIDES: usize = 4;

/// A point lies among surfels, and not past an outline, if in each of this many directions there is
/// a surfel beyond it.
const OUTWARD: usize = 8;

/// A disk can close a gap only if the sine of the angle between its plane and the line of sight is
/// larger than this: 3 degrees.
const EDGE_ON: f64 = 0.05;

/// The density of a scene's surfels, and the fraction of the surface that they cover.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Coverage {
    /// Median distance from a surfel's centre to the nearest other centre, world units.
    pub spacing: f64,
    /// The fraction of surfels without an open gap around them, among those that lie on a surface.
    pub covered: f64,
    /// The number of surfels with an open gap around them.
    ///
    /// Gaps are searched in the surfel's plane, between its centre and the corners of its Voronoi
    /// cell. A gap is open if no disk at the centre and no disk of the 64 nearest neighbours covers
    /// a point there. Beyond a clip line at which the surface ends, nothing has to be covered. At a
    /// ragged boundary, such a point may lie outside the surface.
    pub open: u64,
    /// The number of surfels that do not lie on a surface, such as those of leaves and wires. They
    /// are not examined for gaps.
    pub lone: u64,
    /// The fraction of surfels without an open gap, among those that lie on a surface, seen at
    /// [`ASLANT`] degrees to the surfel's plane from four sides. Disks count as flat, and at most
    /// 50,000 positions are examined.
    pub covered_aslant: f64,
}

/// Measures how well the surfels of `scene` cover its surface. Returns None if all are at one
/// position.
///
/// # Errors
///
/// [`Error::Usage`](crate::Error::Usage) for more than 2^32 - 1 surfels.
pub fn coverage(scene: &Scene, progress: &dyn Progress) -> Result<Option<Coverage>> {
    coverage_among(scene, None, progress)
}

/// As [`coverage`], for the surfels whose flag in `examined` is set (all for None); the others are
/// their neighbours.
pub(super) fn coverage_among(
    scene: &Scene,
    examined: Option<&[bool]>,
    progress: &dyn Progress,
) -> Result<Option<Coverage>> {
    let center = |index: usize| scene.center(index).to_array();
    let centers: Vec<[f64; 3]> = (0..scene.surfels.len()).into_par_iter().map(center).collect();
    let distinct = DistinctPositions::new(&centers, &scene.bounds(), DVec3::ZERO)?;
    drop(centers);
    if distinct.len() < 2 {
        return Ok(None);
    }
    let of_position = disks_of(&distinct, scene);
    let at = |position: u32| of_position.of(position);
    progress.begin("looking for gaps", distinct.len() as u64);
    let is_examined = examined.map(|examined| examined_positions(&distinct, examined));
    let is_examined = |position: u32| is_examined.as_ref().is_none_or(|all| all[position as usize]);
    let step = distinct.len().div_ceil(MOST_ASLANT) as u32;
    let is_sampled = |position: u32| position.is_multiple_of(step);
    let mut found = vec![(0.0, Found::Closed); distinct.len()];
    NeighbourGraph::visit(
        (&distinct, NEIGHBOURS, 0),
        |position| is_examined(position as u32),
        &mut found,
        progress,
        |position, near| {
            let spacing = near.first().map_or(0.0, |nearest| nearest.squared_distance.sqrt());
            let gaps = Gaps::new(&distinct, position, near, at);
            (spacing / distinct.scale(), gaps.map_or(Found::Closed, |gaps| gaps.found(is_sampled(position))))
        },
    );
    progress.end();
    let count = |sampled: bool, what: &[Found]| {
        let counted = |position: &&u32| {
            let at = **position;
            is_examined(at) && (!sampled || is_sampled(at)) && what.contains(&found[at as usize].1)
        };
        distinct.of_point().par_iter().filter(counted).count() as u64
    };
    let share = |sampled: bool, closed: &[Found]| match count(sampled, &Found::OF_SURFACES) {
        0 => 1.0,
        all => count(sampled, closed) as f64 / all as f64,
    };
    let (covered, covered_aslant) = (share(false, &[Found::Closed, Found::OpenAslant]), share(true, &[Found::Closed]));
    let (open, lone) = (count(false, &[Found::Open]), count(false, &[Found::Lone]));
    let spacings = found.into_par_iter().zip(0..distinct.len() as u32).filter(|(_, at)| is_examined(*at));
    let spacing = median(&mut spacings.map(|((spacing, _), _)| spacing).collect::<Vec<_>>());
    Ok(spacing.map(|spacing| Coverage { spacing, covered, open, lone, covered_aslant }))
}

/// Whether one of the points at each position is examined.
fn examined_positions(distinct: &DistinctPositions, examined: &[bool]) -> Vec<bool> {
    let mut all = vec![false; distinct.len()];
    distinct.of_point().iter().zip(examined).for_each(|(position, examined)| all[*position as usize] |= *examined);
    all
}

/// The result for a position.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Found {
    /// No gap is open.
    Closed,
    /// A gap is open in the surfel's plane.
    Open,
    /// A gap is open, but only seen aslant.
    OpenAslant,
    /// The position does not lie on a surface.
    Lone,
}

impl Found {
    const OF_SURFACES: [Self; 3] = [Self::Closed, Self::Open, Self::OpenAslant];
}

/// A position, its neighbours, and the disks at all of them.
struct Gaps<'a, 'n, At> {
    distinct: &'a DistinctPositions,
    near: &'n [Neighbour],
    at: At,
    /// All disks at the position, the largest first. `own` is the largest.
    here: &'a [(&'a Surfel, Clip)],
    own: (&'a Surfel, Clip),
    /// From the position to its neighbours, scaled units.
    offsets: Vec<DVec3>,
    /// Whether the surface ends at the own disk's clip lines.
    ends: bool,
    normal: DVec3,
}

impl<'a, 'n, At: Fn(u32) -> &'a [(&'a Surfel, Clip)]> Gaps<'a, 'n, At> {
    /// Returns None if there is no disk at the position.
    fn new(distinct: &'a DistinctPositions, position: u32, near: &'n [Neighbour], at: At) -> Option<Self> {
        let here = at(position);
        let own = *here.first()?;
        let offset = |other: &Neighbour| distinct.position(other.index) - distinct.position(position);
        let offsets: Vec<DVec3> = near.iter().map(offset).collect();
        // The surface ends at the clip lines, unless a surfel beyond them faces the same side.
        let same_side = |disk: &(&Surfel, Clip)| side(disk).dot(side(&own)) > SAME_SIDE;
        let goes_on = |(other, offset): (&Neighbour, &DVec3)| {
            is_past(own, *offset / distinct.scale()) && at(other.index).iter().any(same_side)
        };
        let ends = !near.iter().zip(&offsets).any(goes_on);
        let normal = own.0.normal().as_dvec3().normalize_or(DVec3::Z);
        Some(Self { distinct, near, at, here, own, offsets, ends, normal })
    }

    fn found(&self, aslant: bool) -> Found {
        let normal = |other: &Neighbour| (self.at)(other.index).first().map_or(DVec3::ZERO, side);
        let (offsets, normals) = (self.offsets.iter().copied(), self.near.iter().map(normal));
        match surroundings(self.normal, offsets, normals) == Surroundings::Surface {
            false => Found::Lone,
            true if self.is_any_open() => Found::Open,
            true if aslant && self.is_any_open_aslant() => Found::OpenAslant,
            true => Found::Closed,
        }
    }

    /// The radius within which the neighbours fully bound the cell: half the distance of the
    /// farthest.
    fn known(&self) -> f64 {
        0.5 * self.offsets.last().map_or(0.0, |farthest| farthest.length())
    }

    /// The length of the own disk's longer half-axis, plus rounding.
    fn rim(&self) -> f64 {
        (1.0 + 10.0 * ROUNDING) * f64::from(self.own.0.radius()) * self.distinct.scale()
    }

    /// Whether `fits` holds for any disk; it is called with the disk and the offset of its centre,
    /// scaled units.
    fn any_disk(&self, fits: impl Fn(&(&Surfel, Clip), DVec3) -> bool) -> bool {
        let near = self.near.iter().zip(&self.offsets);
        self.here.iter().any(|disk| fits(disk, DVec3::ZERO))
            || near.into_iter().any(|(other, from)| (self.at)(other.index).iter().any(|disk| fits(disk, *from)))
    }

    /// Whether a gap is open in the plane of the own disk.
    fn is_any_open(&self) -> bool {
        let scale = self.distinct.scale();
        let closed = |place: DVec3| {
            self.ends && is_past(self.own, place / scale)
                || self.any_disk(|disk, from| reaches(*disk, (place - from) / scale))
        };
        let corners = Cell::new(&self.offsets, self.normal, (2.0 * self.known(), 0.0));
        let mut corners = corners.closed_corners().filter(|corner| corner.length() <= self.known());
        corners.any(|corner| !closed(corner) || !closed(corner.clamp_length_max(self.rim())))
    }

    /// Whether a gap is open along any oblique line of sight.
    fn is_any_open_aslant(&self) -> bool {
        let (along, across) = self.normal.any_orthonormal_pair();
        let (sine, cosine) = ASLANT.to_radians().sin_cos();
        (0..SIDES).any(|side| {
            let (y, x) = (std::f64::consts::TAU * side as f64 / SIDES as f64).sin_cos();
            self.is_open_along(self.normal * sine + (along * x + across * y) * cosine)
        })
    }

    /// Whether a line of sight through a corner of the cell in the image misses all disks. `sight`
    /// is the unit vector along it.
    ///
    /// This cell is the Voronoi cell among the neighbours that face the eye, projected along the
    /// line of sight into the own disk's plane. Corners that do not lie among them may lie past an
    /// outline and are left out.
    fn is_open_along(&self, sight: DVec3) -> bool {
        let scale = self.distinct.scale();
        let into_plane = |offset: DVec3| offset - sight * (offset.dot(self.normal) / sight.dot(self.normal));
        // The sign of normals may be arbitrary, so each normal is flipped to the side of the own
        // disk's normal.
        let faces = |normal: DVec3| normal.dot(sight) * normal.dot(self.normal).signum() > EDGE_ON;
        let facing = |other: &Neighbour| (self.at)(other.index).iter().any(|disk| faces(side(disk)));
        let seen = self.near.iter().zip(&self.offsets).filter(|(other, _)| facing(other));
        let mut seen: Vec<DVec3> = seen.map(|(_, offset)| into_plane(*offset)).collect();
        seen.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        let closed = |place: DVec3| {
            self.ends && is_past(self.own, place / scale)
                || self.any_disk(|disk, from| meets(*disk, (place - from) / scale, sight))
        };
        let known = KNOWN_ASLANT * self.known();
        let (x, y) = self.normal.any_orthonormal_pair();
        let is_amid = |corner: &DVec3| {
            let near = |other: &&DVec3| other.distance_squared(*corner) <= 4.0 * corner.length_squared();
            (0..OUTWARD).all(|k| {
                let (b, a) = (std::f64::consts::TAU * k as f64 / OUTWARD as f64).sin_cos();
                let is_beyond = |other: &DVec3| (*other - *corner).dot(x * a + y * b) > 0.0;
                is_beyond(&DVec3::ZERO) || seen.iter().filter(near).any(is_beyond)
            })
        };
        let corners = Cell::new(&seen, self.normal, (2.0 * self.known(), 0.0));
        let mut corners = corners.closed_corners().filter(|corner| corner.length() <= known && is_amid(corner));
        corners.any(|corner| !closed(corner))
    }
}

/// The unit normal of a disk; zero if it is degenerate.
fn side(disk: &(&Surfel, Clip)) -> DVec3 {
    disk.0.normal().as_dvec3().normalize_or_zero()
}

/// The disks at each position, the largest first.
struct Disks<'a> {
    all: Vec<(&'a Surfel, Clip)>,
    /// The index in `all` of each position's first disk, and a final entry: the length of `all`.
    starts: Vec<usize>,
}

impl Disks<'_> {
    fn of(&self, position: u32) -> &[(&Surfel, Clip)] {
        &self.all[self.starts[position as usize]..self.starts[position as usize + 1]]
    }
}

fn disks_of<'a>(distinct: &DistinctPositions, scene: &'a Scene) -> Disks<'a> {
    let mut order: Vec<(u32, u32)> = distinct.of_point().iter().copied().zip(0..).collect();
    let smallness = |surfel: u32| -scene.surfels[surfel as usize].radius();
    order
        .par_sort_unstable_by(|a, b| a.0.cmp(&b.0).then(smallness(a.1).total_cmp(&smallness(b.1))).then(a.1.cmp(&b.1)));
    let mut starts = vec![0; distinct.len() + 1];
    order.iter().for_each(|(position, _)| starts[*position as usize + 1] += 1);
    (0..distinct.len()).for_each(|position| starts[position + 1] += starts[position]);
    let disk = |&(_, surfel): &(u32, u32)| {
        (&scene.surfels[surfel as usize], scene.clips.get(surfel as usize).copied().unwrap_or_default())
    };
    Disks { all: order.iter().map(disk).collect(), starts }
}

/// Whether the disk covers the point at `offset` from its centre, projected into its plane.
fn reaches((surfel, clip): (&Surfel, Clip), offset: DVec3) -> bool {
    let [s, t] = half_axes(surfel);
    let within = offset.length_squared() <= s.length_squared().max(t.length_squared()) * (1.0 + ROUNDING);
    let at = on_disk([s, t], offset);
    within && at.length() <= 1.0 + ROUNDING && clip.inside(at.x, at.y) >= -ROUNDING
}

/// Whether the line along `sight` through the point at `offset` from the disk's centre meets the
/// disk.
fn meets((surfel, clip): (&Surfel, Clip), offset: DVec3, sight: DVec3) -> bool {
    let normal = side(&(surfel, clip));
    let slope = sight.dot(normal);
    slope.abs() > EDGE_ON && reaches((surfel, clip), offset - sight * (offset.dot(normal) / slope))
}

/// Whether a clip line separates the point at `offset` from the disk's centre.
fn is_past((surfel, clip): (&Surfel, Clip), offset: DVec3) -> bool {
    let at = on_disk(half_axes(surfel), offset);
    clip.inside(at.x, at.y) < 0.0
}

fn half_axes(surfel: &Surfel) -> [DVec3; 2] {
    [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)))
}

fn on_disk([s, t]: [DVec3; 2], offset: DVec3) -> DVec2 {
    DVec2::new(offset.dot(s) / s.length_squared(), offset.dot(t) / t.length_squared())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::io::Points;
    use crate::surfels::build;

    #[test]
    fn disks_on_a_grid_are_counted_from_the_size_that_closes_it() {
        let of_radius = |radius: f32| {
            let points = Points {
                positions: (0..2500).map(|i| [f64::from(i % 50) * 0.1, f64::from(i / 50) * 0.1, 0.0]).collect(),
                normals: Some(vec![[0.0, 0.0, 1.0]; 2500]),
                radii: Some(vec![radius; 2500]),
                ..Points::default()
            };
            coverage(&build(vec![points], &()).unwrap().0, &()).unwrap().unwrap()
        };
        // Disks close a grid if their radius is half the diagonal of the grid's squares. The rim of
        // the grid is no gap.
        let (small, large) = (of_radius(0.0705), of_radius(0.0709));
        assert!((small.spacing - 0.1).abs() < 1e-6, "{small:?}");
        assert_eq!((small.covered, small.open), (0.0, 2500));
        assert_eq!((large.covered, large.open), (1.0, 0));
        assert_eq!((small.covered_aslant, large.covered_aslant), (0.0, 1.0));
        let alone = Points { positions: vec![[1.0; 3]; 4], ..Points::default() };
        assert_eq!(coverage(&build(vec![alone], &()).unwrap().0, &()).unwrap(), None);
    }

    #[test]
    fn heights_open_gaps_that_are_seen_aslant_alone() {
        let of_heights = |height: f64, radius: f32| {
            let at = |i: u32| [f64::from(i % 50) * 0.1, f64::from(i / 50) * 0.1, height * f64::from((i * 7919) % 7)];
            let points = Points {
                positions: (0..2500).map(at).collect(),
                normals: Some(vec![[0.0, 0.0, 1.0]; 2500]),
                radii: Some(vec![radius; 2500]),
                ..Points::default()
            };
            coverage(&build(vec![points], &()).unwrap().0, &()).unwrap().unwrap()
        };
        let (even, rough, larger) = (of_heights(0.0, 0.08), of_heights(0.005, 0.08), of_heights(0.005, 0.2));
        assert_eq!((even.covered, even.covered_aslant), (1.0, 1.0));
        assert!(rough.covered == 1.0 && rough.covered_aslant < 0.3, "{rough:?}");
        // All positions except those at the rim of the grid are covered.
        assert!(larger.covered_aslant > 0.9, "{larger:?}");
    }
}
