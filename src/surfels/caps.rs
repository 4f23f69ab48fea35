//! Caps of points: the curvature of the surface around each, estimated from its neighbours.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::curvature::{Around, normals_at};
use super::estimate::NORMAL_NEIGHBOURS;
use super::from_points::HalfAxes;
use super::graph::NeighbourGraph;
use super::origin_for;
use super::positions::DistinctPositions;
use crate::io::Points;
use crate::scene::{Bounds, Cap, body};
use crate::{Progress, Result};

/// The caps of surfels with these `normals` and half-axes; `sided` says whether the normals
/// distinguish the two sides of the surface.
pub(super) fn caps_of(
    (distinct, graph): (&DistinctPositions, &NeighbourGraph),
    (normals, sided): (&[[f32; 3]], bool),
    axes: &HalfAxes,
) -> Vec<Cap> {
    let of_positions = normals_at(distinct, |point| Some(Vec3::from_array(normals[point])));
    let normal =
        |position: u32| of_positions[position as usize].map_or(DVec3::ZERO, |n| n.as_dvec3().normalize_or_zero());
    let around = Around { distinct, graph, normal, sided };
    distinct.map_points(|point, position| around.cap(position, axes[point as usize]))
}

/// Gives points with half-axes the caps of the surface that is tangent to their planes.
///
/// The curvature is estimated from the normals of the half-axes, not from the shading normals.
/// Points without half-axes are returned unchanged.
///
/// # Errors
///
/// [`Error::Usage`](crate::Error::Usage) for more than 2^32 - 1 points.
pub fn curve(points: Points, progress: &dyn Progress) -> Result<Points> {
    let Some(axes) = &points.axes else { return Ok(points) };
    let normals: Vec<[f32; 3]> = axes
        .par_iter()
        .map(|axes| {
            let [s, t] = axes.map(|axis| DVec3::from_array(axis.map(f64::from)));
            s.cross(t).normalize_or_zero().as_vec3().to_array()
        })
        .collect();
    let bounds = Bounds::of(points.positions.par_iter().map(|position| DVec3::from_array(*position)));
    let (body, _) = body(points.positions.len(), |index| DVec3::from_array(points.positions[index]));
    progress.begin("sorting points", 0);
    let distinct = DistinctPositions::new(&points.positions, &bounds, origin_for(&body))?;
    progress.end();
    let graph = NeighbourGraph::new(&distinct, NORMAL_NEIGHBOURS, progress);
    let caps = caps_of((&distinct, &graph), (&normals, true), axes);
    Ok(Points { caps: Some(caps), tree: None, ..points })
}
