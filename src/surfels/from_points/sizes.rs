//! The sizes of surfels, and their limits.

use glam::DVec3;
use rayon::prelude::*;

use super::{FromPoints, HalfAxes, longer};
use crate::Progress;
use crate::surfels::estimate::{LONE_RADIUS, RADIUS_RANGE};
use crate::surfels::graph::NeighbourGraph;
use crate::surfels::planes::Neighbourhoods;
use crate::surfels::positions::DistinctPositions;
use crate::surfels::sizes::{
    LEAST, RADIUS_NEIGHBOURS, Rough, Size, bsp_radii, common_radius, grown, half_axes_at, local_limits, lone_radius,
    offsets, open_radius,
};

/// The sizes of the surfels at positions, in the units of [`DistinctPositions`].
pub(super) struct Sizes {
    size: Size,
    /// The longer half-axis at each position, before it is limited.
    radii: Vec<f64>,
    /// The largest half-axis that the neighbours of each position allow.
    limits: Vec<f64>,
    /// The half-axes for the positions' own normals; empty for disks.
    ellipses: Vec<[DVec3; 2]>,
    /// The number of positions whose cluster of three points is collinear.
    pub(super) collinear: u64,
    /// The positions around which one radius for all leaves gaps; empty with other sizes.
    sparse: Vec<bool>,
    /// Scaled units per world unit.
    scale: f64,
}

impl Sizes {
    pub(super) fn of(
        (distinct, graph): (&DistinctPositions, &NeighbourGraph),
        normals: &[[f32; 3]],
        measured: Option<&[f32]>,
        options: &FromPoints,
        progress: &dyn Progress,
    ) -> Self {
        let (mut ellipses, mut collinear, mut sparse) = (Vec::new(), 0, Vec::new());
        let radii: Vec<f64> = match options.size {
            Size::Bsp(triangle) => {
                let (radii, degenerate) = bsp_radii(distinct, triangle, progress);
                collinear = degenerate;
                radii
            }
            Size::BspGlobal(triangle) => {
                let radius = common_radius(distinct, triangle, progress);
                let needed = |at: u32| LEAST * open_radius(offsets(distinct, graph, at, RADIUS_NEIGHBOURS));
                sparse = (0..distinct.len() as u32).into_par_iter().map(|at| needed(at) > radius).collect();
                vec![radius; distinct.len()]
            }
            Size::Qsplat => {
                let own = largest_at(distinct, measured.unwrap_or_default()).into_par_iter().enumerate();
                // Vertices of no triangle are sized like points.
                let cell = |position: usize| {
                    let [s, _] = half_axes_at(Size::Knn, (distinct, graph), position as u32, normals[position]);
                    s.length()
                };
                own.map(|(position, radius)| if radius > 0.0 { radius } else { cell(position) }).collect()
            }
            size @ (Size::Knn | Size::Ellipse) => {
                let own = normals.par_iter().zip(0..distinct.len() as u32);
                let at =
                    |(normal, position): (&[f32; 3], u32)| half_axes_at(size, (distinct, graph), position, *normal);
                ellipses = own.map(at).collect();
                if size == Size::Knn {
                    ellipses = roughened((distinct, graph), normals, ellipses);
                }
                ellipses.par_iter().map(|[s, _]| s.length()).collect()
            }
        };
        let lone = |position: u32| {
            let normal = |position: u32| DVec3::from_array(normals[position as usize].map(f64::from));
            Some(position)
                .filter(|_| options.size == Size::Knn)
                .and_then(|at| lone_radius((distinct, graph), at, normal))
        };
        let limits = local_limits(graph, &radii, options.limits.largest_ratio, lone);
        Self { size: options.size, radii, limits, ellipses, collinear, sparse, scale: distinct.scale() }
    }

    /// Returns the half-axes of points with the normals `point_normals` (None for disks), and the
    /// lengths of the longer half-axes, world units.
    pub(super) fn of_points(
        &self,
        (distinct, graph): (&DistinctPositions, &NeighbourGraph),
        normals: &[[f32; 3]],
        point_normals: &[[f32; 3]],
    ) -> (Option<HalfAxes>, Vec<f32>) {
        let positions = distinct.of_point().par_iter();
        if self.ellipses.is_empty() {
            return (None, positions.map(|&position| self.length(position) as f32).collect());
        }
        let ellipse = |(&position, &normal)| self.ellipse((distinct, graph), normals, position, normal);
        let axes: HalfAxes = positions.zip(point_normals).map(ellipse).collect();
        let radii = longer(&axes);
        (Some(axes), radii)
    }

    /// The number of points, at these positions, whose surfels were made smaller because of their
    /// neighbours.
    pub(super) fn limited(&self, of_point: &[u32]) -> u64 {
        let limited = |position: usize| self.radii[position] > self.limits[position];
        of_point.par_iter().filter(|position| limited(**position as usize)).count() as u64
    }

    /// The number of points that lie too sparsely for the one radius of all.
    pub(super) fn sparse(&self, of_point: &[u32]) -> u64 {
        let is_sparse = |position: &&u32| self.sparse.get(**position as usize).is_some_and(|sparse| *sparse);
        of_point.par_iter().filter(is_sparse).count() as u64
    }

    fn world(&self, length: f64) -> f64 {
        (length / self.scale).clamp(RADIUS_RANGE.0, RADIUS_RANGE.1)
    }

    /// The longer half-axis at a position after limiting, world units.
    fn length(&self, position: u32) -> f64 {
        let radius = self.radii[position as usize].min(self.limits[position as usize]);
        if radius > 0.0 { self.world(radius) } else { LONE_RADIUS }
    }

    /// The half-axes at a position for a point with the normal `normal`, world units. The length of
    /// the position's own ellipse limits them, even if `normal` is not the position's own normal.
    fn ellipse(
        &self,
        (distinct, graph): (&DistinctPositions, &NeighbourGraph),
        normals: &[[f32; 3]],
        position: u32,
        normal: [f32; 3],
    ) -> [[f32; 3]; 2] {
        let own = normal == normals[position as usize];
        let at = || half_axes_at(self.size, (distinct, graph), position, normal);
        let axes = if own { self.ellipses[position as usize] } else { at() };
        let length = self.length(position);
        let axes = if axes[0] == DVec3::ZERO {
            let (a, b) = DVec3::from_array(normal.map(f64::from)).normalize().any_orthonormal_pair();
            [a * length, b * length]
        } else {
            axes.map(|axis| axis.normalize() * self.world(axis.length()).min(length))
        };
        axes.map(|axis| axis.as_vec3().to_array())
    }
}

/// The half-axes of all positions, longer where the surface is rough.
fn roughened(
    (distinct, graph): (&DistinctPositions, &NeighbourGraph),
    normals: &[[f32; 3]],
    axes: Vec<[DVec3; 2]>,
) -> Vec<[DVec3; 2]> {
    let at = |index: u32| {
        let near = Neighbourhoods::around((distinct, graph), [index]);
        Rough::of(near.of_neighbours(0), DVec3::from_array(normals[index as usize].map(f64::from)).normalize())
    };
    let rough: Vec<Rough> = (0..distinct.len() as u32).into_par_iter().map(at).collect();
    let own = axes.into_par_iter().zip(0..distinct.len() as u32);
    own.map(|(axes, index)| grown(axes, Rough::growth(graph, index, |other| rough[other as usize]))).collect()
}

/// The largest of the radii of the points at each position, scaled units; `radii` is in world
/// units.
fn largest_at(distinct: &DistinctPositions, radii: &[f32]) -> Vec<f64> {
    let mut largest = vec![0.0f64; distinct.len()];
    for (&position, radius) in distinct.of_point().iter().zip(radii) {
        let own = &mut largest[position as usize];
        *own = own.max(f64::from(*radius) * distinct.scale());
    }
    largest
}
