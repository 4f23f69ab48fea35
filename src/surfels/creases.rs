//! Creases between points: where the planes of two of them meet, and the lines at which the surfels of a cloud end there.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::graph::NeighbourGraph;
use super::lines::{self, Line};
use super::positions::DistinctPositions;
use crate::scene::Clip;

/// The cosine of the angle between two tangent planes past which a crease is an edge of the surface: 60 degrees. Rough surfaces have
/// many creases of less.
pub(super) const SHARP: f64 = 0.5;

/// A crease is at least this part of the distance of two points from either: a cell has an area.
pub(super) const NARROWEST: f64 = 0.01;

/// The sine of the angle between two planes below which rounding and noise decide where they meet: 3 degrees.
const LEAST_SINE: f64 = 0.05;

/// A point that is farther than so many radii of either's surfel is out of reach.
const REACH: f64 = 5.0;

/// The cosine of the angle up to which another point is of one piece of surface with a point: 30 degrees.
pub(super) const SMOOTH: f64 = 0.866_025_403_784_438_6;

/// A surfel is cut where it stands out past an edge by more than so many times what the points of its side stand off its plane.
const ROUGH: f64 = 4.0;

/// How far past an edge a surfel goes, in its shorter half-axis.
const MARGIN: f64 = 0.05;

/// Where a crease runs between a point and another at `offset`, of these unit normals and the smaller of their surfels' radii: the unit
/// direction from the point to it in the tangent plane, and how far that is.
///
/// Each of the two then lies below the plane of the other, or each above it, together by more than `least`; they face each other
/// across the line where the planes meet, rather than along it; and each is within reach of the other's surfel, as no outlier is.
pub(super) fn crease([normal, other]: [DVec3; 2], offset: DVec3, radius: f64, least: f64) -> Option<(DVec3, f64)> {
    if offset.length() > REACH * radius {
        return None;
    }
    // Of the other point over this one's plane, and of this one over the other's.
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

/// Where the surfels of positions end at sharp edges: of these `normals`, of any length, and half-axes, world units. None if none does.
///
/// An edge is found between points whose normals say it, as of a drawing or a sampled mesh. Normals that were estimated are blurred
/// across edges, and tell of none. Where a cloud ends without an edge, its points do not say: lines would cut what lies between them.
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
        // Halfway to the points of its side what is nearer to it ends.
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
