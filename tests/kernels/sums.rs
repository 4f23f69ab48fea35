//! Sums read from a device: they are equal on every adapter, and resolve to the same picture.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use common::scenes::{cases, shuffled, sphere, sphere_camera};
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::plan::{Accumulator, Optimisation, Organisation, Settings};
use epsplat::low_level::render::sums::{Sums, resolve, sums};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Colors, Epsilon, Light, LowPass, Map, Maps, Projection, Scene, Shading};

fn of(scene: &Scene, camera: &Camera, options: &Settings, gpu: &Gpu) -> Sums {
    sums(scene, camera, options, gpu, &Sources::default()).unwrap()
}

/// The default options, and some that store sums differently.
fn options() -> Vec<Settings> {
    let plain = Settings { maps: Maps::ON_DEVICE, ..Settings::default() };
    vec![
        Settings { low_pass: LowPass::Ewa, background: [0.2, 0.1, 0.4, 1.0], ..plain.clone() },
        Settings { organisation: Organisation::Scatter, shading: Shading::Phong, ..plain.clone() },
        Settings { organisation: Organisation::Tile, maps: Maps::NONE, ..plain.clone() },
        plain,
    ]
}

#[test]
fn what_left_the_device_makes_the_picture_that_stayed() {
    let Some(gpu) = common::gpu() else { return };
    let mut scenes: Vec<_> = cases().into_iter().map(|case| (case.scene, case.camera)).collect();
    scenes.push((sphere(3000, 1.5), sphere_camera(96, Projection::Pinhole)));
    let scenes: Vec<_> = scenes.into_iter().filter(|(scene, _)| !matches!(scene.colors, Colors::Textured(_))).collect();
    assert!(scenes.len() > 3);
    let other = Backend::gpu(common::gpu().unwrap());
    for (scene, camera) in &scenes {
        for options in options() {
            let taken = of(scene, camera, &options, &gpu);
            let back = resolve(&taken, scene, camera, &options, &gpu, &Sources::default()).unwrap();
            let (frame, _) = render(scene, camera, &options, &other, &()).unwrap();
            assert!(bits(&back) == bits(&frame), "{options:?}");
        }
    }
}

#[test]
fn every_adapter_and_cut_has_the_same_sums() {
    let (scene, camera) = (sphere(3000, 1.5), sphere_camera(96, Projection::Pinhole));
    for options in options() {
        let Some(gpu) = common::gpu() else { return };
        let whole = of(&scene, &camera, &options, &gpu);
        assert!(whole.sums.iter().any(|sum| *sum > u64::from(u32::MAX)), "no sum has a carry");
        let mut plain = common::gpu().unwrap();
        (plain.adapter.atomics_u64, plain.adapter.integers_u64, plain.adapter.subgroups) = (false, false, false);
        for (name, other) in [
            ("without 64 bits", plain),
            ("core", common::core_gpu().unwrap()),
            ("in pieces", common::gpu().unwrap().with_buffer_limit(70_000)),
        ] {
            let taken = of(&scene, &camera, &options, &other);
            assert!(taken == whole, "{name}, {options:?}");
            // The sums of one device resolve on another.
            let there = resolve(&whole, &scene, &camera, &options, &other, &Sources::default()).unwrap();
            let here = resolve(&taken, &scene, &camera, &options, &gpu, &Sources::default()).unwrap();
            assert!(bits(&there) == bits(&here), "{name}, {options:?}");
        }
        // The order of the surfels does not matter either.
        assert!(of(&shuffled(&scene, 5), &camera, &options, &gpu) == whole);
    }
}

#[test]
fn sums_of_two_parts_add_to_those_of_the_whole() {
    let Some(gpu) = common::gpu() else { return };
    let camera = sphere_camera(96, Projection::Pinhole);
    let one = sphere(2000, 1.5);
    let Colors::Srgb8(codes) = &one.colors else { panic!("of 8 bits") };
    let twice = Scene {
        surfels: one.surfels.iter().chain(&one.surfels).copied().collect(),
        colors: Colors::Srgb8(codes.iter().chain(codes).copied().collect()),
        ..one.clone()
    };
    let options = Settings { without: vec![Optimisation::Copies], maps: Maps::ON_DEVICE, ..Settings::default() };
    let (part, whole) = (of(&one, &camera, &options, &gpu), of(&twice, &camera, &options, &gpu));
    let added = Sums { sums: part.sums.iter().map(|sum| 2 * sum).collect(), ..part.clone() };
    assert!(added == whole && part != whole);
    let pixel = (0..camera.pixels()).find(|&pixel| whole.count(pixel) > Some(2)).unwrap();
    assert_eq!(whole.count(pixel), part.count(pixel).map(|count| 2 * count));
}

#[test]
fn a_changed_sum_shows_and_sums_of_another_render_are_refused() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera) = (sphere(2000, 1.5), sphere_camera(96, Projection::Pinhole));
    let options = Settings::default();
    let taken = of(&scene, &camera, &options, &gpu);
    let picture = |sums: &Sums, options: &Settings| resolve(sums, &scene, &camera, options, &gpu, &Sources::default());
    let mut changed = taken.clone();
    let at = changed.sums.iter().position(|sum| *sum > 0).unwrap();
    changed.sums[at] *= 2;
    assert!(bits(&picture(&changed, &options).unwrap()) != bits(&picture(&taken, &options).unwrap()));
    let others = [
        Settings { low_pass: LowPass::Ewa, ..options.clone() },
        Settings { maps: Maps::ON_DEVICE, ..options.clone() },
        Settings { accumulator: Accumulator::Fixed32, ..options.clone() },
        Settings { maps: Maps::of(&[Map::Index]), ..options.clone() },
        Settings { epsilon: Epsilon::Absolute(0.5), ..options.clone() },
    ];
    for other in others {
        let error = picture(&taken, &other).unwrap_err().to_string();
        assert!(error.contains("sums"), "{error}");
    }
    // Lights affect the picture, not the sums.
    let dark = Settings { lights: vec![Light::Headlight { intensity: 0.5 }], ..options.clone() };
    let [lit, dim] = [&options, &dark].map(|options| picture(&taken, options).unwrap());
    let expected = render(&scene, &camera, &dark, &Backend::gpu(common::gpu().unwrap()), &()).unwrap().0;
    assert!(bits(&dim) == bits(&expected) && bits(&dim) != bits(&lit));
    let short = Sums { nearest: taken.nearest[1..].to_vec(), ..taken.clone() };
    assert!(picture(&short, &options).is_err());
}
