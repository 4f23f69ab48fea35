//! The disk of each sample: the smallest ellipse, in the plane nearest to its Voronoi cell, that
//! holds the cell.

use std::array;
use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::ends::{Covering, Ends};
use super::surface::{MeshSurface, Place};
use super::voronoi::{SIDE, Voronoi};
use crate::error::Result;
use crate::progress::Progress;
use crate::scene::Clip;
use crate::surfels::eigen::Symmetric3;
use crate::surfels::ellipse::Ellipse;
use crate::surfels::positions::DistinctPositions;

/// The factor by which a disk is larger than the ellipse that it must cover.
const OVERLAP: f64 = 1.28;

/// The slope of a part of a cell against its disk counts as at most this, 60 degrees. From the
/// directions that see a steeper part best, the disk is hardly visible, and no size helps.
const STEEPEST: f64 = 1.732;

/// A cell whose mean square length is more than this many times its mean square width is a line,
/// and lies in many planes.
const LONGEST: f64 = 1e12;

/// The shorter half-axis is at least this fraction of the cell's largest reach. Without this limit,
/// the coverage of a needle-shaped cell in oblique views would depend only on the height terms of
/// neighbouring disks.
const THINNEST: f64 = 0.25;

/// The number of directions, evenly over half a turn, in which a cell's reach is measured.
///
/// The polygon that they bound holds the cell. It is wider than a round cell by at most a factor of
/// 1 / cos(PI / 16), 2 %, and wider than a cell with an aspect ratio of four by a quarter.
const DIRECTIONS: usize = 8;

/// The reach of a cell from its sample, the larger of both senses of each direction in the disk's
/// plane, in the scaled units of [`Voronoi`].
type Reach = [f32; DIRECTIONS];

/// The disks of all samples, in the order of the samples.
pub(super) struct Disks {
    /// Perpendicular half-axes s, the longer one, and t, world units; s x t is along the normal.
    pub axes: Vec<[DVec3; 2]>,
    /// The clip lines of each disk; empty if no disk has any.
    pub clips: Vec<Clip>,
}

impl Disks {
    /// Flips each disk to the side of its normal in `named`; returns whether no disk had to be
    /// flipped.
    pub fn turn_to(&mut self, named: &[DVec3]) -> bool {
        let mut all = true;
        for (index, ([s, t], named)) in self.axes.iter_mut().zip(named).enumerate() {
            if s.cross(*t).dot(*named) < 0.0 {
                all = false;
                *t = -*t;
                if let Some(Clip(lines)) = self.clips.get_mut(index) {
                    lines.iter_mut().for_each(|[_, v, _]| *v = -*v);
                }
            }
        }
        all
    }

    /// The unit normals.
    pub fn normals(&self) -> Vec<DVec3> {
        self.axes.iter().map(|[s, t]| s.normalize().cross(t.normalize())).collect()
    }

    /// The longer half-axes, world units.
    pub fn radii(&self) -> Vec<f32> {
        self.axes.iter().map(|[s, _]| s.length() as f32).collect()
    }

    /// The half-axes s and t, world units.
    pub fn half_axes(&self) -> Vec<[[f32; 3]; 2]> {
        self.axes.iter().map(|axes| axes.map(|axis| axis.as_vec3().to_array())).collect()
    }
}

/// Unit axes x and y of the plane with this unit normal, which is x × y.
fn plane(normal: DVec3) -> [DVec3; 2] {
    normal.any_orthonormal_pair().into()
}

/// Computes the half-axes and the clip lines of each sample's disk.
///
/// # The plane
///
/// The plane through the sample with the least mean square distance to the cell: its normal is the
/// eigenvector of the smallest eigenvalue of the cell's second moments about the sample. These are
/// exact integrals over the cell's polygons. A flat cell lies in its disk's plane, however many
/// triangles it spans; on a rough surface the disk lies amid the facets. Parts of the cell on
/// another side of the surface than the sample are ignored.
///
/// # The half-axes
///
/// A disk must cover its cell from every direction. From an angle phi off the normal, a point at
/// height h above or below the disk's plane appears h tan(phi) farther out. So in each direction of
/// the plane the disk reaches as far as the cell's corners plus their heights: it then covers its
/// whole cell by itself from up to 45 degrees off its normal, and a flat cell from everywhere. A
/// part that slopes against the disk by more than 45 degrees is seen head-on from beyond 45
/// degrees, so its heights are multiplied by the tangent of that slope. The disk is the smallest
/// ellipse that holds the polygon of these reaches in a few directions.
///
/// From farther off the normal, cells that are not flat are also covered by neighbouring disks,
/// provided that [`OVERLAP`] makes all disks a little larger. With 1.28, 9 of 31 million rays at
/// samples of ten models, from 64 views each, find a hole, none of them on the fandisk.
pub(super) fn disks(surface: &MeshSurface<'_>, samples: &[Place], progress: &dyn Progress) -> Result<Disks> {
    let points: Vec<[f64; 3]> = samples.par_iter().map(|place| surface.point(*place).to_array()).collect();
    let distinct = DistinctPositions::new(&points, &surface.bounds, DVec3::ZERO)?;
    // Samples that coincide share one cell; the first of them determines its normal.
    let mut sample_at = vec![u32::MAX; distinct.len()];
    for (sample, &position) in distinct.of_point().iter().enumerate().rev() {
        sample_at[position as usize] = sample as u32;
    }
    let triangles: Vec<u32> = sample_at.iter().map(|&sample| samples[sample as usize].triangle).collect();
    let ends = Ends::new(surface)?;
    let voronoi = Voronoi::new(surface, &distinct, &triangles, &ends.patches, progress);
    let normals = nearest_planes(&voronoi, distinct.len(), progress);
    let directions = directions();
    let parts = voronoi.measure(progress, |sample, triangle, corners| {
        let normal = normals[sample as usize];
        let [x, y] = plane(normal);
        let cosine = triangle.normal.dot(normal).abs();
        let slope = ((1.0 - cosine * cosine).max(0.0).sqrt() / cosine).clamp(1.0, STEEPEST);
        let mut reach = Reach::default();
        for corner in corners {
            let (at, over) = (DVec2::new(corner.dot(x), corner.dot(y)), slope * corner.dot(normal).abs());
            grow(&mut reach, directions.map(|direction| (at.dot(direction).abs() + over) as f32));
        }
        reach
    });
    let mut reaches = vec![Reach::default(); distinct.len()];
    parts.into_iter().for_each(|(position, reach)| grow(&mut reaches[position as usize], reach));
    let ellipses = reaches.par_iter().map(|reach| ellipse(reach).map(|axis| axis * (OVERLAP / distinct.scale())));
    let mut ellipses: Vec<[DVec2; 2]> = ellipses.collect();
    // A cell may vanish in rounding: it gets a disk of the smallest size.
    let lengths = ellipses.iter().map(|[s, _]| s.length()).filter(|length| *length > 0.0);
    let smallest = lengths.fold(f64::INFINITY, f64::min);
    let nothing = |ellipse: &&mut [DVec2; 2]| ellipse[0] == DVec2::ZERO;
    ellipses.iter_mut().filter(nothing).for_each(|ellipse| *ellipse = [DVec2::X, DVec2::Y].map(|axis| axis * smallest));
    let in_space = |(ellipse, normal): (&[DVec2; 2], &DVec3)| {
        let [x, y] = plane(*normal);
        ellipse.map(|axis| x * axis.x + y * axis.y)
    };
    let axes: Vec<[DVec3; 2]> = ellipses.par_iter().zip(&normals).map(in_space).collect();
    let clips = clips(&ends, &voronoi, &axes, progress);
    let of_point = distinct.of_point().iter().map(|&position| position as usize);
    Ok(Disks {
        axes: of_point.clone().map(|position| axes[position]).collect(),
        clips: if clips.is_empty() { clips } else { of_point.map(|position| clips[position]).collect() },
    })
}

fn directions() -> [DVec2; DIRECTIONS] {
    array::from_fn(|k| DVec2::from_angle(PI * k as f64 / DIRECTIONS as f64))
}

fn grow(reach: &mut Reach, by: Reach) {
    reach.iter_mut().zip(by).for_each(|(most, one)| *most = most.max(one));
}

/// Returns the half-axes of the smallest ellipse that holds the polygon of these reaches, the
/// longer one first.
fn ellipse(reach: &Reach) -> [DVec2; 2] {
    let farthest = f64::from(reach.iter().fold(0f32, |most, one| most.max(*one)));
    if farthest == 0.0 {
        return [DVec2::ZERO; 2];
    }
    // The unit is the largest reach, so that squares of areas neither overflow nor underflow.
    let reach = |k: usize| f64::from(reach[k % DIRECTIONS]) / farthest;
    let (sine, cosine) = (PI / DIRECTIONS as f64).sin_cos();
    let corner = |(k, direction): (usize, DVec2)| {
        direction * reach(k) + direction.perp() * ((reach(k + 1) - reach(k) * cosine) / sine)
    };
    let corners: Vec<DVec2> = directions().into_iter().enumerate().map(corner).collect();
    Ellipse::around_points(&corners, THINNEST).half_axes().map(|axis| axis * farthest)
}

/// Returns the clip lines of each position's disk; empty if no disk has any.
fn clips(ends: &Ends, voronoi: &Voronoi<'_>, axes: &[[DVec3; 2]], progress: &dyn Progress) -> Vec<Clip> {
    if ends.is_empty() {
        return Vec::new();
    }
    let center = |position: usize| voronoi.position(position as u32);
    let count = axes.len();
    let near: Vec<bool> =
        (0..count).into_par_iter().map(|at| ends.are_near(center(at), axes[at][0].length())).collect();
    let parts = voronoi
        .measure(progress, |sample, _, corners| if near[sample as usize] { corners.to_vec() } else { Vec::new() });
    let mut cells = vec![Vec::new(); count];
    for (position, corners) in parts {
        cells[position as usize].extend(corners.iter().map(|corner| corner / voronoi.scale()));
    }
    let clip = |at: usize| {
        let disk = Covering { center: center(at), axes: axes[at], cell: &cells[at] };
        if near[at] { ends.clip(&disk) } else { Clip::NONE }
    };
    let clips: Vec<Clip> = (0..count).into_par_iter().map(clip).collect();
    if clips.iter().all(Clip::is_none) { Vec::new() } else { clips }
}

/// Returns the normal of the plane nearest to each cell, on the side that the sample's triangle
/// faces.
fn nearest_planes(voronoi: &Voronoi<'_>, count: usize, progress: &dyn Progress) -> Vec<DVec3> {
    let parts = voronoi.measure(progress, |sample, triangle, corners| {
        if voronoi.is_of_side(sample, triangle) { second_moments(corners) } else { Symmetric3::ZERO }
    });
    let mut moments = vec![Symmetric3::ZERO; count];
    for (position, part) in parts {
        moments[position as usize] = moments[position as usize] + part;
    }
    let normal = |(position, moments): (usize, &Symmetric3)| {
        let facet = voronoi.facet(position as u32);
        let ([_, width, length], [normal, ..]) = moments.eigen();
        let normal = if normal.dot(facet) < 0.0 { -normal } else { normal };
        // If there is no cell, or it is a line, the triangle's own plane is as near as any.
        if width * LONGEST > length && normal.dot(facet) > SIDE { normal } else { facet }
    };
    moments.par_iter().enumerate().map(normal).collect()
}

/// The integral of `x x^T` over a convex polygon in space.
fn second_moments(corners: &[DVec3]) -> Symmetric3 {
    let Some((&a, others)) = corners.split_first() else { return Symmetric3::ZERO };
    let fan = others.windows(2).map(|pair| {
        let [b, c] = [pair[0], pair[1]];
        let area = 0.5 * (b - a).cross(c - a).length();
        // Over a triangle of unit area, the integral of a product of two linear functions is 1/12
        // of the sum of their products at the three corners and at the sum of the corners.
        Symmetric3::scatter([a, b, c, a + b + c].into_iter()) * (area / 12.0)
    });
    fan.fold(Symmetric3::ZERO, |sum, triangle| sum + triangle)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::io::Mesh;
    use crate::random::Random;

    #[test]
    fn a_disk_holds_its_cell_and_is_no_larger_than_it_must_be() {
        let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, 0.1, 0.6]];
        let triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let mesh = Mesh { positions: corners, triangles, ..Mesh::default() };
        let surface = MeshSurface::new(&mesh).unwrap();
        // Most samples crowd in one corner, so a few neighbours do not bound the cells that reach
        // across to the other side.
        let mut random = Random::stream(1, 0);
        let place = |k: u32| {
            let far = if k < 40 { 0.1 } else { 1.0 };
            let [u, v] = [far * random.number(), far * random.number()];
            let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
            Place { triangle: k % 4, weights: DVec3::new(1.0 - u - v, u, v) }
        };
        let places: Vec<Place> = (0..55).map(place).collect();
        let made = disks(&surface, &places, &()).unwrap();
        let normals = made.normals();
        // The sides are flat here, so the nearest plane is the triangle's.
        for (normal, place) in normals.iter().zip(&places) {
            assert!(normal.distance(surface.normal(*place)) < 1e-9, "{normal}");
        }

        let centers: Vec<DVec3> = places.iter().map(|place| surface.point(*place)).collect();
        // All samples by distance from a point, the nearest first.
        let by_distance = |at: DVec3| {
            let mut order: Vec<usize> = (0..places.len()).collect();
            order.sort_by(|&a, &b| centers[a].distance_squared(at).total_cmp(&centers[b].distance_squared(at)));
            order
        };
        // `reached`: the largest reach of each cell. `filled`: the largest ratio, over all
        // directions, of the cell's reach to that of its disk without OVERLAP.
        let (mut reached, mut filled) = (vec![0f64; places.len()], vec![0f64; places.len()]);
        const STEPS: u32 = 200;
        let mut shared = 0;
        for (triangle, facet) in (0..4).zip(&surface.triangles) {
            // The angle between any two sides exceeds 90 degrees.
            let is_of_side = |sample: &usize| places[*sample].triangle == triangle;
            let is_shared = facet.corners.iter().any(|&corner| !by_distance(corner)[..16].iter().any(is_of_side));
            shared += u32::from(is_shared);
            for (i, j) in (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| (i, j))) {
                let [u, v] = [i, j].map(|step| f64::from(step) / f64::from(STEPS));
                let at = surface.point(Place { triangle, weights: DVec3::new(1.0 - u - v, u, v) });
                let nearest = by_distance(at).into_iter().find(|sample| is_shared || is_of_side(sample)).unwrap();
                let (offset, normal) = (at - centers[nearest], surface.normal(places[nearest]));
                let (height, slope) = (offset.dot(normal), normal.angle_between(facet.normal).tan().abs());
                let over = slope.clamp(1.0, STEEPEST) * height.abs();
                let flat = offset - normal * height;
                reached[nearest] = reached[nearest].max(flat.length() + over);
                let [s, t] = made.axes[nearest];
                for turn in 0..32 {
                    let (sine, cosine) = (f64::from(turn) * PI / 32.0).sin_cos();
                    let direction = s.normalize() * cosine + t.normalize() * sine;
                    let support = (s.dot(direction).powi(2) + t.dot(direction).powi(2)).sqrt() / OVERLAP;
                    filled[nearest] = filled[nearest].max((flat.dot(direction).abs() + over) / support);
                }
            }
        }
        // A triangle is shared by the samples of all sides if only samples of other sides are near
        // one of its corners.
        assert!((1..4).contains(&shared), "{shared}");
        assert!(filled.iter().all(|filled| *filled < 1.0 + 1e-6), "{filled:?}");
        // The corners of cells lie between the tested points. The longest edge is 1.42, and the sum
        // `length + over` grows by at most |(1, STEEPEST)| = 2 times a distance. The disk is the
        // smallest for the reaches in a few directions, unless THINNEST limits it.
        let step = 2.0 * 1.42 / f64::from(STEPS);
        let mut of_rounds = (0.0, 0.0);
        for (k, [s, t]) in made.axes.iter().enumerate() {
            let wide = PI / (2.0 * DIRECTIONS as f64);
            assert!(filled[k] > wide.cos() - 0.03 - step / t.length(), "{} of {s} {t}", filled[k]);
            assert!(s.length() >= t.length() && t.length() > 0.95 * OVERLAP * THINNEST * reached[k], "{s} {t}");
            of_rounds = (of_rounds.0 + s.length() * t.length(), of_rounds.1 + (OVERLAP * reached[k]).powi(2));
        }
        assert!(of_rounds.0 < 0.85 * of_rounds.1, "{of_rounds:?}");
        assert!(reached.iter().any(|reached| *reached > 0.3) && reached.iter().any(|reached| *reached < 0.1));
    }

    #[test]
    fn second_moments_are_those_of_many_points() {
        let corners = [[0.1, 0.2, 0.3], [1.0, 0.1, 0.2], [1.2, 0.9, 0.5], [0.4, 1.1, 0.4]].map(DVec3::from);
        // The last corner is moved into the plane of the first three.
        let [a, b, c, d] = corners;
        let normal = (b - a).cross(c - a).normalize();
        let corners = [a, b, c, d - normal * (d - a).dot(normal)];
        let exact = second_moments(&corners);
        let mut summed = Symmetric3::ZERO;
        const STEPS: u32 = 300;
        for [a, b, c] in [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]] {
            let area = 0.5 * (b - a).cross(c - a).length();
            // The centroids of small triangles, upright and turned ones.
            let weight = area / f64::from(STEPS * STEPS);
            let at = |i: u32, j: u32, third: f64| {
                let [u, v] = [i, j].map(|k| (f64::from(k) + third) / f64::from(STEPS));
                a + (b - a) * u + (c - a) * v
            };
            let upright = (0..STEPS).flat_map(|i| (0..STEPS - i).map(move |j| (i, j, 1.0 / 3.0)));
            let turned = (0..STEPS - 1).flat_map(|i| (0..STEPS - 1 - i).map(move |j| (i, j, 2.0 / 3.0)));
            summed = summed + Symmetric3::scatter(upright.chain(turned).map(|(i, j, third)| at(i, j, third))) * weight;
        }
        let off = exact + summed * -1.0;
        for (entry, size) in [(off.xx, exact.xx), (off.yy, exact.yy), (off.xy, exact.xy), (off.xz, exact.xz)] {
            assert!(entry.abs() < 1e-4 * size, "{exact:?} {summed:?}");
        }
        assert_eq!(second_moments(&[]), Symmetric3::ZERO);
    }
}
