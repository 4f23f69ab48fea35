//! Normals where the neighbours of a point lie on several sheets: thin parts, folds and their rims.
//!
//! A plane fitted to points of two sheets lies in neither, and where a part is thinner than its points are apart it stands
//! across both. Once normals have sides, sheets can be told apart: neighbours on one face the same way, and the point
//! lies in their planes.

use glam::DVec3;
use rayon::prelude::*;

use super::estimate::fitted_normal;
use super::graph::NeighbourGraph;
use super::positions::DistinctPositions;

/// The sine of the elevation of a point over its neighbour's plane at which the neighbour's say falls to 1/e: 11 degrees.
const SAME_PLANE: f64 = 0.2;

/// The mean of the unit vectors to the neighbours is longer than this where they lie to one side: half a plane's is 0.64,
/// a whole plane's 0.
const ONE_SIDED: f64 = 0.5;

/// A plane needs as many points, besides the position itself.
const FEWEST: usize = 3;

/// Fits the oriented `normals` again, each to neighbours of its own sheet, where a neighbour faces the other way.
///
/// The sheet is that of the neighbours in whose planes the position lies. At the rim of a thin part there is none, or one
/// of either side: all neighbours lie behind then, and the normal points away from them. Other positions keep their
/// normals to the bit. On the 1,839 points of `data/bunny.obj`, whose ears are thinner than points are apart, this
/// takes the mean error from 7.1 to 6.1 degrees, the 99th percentile from 47 to 34, and the 3 normals on the wrong side to 0.
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

/// The normal of a position's own sheet; None where no few neighbours agree on one.
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
