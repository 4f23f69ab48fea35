//! Normals and radii for points that come without.

use glam::DVec3;
use rayon::prelude::*;

use super::eigen::Symmetric3;
use super::gaps::Cell;
use super::graph::NeighbourGraph;
use super::neighbours::Neighbour;
use super::positions::DistinctPositions;
use super::sizes::local_limits;
use crate::Progress;

/// How many neighbours a plane is fitted to. Few follow edges and curvature, many average noise. Measured on spheres of
/// random points, RMS error of the normal in degrees, for 8, 12, 16, 24 neighbours: 200,000 points with radial noise of
/// 0.1 spacings 4.6, 2.8, 2.0, 1.3; with 0.3 spacings 17, 9.2, 6.3, 4.0; 2,000 points without noise 1.8, 1.5, 1.4, 1.3.
/// From 16 on more neighbours buy little that their wider rounding of edges does not cost.
pub(crate) const NORMAL_NEIGHBOURS: usize = 16;

/// How many neighbours a radius is the mean distance of: the first two rings of a square grid.
pub(crate) const RADIUS_NEIGHBOURS: usize = 8;

/// Disk radius for each unit of mean distance to [`RADIUS_NEIGHBOURS`] neighbours: 1.2 spacings on a square grid. Disks of it would
/// leave 0.4 % of a random (Poisson) plane uncovered; wider gaps than it closes are measured one by one.
const RADIUS_FACTOR: f64 = 1.0;

/// A disk reaches past the farthest corner of its cell by this factor, as surfaces are not flat and normals not exact.
const PAST_CORNER: f64 = 1.05;

/// Where the cell ends that no neighbour bounds, in distances to the farthest neighbour: a corner beyond is of no gap that they know.
const CELL_REACH: f64 = 1.5;

/// For the sake of its cell, a disk becomes larger by at most this factor. At a ragged boundary corners lie outside of the surface.
const LARGEST_FOR_CELL: f64 = 1.8;

/// A radius is at most this many times the mean distance of its neighbours from their own centre. That distance is a
/// point's own mean distance where points surround it, and stays small for an outlier that sees a far surface.
const LARGEST_LOCAL_RATIO: f64 = 2.0;

/// A radius is at most this many times the median of the estimated ones, so that sparse noise does not hide the scene.
pub(crate) const LARGEST_MEDIAN_RATIO: f64 = 8.0;

/// The radius in world units where there is one position only, and so no size to go by.
pub(crate) const LONE_RADIUS: f64 = 0.5;

/// The smallest and largest radius of any surfel, world units: products of half-axes stay normal f32 numbers.
pub(crate) const RADIUS_RANGE: (f64, f64) = (1e-18, 1e18);

/// What the surroundings of a position suggest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Estimate {
    /// Unit normal, in the half-space of the up axis.
    pub normal: [f32; 3],
    /// Disk radius, world units, within [`RADIUS_RANGE`].
    pub radius: f32,
    /// Distance to the nearest neighbour, world units; zero where there is none.
    spacing: f32,
}

/// Estimates for a set of distinct positions.
pub(crate) struct Estimates {
    /// One for each position; default where it was not wanted.
    pub of_position: Vec<Estimate>,
    /// Median over the wanted positions of the distance to the nearest other position, world units; None if there is
    /// one position only.
    pub median_spacing: Option<f64>,
    /// Of each position, whether its radius would have been larger.
    pub limited: Vec<bool>,
    /// The neighbours of the wanted positions, the nearest first.
    pub graph: NeighbourGraph,
}

/// Estimates a normal and a radius at each position where `wanted` says so (everywhere for None), from all positions.
///
/// The normal is the direction of least variance of the position and its [`NORMAL_NEIGHBOURS`] nearest others (Hoppe et
/// al. 1992), turned toward `up`: the renderer turns normals to the viewer, so the sign only has to be definite.
/// The radius is that of [`fitted_radius`], and at most `largest_ratio` times the median of those of the neighbours that have one, as
/// [`local_limits`] says.
pub(crate) fn estimate(
    distinct: &DistinctPositions,
    wanted: Option<&[bool]>,
    (up, largest_ratio): (DVec3, f64),
    progress: &dyn Progress,
) -> Estimates {
    let wanted = |index: usize| wanted.is_none_or(|flags| flags.get(index).copied().unwrap_or(false));
    progress.begin("estimating normals and radii", distinct.len() as u64);
    let mut of_position = vec![Estimate::default(); distinct.len()];
    let graph = NeighbourGraph::visit(
        (distinct, NORMAL_NEIGHBOURS, RADIUS_NEIGHBOURS),
        wanted,
        &mut of_position,
        progress,
        |index, neighbours| estimate_at(distinct, index, neighbours, up),
    );
    progress.end();
    if distinct.len() < 2 {
        let limited = vec![false; distinct.len()];
        return Estimates { of_position, median_spacing: None, limited, graph };
    }
    let radii: Vec<f64> = of_position.par_iter().map(|e| e.radius.into()).collect();
    let limits = local_limits(&graph, &radii, largest_ratio);
    let limited = limits.par_iter().zip(&radii).map(|(limit, radius)| radius > limit).collect();
    of_position.par_iter_mut().zip(limits).for_each(|(e, limit)| e.radius = e.radius.min(limit as f32));
    let spacings = of_position.par_iter().enumerate().filter(|(index, _)| wanted(*index));
    let median_spacing = median(&mut spacings.map(|(_, e)| e.spacing.into()).collect::<Vec<f64>>());
    Estimates { of_position, median_spacing, limited, graph }
}

fn estimate_at(distinct: &DistinctPositions, index: u32, neighbours: &[Neighbour], up: DVec3) -> Estimate {
    let center = distinct.position(index);
    let mut offsets = [DVec3::ZERO; NORMAL_NEIGHBOURS + 1];
    let mut count = 1;
    // The first offset stays zero: it is the position itself.
    for (offset, neighbour) in offsets.iter_mut().skip(1).zip(neighbours) {
        *offset = distinct.position(neighbour.index) - center;
        count += 1;
    }
    let offsets = &offsets[..count];
    let world = |length: f64| (length / distinct.scale()).clamp(RADIUS_RANGE.0, RADIUS_RANGE.1) as f32;
    let Some(nearest) = neighbours.first() else {
        return Estimate { normal: up.as_vec3().to_array(), radius: LONE_RADIUS as f32, spacing: 0.0 };
    };
    let normal = fitted_normal(offsets, up);
    Estimate {
        normal: normal.as_vec3().to_array(),
        radius: world(fitted_radius(&offsets[1..], normal)),
        spacing: world(nearest.squared_distance.sqrt()),
    }
}

/// A radius from the offsets of the nearest neighbours, the nearest first, in their unit, and the unit normal across which they lie:
/// [`RADIUS_FACTOR`] times the mean distance to [`RADIUS_NEIGHBOURS`] of them, within [`LARGEST_LOCAL_RATIO`], or more where the
/// point's [cell](Cell) reaches farther.
///
/// Measured on random points of a sphere, 1,000,000, and on the vertices of igea, the Stanford bunny and the Dragon (1024x1024, PSNR
/// against rays with `radius:1`): 1.2 times the mean distance alone leaves 3.7e-4 of the sphere's pixels to its back, and gives 31.2,
/// 24.3 and 31.8 dB; this 5e-6, and 32.3, 25.5 and 33.0 dB, as disks are smaller where points are evenly spaced.
pub(crate) fn fitted_radius(offsets: &[DVec3], normal: DVec3) -> f64 {
    let near = &offsets[..offsets.len().min(RADIUS_NEIGHBOURS)];
    let count = near.len() as f64;
    let mean_distance = near.iter().map(|o| o.length()).sum::<f64>() / count;
    if near.len() < RADIUS_NEIGHBOURS {
        return RADIUS_FACTOR * mean_distance;
    }
    let center = near.iter().sum::<DVec3>() / count;
    let spread = near.iter().map(|o| o.distance(center)).sum::<f64>() / count;
    let radius = RADIUS_FACTOR * mean_distance.min(LARGEST_LOCAL_RATIO * spread);
    let reach = CELL_REACH * offsets.last().map_or(0.0, |farthest| farthest.length());
    let of_cell = PAST_CORNER * Cell::new(offsets, normal, (reach, radius / PAST_CORNER)).farthest_corner();
    radius.max(of_cell.min(LARGEST_FOR_CELL * radius))
}

/// The direction in which the offsets vary least, in the half-space of `up` (a unit vector). For offsets on a line it
/// is the direction across the line nearest to `up`, for coincident ones it is `up`.
pub(crate) fn fitted_normal(offsets: &[DVec3], up: DVec3) -> DVec3 {
    let largest = offsets.iter().fold(0.0, |m: f64, o| m.max(o.abs().max_element()));
    if largest == 0.0 {
        return up;
    }
    // Offsets of about one, whatever the spacing: the squares below are as exact for dense parts as for sparse ones.
    let mean = offsets.iter().map(|o| o / largest).sum::<DVec3>() / offsets.len() as f64;
    let covariance = Symmetric3::scatter(offsets.iter().map(|o| o / largest - mean));
    let (values, vectors) = covariance.eigen();
    let across_line = |line: DVec3| {
        // Up itself, then the other axes, in case the line is along up.
        let candidates = [up, DVec3::X, DVec3::Y].map(|axis| axis - line * axis.dot(line));
        candidates.into_iter().find(|c| c.length_squared() > 1e-12).map_or(up, DVec3::normalize)
    };
    // A width of a millionth of the length is the rounding of the coordinates and says nothing.
    let normal = if values[1] <= 1e-12 * values[2] { across_line(vectors[2]) } else { vectors[0] };
    let side = normal.dot(up);
    let flip =
        side < 0.0 || (side == 0.0 && normal.to_array().into_iter().find(|c| *c != 0.0).is_some_and(|c| c < 0.0));
    if flip { -normal } else { normal }
}

/// The middle value (the upper one of two).
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degenerate_neighbourhoods_have_a_normal() {
        let up = DVec3::Z;
        assert_eq!(fitted_normal(&[DVec3::ZERO; 5], up), up);
        for size in [1e-150, 1.0, 1e150] {
            let line: Vec<_> = (0..13).map(|i| DVec3::new(i as f64, 0.0, i as f64) * size).collect();
            let normal = fitted_normal(&line, up);
            assert!(normal.distance(DVec3::new(-1.0, 0.0, 1.0).normalize()) < 1e-12, "{normal}");
            let upright: Vec<_> = (0..13).map(|i| DVec3::new(0.0, 0.0, i as f64) * size).collect();
            assert!(fitted_normal(&upright, up).distance(DVec3::X) < 1e-12);
            let wall: Vec<_> = (0..13).map(|i| DVec3::new(0.0, (i % 4) as f64, (i / 4) as f64) * size).collect();
            assert!(fitted_normal(&wall, up).distance(DVec3::X) < 1e-12);
        }
    }

    #[test]
    fn median_is_the_middle() {
        assert_eq!(median(&mut []), None);
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
    }
}
