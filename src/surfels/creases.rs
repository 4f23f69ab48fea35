//! Finds the creases between points, where their tangent planes meet, and the clip lines at which
//! surfels end there.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::graph::NeighbourGraph;
use super::lines::{self, Line};
use super::positions::DistinctPositions;
use crate::scene::Clip;

/// A crease is an edge of the surface if the cosine between the two normals is below this: 60
/// degrees. Rough surfaces have many creases of smaller angles.
pub(super) const SHARP: f64 = 0.5;

/// The least distance of a crease from either of its points, as a fraction of the distance between
/// the points. It keeps cells from being empty.
pub(super) const NARROWEST: f64 = 0.01;

/// Below this sine of the angle between two planes, rounding and noise decide where they meet: 3
/// degrees.
const LEAST_SINE: f64 = 0.05;

/// The largest distance between two points with a crease, in radii of the surfel.
const REACH: f64 = 5.0;

/// Two points lie on one smooth piece of the surface if the cosine between their normals is larger
/// than this: 30 degrees.
pub(super) const SMOOTH: f64 = 0.866_025_403_784_438_6;

/// A surfel is clipped only where it reaches past an edge by more than this many times the
/// roughness: the largest distance from its plane among the neighbours on its own side of the edge.
const ROUGH: f64 = 4.0;

/// A surfel extends past an edge by this distance, on its unit disk.
const MARGIN: f64 = 0.05;

/// Finds the crease between a point and another one at `offset`. Returns the unit direction toward
/// the crease in the point's tangent plane, and the distance to it. The normals are unit vectors,
/// and `radius` is the radius of the point's surfel, or of the smaller one of both surfels.
///
/// There is a crease if
///
/// - each point lies below the plane of the other, or each above it, and the sum of both distances
///   exceeds `least`;
/// - the points lie across the line where the planes meet, rather than along it;
/// - the points are at most `REACH` radii apart, which excludes outliers.
pub(super) fn crease([normal, other]: [DVec3; 2], offset: DVec3, radius: f64, least: f64) -> Option<(DVec3, f64)> {
    if offset.length() > REACH * radius {
        return None;
    }
    // The height of the other point over this one's plane, and of this one over the other's.
    let (height, back) = (offset.dot(normal), -offset.dot(other));
    if height * back < 0.0 || height.abs() + back.abs() <= least {
        return None;
    }
    let slope = other - normal * other.dot(normal);
    let sine = slope.length();
    if sine < LEAST_SINE {
        return None;
    }
    let toward = slope.try_normalize()? * if height + back < 0.0 { 1.0 } else { -1.0 };
    let along = offset.dot(normal.cross(toward));
    (along.abs() * sine <= height.abs() + back.abs())
        .then_some((toward, (back.abs() / sine).max(NARROWEST * offset.length())))
}

/// Finds the clip lines at which the surfels of positions end at sharp edges; empty if there are
/// none. `normals` are unit vectors or zero, and `axes` returns half-axes in world units.
///
/// An edge is found only if the normals show it, as those of a drawing or of a sampled mesh do.
/// Estimated normals are blurred across edges and show none. Where a cloud ends without an edge,
/// the points do not show its exact boundary, and clip lines would cut gaps between them.
pub(super) fn clips(
    distinct: &DistinctPositions,
    graph: &NeighbourGraph,
    normals: &[DVec3],
    axes: impl Fn(u32) -> [DVec3; 2] + Sync,
) -> Vec<Clip> {
    let clip = |position: u32| {
        let normal = normals[position as usize];
        let near = |other: &&u32| normals[**other as usize].dot(normal) < SHARP;
        if !graph.of(position).iter().any(|other| near(&other)) {
            return Clip::NONE;
        }
        let [s, t] = axes(position).map(|axis| axis * distinct.scale());
        let radius = s.length().min(t.length());
        let on_disk = |d: DVec3| DVec2::new(d.dot(s) / s.length_squared(), d.dot(t) / t.length_squared());
        let others = graph
            .of(position)
            .iter()
            .map(|&other| (normals[other as usize], distinct.position(other) - distinct.position(position)));
        let own: Vec<DVec3> =
            others.clone().filter(|(other, _)| other.dot(normal) > SMOOTH).map(|(_, offset)| offset).collect();
        let rough = own.iter().map(|offset| offset.dot(normal).abs()).fold(0.0, f64::max);
        // The part of the own cell that must be kept, on the unit disk: up to halfway to the points
        // on the same side of the edge.
        let cell: Vec<DVec2> = own.iter().map(|offset| on_disk(*offset * 0.5)).filter(|p| p.length() < 1.0).collect();
        let line = |(other, offset): (DVec3, DVec3)| {
            let (toward, distance) = crease([normal, other], offset, radius, ROUGH * rough)?;
            let inward = DVec2::new(-toward.dot(s), -toward.dot(t));
            let line = Line { inward: inward.try_normalize()?, offset: -distance / inward.length() };
            let line = line.keeping(&cell, MARGIN);
            ((1.0 + line.offset) * radius > ROUGH * rough).then_some(line)
        };
        lines::clip(others.filter(|(other, _)| other.dot(normal) < SHARP).filter_map(line).collect())
    };
    let clips: Vec<Clip> = (0..distinct.len() as u32).into_par_iter().map(clip).collect();
    if clips.iter().all(Clip::is_none) { Vec::new() } else { clips }
}
