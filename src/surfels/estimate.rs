//! Estimates normals and radii of points that lack them.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::eigen::Symmetric3;
use super::graph::NeighbourGraph;
use super::neighbours::Neighbour;
use super::positions::DistinctPositions;
use super::sizes::{Rough, cell_ellipse, grown, local_limits, lone_radius};
use crate::Progress;

/// The number of neighbours that a plane is fitted to. Fewer neighbours follow edges and curvature
/// more closely, more neighbours average noise.
///
/// RMS error of the normal in degrees on spheres of random points, for 8, 12, 16 and 24 neighbours:
/// 4.6, 2.8, 2.0, 1.3 (200,000 points with radial noise of 0.1 spacings); 17, 9.2, 6.3, 4.0 (noise
/// of 0.3 spacings); 1.8, 1.5, 1.4, 1.3 (2,000 points without noise). Beyond 16, further neighbours
/// gain less than they lose by rounding edges more widely.
pub(crate) const NORMAL_NEIGHBOURS: usize = 16;

/// A radius is at most this many times the median of the estimated radii, so that sparse noise does
/// not hide the scene.
pub(crate) const LARGEST_MEDIAN_RATIO: f64 = 8.0;

/// The radius, world units, if there is only one position, which determines no size.
pub(crate) const LONE_RADIUS: f64 = 0.5;

/// The smallest and largest radius of a surfel, world units: products of half-axes are normal f32
/// numbers.
pub(crate) const RADIUS_RANGE: (f64, f64) = (1e-18, 1e18);

/// The estimate at a position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Estimate {
    /// Half-axes s, the longer one, and t, world units. Their lengths are within [`RADIUS_RANGE`],
    /// and s x t points into the half-space of up.
    pub axes: [[f32; 3]; 2],
    /// Distance to the nearest neighbour, world units; zero without one.
    spacing: f32,
    /// The neighbours' heights over the plane, in the unit of positions.
    rough: Rough,
}

impl Estimate {
    /// The unit normal, in the half-space of up.
    pub fn normal(&self) -> Vec3 {
        let [s, t] = self.axes.map(|axis| DVec3::from_array(axis.map(f64::from)));
        s.cross(t).normalize_or(DVec3::Z).as_vec3()
    }

    /// The longer half-axis, world units.
    fn radius(&self) -> f64 {
        DVec3::from_array(self.axes[0].map(f64::from)).length()
    }
}

/// Shortens `axis` to at most `limit`.
fn at_most(axis: [f32; 3], limit: f64) -> [f32; 3] {
    DVec3::from_array(axis.map(f64::from)).clamp_length_max(limit).as_vec3().to_array()
}

/// The estimates for a set of distinct positions.
pub(crate) struct Estimates {
    /// The estimate at each position; the default where no estimate was wanted.
    pub of_position: Vec<Estimate>,
    /// Median over the wanted positions of the distance to the nearest other position, world units;
    /// None if there is only one position.
    pub median_spacing: Option<f64>,
    /// Whether the limit from the neighbours made the disk at each position smaller.
    pub limited: Vec<bool>,
    /// The neighbours of the wanted positions, the nearest first.
    pub graph: NeighbourGraph,
}

/// Estimates the half-axes of a disk at each position that is `wanted` (all for None), from all
/// positions.
///
/// The normal is the direction of least variance of the position and its [`NORMAL_NEIGHBOURS`]
/// nearest neighbours (Hoppe et al. 1992), turned toward `up`: the renderer turns normals to the
/// viewer, so the sign only has to be definite. The half-axes are those of [`cell_ellipse`], longer
/// where the surface is [`Rough`], and limited by [`local_limits`] to `largest_ratio` times the
/// median radius of the neighbours.
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
        (distinct, NORMAL_NEIGHBOURS, NORMAL_NEIGHBOURS),
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
    let growth = (0..distinct.len() as u32).into_par_iter().map(|index| {
        let growth = Rough::growth(&graph, index, |other| of_position[other as usize].rough);
        // The half-axes are in world units.
        if wanted(index as usize) { growth / distinct.scale() } else { 0.0 }
    });
    let growth: Vec<f64> = growth.collect();
    of_position.par_iter_mut().zip(growth).for_each(|(e, growth)| {
        let axes = e.axes.map(|axis| DVec3::from_array(axis.map(f64::from)));
        e.axes = grown(axes, growth).map(|axis| axis.as_vec3().to_array());
    });
    let radii: Vec<f64> = of_position.par_iter().map(Estimate::radius).collect();
    let limits = local_limits(&graph, &radii, largest_ratio, |position| {
        let normal = |position: u32| {
            let [s, t] = of_position[position as usize].axes.map(|axis| DVec3::from_array(axis.map(f64::from)));
            s.cross(t).normalize_or_zero()
        };
        // Radii are in world units.
        lone_radius((distinct, &graph), position, normal).map(|radius| (radius / distinct.scale()).max(RADIUS_RANGE.0))
    });
    let limited = limits.par_iter().zip(&radii).map(|(limit, radius)| radius > limit).collect();
    of_position.par_iter_mut().zip(limits).for_each(|(e, limit)| e.axes = e.axes.map(|axis| at_most(axis, limit)));
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
    let world = |length: f64| (length / distinct.scale()).clamp(RADIUS_RANGE.0, RADIUS_RANGE.1);
    let Some(nearest) = neighbours.first() else {
        let (s, t) = up.any_orthonormal_pair();
        return Estimate {
            axes: [s, t].map(|axis| (axis * LONE_RADIUS).as_vec3().to_array()),
            spacing: 0.0,
            rough: Rough::default(),
        };
    };
    let normal = fitted_normal(offsets, up);
    let axes = cell_ellipse(&offsets[1..], normal);
    Estimate {
        axes: axes.map(|axis| (axis.normalize() * world(axis.length())).as_vec3().to_array()),
        spacing: world(nearest.squared_distance.sqrt()) as f32,
        rough: Rough::of(&offsets[1..], normal),
    }
}

/// The direction in which the offsets vary least, in the half-space of the unit vector `up`. For
/// offsets on a line it is the direction perpendicular to the line that is nearest to `up`; if all
/// are equal, it is `up`.
pub(crate) fn fitted_normal(offsets: &[DVec3], up: DVec3) -> DVec3 {
    let largest = offsets.iter().fold(0.0, |m: f64, o| m.max(o.abs().max_element()));
    if largest == 0.0 {
        return up;
    }
    // Offsets are scaled to about 1, so the squares below are equally exact in dense and sparse
    // parts.
    let mean = offsets.iter().map(|o| o / largest).sum::<DVec3>() / offsets.len() as f64;
    let covariance = Symmetric3::scatter(offsets.iter().map(|o| o / largest - mean));
    let (values, vectors) = covariance.eigen();
    let across_line = |line: DVec3| {
        // Up comes first; the other axes serve a line along up.
        let candidates = [up, DVec3::X, DVec3::Y].map(|axis| axis - line * axis.dot(line));
        candidates.into_iter().find(|c| c.length_squared() > 1e-12).map_or(up, DVec3::normalize)
    };
    // A width of a millionth of the length is only the rounding of the coordinates.
    let normal = if values[1] <= 1e-12 * values[2] { across_line(vectors[2]) } else { vectors[0] };
    let side = normal.dot(up);
    let flip =
        side < 0.0 || (side == 0.0 && normal.to_array().into_iter().find(|c| *c != 0.0).is_some_and(|c| c < 0.0));
    if flip { -normal } else { normal }
}

/// The median (the upper one of two middle values); None without values.
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
