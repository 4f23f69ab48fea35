//! Surfels of a mesh: disks at its vertices that cover its triangles and end where the surface does.
//!
//! The triangles around a vertex make a fan, or several where the surface has an edge or a border there ([`fans`]). Each fan has a
//! surfel in its own plane, the least ellipse with which those of all corners cover the triangles ([`cover`]), cut along the fan's
//! two sides ([`Clip`]): else disks would stand out past edges and borders by up to their radius.

mod cover;
mod fans;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use self::cover::{Ellipse, Facet};
pub(super) use self::fans::TOLERANCE;
use self::fans::{Around, Fan};
use crate::io::Points;
use crate::io::points::taken;
use crate::scene::Clip;

/// How much larger disks are than needed to cover: a blending kernel fades towards its rim.
const OVERLAP: f64 = 1.1;

/// How far past an edge or a border a disk goes, in its own shorter half-axes: two that end at one line leave no pixel between them
/// out, whatever is rounded.
pub(super) const MARGIN: f64 = 0.02;

/// One surfel.
struct Made {
    vertex: u32,
    normal: DVec3,
    s: DVec3,
    t: DVec3,
    clip: Clip,
}

/// The vertices of a mesh that no triangle with an area names cover nothing, and the others have a surfel for each of their fans. A
/// cloud, or one with a few triangles, stays as it is, and so does a mesh whose file says radii.
pub(super) fn of_vertices(mut points: Points) -> Points {
    let Some(faces) = points.faces.take().filter(|_| points.of_mesh) else { return points };
    let facets: Vec<Option<Facet>> = faces.triangles.par_iter().map(|t| Facet::of(&points.positions, *t)).collect();
    let around = Around::new(points.positions.len(), &faces.triangles, &facets);
    let loose = around.loose();
    if 2 * loose > points.positions.len() {
        return points;
    }
    let tolerance = TOLERANCE * crate::surfels::bounds(&points).extent().length();
    let made = |vertex: u32| {
        let fans = around.fans(vertex, &faces.triangles, &facets, tolerance);
        let of_fan = |fan: Fan| {
            let normal = fan.seen_normal(faces.normals.as_ref());
            surfels((vertex, normal), &fan, &points.positions, &facets)
        };
        fans.into_iter().flat_map(of_fan).collect::<Vec<_>>()
    };
    let all: Vec<Made> = (0..points.positions.len() as u32).into_par_iter().flat_map_iter(made).collect();
    let of: Vec<u32> = all.iter().map(|made| made.vertex).collect();
    let axes = |made: &Made| [made.s, made.t].map(|axis| axis.as_vec3().to_array());
    let radius = |made: &Made| made.s.length().max(made.t.length()) as f32;
    Points {
        normals: Some(all.iter().map(|made| made.normal.as_vec3().to_array()).collect()),
        radii: Some(all.iter().map(radius).collect()),
        axes: Some(all.iter().map(axes).collect()),
        clips: Some(all.iter().map(|made| made.clip).collect()),
        loose: loose as u64,
        ..taken(points, of)
    }
}

/// The surfels of one of a vertex's fans: one, or where its sides enclose more than a straight angle, one on each side.
fn surfels((vertex, normal): (u32, DVec3), fan: &Fan, positions: &[[f64; 3]], facets: &[Option<Facet>]) -> Vec<Made> {
    let at = |vertex: u32| DVec3::from(positions[vertex as usize]);
    let (x, y) = fan.normal.any_orthonormal_pair();
    // As any_orthonormal_pair gives them x × y is the normal.
    let plane = |d: DVec3| DVec2::new(d.dot(x), d.dot(y));
    let center = at(vertex);
    let corners: Vec<[DVec2; 2]> =
        fan.corners.iter().map(|corner| [corner.next, corner.last].map(|other| plane(at(other) - center))).collect();
    let wanted = fan.corners.iter().zip(&corners);
    let wanted =
        wanted.filter_map(|(corner, sides)| Some(cover::wanted(facets[corner.triangle as usize].as_ref()?, *sides)));
    let Some(ellipse) = Ellipse::around(&wanted.collect::<Vec<_>>()) else { return Vec::new() };
    let [major, minor] = ellipse.half_axes().map(|axis| axis * OVERLAP);
    let world = |axis: DVec2| axis.x * x + axis.y * y;
    let made = |lines: Vec<cover::Line>| {
        let mut clip = Clip::NONE;
        for (line, of_disk) in lines.iter().zip(&mut clip.0) {
            *of_disk = line.on_disk(major, minor, MARGIN * minor.length());
        }
        Made { vertex, normal, s: world(major), t: world(minor), clip }
    };
    cover::lines(fan, &corners, major.length()).into_iter().map(made).collect()
}
