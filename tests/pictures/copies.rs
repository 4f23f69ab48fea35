//! Equal surfels are drawn once: the image, counts included, has the same bits as when each copy is
//! drawn.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use common::scenes::{shuffled, sphere, sphere_camera};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::metrics::compare;
use epsplat::low_level::plan::{Optimisation, Settings};
use epsplat::low_level::render::{Backend, Report, render};
use epsplat::low_level::scene::{Colors, LowPass, Map, Maps, Projection, Scene, Shading, Surfel};
use glam::Vec3;

/// A sphere of disks in all colours, with many copies of a disk in front and of one through the
/// centre. The disk in front also has one copy in another colour.
fn scene() -> Scene {
    let mut scene = sphere(800, 1.7);
    let Colors::Srgb8(codes) = &mut scene.colors else { unreachable!() };
    for (center, radius, code, copies) in [
        ([0.5, 0.2, 1.0], 0.4, [200, 30, 40, 255], 3000),
        ([0.5, 0.2, 1.0], 0.4, [9, 9, 9, 128], 1),
        ([0.0; 3], 1.4, [20, 90, 160, 200], 1500),
    ] {
        let surfel = Surfel::disk(Vec3::from_array(center), Vec3::new(0.3, 0.1, 1.0), radius);
        scene.surfels.extend(vec![surfel; copies]);
        codes.extend(vec![code; copies]);
    }
    scene
}

fn options(low_pass: LowPass, without: &[Optimisation]) -> Settings {
    let maps = Maps::ON_DEVICE;
    Settings { maps, low_pass, shading: Shading::Phong, without: without.to_vec(), ..Settings::default() }
}

fn frame(scene: &Scene, options: &Settings, backend: &Backend) -> (Frame, Report) {
    render(scene, &sphere_camera(96, Projection::Pinhole), options, backend, &()).unwrap()
}

#[test]
fn copies_do_not_show() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let scene = scene();
    // Weights fill 32 bits without a low-pass and 40 with EWA.
    for low_pass in [LowPass::None, LowPass::Ewa] {
        let (each, report) = frame(&scene, &options(low_pass, &[Optimisation::Copies]), &backend);
        assert!(!report.needs.contains(&"copies"));
        for order in [scene.clone(), shuffled(&scene, 3)] {
            let (once, of_once) = frame(&order, &options(low_pass, &[]), &backend);
            assert!(of_once.needs.contains(&"copies"));
            assert!(bits(&once) == bits(&each), "{low_pass:?}");
            assert_eq!((of_once.surfels, of_once.splats_drawn), (5301, report.splats_drawn));
        }
        assert!(each.map(Map::Count).unwrap().iter().any(|count| *count > 3000.0));
    }
}

#[test]
fn the_reference_multiplies_too() {
    let scene = scene();
    let [each, once] = [vec![Optimisation::Copies], vec![]]
        .map(|without| frame(&scene, &options(LowPass::None, &without), &Backend::Reference).0);
    assert_eq!(each.map(Map::Count), once.map(Map::Count));
    let comparison = compare(&once, &each).unwrap();
    // A sum of 3,000 equal f64 terms errs by at most 3,000 roundings of 2^-53, and a frame is f32.
    for map in &comparison.maps {
        assert!(map.max_of_range <= 1.2e-7, "{map:?}");
    }
}

#[test]
fn a_wrong_number_shows() {
    for (file, from, to) in [
        ("copies.wgsl", "times = copies_of(index);", "times = 1u;"),
        ("copies.wgsl", "a_high * b_high + (one >> 16u)", "a_high * b_high"),
        ("accumulator_fixed_wide.wgsl", "select(0u, 1u, before + term.x < before)", "0u"),
    ] {
        let Some(gpu) = common::gpu() else { return };
        let right = Backend::gpu(gpu);
        let sources = Sources::default().replace(file, from, to).unwrap();
        let wrong = Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources };
        let scene = scene();
        let [right, wrong] =
            [right, wrong].map(|backend| bits(&frame(&scene, &options(LowPass::None, &[]), &backend).0));
        assert!(right != wrong, "{file}: {to}");
    }
}
