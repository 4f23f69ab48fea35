//! Refits normals of points whose neighbours lie on several sheets: at thin parts, folds and their
//! rims.
//!
//! A plane fitted to points of two sheets lies in neither, and where a part is thinner than its
//! points' spacing, the plane stands across both. Once normals have sides, the sheets can be
//! separated: the neighbours on one sheet face the same way, and the point lies in their planes.

use glam::DVec3;
use rayon::prelude::*;

use super::graph::NeighbourGraph;
use super::planes::fitted_normal;
use super::positions::DistinctPositions;

/// The sine of the point's elevation over a neighbour's plane at which the neighbour's weight falls
/// to 1/e: 11 degrees.
const SAME_PLANE: f64 = 0.2;

/// The neighbours lie to one side if the mean of the unit vectors to them is longer than this: the
/// mean is 0.64 long for points of a half-plane, and 0 for points of a plane.
const ONE_SIDED: f64 = 0.5;

/// The number of points, besides the position itself, that a plane needs.
const FEWEST: usize = 3;

/// Refits those of the oriented `normals` for which a neighbour faces the other way, each to
/// neighbours of its own sheet.
///
/// The own sheet is that of the neighbours in whose planes the position lies. At the rim of a thin
/// part, there is no such sheet, or one on either side. All neighbours then lie behind the
/// position, and the normal is turned to point away from them. Other normals do not change. On the
/// 1,839 points of `data/bunny.obj`, whose ears are thinner than the points' spacing, this reduces
/// the mean error from 7.1 to 6.1 degrees, the 99th percentile from 47 to 34 degrees, and the
/// normals on the wrong side from 3 to 0.
pub(crate) fn refit(distinct: &DistinctPositions, graph: &NeighbourGraph, normals: &mut [[f32; 3]]) {
    let before = normals.to_vec();
    let at = |index: u32| DVec3::from_array(before[index as usize].map(f64::from));
    normals.par_iter_mut().enumerate().for_each_init(Vec::new, |offsets, (index, normal)| {
        let index = index as u32;
        let own = at(index);
        if graph.of(index).iter().any(|&other| at(other).dot(own) < 0.0)
            && let Some(separated) = of_own_sheet(distinct, graph.of(index), index, &at, offsets)
        {
            *normal = separated.as_vec3().to_array();
        }
    });
}

/// The normal of the position's own sheet; None if too few neighbours agree on one.
fn of_own_sheet(
    distinct: &DistinctPositions,
    neighbours: &[u32],
    index: u32,
    normal: &impl Fn(u32) -> DVec3,
    offsets: &mut Vec<DVec3>,
) -> Option<DVec3> {
    let center = distinct.position(index);
    let (mut facing, mut weights, mut away) = (DVec3::ZERO, 0.0, DVec3::ZERO);
    for &other in neighbours {
        let offset = distinct.position(other) - center;
        let distance = offset.length();
        let elevation = normal(other).dot(offset) / distance;
        let weight = (-(elevation / SAME_PLANE).powi(2)).exp() / distance;
        facing += normal(other) * weight;
        weights += weight;
        away -= offset / distance;
    }
    away /= neighbours.len() as f64;
    let side = (facing / weights.max(f64::MIN_POSITIVE) + away).try_normalize()?;
    if away.length() > ONE_SIDED {
        return Some(side);
    }
    offsets.clear();
    offsets.push(DVec3::ZERO);
    let on_sheet = neighbours.iter().filter(|&&other| normal(other).dot(side) > 0.0);
    offsets.extend(on_sheet.map(|&other| distinct.position(other) - center));
    (offsets.len() > FEWEST).then(|| fitted_normal(offsets, side))
}
