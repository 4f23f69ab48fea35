//! The low-pass: its benefits measured against rays, and the device against the reference.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use epsplat::io::Points;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::metrics::{Reconstruction, compare, reconstruction};
use epsplat::low_level::passes::lowpass::RADIUS;
use epsplat::low_level::plan::Settings;
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Colors, Kernel, Lens, LowPass, Map, Maps, Scene, Shading, Surfel, Up};
use epsplat::low_level::surfels::analytic::{Shape, generate};
use epsplat::low_level::surfels::build;
use epsplat::low_level::truth::{DEFAULT_GRID, Surface, Truth};
use glam::{DVec3, Vec3};

/// `count` disks on `shape`; `radius` is in units of their spacing.
fn surfels(shape: Shape, count: u64, radius: f32) -> Scene {
    let samples: Vec<_> = generate(shape, count).collect();
    let of_default = radius / 1.5;
    let points = Points {
        positions: samples.iter().map(|s| s.position).collect(),
        normals: Some(samples.iter().map(|s| s.normal).collect()),
        radii: Some(samples.iter().map(|s| s.radius * of_default).collect()),
        colors: Some(Colors::Srgb8(samples.iter().map(|s| [s.color[0], s.color[1], s.color[2], 255]).collect())),
        ..Points::default()
    };
    build(vec![points], &()).unwrap().0
}

fn options(low_pass: LowPass) -> Settings {
    Settings { low_pass, shading: Shading::Unlit, maps: Maps::ON_DEVICE, ..Settings::default() }
}

/// The error of the reference's image against 16 rays per pixel.
fn against_rays(shape: Shape, scene: &Scene, camera: &Camera, options: &Settings) -> Reconstruction {
    let (frame, _) = render(scene, camera, options, &Backend::Reference, &()).unwrap();
    let truth = Truth::cast(&Surface::Analytic(shape), camera, options, DEFAULT_GRID, &()).unwrap();
    reconstruction(&frame, &truth).unwrap()
}

/// About one disk per pixel with a radius of 0.4 spacings: both filters close all holes.
#[test]
fn a_surface_of_small_disks_has_no_holes() {
    let scene = surfels(Shape::Sphere, 20_000, 0.4);
    let camera = Camera::framing((96, 96), Lens::Fov(45.0), &scene, Camera::default_near(&scene)).unwrap();
    let holes = |options: &Settings| against_rays(Shape::Sphere, &scene, &camera, options).hole_rate.unwrap();
    assert!(holes(&options(LowPass::None)) > 0.1, "{}", holes(&options(LowPass::None)));
    for kernel in ["ellipse:6,3", "gaussian", "hat", "constant"] {
        for low_pass in [LowPass::Max, LowPass::Ewa] {
            let kernel: Kernel = kernel.parse().unwrap();
            let filtered = Settings { kernel, ..options(low_pass) };
            assert_eq!(holes(&filtered), 0.0, "{kernel:?}, {low_pass:?}");
        }
    }
}

/// A checkerboard with squares of 1.5 pixels: both filters raise PSNR and SSIM against rays.
#[test]
fn a_far_checkerboard_aliases_less() {
    let scene = surfels(Shape::Checkerboard, 200_000, 1.5);
    let lens = Lens::OrthographicHeight(1.7);
    let camera =
        Camera::look_at((40, 40), lens, DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, Some(DVec3::Y), Up::Z, 1e-3).unwrap();
    let measure = |low_pass| {
        let error = against_rays(Shape::Checkerboard, &scene, &camera, &options(low_pass));
        (error.psnr_db.unwrap(), error.ssim.unwrap())
    };
    let (none, max, ewa) = (measure(LowPass::None), measure(LowPass::Max), measure(LowPass::Ewa));
    assert!(max.0 > none.0 + 6.0 && max.1 > none.1 + 0.2, "{none:?} {max:?}");
    assert!(ewa.0 > none.0 + 6.0 && ewa.1 > none.1 + 0.2, "{none:?} {ewa:?}");
}

/// In a slanted row of disks that shrink from many pixels to a fraction of one, the depth stays
/// near the plane.
#[test]
fn depth_is_continuous_where_the_filter_takes_over() {
    let normal = Vec3::new(0.0, -0.8, 0.6);
    let disks: Vec<_> = (0..400)
        .map(|k| {
            let z = 1.0 + 0.05 * k as f32;
            Surfel::disk(Vec3::new(0.0, 0.75 * (z - 1.0), z), normal, 0.08)
        })
        .collect();
    let scene = Scene {
        origin: DVec3::ZERO,
        surfels: disks,
        low: vec![],
        colors: Colors::Constant([1.0; 4]),
        oriented: true,
        up: Up::Y,
        ..Scene::default()
    };
    let camera = Camera::look_at(
        (8, 200),
        Lens::Intrinsics([120.0, 240.0, 4.0, 6.0]),
        DVec3::ZERO,
        DVec3::Z,
        Some(DVec3::NEG_Y),
        Up::Y,
        1e-2,
    )
    .unwrap();
    for low_pass in [LowPass::Max, LowPass::Ewa] {
        let (frame, _) = render(&scene, &camera, &options(low_pass), &Backend::Reference, &()).unwrap();
        let depth = frame.map(Map::Depth).unwrap();
        let (mut covered, mut worst) = (0, 0f64);
        for y in 0..200 {
            let z = f64::from(depth[y * 8 + 4]);
            if !z.is_finite() {
                continue;
            }
            covered += 1;
            // All disks lie in the plane y = 0.75 (z - 1). A filtered disk also shows beside its
            // centre, with an error of at most its own extent in depth plus the depth that a pixel
            // spans. A filter that extrapolated the disk's plane or jumped to the depth of its
            // centre would exceed that.
            let slope = (y as f64 + 0.5 - 6.0) / 240.0;
            let plane = 0.75 / (0.75 - slope);
            if plane < 20.0 {
                let pixel = plane * plane / (0.75 * 240.0);
                worst = worst.max((z - plane).abs() / (0.08 * 0.8 + pixel));
            }
        }
        assert!(worst < 1.0, "{low_pass:?}: {worst} of a disk's and a pixel's depth");
        assert!(covered > 120, "{low_pass:?}: {covered}");
    }
}

/// The device's filter equals the twin's in all pixels that are not near a decision.
#[test]
fn the_device_filters_as_the_reference_does() {
    let Some(gpu) = common::gpu() else { return };
    let scenes = [surfels(Shape::Torus, 30_000, 0.6), surfels(Shape::Checkerboard, 30_000, 1.5)];
    let worst = |backend: &Backend, low_pass: LowPass| {
        let mut worst = 0f64;
        for scene in &scenes {
            for lens in [Lens::Fov(45.0), Lens::OrthographicHeight(3.0)] {
                let near = Camera::default_near(scene);
                let camera = Camera::framing((120, 90), lens, scene, near).unwrap();
                let with_decision = Settings { maps: Maps::ON_DEVICE.and(&[Map::Decision]), ..options(low_pass) };
                let (reference, _) = render(scene, &camera, &with_decision, &Backend::Reference, &()).unwrap();
                let (frame, _) = render(scene, &camera, &options(low_pass), backend, &()).unwrap();
                let comparison = compare(&frame, &reference).unwrap();
                assert!(comparison.excused.unwrap() < 0.02, "{comparison:?}");
                let of_range = comparison.maps.iter().filter_map(|m| m.max_of_range_decided);
                worst = of_range.fold(worst, f64::max);
            }
        }
        worst
    };
    let backend = Backend::gpu(gpu);
    for low_pass in [LowPass::Max, LowPass::Ewa] {
        let error = worst(&backend, low_pass);
        assert!(error < 2e-5, "{low_pass:?}: {error}");
    }
    for (low_pass, file, from, to) in [
        (LowPass::Max, "lowpass_max.wgsl", "1.0 / FILTER_RADIUS", "1.01 / FILTER_RADIUS"),
        (LowPass::Ewa, "filter.wgsl", "filter_.r_yy * x.y", "1.001 * filter_.r_yy * x.y"),
        (LowPass::Max, "perspective.wgsl", "clamp(abc.z, 1.0 / high, 1.0 / low)", "abc.z"),
    ] {
        let Some(gpu) = common::gpu() else { return };
        let sources = Sources::default().replace(file, from, to).unwrap();
        let error = worst(&Backend::Gpu { gpu: Box::new(gpu), sources }, low_pass);
        assert!(error > 1e-4, "{file} with {to}: {error}");
    }
    const { assert!(RADIUS > 0.707) };
}
