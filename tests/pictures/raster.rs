//! The rasteriser's path: the same picture as with compute, up to the error of its blending and
//! depth test.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::hardcases::{HardCase, Row, Truth, cases, judge};
use epsplat::low_level::plan::{Accumulator, AccumulatorRow, BlendFormat, Features, Raster, RasterDepth, Settings};
use epsplat::low_level::render::{Backend, Report, render};
use epsplat::low_level::scene::{Camera, Epsilon, Map, Maps, Shading};

/// Cases with every kind of footprint and attribute, and depths of many magnitudes.
const CASES: [&str; 6] = [
    "intersecting sheets",
    "intersecting sheets, orthographic",
    "only the kernel's tail, hat",
    "across the near depth",
    "anisotropy 1000:1",
    "UTM, a kilometre off",
];

fn all_cases() -> Vec<(HardCase, Truth)> {
    let all = cases().unwrap().into_iter().filter(|case| CASES.contains(&case.name.as_str()));
    let all: Vec<_> = all.map(|case| (case.truth().unwrap(), case)).map(|(truth, case)| (case, truth)).collect();
    assert_eq!(all.len(), CASES.len());
    all
}

fn options(case: &HardCase, format: BlendFormat, depth: RasterDepth) -> Settings {
    let maps = if format == BlendFormat::Rgba8Unorm { Maps::ON_DEVICE.but(&[Map::Count]) } else { Maps::ON_DEVICE };
    Settings { raster: Some(Raster { format, depth }), maps, ..case.options.clone() }
}

fn frame(case: &HardCase, options: &Settings, backend: &Backend) -> (Frame, Report) {
    render(&case.scene, &case.camera, options, backend, &()).unwrap()
}

/// The row of a floating-point blend format with this error bound (src/passes/raster.rs).
fn floating(error_bound: fn(f64, f64, u32) -> f64) -> AccumulatorRow {
    AccumulatorRow {
        of: Accumulator::Float,
        name: "raster",
        file: "",
        words: 0,
        deterministic: false,
        features: Features::None,
        error_bound,
    }
}

fn judged(case: &HardCase, truth: &Truth, format: BlendFormat, backend: &Backend) -> Row {
    let (frame, report) = frame(case, &options(case, format, RasterDepth::Exact), backend);
    assert_eq!((report.backend, report.accumulator), ("raster", format.name()));
    let bound = match format {
        BlendFormat::Rgba32Float => floating(|n, _, _| (2.0 * n * 2f64.powi(-24)) + 4.0 * 2f64.powi(-24)),
        _ => floating(|n, _, _| (2.0 * n * 2f64.powi(-11)) + 4.0 * 2f64.powi(-24)),
    };
    judge(case, truth, &bound, &frame, &report)
}

fn kept(row: &Row) -> bool {
    row.lost + row.invented + row.nan == 0 && row.maps.iter().all(|map| map.used_of_own <= 1.0)
}

#[test]
fn exact_depths_lose_no_more_than_the_formats_bound() {
    let cases = all_cases();
    for gpu in [common::gpu(), common::opengl()].into_iter().flatten() {
        let blends_f32 = gpu.adapter.blends_f32;
        let name = format!("{} ({})", gpu.adapter.name, gpu.adapter.api);
        let backend = Backend::gpu(gpu);
        for (case, truth) in &cases {
            for (format, runs) in [(BlendFormat::Rgba32Float, blends_f32), (BlendFormat::Rgba16Float, true)] {
                if runs {
                    let row = judged(case, truth, format, &backend);
                    assert!(kept(&row), "{} in {} on {name}: {row:#?}", case.name, format.name());
                }
            }
        }
    }
}

/// A format or depth test that the adapter lacks is refused, and the error names an alternative.
#[test]
fn what_an_adapter_cannot_draw_is_refused() {
    let (case, _) = all_cases().into_iter().find(|(case, _)| case.name == "intersecting sheets").unwrap();
    let refused = |gpu: Gpu, format, depth, words: &str| {
        let backend = Backend::gpu(gpu);
        let options = options(&case, format, depth);
        let error = render(&case.scene, &case.camera, &options, &backend, &()).unwrap_err().to_string();
        assert!(error.contains(words), "{words}: {error}");
    };
    if let Some(gpu) = common::opengl() {
        refused(gpu, BlendFormat::Rgba16Float, RasterDepth::Offset, "take --raster-depth exact");
    }
    let Some(mut gpu) = common::gpu() else { return };
    gpu.adapter.blends_f32 = false;
    refused(gpu, BlendFormat::Rgba32Float, RasterDepth::Exact, "take --blend-format rgba16float");
    let Some(mut gpu) = common::gpu() else { return };
    gpu.adapter.vertex_storage = false;
    refused(gpu, BlendFormat::Rgba16Float, RasterDepth::Exact, "take --backend gpu");
}

#[test]
fn a_broken_raster_kernel_is_noticed() {
    let cases = all_cases();
    for (file, from, to) in [
        ("side.wgsl", "fragment.depth <= farthest", "fragment.depth * 1.001 <= farthest"),
        ("raster_exact.wgsl", "fragment.depth * depth_scale()", "0.999 * fragment.depth * depth_scale()"),
        ("raster.wgsl", "extent.last + 1u", "extent.last"),
        ("accumulator_raster.wgsl", "clamp(value, 0.0, 1.0)", "clamp(1.01 * value, 0.0, 1.0)"),
        ("raster_targets_3.wgsl", "textureLoad(sums_1", "textureLoad(sums_2"),
    ] {
        let Some(gpu) = common::gpu() else { return };
        let backend = Backend::Gpu { gpu: Box::new(gpu), sources: Sources::default().replace(file, from, to).unwrap() };
        let noticed =
            |(case, truth): &(HardCase, Truth)| !kept(&judged(case, truth, BlendFormat::Rgba16Float, &backend));
        assert!(cases.iter().any(noticed), "{file} with {to}");
    }
}

/// Interpolated depths change the accepted fragments in few pixels, and cover the same pixels.
#[test]
fn the_classic_depth_test_accepts_nearly_the_same_fragments() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    for name in ["intersecting sheets", "intersecting sheets, orthographic", "UTM, a kilometre off"] {
        let case = cases().unwrap().into_iter().find(|case| case.name == name).unwrap();
        for epsilon in [case.options.epsilon, Epsilon::Ray(0.01)] {
            let case = HardCase { options: Settings { epsilon, ..case.options.clone() }, ..case.clone() };
            let count = |depth| {
                let frame = frame(&case, &options(&case, BlendFormat::Rgba16Float, depth), &backend).0;
                frame.map(Map::Count).unwrap().to_vec()
            };
            let (exact, classic) = (count(RasterDepth::Exact), count(RasterDepth::Offset));
            let covered = exact.iter().filter(|count| **count > 0.0).count();
            let differ = exact.iter().zip(&classic).filter(|(a, b)| a != b).count();
            let changed = exact.iter().zip(&classic).filter(|(a, b)| (**a > 0.0) != (**b > 0.0)).count();
            assert_eq!(changed, 0, "{name}, {epsilon:?}: covered pixels");
            assert!(differ * 50 < covered, "{name}, {epsilon:?}: {differ} of {covered} pixels");
        }
    }
}

#[test]
fn eight_bits_lose_what_they_must_and_refuse_to_count() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let (case, truth) = all_cases().into_iter().find(|(case, _)| case.name == "intersecting sheets").unwrap();
    let (eight, _) = frame(&case, &options(&case, BlendFormat::Rgba8Unorm, RasterDepth::Exact), &backend);
    let worst = |frame: &Frame| {
        let both = frame.color.iter().zip(&truth.frame.color).filter(|(a, b)| a[3] > 0.0 && b[3] > 0.0);
        both.flat_map(|(a, b)| a.iter().zip(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    let (half, _) = frame(&case, &options(&case, BlendFormat::Rgba16Float, RasterDepth::Exact), &backend);
    assert!(worst(&eight) > 10.0 * worst(&half), "{} and {}", worst(&eight), worst(&half));
    let counted = Settings { maps: Maps::ON_DEVICE, ..options(&case, BlendFormat::Rgba8Unorm, RasterDepth::Exact) };
    let error = render(&case.scene, &case.camera, &counted, &backend, &()).unwrap_err().to_string();
    assert!(error.contains("8-bit"), "{error}");
}

/// Lit pictures match those of compute within the blending error.
///
/// A mean of n fragments in a format of 11 bits errs by `2 n 2^-11` of the attribute's range
/// (src/passes/raster.rs). This holds for the colour and for each component of the normal. The mean
/// normal's length is at least a half where planes intersect, so the cosine errs by four times as
/// much.
#[test]
fn lit_pictures_are_computes() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    for (case, _) in all_cases().iter().filter(|(case, _)| case.name.starts_with("intersecting")) {
        let plain = Settings::default();
        assert_eq!(plain.shading, Shading::Lambert);
        let lit = Settings { shading: plain.shading, lights: plain.lights, ..case.options.clone() };
        let lit = Settings { maps: lit.maps.and(&[Map::Count]), ..lit };
        let (compute, _) = frame(case, &lit, &backend);
        let raster = Settings { raster: Some(Raster::default()), ..lit.clone() };
        let (raster, _) = frame(case, &raster, &backend);
        let largest = case.scene.colors.clone();
        let range = (0..case.scene.surfels.len()).flat_map(|k| largest.linear(k)).fold(1.0, f32::max);
        let counts = compute.map(Map::Count).unwrap();
        let pixels = compute.color.iter().zip(&raster.color).zip(counts);
        let used = pixels.flat_map(|((a, b), n)| {
            let bound = range * (1.0 + 4.0) * 2.0 * n.max(1.0) / 2048.0;
            a.iter().zip(b).map(move |(a, b)| (a - b).abs() / bound)
        });
        let worst = used.fold(0.0, f32::max);
        assert!(worst > 0.0 && worst < 1.0, "{}: {worst} of the bound", case.name);
    }
}

/// Tight triangles and parallelograms around disks lose no fragment that bounding boxes have;
/// shapes that are too small lose some.
#[test]
fn tight_shapes_leave_out_nothing() {
    let tight = Sources::default();
    let boxes = tight.clone().replace("raster.wgsl", "if (FACES || FILTERED", "if (true || FILTERED").unwrap();
    let small = tight.clone().replace("raster.wgsl", "SHAPE_MARGIN: f32 = 0.05", "SHAPE_MARGIN: f32 = -0.5").unwrap();
    let draw = |sources: &Sources, case: &HardCase, size, depth| {
        let Some(gpu) = common::gpu() else { return vec![] };
        let backend = Backend::Gpu { gpu: Box::new(gpu), sources: sources.clone() };
        let camera = Camera { width: size, height: size, ..case.camera.clone() };
        let options = Settings { ..options(case, BlendFormat::Rgba16Float, depth) };
        common::bits(&render(&case.scene, &camera, &options, &backend, &()).unwrap().0)
    };
    let mut noticed = [0; 2];
    for (case, _) in all_cases() {
        // Image sizes at which each splat is drawn as a triangle, and as a quad.
        let most = 10 * case.scene.surfels.len() as u32;
        let few = (f64::from(most).sqrt() as u32 - 1).min(case.camera.width);
        for (shape, size) in [(0, few), (1, (f64::from(most).sqrt() as u32 + 1).max(case.camera.width))] {
            for depth in [RasterDepth::Exact, RasterDepth::Offset] {
                let expected = draw(&boxes, &case, size, depth);
                // Interpolated depths depend on the corners, so only coverage is compared.
                let same = |bits: Vec<u32>| match depth {
                    RasterDepth::Exact => bits == expected,
                    _ => bits.iter().zip(&expected).all(|(a, b)| (*a == 0) == (*b == 0)),
                };
                assert!(same(draw(&tight, &case, size, depth)), "{} at {size}, {}", case.name, depth.name());
                noticed[shape] += u32::from(!same(draw(&small, &case, size, depth)));
            }
        }
    }
    assert!(common::gpu().is_none() || noticed.iter().all(|n| *n > 2), "{noticed:?}");
}
