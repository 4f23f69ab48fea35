//! Estimates normals and radii of points that lack them.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::graph::NeighbourGraph;
use super::planes::{Neighbourhoods, TOGETHER};
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

/// The number of positions that a thread processes at a time; a multiple of [`TOGETHER`].
const CHUNK: usize = 4096;

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
    let count = distinct.len();
    progress.begin("finding neighbours", count as u64);
    let degree = (distinct, NORMAL_NEIGHBOURS, NORMAL_NEIGHBOURS);
    let graph = NeighbourGraph::visit(degree, wanted, &mut vec![(); count], progress, |_, _| ());
    progress.end();
    progress.begin("estimating normals and radii", count as u64);
    let mut of_position = vec![Estimate::default(); count];
    of_position.par_chunks_mut(CHUNK).zip((0..count).into_par_iter().step_by(CHUNK)).for_each(|(chunk, first)| {
        for (group, first) in chunk.chunks_mut(TOGETHER).zip((first..).step_by(TOGETHER)) {
            let last = first + group.len() - 1;
            if (first..=last).any(wanted) {
                let indices = std::array::from_fn(|lane| (first + lane).min(last) as u32);
                let estimates = estimates_at((distinct, &graph), indices, up);
                let each = (first..).zip(group.iter_mut().zip(estimates));
                each.filter(|(index, _)| wanted(*index)).for_each(|(_, (slot, estimate))| *slot = estimate);
            }
        }
        progress.advance(chunk.len() as u64);
    });
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

/// The estimates at several positions.
fn estimates_at(
    (distinct, graph): (&DistinctPositions, &NeighbourGraph),
    indices: [u32; TOGETHER],
    up: DVec3,
) -> [Estimate; TOGETHER] {
    let near = Neighbourhoods::around((distinct, graph), indices);
    let normals = near.normals(up);
    std::array::from_fn(|lane| estimate_at(near.of_neighbours(lane), normals[lane], (up, distinct.scale())))
}

/// The estimate at a position with the unit normal `normal`, from the offsets of its neighbours, the
/// nearest first; `scale` is in scaled units per world unit.
fn estimate_at(offsets: &[DVec3], normal: DVec3, (up, scale): (DVec3, f64)) -> Estimate {
    let world = |length: f64| (length / scale).clamp(RADIUS_RANGE.0, RADIUS_RANGE.1);
    let Some(nearest) = offsets.first() else {
        let (s, t) = up.any_orthonormal_pair();
        return Estimate {
            axes: [s, t].map(|axis| (axis * LONE_RADIUS).as_vec3().to_array()),
            spacing: 0.0,
            rough: Rough::default(),
        };
    };
    let axes = cell_ellipse(offsets, normal);
    Estimate {
        axes: axes.map(|axis| (axis.normalize() * world(axis.length())).as_vec3().to_array()),
        spacing: world(nearest.length()) as f32,
        rough: Rough::of(offsets, normal),
    }
}

/// The median (the upper one of two middle values); None without values.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The median (the upper one of two middle values) of a few numbers, without a branch.
pub(crate) fn median_of_few<const COUNT: usize>(mut values: [f64; COUNT]) -> f64 {
    // Neighbours are put in order, in as many rounds as there are values.
    for round in 0..COUNT {
        for k in (round % 2..COUNT - 1).step_by(2) {
            let (a, b) = (values[k], values[k + 1]);
            (values[k], values[k + 1]) = if b < a { (b, a) } else { (a, b) };
        }
    }
    values[COUNT / 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_is_the_middle() {
        assert_eq!(median(&mut []), None);
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
        let mut random = crate::random::Random::stream(2, 0);
        for _ in 0..1000 {
            let mut few: [f64; 9] = std::array::from_fn(|_| (8.0 * random.number()).floor());
            let [first, eight @ ..] = few;
            assert_eq!((Some(median_of_few(few)), first >= 0.0), (median(&mut few), true));
            assert_eq!(Some(median_of_few(eight)), median(&mut { eight }));
        }
    }
}
