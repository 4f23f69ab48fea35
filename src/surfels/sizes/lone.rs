//! Lone points, which no surface surrounds: leaves, wires, spray.

use glam::DVec3;

use super::{RADIUS_NEIGHBOURS, offsets};
use crate::surfels::estimate::NORMAL_NEIGHBOURS;
use crate::surfels::graph::NeighbourGraph;
use crate::surfels::positions::DistinctPositions;

/// A point is lone if at most this many of its [`NORMAL_NEIGHBOURS`] neighbours lie on one surface
/// with it. In a crown of random leaves 55 % of the points are lone, on noisy ground one of 2,000,
/// and none of the vertices of the Stanford bunny.
const MOST_BESIDE: usize = 4;

/// The cosine of 45 degrees: the planes of two points of one surface differ by a smaller angle.
const ONE_SURFACE: f64 = 0.7;

/// The sine of 30 degrees: the elevation of a point over the plane of another point of the same
/// surface is lower.
const LOWEST: f64 = 0.5;

/// The largest radius of a lone point's disk, as a fraction of the point's mean distance to
/// [`RADIUS_NEIGHBOURS`] neighbours. Among random points, it is about the distance of the nearest
/// one.
const PART: f64 = 0.5;

/// A point lies on a line with its neighbours if they all are near the line to the farthest
/// neighbour: within this fraction of the farthest neighbour's distance. With 16 neighbours on a
/// surface this does not occur, unless scan lines are as far apart as eight points on one of them.
const LINE: f64 = 0.12;

/// The largest radius of the disk of a point on a line, as a fraction of the point's mean distance
/// to [`RADIUS_NEIGHBOURS`] neighbours. For evenly spaced points, it is three quarters of the
/// spacing.
const PART_OF_LINE: f64 = 0.3;

/// Returns the largest radius of the disk of a lone position, in the unit of positions.
///
/// None if a surface surrounds the position, or there are too few points to tell. `normal` is the
/// unit normal at a position, with either sign, or zero if it is unknown.
pub(crate) fn lone_radius(
    (distinct, graph): (&DistinctPositions, &NeighbourGraph),
    index: u32,
    normal: impl Fn(u32) -> DVec3,
) -> Option<f64> {
    let near = graph.of(index);
    let all = offsets(distinct, graph, index, near.len());
    let part = surroundings(normal(index), all.clone(), near.iter().map(|other| normal(*other))).part()?;
    let mean = all.take(RADIUS_NEIGHBOURS).map(DVec3::length).sum::<f64>() / RADIUS_NEIGHBOURS as f64;
    Some(part * mean)
}

/// The surroundings of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Surroundings {
    /// A surface, or too few neighbours to tell.
    Surface,
    /// A line: a wire, or one scan line without another beside it.
    Line,
    /// Points on all sides.
    Volume,
}

impl Surroundings {
    /// The largest radius of a disk, as a fraction of the mean distance to the neighbours; None if
    /// there is no limit.
    fn part(self) -> Option<f64> {
        match self {
            Self::Surface => None,
            Self::Line => Some(PART_OF_LINE),
            Self::Volume => Some(PART),
        }
    }
}

/// Classifies the surroundings of a point from its unit normal `own` and the offsets and unit
/// normals of its neighbours, the nearest first. Normals have either sign, and are zero if unknown.
pub(crate) fn surroundings(
    own: DVec3,
    offsets: impl Iterator<Item = DVec3> + Clone,
    normals: impl Iterator<Item = DVec3>,
) -> Surroundings {
    let offsets = offsets.take(NORMAL_NEIGHBOURS);
    let Some(farthest) = offsets.clone().nth(NORMAL_NEIGHBOURS - 1) else { return Surroundings::Surface };
    let most = (LINE * farthest.length_squared()).powi(2);
    if offsets.clone().all(|offset| offset.cross(farthest).length_squared() <= most) {
        return Surroundings::Line;
    }
    let on_surface = |(offset, other): &(DVec3, DVec3)| {
        let low = LOWEST * offset.length();
        let agrees = own.dot(*other).abs() > ONE_SURFACE && other.dot(*offset).abs() < low;
        own.dot(*offset).abs() < low && (agrees || *other == DVec3::ZERO)
    };
    // On a surface, the first few neighbours suffice.
    let more_beside = offsets.zip(normals).filter(on_surface).nth(MOST_BESIDE);
    if more_beside.is_none() { Surroundings::Volume } else { Surroundings::Surface }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::scene::Bounds;
    use crate::surfels::planes::fitted_normal;
    use rayon::prelude::*;

    /// The fraction of lone points among 2,000 in a unit cube that is flattened to this height,
    /// with normals of the planes through their neighbours.
    fn lone(height: f64) -> f64 {
        let mut random = Random::stream(11, 0);
        let mut number = || random.number();
        let positions: Vec<[f64; 3]> = (0..2000).map(|_| [number(), number(), height * number()]).collect();
        let bounds = Bounds::of(positions.par_iter().map(|position| DVec3::from_array(*position)));
        let distinct = DistinctPositions::new(&positions, &bounds, DVec3::ZERO).unwrap();
        let graph = NeighbourGraph::new(&distinct, NORMAL_NEIGHBOURS, &());
        let normals: Vec<DVec3> = (0..2000)
            .map(|index| {
                let near = offsets(&distinct, &graph, index, NORMAL_NEIGHBOURS);
                fitted_normal(&std::iter::once(DVec3::ZERO).chain(near).collect::<Vec<_>>(), DVec3::Z)
            })
            .collect();
        let radius = |index| lone_radius((&distinct, &graph), index, |other| normals[other as usize]);
        (0..2000).filter_map(radius).filter(|radius| *radius > 0.0).count() as f64 / 2000.0
    }

    #[test]
    fn leaves_are_lone_and_ground_is_not() {
        // The mean spacing is 0.022 in the plane, and the noise a third of it.
        assert!(lone(0.02) < 0.01, "{}", lone(0.02));
        assert!(lone(1.0) > 0.4, "{}", lone(1.0));
    }

    #[test]
    fn of_few_points_nothing_is_told() {
        let positions: Vec<[f64; 3]> =
            (0..9).map(|k| [f64::from(k % 3), f64::from(k / 3), f64::from(k * k % 5)]).collect();
        let bounds = Bounds::of(positions.par_iter().map(|position| DVec3::from_array(*position)));
        let distinct = DistinctPositions::new(&positions, &bounds, DVec3::ZERO).unwrap();
        let graph = NeighbourGraph::new(&distinct, NORMAL_NEIGHBOURS, &());
        assert_eq!(lone_radius((&distinct, &graph), 0, |_| DVec3::Z), None);
    }

    #[test]
    fn wires_are_lines_and_dense_scan_lines_are_not() {
        let of = |spacing: [f64; 2]| {
            let at = |k: i32| DVec3::new(spacing[0] * f64::from(k / 99 - 9), spacing[1] * f64::from(k % 99 - 49), 0.0);
            let mut offsets: Vec<DVec3> = (0..19 * 99).map(at).filter(|offset| *offset != DVec3::ZERO).collect();
            offsets.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
            surroundings(DVec3::Z, offsets.into_iter(), std::iter::repeat(DVec3::Z))
        };
        assert_eq!([1.0, 3.0, 7.0, 12.0].map(|apart| of([apart, 1.0])), {
            use Surroundings::{Line, Surface};
            [Surface, Surface, Surface, Line]
        });
    }
}
