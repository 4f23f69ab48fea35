//! Order-independent transparency against formulas and the f64 twins.
//!
//! Also tests that the order of fragments changes only sums of floats.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use common::scenes::{cases, crowded, shuffled, sphere, sphere_camera, stack};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::metrics::{DECISION_MARGIN, compare};
use epsplat::low_level::plan::{Accumulator, Facts, Raster, Settings, depths};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Colors, Composite, Kernel, Map, Maps, Projection, Samples, Scene, Shading};

const BOTH: [Composite; 2] = [Composite::Weighted, Composite::Moments];

fn gpu() -> Option<Backend> {
    common::gpu().map(Backend::gpu)
}

fn options(composite: Composite) -> Settings {
    Settings { composite, opacity: 0.7, ..Settings::default() }
}

fn frame(scene: &Scene, camera: &Camera, options: &Settings, backend: &Backend) -> Frame {
    render(scene, camera, options, backend, &()).unwrap().0
}

/// Planes over the whole image at the given depths, with the given straight colours and alphas.
fn planes(of: &[(f32, [f32; 4])]) -> (Scene, Camera) {
    let (mut scene, camera) = stack(of.len(), 0.0);
    // `stack` adds surfels that extend the range of colours; they are moved out of sight.
    scene.surfels.iter_mut().skip(of.len()).for_each(|surfel| surfel.center[0] = 1000.0);
    let Colors::Linear(colors) = &mut scene.colors else { unreachable!() };
    for ((surfel, color), (depth, of)) in scene.surfels.iter_mut().zip(colors).zip(of) {
        (surfel.center[2], *color) = (*depth, *of);
    }
    (scene, camera)
}

/// Two planes match the closed form, and the transmittances of many planes multiply, whatever the
/// weights of their colours.
#[test]
fn planes_are_what_the_formulas_say() {
    let Some(backend) = gpu() else { return };
    let plain = |composite| Settings {
        opacity: 1.0,
        shading: Shading::Unlit,
        kernel: Kernel::Constant,
        maps: Maps::of(&[Map::Transmittance]),
        ..options(composite)
    };
    let of = [(8.0, [0.9, 0.1, 0.3, 0.6]), (20.0, [0.2, 0.8, 0.3, 0.5])];
    let (scene, camera) = planes(&of);
    let [first, farthest] = depths(&Facts::of(&scene), &camera);
    assert!(first <= 8.0 && farthest > 90.0);
    let weights = of.map(|(z, _)| ((farthest - f64::from(z)) / (farthest - first)).powi(3));
    let mean = |channel: usize, weights: [f64; 2]| {
        let total = |value: &dyn Fn(&[f32; 4]) -> f32| -> f64 {
            of.iter().zip(weights).map(|((_, color), w)| w * f64::from(color[3]) * f64::from(value(color))).sum()
        };
        total(&|color| color[channel]) / total(&|_| 1.0)
    };
    for (composite, weights, margin) in [
        (Composite::Weighted, weights, 1e-6),
        // With few surfaces, moments reconstruct the transmittance between the surfaces, and a
        // quarter of a surface's own absorbance counts as in front of it.
        (Composite::Moments, [0.4f64.powf(0.25), 0.4 * 0.5f64.powf(0.25)], 5e-3),
    ] {
        let shown = frame(&scene, &camera, &plain(composite), &backend);
        for color in &shown.color {
            let expected = [mean(0, weights), mean(1, weights), mean(2, weights), 0.8];
            let near = color.iter().zip(expected).all(|(a, b)| (f64::from(*a) - b).abs() <= margin);
            assert!(near, "{composite:?}: {color:?}, not {expected:?}");
        }
    }
    for composite in BOTH {
        for count in [2, 4, 10, 20, 100] {
            let many: Vec<_> = (0..count).map(|k| (5.0 + 0.5 * k as f32, [0.25, 0.25, 0.25, 1.0])).collect();
            let (scene, camera) = planes(&many);
            let shown = frame(&scene, &camera, &Settings { opacity: 0.1, ..plain(composite) }, &backend);
            let expected = 0.9f64.powi(count);
            for transmittance in shown.map(Map::Transmittance).unwrap() {
                assert!((f64::from(*transmittance) - expected).abs() < 1e-5, "{composite:?} {count}: {transmittance}");
            }
            assert!(shown.color.iter().all(|color| (color[0] - 0.25).abs() < 1e-5));
        }
    }
}

/// Device and twin agree at pixels that no rounding decides; broken kernels do not.
#[test]
fn kernels_and_twins_sum_alike() {
    let Some(backend) = gpu() else { return };
    let broken = |file: &str, from: &str, to: &str| {
        let sources = Sources::default().replace(file, from, to).unwrap();
        common::gpu().map(|gpu| Backend::Gpu { gpu: Box::new(gpu), sources }).unwrap()
    };
    let wrong = [
        broken("oit_weighted.wgsl", "left * left * left", "left * left"),
        broken("oit_moments.wgsl", "term *= place;", "term *= abs(place);"),
        broken("oit_moments.wgsl", "low == 0u", "low != 0u"),
        broken("oit_moments.wgsl", "OF_OWN * own", "0.5 * own"),
        broken("oit_moments.wgsl", "- select(0, 1, term < 0)", ""),
        broken("oit.wgsl", "weight * OPACITY *", "OPACITY *"),
        broken("oit.wgsl", "HELD_BACK_UNITS * sum)", "sum)"),
    ];
    let mut noticed = [0; 7];
    let mut all: Vec<(Scene, Camera)> = crowded();
    all.extend(cases().into_iter().skip(2).map(|case| (case.scene, case.camera)));
    let mut compared = 0;
    for (number, (scene, camera)) in all.iter().enumerate() {
        for (composite, most) in BOTH.into_iter().zip([1e-5, 1e-3]) {
            let shading = if number % 2 == 0 { Shading::Lambert } else { Shading::Unlit };
            let own = Settings { shading, maps: Maps::of(&[Map::Transmittance]), ..options(composite) };
            let with_decision = Settings { maps: own.maps.and(&[Map::Decision]), ..own.clone() };
            let truth = frame(scene, camera, &with_decision, &Backend::Reference);
            let decided = truth.map(Map::Decision).unwrap();
            let differ = |other: &Frame| {
                let far = |pixel: usize| {
                    let [a, b] = [&truth, other].map(|frame| frame.color[pixel]);
                    let near = |a: f32, b: f32| (a - b).abs() <= most * (1.0 + a.abs());
                    let shown = (0..3).all(|k| near(a[k] * a[3], b[k] * b[3]));
                    !(shown && near(a[3], b[3]))
                };
                (0..decided.len()).filter(|pixel| decided[*pixel] > DECISION_MARGIN && far(*pixel)).count()
            };
            compared += decided.len();
            let wrong_pixels = differ(&frame(scene, camera, &own, &backend));
            assert!(wrong_pixels <= decided.len() / 1000, "{number} {composite:?}: {wrong_pixels}");
            if number < 2 {
                for (wrong, noticed) in wrong.iter().zip(&mut noticed) {
                    *noticed += usize::from(differ(&frame(scene, camera, &own, wrong)) > decided.len() / 100);
                }
            }
        }
    }
    assert!(compared > 100_000, "{compared}");
    assert!(noticed.iter().all(|noticed| *noticed > 0), "{noticed:?}");
}

/// Integer sums do not depend on the order of surfels, bands or device features. Float sums, as
/// other renderers use, do depend on the order.
#[test]
fn the_order_shows_in_sums_of_floats_alone() {
    let Some(backend) = gpu() else { return };
    let small = Backend::gpu(Gpu::with_buffer_limit(common::gpu().unwrap(), 500_000));
    let core = common::core_gpu().map(Backend::gpu).unwrap();
    let mut shows = 0;
    for (scene, camera) in crowded() {
        for composite in BOTH {
            for samples in [Samples::ONE, "4".parse().unwrap()] {
                let own = Settings { samples, ..options(composite) };
                let first = bits(&frame(&scene, &camera, &own, &backend));
                let floats = Settings { accumulator: Accumulator::Cas, ..own.clone() };
                let of_floats = frame(&scene, &camera, &floats, &backend);
                for seed in [3, 4] {
                    let other = shuffled(&scene, seed);
                    assert!(bits(&frame(&other, &camera, &own, &backend)) == first, "{composite:?} {seed}");
                    let moved = frame(&other, &camera, &floats, &backend);
                    shows += usize::from(bits(&moved) != bits(&of_floats));
                }
                for other in [&small, &core] {
                    assert!(bits(&frame(&scene, &camera, &own, other)) == first, "{composite:?}");
                }
                let rmse = compare(&of_floats, &frame(&scene, &camera, &own, &backend)).unwrap().rmse;
                assert!(rmse < 1e-5, "{composite:?}: {rmse}");
            }
        }
    }
    assert_eq!(shows, 3 * 2 * 2 * 2);
}

/// An opaque stack is opaque and shows its front, however dense it is, and even if the scene has a
/// stray surfel far away.
#[test]
fn what_is_dense_and_what_strays_leave_no_holes() {
    let Some(backend) = gpu() else { return };
    for composite in BOTH {
        let own = Settings {
            opacity: 1.0,
            kernel: Kernel::Constant,
            shading: Shading::Unlit,
            maps: Maps::of(&[Map::Transmittance]),
            ..options(composite)
        };
        // Two stacks of forty opaque planes, red in front of blue. Each plane has its own depth,
        // because the search for strays needs many distinct positions.
        let of = |k: usize| {
            let (depth, color) = if k < 40 { (8.0, [1.0, 0.0, 0.0, 1.0]) } else { (30.0, [0.0, 0.0, 1.0, 1.0]) };
            (depth + 0.01 * (k % 40) as f32, color)
        };
        let (mut scene, camera) = planes(&(0..80).map(of).collect::<Vec<_>>());
        for stray in [false, true] {
            if stray {
                scene.surfels[80].center = [0.0, 5000.0, 1e6];
                assert_eq!(scene.body().1, 1);
            }
            for backend in [&backend, &Backend::Reference] {
                let shown = frame(&scene, &camera, &own, backend);
                assert!(shown.map(Map::Transmittance).unwrap().iter().all(|left| *left < 1e-6), "{composite:?}");
                // Weights by depth hide nothing: red has only its share of all weights.
                let least = if composite == Composite::Moments { 0.99 } else { 0.6 };
                let red = |color: &[f32; 4]| color[3] > 1.0 - 1e-6 && color[0] > least;
                assert!(shown.color.iter().all(red), "{composite:?} {stray}: {:?}", shown.color[0]);
            }
        }
    }
}

/// Errors against sorted compositing: moments have less than half the error of weights by depth,
/// and weights by depth less than two thirds of the error of equal weights.
#[test]
fn moments_are_nearer_to_what_is_sorted() {
    let Some(backend) = gpu() else { return };
    let (scene, camera) = (sphere(4000, 2.0), sphere_camera(96, Projection::Pinhole));
    let truth = frame(&scene, &camera, &options(Composite::Sorted), &Backend::Reference);
    let error = |frame: &Frame| compare(frame, &truth).unwrap().rmse;
    let [weighted, moments] = BOTH.map(|composite| error(&frame(&scene, &camera, &options(composite), &backend)));
    let even = Sources::default().replace("oit_weighted.wgsl", "left * left * left", "1.0").unwrap();
    let even = Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources: even };
    let even = error(&frame(&scene, &camera, &options(Composite::Weighted), &even));
    assert!(2.0 * moments < weighted && 1.5 * weighted < even, "{moments} {weighted} {even}");
}

#[test]
fn what_does_not_go_with_sums_of_all_is_refused() {
    let Some(backend) = gpu() else { return };
    let (scene, camera) = stack(2, 0.5);
    let refused = |of: Settings| match render(&scene, &camera, &of, &backend, &()) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("{of:?} is not refused"),
    };
    let own = options(Composite::Weighted);
    for (of, says) in [
        (Settings { accumulator: Accumulator::Fixed32, ..own.clone() }, "sums of 32 bits"),
        (Settings { raster: Some(Raster::default()), ..own.clone() }, "the rasteriser sums one surface"),
    ] {
        assert!(refused(of).contains(says), "{says}");
    }
}
