//! The error of a render against the surface itself.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::ssim::mean_ssim;
use super::{ColorError, Sorted, same_size};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::scene::Map;
use crate::scene::color::linear_to_srgb;
use crate::truth::Truth;

/// The error of a render against the [`Truth`] of the same camera, lights and background.
///
/// The render *covers* a pixel where its depth is finite, the truth where the ray through the
/// pixel's centre meets the surface. Alpha would not do: before an opaque background it is 1
/// everywhere. A pixel is *inside* if the truth covers it and all its samples meet the surface.
/// Other pixels that the truth covers, or with samples that meet the surface, are the silhouette.
/// Only the outline against the background counts as silhouette: an edge in front of another part
/// of the surface is inside.
///
/// Colours are linear RGBA over the background, premultiplied by alpha, so that transparent colours
/// do not count. A measure over no pixels is null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reconstruction {
    /// Peak signal-to-noise ratio for a peak of 1, dB, over the four values of every pixel; null if
    /// the images are equal.
    pub psnr_db: Option<f64>,
    /// Largest absolute difference of these values.
    pub max_abs: f64,
    /// 99.9th percentile over all pixels of the largest such difference in the pixel.
    pub percentile_99_9: f64,
    /// Mean structural similarity in [-1, 1] (Wang et al. 2004: Gaussian windows of 11 x 11 pixels,
    /// sigma 1.5, K1 = 0.01, K2 = 0.03), over all windows that lie in the image; 1 for equal
    /// images, null if a side is below 11 pixels.
    ///
    /// It compares the luma of the premultiplied, sRGB-encoded colours, with the weights of Rec.
    /// 709.
    pub ssim: Option<f64>,
    /// Errors of depth over the inside pixels that the render covers.
    pub depth_relative: Option<DepthError>,
    /// Errors of normals over the same pixels; null if the render has no normals.
    pub normal_degrees: Option<NormalError>,
    /// Share of the inside pixels that the render does not cover.
    pub hole_rate: Option<f64>,
    /// Share of the covered inside pixels whose depth is beyond the middle between the first and
    /// the second surface on the centre ray: the render shows, or blends in, hidden parts.
    ///
    /// A pixel without a second surface is no leak.
    pub leak_rate: Option<f64>,
    /// Number of pixels that both the render and the truth cover, over the number that either
    /// covers.
    pub silhouette_iou: Option<f64>,
    /// Mean distance between the two outlines against the background, pixels.
    ///
    /// Computed as the area that only one of the two covers, over the length of the true outline.
    /// The length follows from the steps between covered and other pixels along rows and columns
    /// (Crofton).
    pub outline_px: Option<f64>,
}

/// The error of depths as a fraction of the true depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DepthError {
    /// Mean absolute error.
    pub mean: f64,
    /// Root of the mean squared error.
    pub rmse: f64,
    /// 99th percentile of the absolute error.
    pub percentile_99: f64,
}

/// The angle between a normal and the true one, degrees. The side counts: a flipped normal is off
/// by 180, and so is a normal that is zero or not finite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NormalError {
    /// Mean.
    pub mean: f64,
    /// 99th percentile.
    pub percentile_99: f64,
}

/// Measures `frame`, which must have a depth map. Normals are measured if `frame` has any.
///
/// # Errors
///
/// [`Error::Usage`] if `frame` lacks the depth map, if `truth` lacks the depth or normal map, or if
/// the two differ in size.
pub fn reconstruction(frame: &Frame, truth: &Truth) -> Result<Reconstruction> {
    same_size(frame, &truth.frame)?;
    let lacks = |what: &str| Error::Usage(format!("{what}, which this comparison needs"));
    let depth = frame.map(Map::Depth).ok_or_else(|| lacks("the render lacks the depth map"))?;
    let (Some(true_depth), Some(true_normal)) = (truth.frame.map(Map::Depth), truth.frame.normals()) else {
        return Err(lacks("the truth lacks the depth or the normal map"));
    };

    let colors = frame.color.par_iter().zip(&truth.frame.color);
    let color = ColorError::of(colors.map(|(a, b)| (premultiplied(a), premultiplied(b))));
    let luma = |frame: &Frame| frame.color.par_iter().map(luma).collect::<Vec<_>>();

    let all = 0..frame.color.len();
    let covered = |pixel: &usize| depth[*pixel].is_finite();
    let truly_covered = |pixel: &usize| true_depth[*pixel].is_finite();
    let inside: Vec<usize> = all.clone().filter(truly_covered).filter(|&pixel| truth.coverage[pixel] == 1.0).collect();
    let both: Vec<usize> = inside.iter().copied().filter(covered).collect();
    let leaks = |pixel: &&usize| {
        let [first, second] = [true_depth[**pixel], truth.second_depth[**pixel]].map(f64::from);
        f64::from(depth[**pixel]) > 0.5 * (first + second)
    };
    let of_depth = |&pixel: &usize| {
        let truth = f64::from(true_depth[pixel]);
        (f64::from(depth[pixel]) - truth).abs() / truth
    };
    let either = all.clone().filter(|pixel| covered(pixel) || truly_covered(pixel)).count();
    let common = all.filter(|pixel| covered(pixel) && truly_covered(pixel)).count();
    Ok(Reconstruction {
        psnr_db: color.psnr_db,
        max_abs: color.max_abs,
        percentile_99_9: color.percentile_99_9,
        ssim: mean_ssim(&luma(frame), &luma(&truth.frame), frame.width as usize),
        depth_relative: DepthError::of(both.par_iter().map(of_depth).collect()),
        normal_degrees: frame.normals().and_then(|normal| {
            NormalError::of(both.par_iter().map(|&pixel| angle(normal[pixel], true_normal[pixel])).collect())
        }),
        hole_rate: share(inside.len() - both.len(), inside.len()),
        leak_rate: share(both.iter().filter(leaks).count(), both.len()),
        silhouette_iou: share(common, either),
        outline_px: outline(true_depth, frame.width as usize).map(|length| (either - common) as f64 / length),
    })
}

/// The length of the outline of the pixels with a depth, pixels; None if there is no outline.
///
/// A line crosses rows and columns of pixels in `|sin| + |cos|` steps per pixel of its length,
/// `4 / pi` on average over all directions.
fn outline(depth: &[f32], width: usize) -> Option<f64> {
    let covered = |pixel: usize| depth[pixel].is_finite();
    let steps = (0..depth.len()).map(|pixel| {
        let beside = (pixel % width > 0 && covered(pixel) != covered(pixel - 1)) as u64;
        let above = (pixel >= width && covered(pixel) != covered(pixel - width)) as u64;
        beside + above
    });
    Some(steps.sum::<u64>() as f64 * PI / 4.0).filter(|length| *length > 0.0)
}

impl DepthError {
    fn of(errors: Vec<f64>) -> Option<Self> {
        let rmse = mean(errors.iter().map(|error| error * error))?.sqrt();
        Some(Self { mean: mean(errors.iter().copied())?, rmse, percentile_99: Sorted::new(errors).percentile(0.99)? })
    }
}

impl NormalError {
    fn of(errors: Vec<f64>) -> Option<Self> {
        Some(Self { mean: mean(errors.iter().copied())?, percentile_99: Sorted::new(errors).percentile(0.99)? })
    }
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let count = values.len();
    (count > 0).then(|| values.sum::<f64>() / count as f64)
}

fn share(part: usize, of: usize) -> Option<f64> {
    (of > 0).then(|| part as f64 / of as f64)
}

/// The angle between two normals in degrees. It uses the arc tangent, as the arc cosine of f32 unit
/// vectors cannot tell small angles from zero.
fn angle(a: [f32; 3], b: [f32; 3]) -> f64 {
    let (a, b) = (DVec3::from(a.map(f64::from)), DVec3::from(b.map(f64::from)));
    let usable = |v: DVec3| v.is_finite() && v != DVec3::ZERO;
    if usable(a) && usable(b) { a.cross(b).length().atan2(a.dot(b)).to_degrees() } else { 180.0 }
}

fn premultiplied(color: &[f32; 4]) -> [f64; 4] {
    let [r, g, b, alpha] = color.map(f64::from);
    [r * alpha, g * alpha, b * alpha, alpha]
}

/// The luma of a colour over black: the Rec. 709 mean of its sRGB codes, in [0, 1].
fn luma(color: &[f32; 4]) -> f64 {
    let [r, g, b, _] = premultiplied(color).map(linear_to_srgb);
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::plan::Settings;
    use crate::scene::{Camera, Lens, Up};
    use crate::surfels::analytic::Shape;
    use crate::truth::Surface;

    const SIDE: usize = 64;
    /// A pixel inside.
    const CENTER: usize = SIDE * SIDE / 2 + SIDE / 2;

    fn truth() -> Truth {
        let (side, eye) = (SIDE as u32, DVec3::new(0.5, 1.0, 5.0));
        let camera = Camera::look_at((side, side), Lens::Fov(30.0), eye, DVec3::ZERO, None, Up::Y, 0.01).unwrap();
        // The background is opaque, so that alpha is 1 everywhere and does not tell coverage.
        let options = Settings { background: [0.1, 0.2, 0.3, 1.0], ..Settings::default() };
        Truth::cast(&Surface::Analytic(Shape::Sphere), &camera, &options, 4, &()).unwrap()
    }

    /// Returns the measures of the perfect frame with a fault, and the numbers of inside and
    /// covered pixels.
    fn with(fault: impl Fn(&mut Frame, &Truth)) -> (Reconstruction, f64, f64) {
        let truth = truth();
        let mut frame = truth.frame.clone();
        fault(&mut frame, &truth);
        let inside = truth.coverage.iter().filter(|share| **share == 1.0).count();
        let covered = truth.frame.map(Map::Depth).unwrap().iter().filter(|depth| depth.is_finite()).count();
        (reconstruction(&frame, &truth).unwrap(), inside as f64, covered as f64)
    }

    fn depths(frame: &mut Frame) -> &mut [f32] {
        frame.map_mut(Map::Depth).unwrap()
    }

    fn normals(frame: &mut Frame) -> &mut [[f32; 3]] {
        bytemuck::cast_slice_mut(frame.map_mut(Map::Normal).unwrap())
    }

    /// The outline lies two pixels outside the true circle, all around.
    #[test]
    fn outlines_are_as_far_apart_as_they_were_moved() {
        let covered = truth().frame.map(Map::Depth).unwrap().iter().filter(|depth| depth.is_finite()).count();
        let wider = (covered as f64 / PI).sqrt() + 2.0;
        let away = |pixel: usize| {
            let [x, y] = [pixel % SIDE, pixel / SIDE].map(|k| k as f64 + 0.5 - SIDE as f64 / 2.0);
            x.hypot(y)
        };
        let widen = |frame: &mut Frame, _: &Truth| {
            for (pixel, depth) in depths(frame).iter_mut().enumerate() {
                *depth = if away(pixel) < wider { depth.min(5.0) } else { f32::INFINITY };
            }
        };
        let found = with(widen).0.outline_px.unwrap();
        // The outer edge of a ring is longer.
        let expected = 2.0 * (1.0 + 1.0 / (wider - 2.0));
        assert!((found / expected - 1.0).abs() < 0.05, "{found} for {expected}");
        assert_eq!(with(|_, _| ()).0.outline_px, Some(0.0));
    }

    const NO_DEPTH_ERROR: Option<DepthError> = Some(DepthError { mean: 0.0, rmse: 0.0, percentile_99: 0.0 });
    const NO_NORMAL_ERROR: Option<NormalError> = Some(NormalError { mean: 0.0, percentile_99: 0.0 });

    #[test]
    fn the_truth_has_no_error() {
        let (error, inside, covered) = with(|_, _| {});
        assert!(inside > 1000.0 && covered > inside + 50.0);
        assert_eq!((error.psnr_db, error.max_abs, error.percentile_99_9), (None, 0.0, 0.0));
        assert!((error.ssim.unwrap() - 1.0).abs() < 1e-12);
        assert_eq!((error.depth_relative, error.normal_degrees), (NO_DEPTH_ERROR, NO_NORMAL_ERROR));
        assert_eq!((error.hole_rate, error.leak_rate, error.silhouette_iou), (Some(0.0), Some(0.0), Some(1.0)));
    }

    #[test]
    fn a_hole_is_a_hole_and_no_depth_error() {
        for empty in [f32::INFINITY, f32::NAN] {
            let (error, inside, covered) = with(|frame, _| {
                depths(frame)[CENTER] = empty;
                normals(frame)[CENTER] = [0.0; 3];
                frame.color[CENTER] = [0.1, 0.2, 0.3, 1.0];
            });
            assert_eq!((error.hole_rate, error.silhouette_iou), (Some(1.0 / inside), Some((covered - 1.0) / covered)));
            assert_eq!((error.depth_relative, error.normal_degrees), (NO_DEPTH_ERROR, NO_NORMAL_ERROR));
            assert!(error.leak_rate == Some(0.0) && error.psnr_db.is_some() && error.max_abs > 0.05);
            assert!(error.ssim.unwrap() < 0.9999);
        }
        // A pixel that is drawn in excess is no hole.
        let (error, _, covered) = with(|frame, _| depths(frame)[0] = 1.0);
        assert_eq!((error.hole_rate, error.silhouette_iou), (Some(0.0), Some(covered / (covered + 1.0))));
        let (empty, ..) = with(|frame, _| depths(frame).fill(f32::INFINITY));
        assert_eq!((empty.hole_rate, empty.leak_rate, empty.depth_relative), (Some(1.0), None, None));
        assert_eq!(empty.silhouette_iou, Some(0.0));
        assert!(serde_json::to_string(&empty).unwrap().contains("\"leak_rate\":null"));
    }

    #[test]
    fn a_leak_begins_halfway_to_the_surface_behind() {
        let leaking = |part: f32| {
            with(|frame, truth| {
                let behind = truth.second_depth[CENTER];
                let first = &mut depths(frame)[CENTER];
                *first += part * (behind - *first);
            })
        };
        let (error, inside, _) = leaking(1.0);
        assert_eq!((error.leak_rate, error.hole_rate), (Some(1.0 / inside), Some(0.0)));
        assert!(error.depth_relative.unwrap().mean > 1e-4);
        assert_eq!(leaking(0.51).0.leak_rate, Some(1.0 / inside));
        assert_eq!(leaking(0.49).0.leak_rate, Some(0.0));
    }

    #[test]
    fn depths_and_normals_are_off_by_what_they_are_moved() {
        let near = |value: f64, expected: f64| (value / expected - 1.0).abs() < 1e-4;
        let (error, ..) = with(|frame, _| depths(frame).iter_mut().for_each(|depth| *depth *= 1.01));
        let depth = error.depth_relative.unwrap();
        assert!(near(depth.mean, 0.01) && near(depth.rmse, 0.01) && near(depth.percentile_99, 0.01), "{depth:?}");
        assert_eq!((error.normal_degrees, error.psnr_db), (NO_NORMAL_ERROR, None));
        // One pixel changes the mean and the root by its share of all pixels, and the percentile
        // not at all.
        let (error, inside, _) = with(|frame, _| depths(frame)[CENTER] *= 1.1);
        let depth = error.depth_relative.unwrap();
        assert!(near(depth.mean, 0.1 / inside) && near(depth.rmse, 0.1 / inside.sqrt()) && depth.percentile_99 == 0.0);

        let turned = |degrees: f64| {
            let (error, ..) = with(|frame, _| {
                for normal in normals(frame) {
                    let n = DVec3::from(normal.map(f64::from));
                    let across = n.any_orthogonal_vector().normalize_or_zero();
                    let (sin, cos) = degrees.to_radians().sin_cos();
                    *normal = (n * cos + across * sin).as_vec3().to_array();
                }
            });
            assert_eq!(error.depth_relative, NO_DEPTH_ERROR);
            error.normal_degrees.unwrap()
        };
        for degrees in [0.01, 10.0, 90.0, 180.0] {
            let normal = turned(degrees);
            // f32 normals are off by some 4e-6 degrees each.
            let off = (normal.mean - degrees).abs().max((normal.percentile_99 - degrees).abs());
            assert!(off < 1e-5, "{degrees}: {normal:?}");
        }
        for missing in [[0.0; 3], [f32::NAN; 3]] {
            let (error, ..) = with(|frame, _| normals(frame).fill(missing));
            assert_eq!(error.normal_degrees, Some(NormalError { mean: 180.0, percentile_99: 180.0 }));
        }
    }

    #[test]
    fn a_blurred_image_has_less_structure_and_the_same_shape() {
        let blurred = |reach: usize| {
            let (error, ..) = with(|frame, truth| {
                for pixel in 0..SIDE * SIDE {
                    let around = |k: usize| k.saturating_sub(reach)..(k + reach + 1).min(SIDE);
                    let places = around(pixel / SIDE).flat_map(|y| around(pixel % SIDE).map(move |x| y * SIDE + x));
                    let colors: Vec<_> = places.map(|place| truth.frame.color[place]).collect();
                    let mean = |k: usize| colors.iter().map(|color| color[k]).sum::<f32>() / colors.len() as f32;
                    frame.color[pixel] = std::array::from_fn(mean);
                }
            });
            assert_eq!((error.depth_relative, error.silhouette_iou), (NO_DEPTH_ERROR, Some(1.0)));
            (error.ssim.unwrap(), error.psnr_db.unwrap())
        };
        let (little, much) = (blurred(1), blurred(3));
        assert!(much.0 < little.0 && little.0 < 0.99 && much.1 < little.1 && little.1 < 40.0, "{little:?} {much:?}");
    }

    #[test]
    fn a_known_change_of_color_has_its_ratio_and_premultiplied_ones_count_by_alpha() {
        let (error, ..) = with(|frame, _| frame.color.iter_mut().for_each(|color| color[1] += 0.1));
        // One of four values is off by 0.1: 20 dB and 6.02.
        assert!((error.psnr_db.unwrap() - 26.0206).abs() < 1e-4 && (error.max_abs - 0.1).abs() < 1e-6);
        assert!((error.percentile_99_9 - 0.1).abs() < 1e-6);
        let mut truth = truth();
        let mut frame = truth.frame.clone();
        truth.frame.color[0] = [1.0, 0.0, 0.0, 0.0];
        frame.color[0] = [0.0, 1.0, 0.0, 0.0];
        assert_eq!(reconstruction(&frame, &truth).unwrap().psnr_db, None);
        let mut frame = frame.without(Map::Depth);
        assert!(reconstruction(&frame, &truth).unwrap_err().to_string().contains("depth"));
        frame.width = 32;
        assert!(reconstruction(&frame, &truth).unwrap_err().to_string().contains("size"));
    }
}
