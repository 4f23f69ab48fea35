//! The roughness of a surface: the distances of points from it, along its normal.
//!
//! Two disks whose points lie off a surface have different heights. From above they overlap like
//! the disks of a smooth surface. From ten degrees over the surface, a gap opens between them that
//! is 5.7 times as wide as the heights differ, and the background shows through. So the disks of
//! rough surfaces are larger. Curvature is not roughness: disks of a smooth surface that are too
//! large stand out past its outlines.

use glam::{DMat3, DVec3};

use super::RADIUS_NEIGHBOURS;
use crate::surfels::estimate::{median, median_of_few};
use crate::surfels::gaps::is_beside;
use crate::surfels::graph::NeighbourGraph;

/// A half-axis grows by this many times the RMS height of the neighbours, times the fraction of
/// their squared heights that no paraboloid explains. On an airborne scan seen from ten degrees,
/// 2 % of the pixels are pinholes without this, and 0.09 % with it.
const PER_HEIGHT: f64 = 3.3;

/// The growth falls to zero where neighbours have this RMS height, in mean distances: the surface
/// is not known well enough, or there is none.
const HIGHEST: f64 = 0.2;

/// A half-axis grows by at most this fraction of itself.
const MOST: f64 = 0.5;

/// The least determinant of a paraboloid's normal equations, as a fraction of their trace cubed.
/// Below it the neighbours lie on few lines, and no paraboloid is fitted.
const LEAST_SPREAD: f64 = 1e-3;

/// The heights of a point's neighbours over its plane; neighbours above or below the point do not
/// count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Rough {
    /// Mean distance to [`RADIUS_NEIGHBOURS`] neighbours, in the unit of the offsets.
    mean: f32,
    /// Mean square of their heights over the plane, in mean distances.
    heights: f32,
    /// Mean square of the residuals of a paraboloid through the point, per degree of freedom: the
    /// number of neighbours minus its three coefficients.
    left: f32,
}

impl Rough {
    /// Measures the offsets of a point's neighbours, the nearest first, over the plane with the
    /// unit normal `normal`.
    pub(crate) fn of(offsets: &[DVec3], normal: DVec3) -> Self {
        let near = &offsets[..offsets.len().min(RADIUS_NEIGHBOURS)];
        let mean = near.iter().map(|offset| offset.length()).sum::<f64>() / near.len().max(1) as f64;
        let (e1, e2) = normal.any_orthonormal_pair();
        // The coefficients of each neighbour's equation, and its height.
        let mut rows = [(DVec3::ZERO, 0.0); RADIUS_NEIGHBOURS];
        let mut count = 0;
        for offset in near.iter().filter(|offset| is_beside(**offset, normal)) {
            let offset = *offset / mean;
            let (x, y) = (offset.dot(e1), offset.dot(e2));
            rows[count] = (DVec3::new(x * x, x * y, y * y), offset.dot(normal));
            count += 1;
        }
        let rows = &rows[..count];
        if count <= 3 {
            return Self { mean: mean as f32, ..Self::default() };
        }
        let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for (row, height) in rows {
            matrix += DMat3::from_cols(*row * row.x, *row * row.y, *row * row.z);
            right += *row * *height;
        }
        let trace = matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z;
        let known = matrix.determinant() >= LEAST_SPREAD * trace.powi(3);
        let bend = if known { matrix.inverse() * right } else { DVec3::ZERO };
        let left: f64 = rows.iter().map(|(row, height)| (height - row.dot(bend)).powi(2)).sum();
        let heights: f64 = rows.iter().map(|(_, height)| height * height).sum();
        let each = |sum: f64, count: usize| (sum / count as f64) as f32;
        Self { mean: mean as f32, heights: each(heights, count), left: each(left, count - 3) }
    }

    /// Returns the length by which the half-axes of position `index` should grow, in the unit of
    /// offsets.
    ///
    /// It depends on the heights at the position itself and on the roughness around it. The
    /// roughness is a median over the neighbours, so that an edge does not count as roughness. `at`
    /// returns the roughness of a position.
    pub(crate) fn growth(graph: &NeighbourGraph, index: u32, at: impl Fn(u32) -> Self) -> f64 {
        let own = at(index);
        let near = graph.of(index);
        let around = || std::iter::once(own).chain(near.iter().take(RADIUS_NEIGHBOURS).map(|&other| at(other)));
        let of = |value: fn(Self) -> f32| {
            let mut values = [0.0; RADIUS_NEIGHBOURS + 1];
            let count = values.iter_mut().zip(around()).map(|(slot, rough)| *slot = value(rough).into()).count();
            match count == values.len() {
                true => median_of_few(values),
                false => median(&mut values[..count]).unwrap_or(0.0),
            }
        };
        let (heights, left) = (of(|rough| rough.heights), of(|rough| rough.left));
        if heights == 0.0 {
            return 0.0;
        }
        let surface = (1.0 - heights / (HIGHEST * HIGHEST)).max(0.0);
        PER_HEIGHT * f64::from(own.heights).sqrt() * (left / heights).min(1.0) * surface * f64::from(own.mean)
    }
}

/// Returns the half-axes, each longer by `growth`, but at most by the fraction [`MOST`] of itself.
pub(crate) fn grown(axes: [DVec3; 2], growth: f64) -> [DVec3; 2] {
    axes.map(|axis| {
        let length = axis.length();
        if length > 0.0 { axis * (1.0 + (growth / length).min(MOST)) } else { axis }
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::Random;
    use crate::scene::Bounds;
    use crate::surfels::positions::DistinctPositions;
    use rayon::prelude::*;

    /// The mean growth on a grid of spacing 1 with these heights and slopes of a surface.
    fn growth(height: impl Fn(f64, f64) -> f64, slopes: impl Fn(f64, f64) -> [f64; 2]) -> f64 {
        let positions: Vec<[f64; 3]> = (0..400)
            .map(|k| (f64::from(k % 20) - 9.5, f64::from(k / 20) - 9.5))
            .map(|(x, y)| [x, y, height(x, y)])
            .collect();
        let bounds = Bounds::of(positions.par_iter().map(|position| DVec3::from_array(*position)));
        let distinct = DistinctPositions::new(&positions, &bounds, DVec3::ZERO).unwrap();
        let graph = NeighbourGraph::new(&distinct, 16, &());
        let rough = |index: u32| {
            let own = distinct.position(index);
            let at: Vec<DVec3> = graph.of(index).iter().map(|other| distinct.position(*other) - own).collect();
            let [x, y] = [own.x, own.y].map(|coordinate| coordinate / distinct.scale());
            let [along_x, along_y] = slopes(x, y);
            Rough::of(&at, DVec3::new(-along_x, -along_y, 1.0).normalize())
        };
        let grown = (0..400).map(|index| Rough::growth(&graph, index, rough) / distinct.scale());
        grown.sum::<f64>() / 400.0
    }

    #[test]
    fn noise_grows_and_a_bend_does_not() {
        let noise = |sigma: f64| {
            let mut random = Random::stream(3, 0);
            let heights: Vec<f64> = (0..400).map(|_| sigma * 3.46 * (random.number() - 0.5)).collect();
            growth(move |x, y| heights[((x + 9.5) + 20.0 * (y + 9.5)) as usize], |_, _| [0.0; 2])
        };
        let (slight, rough) = (noise(0.02), noise(0.06));
        assert!(slight > 0.02 && rough > 2.0 * slight && rough < 0.4, "{slight} {rough}");
        // Noise this strong leaves no surface.
        assert!(noise(2.0) < 1e-9);
        assert!(growth(|_, _| 0.0, |_, _| [0.0; 2]) == 0.0);
        let bowl = growth(
            |x, y| 0.004 * (x * x + 0.3 * x * y) + 0.002 * y * y,
            |x, y| [0.008 * x + 0.0012 * y, 0.0012 * x + 0.004 * y],
        );
        assert!(bowl < 0.1 * slight, "{bowl}");
    }
}
