//! Judges the frames of a study: their error against the f64 reference and against ground truth.

use std::collections::BTreeMap;

use super::case::{Case, Timed};
use crate::error::Result;
use crate::frame::Frame;
use crate::metrics::{Reconstruction, compare, joint, reconstruction};
use crate::plan::Settings;
use crate::progress::Progress;
use crate::render::{Backend, Renderer, render};
use crate::report::{ImageSet, Measurement, Numeric};
use crate::scene::{Blend, Colors, Composite, Map, Maps, Scene, Shading, ShadingAt};
use crate::truth::{Surface, Truth};

/// The longer side of the report's pictures, pixels.
const PICTURE_SIDE: usize = 512;

/// The maps of the reference that errors need: fragment counts, and decisions, which mark excused
/// pixels.
pub(super) const OF_REFERENCE: [Map; 2] = [Map::Count, Map::Decision];

/// The error of a configuration against the f64 reference.
pub(super) struct Errors {
    /// The worst error over the cameras.
    pub numeric: Numeric,
    /// Blended fragments per frame, mean over the cameras.
    pub fragments: f64,
    /// The image and the reference of the first camera, for the report.
    pub picture: ImageSet,
}

/// Groups items by key. Returns each key with the indices of its items, in order of first
/// occurrence.
fn grouped<K: PartialEq>(keys: impl Iterator<Item = K>) -> Vec<(K, Vec<usize>)> {
    let mut groups: Vec<(K, Vec<usize>)> = Vec::new();
    for (index, key) in keys.enumerate() {
        match groups.iter_mut().find(|(known, _)| *known == key) {
            Some((_, members)) => members.push(index),
            None => groups.push((key, vec![index])),
        }
    }
    groups
}

/// Compares all configurations with the f64 reference.
///
/// Configurations that differ only in how they store sums share one render of the reference.
pub(super) fn against_reference(case: &Case<'_>, timed: &[Timed<'_>], progress: &dyn Progress) -> Result<Vec<Errors>> {
    let default = Settings::default();
    let maps = Maps::of(&OF_REFERENCE);
    let key = |timed: &Timed<'_>| Settings {
        accumulator: default.accumulator,
        // The rasteriser's peeled layers differ from layers of fragment lists, so they need another
        // reference.
        raster: timed.options.raster.filter(|_| matches!(timed.options.composite, Composite::Layers(_))),
        maps,
        ..timed.options.clone()
    };
    let picture = |timed: &Timed<'_>, reference: &Frame| {
        let (image, reference) = small_pair(&timed.frames[0], reference);
        ImageSet {
            scene: case.entry.name.clone(),
            config: timed.config.name.clone(),
            image,
            reference: Some(reference),
        }
    };
    let mut errors: Vec<Option<Errors>> = timed.iter().map(|_| None).collect();
    let share = 1.0 / case.staged.cameras.len() as f64;
    for (options, members) in grouped(timed.iter().map(key)) {
        for (view, camera) in case.staged.cameras.iter().enumerate() {
            let (reference, _) = render(&case.staged.scene, camera, &options, &Backend::Reference, progress)?;
            let fragments: f64 =
                reference.map(Map::Count).unwrap_or_default().iter().map(|count| f64::from(*count)).sum();
            for &member in &members {
                let timed = &timed[member];
                let comparison = compare(&timed.frames[view], &reference)?;
                let error = errors[member].get_or_insert_with(|| Errors {
                    numeric: Numeric::default(),
                    fragments: 0.0,
                    picture: picture(timed, &reference),
                });
                let numeric = &mut error.numeric;
                numeric.rmse = numeric.rmse.max(comparison.rmse_decided.unwrap_or(comparison.rmse));
                numeric.max_abs = numeric.max_abs.max(comparison.max_abs_decided.unwrap_or(comparison.max_abs));
                numeric.psnr_db = (numeric.rmse > 0.0).then(|| -20.0 * numeric.rmse.log10());
                error.fragments += share * fragments;
            }
        }
    }
    // No entry is `None`: each configuration is in one group, and there is at least one camera.
    Ok(errors.into_iter().flatten().collect())
}

/// Returns the measures of each configuration against ground truth, the worst over the cameras.
///
/// A result is empty if the scene has neither ground truth nor a second input ([`between_inputs`]).
/// Frames with depth and normal are rendered anew for this and are not timed.
pub(super) fn against_truth(
    case: &Case<'_>,
    timed: &[Timed<'_>],
    progress: &dyn Progress,
) -> Result<Vec<BTreeMap<String, f64>>> {
    let mut worst = vec![BTreeMap::new(); timed.len()];
    if case.staged.dressed {
        for (timed, worst) in timed.iter().zip(&mut worst) {
            between_inputs(case, timed, worst)?;
        }
    }
    let Some(surface) = &case.staged.surface else { return Ok(worst) };
    let seen = |timed: &Timed<'_>| {
        (timed.options.shading, timed.options.composite != Composite::Opaque, timed.options.opacity)
    };
    for (_, members) in grouped(timed.iter().map(seen)) {
        let options = timed[members[0]].options;
        let cast = |camera| Truth::cast(surface, camera, options, case.definition.rays, progress);
        let truths: Vec<Truth> = case.staged.cameras.iter().map(cast).collect::<Result<_>>()?;
        for member in members {
            let timed = &timed[member];
            // Normals are compared only if surfels have normals, which points turned to the camera
            // lack, and if blending stores them.
            let normals = timed.options.facing.is_none() && timed.options.blend == Blend::Weighted;
            let wanted: &[Map] = if normals { &[Map::Depth, Map::Normal] } else { &[Map::Depth] };
            let maps = timed.options.maps.and(wanted);
            let with_maps = Settings { maps, ..timed.options.clone() };
            let mut renderer = Renderer::new(&case.staged.scene, &with_maps, case.backend(timed.config))?;
            for (camera, truth) in case.staged.cameras.iter().zip(&truths) {
                let (frame, _) = renderer.frame(camera, &())?;
                join_worst(&mut worst[member], &reconstruction(&frame, truth)?);
            }
            if let Surface::Both(both) = surface {
                beside_joint(case, timed, both, &mut worst[member])?;
            }
        }
    }
    Ok(worst)
}

/// Measures errors where surfels and triangles meet: wrong pixels and the offset of the visible
/// curve.
///
/// Stores the worst values over the cameras as `wrong_winner_rate` and `curve_offset_px`.
fn beside_joint(
    case: &Case<'_>,
    timed: &Timed<'_>,
    both: &[Surface; 2],
    worst: &mut BTreeMap<String, f64>,
) -> Result<()> {
    // Surfels are red and triangles green, so that colour tells which of them a pixel shows.
    let Scene { triangles, .. } = &case.staged.scene;
    let scene = Scene {
        colors: Colors::Constant([1.0, 0.0, 0.0, 1.0]),
        triangles: triangles.painted([0.0, 1.0, 0.0, 1.0]),
        ..case.staged.scene.clone()
    };
    let options = in_own_colors(timed.options);
    let mut renderer = Renderer::new(&scene, &options, case.backend(timed.config))?;
    for camera in &case.staged.cameras {
        let (frame, _) = renderer.frame(camera, &())?;
        let shows: Vec<bool> = frame.color.iter().map(|[r, g, ..]| r > g).collect();
        let Some(joint) = joint(&shows, camera, both.each_ref()) else { continue };
        for (name, value) in [("wrong_winner_rate", joint.wrong_rate), ("curve_offset_px", joint.offset_px)] {
            let known = worst.entry(name.to_owned()).or_insert(value);
            *known = known.max(value);
        }
    }
    Ok(())
}

/// Measures the share of covered pixels that blend the first input with another input.
///
/// Stores the worst value over the cameras as `mixed_rate`.
fn between_inputs(case: &Case<'_>, timed: &Timed<'_>, worst: &mut BTreeMap<String, f64>) -> Result<()> {
    let scene = &case.staged.scene;
    let all = 0..scene.surfels.len() as u64;
    let of_first = |surfel| scene.provenance.of(surfel).0 == 0;
    let color = |surfel| if of_first(surfel) { [1.0, 0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0, 1.0] };
    let told_apart = Scene { colors: Colors::Linear(all.map(color).collect()), ..scene.clone() };
    let options = in_own_colors(timed.options);
    let mut renderer = Renderer::new(&told_apart, &options, case.backend(timed.config))?;
    for camera in &case.staged.cameras {
        let (frame, _) = renderer.frame(camera, &())?;
        let shown = || frame.color.iter().filter(|color| color[3] > 0.0);
        // A share below 1/2048, an eighth of an 8-bit step, is invisible and does not count.
        let mixed = shown().filter(|[r, g, ..]| r.min(*g) > 1.0 / 2048.0).count();
        let rate = mixed as f64 / shown().count().max(1) as f64;
        let known = worst.entry("mixed_rate".to_owned()).or_insert(rate);
        *known = known.max(rate);
    }
    Ok(())
}

/// Returns options that show the unlit, opaque colours of the surfels.
fn in_own_colors(options: &Settings) -> Settings {
    Settings {
        shading: Shading::Unlit,
        shading_at: ShadingAt::Pixel,
        maps: Maps::NONE,
        opacity: 1.0,
        ..options.clone()
    }
}

/// Returns `apart_rmse` and `apart_psnr_db` of configurations that approximate another.
///
/// Both state the error against the f64 reference of the other configuration, the worst over the
/// cameras. No pixel is excused: detail that the approximation omits or adds is part of its error.
pub(super) fn against_approximated(
    case: &Case<'_>,
    timed: &[Timed<'_>],
    progress: &dyn Progress,
) -> Result<Vec<BTreeMap<String, f64>>> {
    let of = |timed: &Timed<'_>| timed.config.approximates.clone();
    let mut apart = vec![BTreeMap::new(); timed.len()];
    for (name, members) in grouped(timed.iter().map(of)) {
        let Some(other) = timed.iter().find(|timed| Some(&timed.config.name) == name.as_ref()) else { continue };
        for (view, camera) in case.staged.cameras.iter().enumerate() {
            let (truth, _) = render(&case.staged.scene, camera, other.options, &Backend::Reference, progress)?;
            for &member in &members {
                let rmse = compare(&timed[member].frames[view], &truth)?.rmse;
                let worst = apart[member].get("apart_rmse").copied().unwrap_or(0.0f64).max(rmse);
                apart[member].insert("apart_rmse".to_owned(), worst);
                apart[member].insert("apart_psnr_db".to_owned(), -20.0 * worst.log10());
            }
        }
    }
    Ok(apart)
}

/// The measures for which a smaller value is worse.
const LESS_IS_WORSE: [&str; 3] = ["psnr_db", "ssim", "silhouette_iou"];

fn join_worst(worst: &mut BTreeMap<String, f64>, error: &Reconstruction) {
    let measures = [
        ("psnr_db", Some(error.psnr_db.unwrap_or(f64::INFINITY))),
        ("max_abs", Some(error.max_abs)),
        ("percentile_99_9", Some(error.percentile_99_9)),
        ("ssim", error.ssim),
        ("depth_relative_mean", error.depth_relative.map(|depth| depth.mean)),
        ("depth_relative_rmse", error.depth_relative.map(|depth| depth.rmse)),
        ("depth_relative_percentile_99", error.depth_relative.map(|depth| depth.percentile_99)),
        ("normal_degrees_mean", error.normal_degrees.map(|normal| normal.mean)),
        ("normal_degrees_percentile_99", error.normal_degrees.map(|normal| normal.percentile_99)),
        ("hole_rate", error.hole_rate),
        ("leak_rate", error.leak_rate),
        ("silhouette_iou", error.silhouette_iou),
        ("outline_px", error.outline_px),
    ];
    for (name, value) in measures {
        let Some(value) = value else { continue };
        let worse = if LESS_IS_WORSE.contains(&name) { f64::min } else { f64::max };
        worst.entry(name.to_owned()).and_modify(|known| *known = worse(*known, value)).or_insert(value);
    }
}

/// Sets [`Measurement::ratio_to_raster`] for the configurations of one case.
pub(super) fn compare_with_raster(measurements: &mut [Measurement]) {
    let rasters: Vec<(f64, f64)> = measurements
        .iter()
        .filter(|m| m.backend == "raster")
        .filter_map(|m| Some((m.numeric_error()?, m.total_ms.median)))
        .collect();
    for m in measurements {
        let Some(error) = m.numeric_error().filter(|_| m.total_ms.median > 0.0) else { continue };
        let times = rasters.iter().filter(|(of_raster, _)| *of_raster <= error).map(|(_, ms)| *ms);
        m.ratio_to_raster = times.min_by(f64::total_cmp).map(|ms| ms / m.total_ms.median);
    }
}

/// Shrinks the colours of both images by an integer factor to at most [`PICTURE_SIDE`].
///
/// Both images keep that pixel of each block in which they differ most, so that no error is
/// averaged away.
fn small_pair(image: &Frame, reference: &Frame) -> (Frame, Frame) {
    let (width, height) = (image.width as usize, image.height as usize);
    let factor = width.max(height).div_ceil(PICTURE_SIDE).max(1);
    let differs = |pixel: usize| {
        let pairs = image.color[pixel].iter().zip(&reference.color[pixel]);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    let mut kept = Vec::new();
    for top in (0..height).step_by(factor) {
        for left in (0..width).step_by(factor) {
            let rows = top..(top + factor).min(height);
            let block = rows.flat_map(|y| (left..(left + factor).min(width)).map(move |x| y * width + x));
            let middle = top * width + left;
            kept.push(block.fold(middle, |most, pixel| if differs(pixel) > differs(most) { pixel } else { most }));
        }
    }
    let small = |frame: &Frame| {
        Frame::of_colors(
            width.div_ceil(factor) as u32,
            height.div_ceil(factor) as u32,
            kept.iter().map(|pixel| frame.color[*pixel]).collect(),
        )
    };
    (small(image), small(reference))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::report::Summary;

    fn measurement(backend: &str, median: f64, rmse: f64) -> Measurement {
        Measurement {
            backend: backend.into(),
            total_ms: Summary { median, ..Summary::default() },
            numeric: Some(Numeric { rmse, ..Numeric::default() }),
            ..Measurement::default()
        }
    }

    #[test]
    fn a_ratio_is_to_the_fastest_raster_that_is_no_less_exact() {
        let mut all = [
            measurement("gpu", 10.0, 1e-6),
            measurement("gpu", 5.0, 1e-3),
            measurement("gpu", 5.0, 1e-9),
            measurement("raster", 20.0, 1e-3),
            measurement("raster", 40.0, 1e-6),
        ];
        compare_with_raster(&mut all);
        let ratios: Vec<_> = all.iter().map(|m| m.ratio_to_raster).collect();
        assert_eq!(ratios, [Some(4.0), Some(4.0), None, Some(1.0), Some(1.0)]);
    }

    #[test]
    fn a_small_picture_keeps_the_largest_difference() {
        let size = 2 * PICTURE_SIDE as u32 - 1;
        let plain = Frame::of_colors(size, 3, vec![[0.5; 4]; 3 * size as usize]);
        let mut other = plain.clone();
        other.color[size as usize + 1] = [1.0; 4];
        let (image, reference) = small_pair(&other, &plain);
        assert_eq!((image.width, image.height, image.color.len()), (512, 2, 1024));
        assert_eq!((image.color[0], image.color[1], reference.color[0]), ([1.0; 4], [0.5; 4], [0.5; 4]));
    }

    #[test]
    fn the_worst_camera_counts() {
        let of = |psnr_db, max_abs| Reconstruction {
            psnr_db,
            max_abs,
            percentile_99_9: 0.0,
            ssim: None,
            depth_relative: None,
            normal_degrees: None,
            hole_rate: Some(0.0),
            leak_rate: None,
            silhouette_iou: Some(1.0),
            outline_px: None,
        };
        let mut worst = BTreeMap::new();
        for error in [of(None, 0.0), of(Some(30.0), 0.2), of(Some(40.0), 0.5)] {
            join_worst(&mut worst, &error);
        }
        assert_eq!((worst["psnr_db"], worst["max_abs"], worst.len()), (30.0, 0.5, 5));
    }
}
