//! Chooses the triangles of a mesh that become surfels (Tien 2008, chapter 5: splats and triangles
//! in one picture).
//!
//! Triangles are exact, but each takes time, however small it is. Surfels at a spacing of half a
//! pixel are as many as a picture needs, because its default four samples per pixel have that
//! spacing. So a triangle becomes surfels if
//!
//! 1. the triangles around it have an area of less than [`LARGEST`] square pixels on average: then
//!    each surfel replaces at least [`COST`] triangles, which together cost about as much;
//! 2. it belongs to a patch of such triangles, joined at edges, of at least [`LEAST_PATCH`] square
//!    pixels: smaller patches would be mostly rims.
//!
//! Triangles at sharp edges and at the ends of the surface become surfels too: samples are clipped
//! there ([`Clip`](crate::scene::Clip)), and the small triangles of a rough scan have sharp edges
//! everywhere. With those triangles kept, the picture of the dragon at 128x128 was as close to ray
//! tracing (within 0.1 dB), and took a third more time.
//!
//! The choice depends on sums of integers and on the planes of triangles, so it does not depend on
//! the order of triangles and vertices.

use glam::DVec3;
use rayon::prelude::*;

use serde::Serialize;

use super::sampling::voxels::Voxel;
use super::sampling::{MOST, MeshSurface, Method, Priority, sample};
use crate::io::closed::{distinct, is_closed};
use crate::io::{Mesh, Points};
use crate::scene::Bounds;
use crate::sets::Sets;
use crate::{Progress, Result};

/// Surfels per square pixel.
pub const DENSITY: f64 = 4.0;

/// The cost of a surfel, in triangles smaller than a pixel. For the Stanford dragon's 871,414
/// triangles of 0.05 square pixels each, a frame takes 94 ms on Mesa's llvmpipe; for the 161,000
/// surfels that replace them, 100 ms.
pub const COST: f64 = 5.0;

/// The largest mean area of triangles that become surfels, square pixels.
pub const LARGEST: f64 = 1.0 / (DENSITY * COST);

/// The area of the smallest patch that becomes surfels, square pixels.
pub const LEAST_PATCH: f64 = 16.0;

/// Areas are stored as multiples of this unit, in square pixels, and limited to [`MOST_UNITS`].
const UNIT: f64 = 1.0 / 16_777_216.0;
const MOST_UNITS: f64 = 1e12;

/// The number of rounds in which areas are averaged over the triangles around each vertex.
const ROUNDS: usize = 2;

/// A mesh, divided into surfels and triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hybrid {
    /// Surfels that replace small triangles.
    pub surfels: Option<Points>,
    /// The other triangles.
    pub triangles: Option<Mesh>,
    /// The counts of both.
    pub report: Report,
}

/// The result of dividing a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Report {
    /// The number of triangles of the mesh.
    pub triangles: u64,
    /// The number of triangles that stay.
    pub kept: u64,
    /// The number of surfels that replace the others.
    pub surfels: u64,
    /// The width of a pixel, world units.
    pub pixel: f64,
}

/// Divides a mesh into surfels and triangles for a view in which a pixel is `pixel` world units
/// wide, positive and finite.
///
/// The triangles that are [`splatted`] become samples that cover them ([`sample`]), [`DENSITY`] per
/// square pixel on average and more where the mesh has more triangles.
///
/// # Errors
///
/// [`Error::Usage`](crate::Error::Usage) for a mesh whose parts do not fit each other, or more than
/// [`MOST`] samples.
pub fn hybrid(mesh: &Mesh, pixel: f64, progress: &dyn Progress) -> Result<Hybrid> {
    mesh.check()?;
    progress.begin("dividing triangles", 0);
    let chosen = splatted(mesh, pixel);
    let kept: Vec<bool> = chosen.iter().map(|chosen| !chosen).collect();
    let [small, large] = [&chosen, &kept].map(|keep| mesh.part(keep));
    progress.end();
    let surfels = if small.triangles.is_empty() { None } else { Some(surfels_of(&small, mesh, pixel, progress)?) };
    let report = Report {
        triangles: mesh.triangles.len() as u64,
        kept: large.triangles.len() as u64,
        surfels: surfels.as_ref().map_or(0, |points| points.positions.len() as u64),
        pixel,
    };
    Ok(Hybrid { surfels, triangles: Some(large).filter(|large| !large.triangles.is_empty()), report })
}

/// Samples surfels that cover the triangles of `small`, a part of `mesh`.
fn surfels_of(small: &Mesh, mesh: &Mesh, pixel: f64, progress: &dyn Progress) -> Result<Points> {
    let area =
        small.triangles.iter().map(|corners| u128::from(units(small, *corners, pixel))).sum::<u128>() as f64 * UNIT;
    let count = (DENSITY * area).ceil().clamp(1.0, 1.0 + MOST as f64) as usize;
    let priority = |surface: &MeshSurface<'_>, voxels: &[Voxel]| Priority::default().of(surface, voxels);
    let (mut points, sampling) =
        sample(small, count, &Method::Stratified { priority: &priority, depth: None }, 0, progress)?;
    // Without texture numbers, coordinates do not determine an image.
    if points.texture_numbers.take().is_some() {
        points.texture = None;
    }
    // Together with the remaining triangles, the surfels cover what the mesh does.
    points.closed = sampling.faces_as_wound && is_closed(&mesh.positions, &mesh.triangles);
    Ok(points)
}

/// The width of a pixel, world units, if the diagonal of the box around a mesh's triangles is
/// `pixels` long; None for a mesh without distinct finite corners.
pub fn pixel(mesh: &Mesh, pixels: f64) -> Option<f64> {
    let corners = mesh.triangles.as_flattened().par_iter();
    let corners = corners.map(|vertex| DVec3::from_array(mesh.positions[*vertex as usize]));
    let pixel = Bounds::of(corners.filter(|corner| corner.is_finite())).extent().length() / pixels;
    Some(pixel).filter(|pixel| pixel.is_finite() && *pixel > 0.0)
}

/// Whether each triangle of a mesh becomes surfels, where a pixel is `pixel` world units wide.
pub fn splatted(mesh: &Mesh, pixel: f64) -> Vec<bool> {
    let welded = distinct(&mesh.positions);
    let corners: Vec<[u32; 3]> =
        mesh.triangles.iter().map(|triangle| triangle.map(|vertex| welded[vertex as usize])).collect();
    let areas: Vec<u64> = corners.iter().map(|corners| units(mesh, *corners, pixel)).collect();
    let sizes = (0..ROUNDS).fold(areas.clone(), |sizes, _| around(&corners, &sizes, mesh.positions.len()));
    let edges = edges(&corners);
    // Triangles without an area stay, so that the code that draws triangles reports them.
    let has_area = |corners: &[u32; 3]| area(mesh, *corners) > 0.0;
    let chosen: Vec<bool> = sizes
        .iter()
        .zip(&corners)
        .map(|(size, corners)| *size < (LARGEST / UNIT) as u64 && has_area(corners))
        .collect();
    let mut patches = Sets::new(corners.len());
    for sides in edges.chunk_by(|a, b| a.0 == b.0) {
        let mut chosen = sides.iter().filter(|(_, side)| chosen[*side as usize]);
        if let Some((_, first)) = chosen.next() {
            chosen.for_each(|(_, other)| patches.unite(*first, *other));
        }
    }
    let patches = patches.all();
    let mut of_patch = vec![0u64; corners.len()];
    for (triangle, area) in areas.iter().enumerate().filter(|(triangle, _)| chosen[*triangle]) {
        of_patch[patches[triangle] as usize] += area;
    }
    let is_large = |triangle: usize| of_patch[patches[triangle] as usize] as f64 * UNIT >= LEAST_PATCH;
    chosen.into_iter().enumerate().map(|(triangle, chosen)| chosen && is_large(triangle)).collect()
}

/// The area of a triangle in multiples of [`UNIT`].
fn units(mesh: &Mesh, corners: [u32; 3], pixel: f64) -> u64 {
    (area(mesh, corners) / (pixel * pixel) / UNIT).clamp(0.0, MOST_UNITS) as u64
}

/// The area of a triangle, world units squared; 0 if it is not finite. It does not depend on which
/// corner comes first.
fn area(mesh: &Mesh, corners: [u32; 3]) -> f64 {
    let mut places = corners.map(|vertex| mesh.positions[vertex as usize]);
    let least = |k: &usize| places[*k].map(f64::to_bits);
    let first = (0..3).min_by_key(least).unwrap_or(0);
    places.rotate_left(first);
    let [a, b, c] = places.map(DVec3::from_array);
    let twice = (b - a).cross(c - a).length();
    if twice.is_finite() { 0.5 * twice } else { 0.0 }
}

/// For each triangle, the mean over its corners of the mean size of the triangles at the corner.
fn around(corners: &[[u32; 3]], sizes: &[u64], vertices: usize) -> Vec<u64> {
    let mut of_vertex = vec![(0u64, 0u64); vertices];
    for (corners, size) in corners.iter().zip(sizes) {
        for &vertex in corners {
            let (sum, count) = &mut of_vertex[vertex as usize];
            (*sum, *count) = (sum.saturating_add(*size), *count + 1);
        }
    }
    let mean = |vertex: u32| {
        let (sum, count) = of_vertex[vertex as usize];
        sum / count.max(1)
    };
    corners.iter().map(|corners| corners.map(mean).iter().sum::<u64>() / 3).collect()
}

/// The edges of triangles with these corners, each with the index of its triangle, sorted by their
/// ends.
fn edges(corners: &[[u32; 3]]) -> Vec<([u32; 2], u32)> {
    let of = |(triangle, [a, b, c]): (usize, &[u32; 3])| {
        let ends = [[a, b], [b, c], [c, a]].map(|[from, to]| [*from.min(to), *from.max(to)]);
        ends.map(|ends| (ends, triangle as u32))
    };
    let mut edges: Vec<_> = corners.par_iter().enumerate().flat_map_iter(of).collect();
    edges.par_sort_unstable();
    edges.retain(|([from, to], _)| from != to);
    edges
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// A square of `side` squared cells of two triangles each. Cells past the middle are `wide`
    /// units wide, others one.
    fn square(side: u32, wide: f64) -> Mesh {
        let at = |k: u32| {
            let (x, y) = (f64::from(k % (side + 1)), f64::from(k / (side + 1)));
            let past = (x - f64::from(side / 2)).max(0.0);
            [x - past + past * wide, y, 0.0]
        };
        let cell = |k: u32| {
            let corner = k / side * (side + 1) + k % side;
            let (right, up) = (corner + 1, corner + side + 1);
            [[corner, right, up + 1], [corner, up + 1, up]]
        };
        Mesh {
            positions: (0..(side + 1) * (side + 1)).map(at).collect(),
            triangles: (0..side * side).flat_map(cell).collect(),
            ..Mesh::default()
        }
    }

    #[test]
    fn small_triangles_become_surfels() {
        let count =
            |wide: f64, pixel: f64| splatted(&square(40, wide), pixel).into_iter().filter(|chosen| *chosen).count();
        // Triangles of half a square unit: too large for a pixel 3 units wide, and too small a
        // patch in all for one 12 units wide.
        assert_eq!([3.5, 3.0, 12.0].map(|pixel| count(1.0, pixel)), [3200, 0, 0]);
        // Wide triangles stay, and so do those beside them whose average is too large.
        let half = count(8.0, 3.5);
        assert!((1440..1600).contains(&half), "{half}");
    }

    #[test]
    fn orders_and_duplicates_of_vertices_change_nothing() {
        let mesh = square(30, 3.0);
        let chosen = splatted(&mesh, 3.5);
        let soup = Mesh {
            positions: mesh.triangles.iter().flatten().map(|vertex| mesh.positions[*vertex as usize]).collect(),
            triangles: (0..mesh.triangles.len() as u32).map(|k| [3 * k + 1, 3 * k + 2, 3 * k]).collect(),
            ..Mesh::default()
        };
        assert_eq!(splatted(&soup, 3.5), chosen);
        let reversed = Mesh { triangles: mesh.triangles.iter().rev().copied().collect(), ..mesh };
        assert!(splatted(&reversed, 3.5).into_iter().rev().eq(chosen));
        assert!(splatted(&Mesh::default(), 1.0).is_empty());
        let broken = Mesh { positions: vec![[f64::NAN; 3]; 3], triangles: vec![[0, 1, 2]], ..Mesh::default() };
        assert_eq!(splatted(&broken, 1.0), [false]);
    }
}
