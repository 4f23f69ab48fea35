//! Bounds on each pixel's error, derived from the pixel's own fragments. No number is fitted to a
//! result.
//!
//! The bounds cover all fragments that the device may accept within the errors of
//! [`Precision`](super::precision::Precision). With u = 2^-24:
//!
//! - **Weight**: rho errs by d, so w errs by at most `max |psi(rho +- d) - psi(rho)|` (psi falls
//!   with rho), and by the errors of `wgsl/common/arithmetic.wgsl`: u (2.8 + 1.4 x) for exp(-x),
//!   1.6 units in the last place for a power, 0.5 for a square root or a division.
//! - **Mean of an attribute** a: wrong weights add `sum dw (a - mean) / sum w`, at most the spread
//!   of the pixel's attributes times `sum |dw| / sum w`. Wrong attributes add `sum w da / sum w`.
//!   The accumulator adds its own bound times the range that it maps to [0, 1]: the scene's
//!   colours, 2 for normals, the accepted interval of depths.
//! - **Colour** is then unpremultiplied and put over nothing, which adds three relative errors of
//!   divisions and products.
//! - **Samples**: the colour of a pixel with several samples is the mean of the samples' colours,
//!   and its bound is the mean of their bounds.
//! - **Lines** at which a disk ends: the distance inside a line errs by the line's length times the
//!   error of (u, v), and by 10 u of itself.
//! - **Caps** turn the normal by the slopes times the error of (u, v), and by 30 u of the slopes.
//! - **Points** that face the camera come nearer by a height that depends on rho. The height errs
//!   by its change over the error of rho.
//! - **Normal**: s x t errs by 6 u |s||t|; normalising and mapping it and normalising the mean add
//!   12 u. The error of the mean is divided by the mean's length.
//!
//! A pixel is **open** if these errors leave undecided whether some fragment belongs to the pixel,
//! or which side is nearest. An open pixel is excused, as f32 may rightly decide otherwise than
//! f64.

use glam::{DVec3, Vec3};

use super::fragment_bounds::{Fragment, Surface, fragments, weight_error};
use super::precision::E as U;
use crate::passes::project::reference_all;
use crate::passes::splat::Splat;
use crate::passes::visibility::Nearest;
use crate::plan::{AccumulatorRow, Facts, Settings, Sides};
use crate::scene::{Camera, Epsilon, Kernel, Scene};

/// Relative error of a division, and of a square root: they are rounded to nearest
/// (`wgsl/common/arithmetic.wgsl`).
pub(super) const DIVISION: f64 = U;

/// Error terms of a pixel, independent of the accumulator. Sums are over accepted fragments.
#[derive(Clone, Copy, Debug)]
pub struct Pixel {
    /// Whether the device may rightly decide otherwise about some fragment.
    pub open: bool,
    /// Number of accepted fragments.
    pub count: u32,
    /// Sum of weights.
    pub weight: f64,
    /// Sum of the weights' errors.
    weight_error: f64,
    /// Sum of weight times the depth's error, world units.
    depth_error: f64,
    /// Sum of weight times the normal's error.
    normal_error: f64,
    /// Sum of weight times premultiplied colour.
    color: [f64; 4],
    /// Sum of weight times normal, turned toward the viewer.
    normal: DVec3,
    /// Smallest and largest premultiplied colour.
    colors: [[f64; 4]; 2],
    /// Smallest and largest normal, by component.
    normals: [DVec3; 2],
    /// Smallest and largest depth, world units.
    depths: [f64; 2],
    /// Length of the interval of depths that the accumulator maps to [0, 1], world units.
    interval: f64,
}

pub(super) const NOTHING: Pixel = Pixel {
    open: false,
    count: 0,
    weight: 0.0,
    weight_error: 0.0,
    depth_error: 0.0,
    normal_error: 0.0,
    color: [0.0; 4],
    normal: DVec3::ZERO,
    colors: [[f64::INFINITY; 4], [f64::NEG_INFINITY; 4]],
    normals: [DVec3::INFINITY, DVec3::NEG_INFINITY],
    depths: [f64::INFINITY, f64::NEG_INFINITY],
    interval: 0.0,
};

/// Bounds on the absolute errors of one pixel's maps.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelBound {
    /// Straight linear RGB, and alpha.
    pub color: [f64; 4],
    /// Depth, world units.
    pub depth: f64,
    /// Each component of the normal.
    pub normal: f64,
    /// Sum of weights.
    pub weight: f64,
}

/// The range of the scene's premultiplied colours, which accumulators map to [0, 1].
#[derive(Clone, Copy, Debug)]
pub struct ColorRange {
    /// Largest minus smallest value of each channel.
    pub span: [f64; 4],
    /// Largest magnitude of each channel.
    pub magnitude: [f64; 4],
}

impl ColorRange {
    /// Returns the range of `scene`.
    pub fn of(scene: &Scene) -> Self {
        let (low, high) = scene.color_range();
        let pair = |k: usize| (f64::from(low[k]), f64::from(high[k]));
        Self {
            span: std::array::from_fn(|k| pair(k).1 - pair(k).0),
            magnitude: std::array::from_fn(|k| pair(k).0.abs().max(pair(k).1.abs())),
        }
    }
}

impl Pixel {
    /// Returns the bounds for sums by `accumulator` with `bits` fraction bits.
    pub fn bound(&self, accumulator: &AccumulatorRow, bits: u32, range: &ColorRange) -> PixelBound {
        if self.count == 0 {
            return PixelBound::default();
        }
        let sums = self.sums(accumulator, bits);
        let wrong_weights = self.weight_error / self.weight;
        let color = straight(self.premultiplied(accumulator, bits, range));
        let mean_normal = self.normal / self.weight;
        let spread = (self.normals[1] - self.normals[0]).length();
        let normal = spread * wrong_weights + self.normal_error / self.weight + 2.0 * sums + 6.0 * U;
        let normal_length = mean_normal.length() - normal;
        let farthest = self.depths[1].abs();
        let depth = (self.depths[1] - self.depths[0]) * wrong_weights
            + self.depth_error / self.weight
            + self.interval * (sums + DIVISION + 4.0 * U)
            + 4.0 * U * farthest;
        PixelBound {
            color,
            depth,
            // If the mean is no longer than its error, it can have any direction.
            normal: if normal_length > 0.0 { 2.0 * normal / normal_length + 6.0 * U } else { 2.0 },
            weight: self.weight_error + self.weight * (sums + 4.0 * U),
        }
    }
}

impl Pixel {
    /// Adds an accepted fragment.
    pub(super) fn add(&mut self, kernel: Kernel, surface: &Surface, f: &Fragment) {
        let weight = f.weight(kernel);
        self.count += 1;
        self.weight += weight;
        self.weight_error += weight_error(kernel, f);
        self.depth_error += weight * f.depth_error;
        self.normal_error += weight * f.normal_error;
        self.normal += weight * f.normal;
        self.normals = [self.normals[0].min(f.normal), self.normals[1].max(f.normal)];
        self.depths = [self.depths[0].min(f.depth), self.depths[1].max(f.depth)];
        for (k, value) in surface.color.into_iter().enumerate() {
            self.color[k] += weight * value;
            self.colors[0][k] = self.colors[0][k].min(value);
            self.colors[1][k] = self.colors[1][k].max(value);
        }
    }

    /// Error that the accumulator and the division add to a mean, as a fraction of the range.
    fn sums(&self, accumulator: &AccumulatorRow, bits: u32) -> f64 {
        (accumulator.error_bound)(f64::from(self.count), self.weight, bits) + DIVISION
    }

    /// Returns the premultiplied colour and its error; zeros if there is no fragment.
    pub(super) fn premultiplied(&self, accumulator: &AccumulatorRow, bits: u32, range: &ColorRange) -> [[f64; 4]; 2] {
        if self.count == 0 {
            return [[0.0; 4]; 2];
        }
        let (sums, wrong_weights) = (self.sums(accumulator, bits), self.weight_error / self.weight);
        let error = |k: usize| {
            if range.span[k] == 0.0 {
                return 0.0;
            }
            let spread = self.colors[1][k] - self.colors[0][k];
            spread * wrong_weights + range.span[k] * (sums + 5.0 * U) + 2.0 * U * range.magnitude[k]
        };
        [self.color.map(|c| c / self.weight), [0, 1, 2, 3].map(error)]
    }
}

/// Converts a premultiplied mean and its error to bounds on straight colour and alpha.
pub(super) fn straight([mean, error]: [[f64; 4]; 2]) -> [f64; 4] {
    let alpha = mean[3] - error[3];
    std::array::from_fn(|k| {
        if k == 3 {
            return error[3] + 2.0 * U * mean[3];
        }
        let straight = (mean[k] / mean[3]).abs();
        // If alpha may be 0, the colour can be anything.
        let of_alpha = if alpha > 0.0 { (error[k] + straight * error[3]) / alpha } else { f64::INFINITY };
        of_alpha + straight * (2.0 * DIVISION + 4.0 * U)
    })
}

/// Returns the bounds on straight colour and alpha of a pixel with several samples: the mean of the
/// samples' bounds.
///
/// Each sample is unpremultiplied and premultiplied again before it is added, which adds the
/// relative errors of two divisions and products. The sum of n samples adds n relative roundings.
pub fn color_of_samples(samples: &[&Pixel], accumulator: &AccumulatorRow, bits: u32, range: &ColorRange) -> [f64; 4] {
    let count = samples.len() as f64;
    let (mut mean, mut error) = ([0.0; 4], [0.0; 4]);
    for [of_sample, wrong] in samples.iter().map(|sample| sample.premultiplied(accumulator, bits, range)) {
        for k in 0..4 {
            mean[k] += of_sample[k] / count;
            error[k] += (wrong[k] + of_sample[k].abs() * (2.0 * DIVISION + (4.0 + count) * U)) / count;
        }
    }
    if mean[3] > 0.0 { straight([mean, error]) } else { [0.0; 4] }
}

/// Bounds on the nearest depth of a pixel.
#[derive(Clone, Copy)]
struct Depths {
    /// The surfel whose fragment may have the smallest depth, and the two smallest possible depths.
    surfel: u32,
    first: f64,
    second: f64,
    /// For fronts and for backs: the smallest depth that a fragment may have, and the depth that
    /// the nearest fragment surely does not exceed.
    sides: [[f64; 2]; 2],
    /// The nearest fragment in the f64 twin.
    found: Nearest,
}

impl Depths {
    const NOTHING: Self = Self {
        surfel: u32::MAX,
        first: f64::INFINITY,
        second: f64::INFINITY,
        sides: [[f64::INFINITY; 2]; 2],
        found: Nearest::NOTHING,
    };

    fn add(&mut self, splat: &Splat, camera: &Camera, f: &Fragment) {
        let [may, surely] = &mut self.sides[usize::from(f.back)];
        if f.may_hit(camera) {
            let depth = (f.depth - f.depth_error).max(camera.near * (1.0 - U));
            *may = may.min(depth);
            if depth < self.first {
                (self.surfel, self.first, self.second) = (splat.surfel, depth, self.first);
            } else {
                self.second = self.second.min(depth);
            }
        }
        if f.surely_hits(camera) {
            *surely = surely.min(f.depth + f.depth_error);
        }
        if f.hits(camera) {
            self.found = self.found.with(f.depth, f.back);
        }
    }

    /// Upper limit of the nearest depth.
    fn high(&self) -> f64 {
        self.sides[0][1].min(self.sides[1][1])
    }

    /// Whether it is undecided if a front or a back is nearest.
    fn side_is_open(&self) -> bool {
        let [front, back] = self.sides;
        let nearer = |a: [f64; 2], b: [f64; 2]| a[1] * (1.0 + 4.0 * U) < b[0];
        !nearer(front, back) && !nearer(back, front)
    }

    /// Returns the smallest possible depth among the fragments of other surfels. The surfel's own
    /// fragment does not count: no fragment is too far behind itself, however uncertain its depth
    /// is.
    fn beside(&self, surfel: u32) -> f64 {
        if surfel == self.surfel { self.second } else { self.first }
    }
}

/// Returns the error terms of each pixel of `scene` seen by `camera`.
pub fn pixels(scene: &Scene, camera: &Camera, options: &Settings) -> Vec<Pixel> {
    let splats = reference_all(scene, camera, options);
    let (relative, absolute, of_radius) = options.epsilon.parts();
    let view = (camera, Sides::of(&Facts::of(scene), camera, options));
    let mut depths = vec![Depths::NOTHING; camera.pixels()];
    fragments(&splats, scene, view, |pixel, splat, _, f| depths[pixel].add(splat, camera, f));
    let deepest = f64::from(scene.largest_shorter()) * of_radius + absolute;
    let farthest = splats.iter().fold(0.0, |far: f64, splat| {
        let surfel = &scene.surfels[splat.surfel as usize];
        let center = Vec3::from_array(surfel.center).as_dvec3() - (camera.eye - scene.origin);
        far.max((camera.rotation * center).z)
    });
    let farthest = (farthest + f64::from(scene.largest_radius())) * 1.001;
    let mut pixels = vec![NOTHING; camera.pixels()];
    fragments(&splats, scene, view, |pixel, splat, surface, f| {
        let along = camera.along_axis(pixel as u32 % camera.width, pixel as u32 / camera.width);
        let behind = |front: f64| options.epsilon.farthest(front, surface.radius, along);
        // The slope of a ray takes an inverse square root, whose argument has three roundings.
        let of_ray = if let Epsilon::Ray(length) = options.epsilon { 10.0 * U * length } else { 0.0 };
        let rounding = 4.0 * U * f.depth.abs() + of_ray;
        let (near, front) = (&depths[pixel], depths[pixel].found);
        let may = f.may_hit(camera) && f.depth - f.depth_error - rounding <= behind(near.high());
        let must = f.surely_hits(camera) && f.depth + f.depth_error + rounding <= behind(near.beside(splat.surfel));
        let hits = f.hits(camera) && front.shows(f.depth, f.back, behind(front.depth));
        let known = &mut pixels[pixel];
        known.open |= may && near.side_is_open() || f.back == front.back && may != must;
        if !hits {
            return;
        }
        known.add(options.kernel, surface, f);
        let near = front.depth;
        known.interval = (near * relative + deepest.min(near * options.epsilon.most())).min(farthest - near).max(0.0);
    });
    pixels
}
