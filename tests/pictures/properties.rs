//! Properties of random scenes: invariants of the maps, agreement with the reference, and bits that
//! depend on the set of surfels alone.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::cell::Cell;

use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::hardcases::{HardCase, judge};
use epsplat::low_level::plan::{ACCUMULATORS, Settings, check};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Colors, Epsilon, Kernel, Lens, Light, Map, Maps, Scene, Shading, Surfel, Up};
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

const SIZE: (u32, u32) = (48, 37);

fn vector(reach: f32) -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-reach..reach).prop_map(Vec3::from_array)
}

fn surfel() -> impl Strategy<Value = Surfel> {
    // Sizes from a hundredth of a pixel to the whole image, aspects from 1:1 to 1:100; some reach
    // behind the camera.
    (vector(1.5), vector(1.0), -3.0f32..0.3, -2.0f32..0.0, 0.0f32..6.3).prop_map(
        |(center, normal, size, shape, turn)| {
            let normal = if normal.length() > 1e-3 { normal } else { Vec3::Z };
            let disk = Surfel::disk(center, normal, 10f32.powf(size));
            let (s, t) = (Vec3::from_array(disk.s), Vec3::from_array(disk.t) * 10f32.powf(shape));
            let (sin, cos) = turn.sin_cos();
            Surfel { center: disk.center, s: (s * cos + t * sin).to_array(), t: (t * cos - s * sin).to_array() }
        },
    )
}

fn scene() -> impl Strategy<Value = Scene> {
    let colored = (surfel(), prop::array::uniform4(any::<u8>()));
    (prop::collection::vec(colored, 1..60), any::<bool>(), any::<bool>()).prop_map(|(all, linear, oriented)| {
        let (surfels, codes): (Vec<_>, Vec<_>) = all.into_iter().unzip();
        let colors = Colors::Srgb8(codes);
        let colors = if linear {
            Colors::Linear((0..surfels.len()).map(|i| colors.linear(i).map(|c| 3.0 * c).map(|c| c.min(1.0))).collect())
        } else {
            colors
        };
        Scene {
            origin: DVec3::new(5e5, -3e6, 80.0),
            surfels,
            low: vec![],
            colors,
            oriented,
            up: Up::Z,
            ..Scene::default()
        }
    })
}

fn camera(scene: &Scene, orthographic: bool) -> Camera {
    let lens = if orthographic { Lens::OrthographicHeight(3.0) } else { Lens::Intrinsics([50.0, 44.0, 20.0, 22.0]) };
    let eye = scene.origin + DVec3::new(0.3, -2.0, 0.8);
    Camera::look_at(SIZE, lens, eye, scene.origin, None, Up::Z, 1e-2).unwrap()
}

fn options() -> impl Strategy<Value = Settings> {
    let ellipse =
        prop_oneof![Just(3.0), Just(2.0), Just(1.7)].prop_map(|n| Kernel::Ellipse { a: 6.0, n, smooth: false });
    let smooth = Kernel::Ellipse { a: 6.0, n: 3.0, smooth: true };
    let others = prop_oneof![
        Just(Kernel::Gaussian { sigma: 0.4 }),
        Just(smooth),
        Just(Kernel::Cone { power: 1.0 }),
        Just(Kernel::Constant)
    ];
    let kernel = prop_oneof![ellipse, others];
    (0usize..4, kernel, 0..ACCUMULATORS.len()).prop_map(|(epsilon, kernel, accumulator)| {
        let epsilons = [Epsilon::Relative(0.01), Epsilon::Absolute(0.05), Epsilon::Relative(0.0), Epsilon::Radius(0.5)];
        Settings {
            epsilon: epsilons[epsilon],
            kernel,
            accumulator: ACCUMULATORS[accumulator].of,
            shading: Shading::Unlit,
            lights: vec![Light::Headlight { intensity: 0.7 }, Light::Directional { toward: Vec3::Z, intensity: 0.3 }],
            maps: Maps::ON_DEVICE,
            ..Settings::default()
        }
    })
}

/// Depth, weight and count exist exactly where a fragment was accepted, normals exist only there,
/// and nothing is NaN.
fn check_maps(frame: &Frame) -> Result<(), TestCaseError> {
    let (depth, weight) = (frame.map(Map::Depth).unwrap(), frame.map(Map::Weight).unwrap());
    let (count, normal) = (frame.map(Map::Count).unwrap(), frame.normals().unwrap());
    for pixel in 0..frame.color.len() {
        let covered = weight[pixel] > 0.0;
        prop_assert_eq!(covered, depth[pixel].is_finite());
        prop_assert_eq!(covered, count[pixel] > 0.0);
        prop_assert!(frame.color[pixel].iter().chain(&normal[pixel]).all(|v| v.is_finite()));
        let length = Vec3::from_array(normal[pixel]).length();
        prop_assert!(length == 0.0 || (covered && (length - 1.0).abs() < 1e-5));
        if !covered {
            prop_assert_eq!(frame.color[pixel], [0.0; 4]);
        }
    }
    Ok(())
}

/// The same scene in another order of surfels: reversed, then dealt like cards to three hands.
fn dealt(scene: &Scene) -> Scene {
    let count = scene.surfels.len();
    let order: Vec<usize> = (0..3).flat_map(|hand| (0..count).rev().filter(move |i| i % 3 == hand)).collect();
    let colors = match &scene.colors {
        Colors::Srgb8(codes) => Colors::Srgb8(order.iter().map(|&i| codes[i]).collect()),
        Colors::Linear(colors) => Colors::Linear(order.iter().map(|&i| colors[i]).collect()),
        constant => constant.clone(),
    };
    let low = order.iter().filter_map(|&i| scene.low.get(i).copied()).collect();
    Scene { surfels: order.iter().map(|&i| scene.surfels[i]).collect(), low, colors, ..scene.clone() }
}

/// The Lambert colour of a pixel in f64, and the error bound of f32, from an unlit frame with
/// normals.
///
/// Roundings: normalising the ray takes nine products and sums, the cosine three more, and each
/// light one.
fn lit(unlit: &Frame, camera: &Camera, lights: &[Light], pixel: usize) -> ([f64; 3], [f64; 3]) {
    let (x, y) = (pixel % unlit.width as usize, pixel / unlit.width as usize);
    let normal = Vec3::from_array(unlit.normals().unwrap()[pixel]).as_dvec3();
    let toward_eye = -camera.ray(x as f64 + 0.5, y as f64 + 0.5).normalize();
    let (mut irradiance, mut intensities) = (0.0, 0.0);
    for light in lights {
        let (cosine, intensity) = match *light {
            Light::Headlight { intensity } => (normal.dot(toward_eye).abs(), intensity),
            Light::Directional { toward, intensity } => (normal.dot(toward.as_dvec3()).max(0.0), intensity),
        };
        irradiance += cosine * f64::from(intensity);
        intensities += f64::from(intensity);
    }
    let color = unlit.color[pixel].map(f64::from);
    let bound = 32.0 * (-24f64).exp2() * intensities;
    (std::array::from_fn(|k| color[k] * irradiance), std::array::from_fn(|k| color[k].abs() * bound))
}

/// Runs the property on `cases` random scenes, the same in every run; `EPSPLAT_PROPERTY_SEED` (a
/// number) draws others.
fn agree(backend: Option<&Backend>, cases: u32) -> Result<(), String> {
    let config = Config { cases, failure_persistence: None, max_shrink_iters: 0, ..Config::default() };
    let strategy = (scene(), options(), any::<bool>());
    let number = std::env::var("EPSPLAT_PROPERTY_SEED").map_or(1u64, |text| text.parse().expect("a seed is a number"));
    let mut seed = [0; 32];
    seed[..8].copy_from_slice(&number.to_le_bytes());
    let random = TestRng::from_seed(RngAlgorithm::ChaCha, &seed);
    // The share of excused pixels. Large disks seen nearly edge-on leave much of a small image
    // undecided: 30 seeds gave 0.02 to 0.09.
    let excused = Cell::new(0.0);
    let outcome = TestRunner::new_with_rng(config, random).run(&strategy, |(scene, options, orthographic)| {
        let case = HardCase {
            name: "random".into(),
            about: "a random scene",
            bound: "of its fragments",
            camera: camera(&scene, orthographic),
            scene,
            options,
            covered: (0.0, 1.0),
            excused: 1.0,
            expected: Vec::new(),
            smallest: None,
        };
        let (scene, camera, options) = (&case.scene, &case.camera, &case.options);
        let truth = case.truth().unwrap();
        check_maps(&truth.frame)?;
        let Some(backend @ Backend::Gpu { gpu, .. }) = backend else { return Ok(()) };
        let row = options.accumulator.row();
        prop_assume!(check::sums(&gpu.adapter, row.of).is_ok());
        let (frame, report) = render(scene, camera, options, backend, &()).unwrap();
        check_maps(&frame)?;
        let judged = judge(&case, &truth, row, &frame, &report);
        excused.set(excused.get() + judged.excused / f64::from(cases));
        prop_assert_eq!((judged.nan, judged.lost, judged.invented), (0, 0, 0));
        for map in &judged.maps {
            prop_assert!(map.used_of_own <= 1.0, "{} over the bound of {}: {:?}", map.map, row.name, map);
        }
        if row.deterministic {
            let (again, _) = render(&dealt(scene), camera, options, backend, &()).unwrap();
            prop_assert!(frame == again, "the order of the surfels changed the image");
            let lambert = Settings { shading: Shading::Lambert, ..options.clone() };
            let (shaded, _) = render(scene, camera, &lambert, backend, &()).unwrap();
            for (pixel, color) in shaded.color.iter().enumerate() {
                let (expected, bound) = lit(&frame, camera, &options.lights, pixel);
                for k in 0..3 {
                    let error = (f64::from(color[k]) - expected[k]).abs();
                    prop_assert!(error <= bound[k], "light errs by {error}, the bound is {}", bound[k]);
                }
            }
        }
        Ok(())
    });
    outcome.map_err(|e| e.to_string())?;
    if excused.get() < 0.15 { Ok(()) } else { Err(format!("{} of all pixels were excused", excused.get())) }
}

#[test]
fn maps_are_consistent_and_the_gpu_agrees_with_the_reference() {
    let gpu = common::gpu().map(Backend::gpu);
    agree(gpu.as_ref(), 48).unwrap();
}

/// Control: a kernel that is slightly wrong must break the property.
#[test]
fn a_wrong_kernel_is_noticed() {
    let Some(gpu) = common::gpu() else { return };
    let sources = Sources::default().replace("kernel_ellipse.wgsl", "exp(-KERNEL_A", "exp(-1.002 * KERNEL_A").unwrap();
    assert!(agree(Some(&Backend::Gpu { gpu: Box::new(gpu), sources }), 48).is_err());
}
