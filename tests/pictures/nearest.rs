//! The nearest fragment alone, as with a depth test: kernels of one pass and of two passes give the
//! same bits, and the f64 twin agrees.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use common::scenes::{sphere, sphere_camera};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::plan::{Accumulator, BlendFormat, Optimisation, Raster, RasterDepth, Settings, check};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::facing::POINT_SHAPES;
use epsplat::low_level::scene::{
    Blend, Colors, Facing, LowPass, Map, Maps, PointShape, Projection, Samples, Scene, Shading, Surfel,
};
use glam::Vec3;

use crate::common;

/// A sphere of surfels, each with its own colour and an alpha of at least a third.
fn colored(count: u64) -> Scene {
    let mut scene = sphere(count as usize, 1.0);
    let code = |k: u64| {
        let mixed = (k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15).to_le_bytes();
        [mixed[7], mixed[6], mixed[5], mixed[4] / 2 + 85]
    };
    scene.colors = Colors::Srgb8((0..count).map(code).collect());
    scene
}

fn options(facing: Option<PointShape>) -> Settings {
    Settings {
        facing: facing.map(|shape| Facing { shape, pixels: [1.0, 40.0] }),
        blend: Blend::Nearest,
        shading: Shading::Unlit,
        maps: Maps::of(&[Map::Depth]),
        ..Settings::default()
    }
}

/// Disks in their own planes (`None`), and every shape that faces the camera.
fn kinds() -> impl Iterator<Item = Option<PointShape>> {
    std::iter::once(None).chain(POINT_SHAPES.map(|(_, shape)| Some(shape)))
}

/// The number of decided pixels, and of those whose colour or depth differs from the reference.
fn wrong(frame: &Frame, reference: &Frame) -> (usize, usize) {
    let decision = reference.map(Map::Decision).unwrap();
    let [ours, theirs] = [frame, reference].map(|frame| frame.map(Map::Depth).unwrap());
    let differs = |pixel: usize| {
        let color = frame.color[pixel].into_iter().zip(reference.color[pixel]).any(|(a, b)| (a - b).abs() > 1e-6);
        let (a, b) = (ours[pixel], theirs[pixel]);
        color || (a != b && (a - b).abs() > 1e-5 * b)
    };
    let decided: Vec<usize> = (0..decision.len()).filter(|&pixel| decision[pixel] >= 1e-5).collect();
    (decided.len(), decided.into_iter().filter(|&pixel| differs(pixel)).count())
}

fn reference(scene: &Scene, projection: Projection, options: &Settings) -> Frame {
    let options = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
    render(scene, &sphere_camera(160, projection), &options, &Backend::Reference, &()).unwrap().0
}

#[test]
fn one_pass_two_passes_and_the_twin_show_the_same_fragments() {
    let (Some(gpu), Some(core)) = (common::gpu(), common::core_gpu()) else { return };
    let once = gpu.adapter.atomics_u64;
    let (backend, core) = (Backend::gpu(gpu), Backend::gpu(core));
    let scene = colored(3000);
    for projection in [Projection::Pinhole, Projection::Orthographic] {
        let camera = sphere_camera(160, projection);
        for kind in kinds() {
            let options = options(kind);
            let (frame, report) = render(&scene, &camera, &options, &backend, &()).unwrap();
            assert!(report.needs.contains(&"nearest") && report.passes.contains_key("accumulate_ms") != once);
            let (decided, wrong) = wrong(&frame, &reference(&scene, projection, &options));
            assert!(wrong == 0 && decided > 20_000, "{wrong} of {decided}, {kind:?}");
            // Two passes are used without 64-bit atomics, which are switched off or absent from the
            // adapter.
            let second = Settings { without: vec![Optimisation::Pairs], ..options.clone() };
            for (options, backend) in [(&second, &backend), (&options, &core)] {
                let (frame_of_two, report) = render(&scene, &camera, options, backend, &()).unwrap();
                assert!(report.passes.contains_key("accumulate_ms"));
                assert!(common::bits(&frame) == common::bits(&frame_of_two), "{kind:?}");
            }
        }
    }
}

#[test]
fn neither_order_nor_what_is_left_out_shows() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let mut scene = colored(60_000);
    // Many surfels at one place and depth: the greatest colour word shows.
    scene.surfels.iter_mut().take(6000).for_each(|surfel| *surfel = Surfel::disk(Vec3::Z * 1.5, Vec3::Z, 0.2));
    let mut reversed = scene.clone();
    reversed.surfels.reverse();
    if let Colors::Srgb8(codes) = &mut reversed.colors {
        codes.reverse();
    }
    let camera = sphere_camera(96, Projection::Pinhole);
    for kind in [None, Some(PointShape::Circle), Some(PointShape::Paraboloid)] {
        for samples in ["1", "4"] {
            let samples: Samples = samples.parse().unwrap();
            let maps = if samples == Samples::ONE { Maps::of(&[Map::Depth]) } else { Maps::NONE };
            let options = Settings { samples, maps, ..options(kind) };
            let bits = |scene: &Scene, without: &[Optimisation]| {
                let options = Settings { without: without.into(), ..options.clone() };
                common::bits(&render(scene, &camera, &options, &backend, &()).unwrap().0)
            };
            let plain = bits(&scene, &[]);
            assert!(plain == bits(&reversed, &[]), "{kind:?}");
            assert!(plain == bits(&reversed, &[Optimisation::Pairs]), "{kind:?}");
            for without in [Optimisation::Culling, Optimisation::Hiding, Optimisation::Order] {
                assert!(plain == bits(&scene, &[without]), "{kind:?} {without:?}");
            }
        }
    }
}

#[test]
fn one_colour_is_told_by_the_depth_alone() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let mut scene = colored(3000);
    scene.colors = Colors::Constant([0.2, 0.4, 0.6, 0.5]);
    let options = options(Some(PointShape::Cone));
    let camera = sphere_camera(160, Projection::Pinhole);
    let (frame, report) = render(&scene, &camera, &options, &backend, &()).unwrap();
    assert!(!report.passes.contains_key("accumulate_ms"));
    let (decided, wrong) = wrong(&frame, &reference(&scene, Projection::Pinhole, &options));
    assert!(wrong == 0 && decided > 20_000, "{wrong} of {decided}");
}

#[test]
fn broken_kernels_are_noticed() {
    let scene = colored(3000);
    let camera = sphere_camera(160, Projection::Pinhole);
    for (without, file, from, to) in [
        (None, "nearest_color.wgsl", "atomicMax(&winners", "atomicMin(&winners"),
        (None, "nearest_color.wgsl", "attribute_word(surfel, 0u)", "attribute_word(surfel / 2u, 0u)"),
        (Some(Optimisation::Pairs), "winner_second.wgsl", "attributes.word", "~attributes.word"),
        (None, "maps.wgsl", "DEPTH_IMAGE, 0u, depth", "DEPTH_IMAGE, 0u, 1.0001 * depth"),
    ] {
        let Some(gpu) = common::gpu() else { return };
        let options = Settings { without: without.into_iter().collect(), ..options(Some(PointShape::Sphere)) };
        let sources = Sources::default().replace(file, from, to).unwrap();
        let (frame, _) = render(&scene, &camera, &options, &Backend::Gpu { gpu: Box::new(gpu), sources }, &()).unwrap();
        let (_, wrong) = wrong(&frame, &reference(&scene, Projection::Pinhole, &options));
        assert!(wrong > 100, "{file}: {wrong}");
    }
}

#[test]
fn the_rasterisers_depth_test_shows_the_same_points() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let scene = colored(3000);
    let camera = sphere_camera(160, Projection::Pinhole);
    for (depth, shape) in [
        (RasterDepth::Exact, PointShape::Square),
        (RasterDepth::Exact, PointShape::Paraboloid),
        (RasterDepth::Offset, PointShape::Circle),
    ] {
        let options = Settings { maps: Maps::NONE, ..options(Some(shape)) };
        let raster = Some(Raster { format: BlendFormat::Rgba32Float, depth });
        let decisions = reference(&scene, Projection::Pinhole, &options);
        let decided = decisions.map(Map::Decision).unwrap();
        let (frame, _) = render(&scene, &camera, &options, &backend, &()).unwrap();
        let (rastered, report) = render(&scene, &camera, &Settings { raster, ..options }, &backend, &()).unwrap();
        assert!(!report.passes.contains_key("accumulate_ms"));
        let far = |pixel: usize| {
            let mut both = frame.color[pixel].into_iter().zip(rastered.color[pixel]);
            decided[pixel] >= 1e-5 && both.any(|(a, b)| (a - b).abs() > 1e-5)
        };
        assert_eq!((0..frame.color.len()).filter(|&pixel| far(pixel)).count(), 0, "{depth:?} {shape:?}");
    }
}

#[test]
fn what_the_nearest_fragment_does_not_have_is_refused() {
    let nearest = options(None);
    let refused = |options: Settings| check::options(&options, false).unwrap_err().to_string();
    assert!(refused(Settings { shading: Shading::Lambert, ..nearest.clone() }).contains("unlit"));
    for map in [Map::Normal, Map::Weight, Map::Count, Map::Index] {
        let options = Settings { maps: Maps::of(&[map]), ..nearest.clone() };
        assert!(refused(options).contains(map.row().name), "{map:?}");
    }
    assert!(refused(Settings { low_pass: LowPass::Max, ..nearest.clone() }).contains("low-pass"));
    assert!(refused(Settings { accumulator: Accumulator::Cas, ..nearest.clone() }).contains("accumulator"));
    let raster = Some(Raster { format: BlendFormat::Rgba16Float, depth: RasterDepth::Offset });
    assert!(refused(Settings { raster, ..nearest.clone() }).contains("exact"));
    assert!(check::options(&nearest, false).is_ok());
}
