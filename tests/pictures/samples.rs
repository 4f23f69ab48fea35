//! Several samples per pixel: the picture is a larger one averaged, for every backend and
//! organisation.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use common::scenes::{sphere, sphere_camera};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Gpu;
use epsplat::low_level::metrics::compare;
use epsplat::low_level::passes::resolve::mean_of_samples;
use epsplat::low_level::plan::{Accumulator, Organisation, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Clip, Colors, Map, Maps, Projection, Samples, Scene, Shading};

use crate::common;

fn samples(count: &str) -> Samples {
    count.parse().unwrap()
}

/// A sphere of translucent colours, where a line clips every third disk.
fn scene() -> Scene {
    let mut scene = sphere(3000, 1.7);
    let Colors::Srgb8(codes) = &mut scene.colors else { unreachable!() };
    codes.iter_mut().enumerate().for_each(|(k, code)| code[3] = 128 + (k % 128) as u8);
    let clip = |k: usize| if k.is_multiple_of(3) { Clip([[1.0, 0.5, 0.3], [0.0, 0.0, 1.0]]) } else { Clip::NONE };
    scene.clips = (0..scene.surfels.len()).map(clip).collect();
    scene
}

fn options(samples: Samples) -> Settings {
    Settings { samples, background: [0.2, 0.4, 0.6, 0.5], ..Settings::default() }
}

fn views() -> [Camera; 2] {
    [Projection::Pinhole, Projection::Orthographic].map(|projection| sphere_camera(90, projection))
}

/// Renders one pixel per sample and averages on the host.
fn averaged(scene: &Scene, camera: &Camera, count: &str, backend: &Backend) -> Frame {
    let fine = camera.sampled(samples(count)).unwrap();
    let (frame, _) = render(scene, &fine, &options(Samples::ONE), backend, &()).unwrap();
    mean_of_samples(&frame, samples(count))
}

fn largest_difference(a: &Frame, b: &Frame) -> f32 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let pairs = a.color.iter().flatten().zip(b.color.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn a_picture_of_many_samples_is_a_large_one_averaged() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, backend) = (scene(), Backend::gpu(gpu));
    for camera in views() {
        for count in ["4", "8", "16"] {
            let expected = averaged(&scene, &camera, count, &backend);
            let (frame, report) = render(&scene, &camera, &options(samples(count)), &backend, &()).unwrap();
            assert_eq!((report.width, report.height), (90, 90));
            // The error of sixteen additions and two divisions of f32 numbers up to 1.
            assert!(largest_difference(&frame, &expected) < 24.0 * f32::EPSILON, "{count}");
            // Control: one sample per pixel gives another picture.
            let (other, _) = render(&scene, &camera, &options(Samples::ONE), &backend, &()).unwrap();
            assert!(largest_difference(&frame, &other) > 0.1);
        }
    }
}

#[test]
fn the_reference_and_every_organisation_agree() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, backend) = (scene(), Backend::gpu(gpu));
    for camera in views() {
        let of = |organisation, accumulator, backend: &Backend| {
            let options = Settings { organisation, accumulator, ..options(samples("8")) };
            render(&scene, &camera, &options, backend, &()).unwrap().0
        };
        let frame = of(Organisation::Auto, Accumulator::Fixed, &backend);
        let same = |other: &Frame| common::bits(other) == common::bits(&frame);
        assert!(same(&of(Organisation::Scatter, Accumulator::Fixed, &backend)));
        assert!(same(&of(Organisation::Tile, Accumulator::Fixed, &backend)));
        let reference = of(Organisation::Auto, Accumulator::Fixed, &Backend::Reference);
        let differing = frame.color.iter().zip(&reference.color);
        let differing = differing.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > 1e-5)).count();
        // A few of the 64,800 samples lie at a rim, a clip line or the tolerance.
        assert!(differing < 20, "{differing}");
        // A small buffer limit makes bands of few rows and pages of few surfels.
        let Some(small) = common::gpu().map(|gpu| Backend::gpu(Gpu::with_buffer_limit(gpu, 60_000))) else { return };
        assert!(same(&of(Organisation::Auto, Accumulator::Fixed, &small)));
    }
}

#[test]
fn colours_of_many_samples_are_excused_by_their_samples() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera, backend) = (scene(), &views()[0], Backend::gpu(gpu));
    let with = |maps: &[Map]| Settings { maps: Maps::of(maps), ..options(samples("4")) };
    let (frame, _) = render(&scene, camera, &with(&[Map::Depth]), &backend, &()).unwrap();
    let (reference, _) = render(&scene, camera, &with(&[Map::Depth, Map::Decision]), &Backend::Reference, &()).unwrap();
    let comparison = compare(&frame, &reference).unwrap();
    assert!(comparison.rmse_decided.unwrap() < 1e-6, "{comparison:?}");
    assert!((0.0..0.01).contains(&comparison.excused.unwrap()));
}

#[test]
fn maps_are_of_the_centre_however_many_samples_there_are() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, backend) = (scene(), Backend::gpu(gpu));
    let maps = Maps::ON_DEVICE;
    for backend in [backend, Backend::Reference] {
        let [one, many] = ["1", "4"].map(|count| {
            let options = Settings { maps, ..options(samples(count)) };
            render(&scene, &views()[0], &options, &backend, &()).unwrap().0
        });
        for map in maps.iter() {
            assert_eq!(one.map(map).unwrap(), many.map(map).unwrap(), "{map:?}");
        }
        assert!(one.color != many.color);
    }
}

/// Maps may need attributes that the colour does not, such as a map of given normals in an unlit
/// picture.
#[test]
fn maps_do_not_change_the_colours_of_several_samples() {
    let Some(gpu) = common::gpu() else { return };
    let (mut scene, backend) = (scene(), Backend::gpu(gpu));
    scene.normals = vec![[0.0, 0.6, 0.8]; scene.surfels.len()];
    let with = |maps: &[Map]| {
        let options = Settings { shading: Shading::Unlit, maps: Maps::of(maps), ..options(samples("4")) };
        render(&scene, &views()[0], &options, &backend, &()).unwrap().0
    };
    let plain = with(&[]);
    for maps in [&[Map::Normal][..], &[Map::Index], &[Map::Depth, Map::Index]] {
        assert!(with(maps).color == plain.color, "{maps:?}");
    }
}

#[test]
fn an_outline_has_alphas_in_between() {
    let (scene, camera) = (sphere(3000, 1.7), &views()[0]);
    let alphas = |count: &str| {
        let options = Settings { samples: samples(count), shading: Shading::Unlit, ..Settings::default() };
        let (frame, _) = render(&scene, camera, &options, &Backend::Reference, &()).unwrap();
        let mut levels: Vec<u32> = frame.color.iter().map(|color| (color[3] * 16.0).round() as u32).collect();
        levels.sort_unstable();
        levels.dedup();
        levels
    };
    assert_eq!(alphas("1"), [0, 16]);
    assert_eq!(alphas("4"), [0, 4, 8, 12, 16]);
    assert!(alphas("16").len() > 12);
}

#[test]
fn too_many_samples_in_a_row_are_refused() {
    let wide = Camera { width: 20_000, height: 2, ..sphere_camera(90, Projection::Pinhole) };
    let error = render(&sphere(10, 1.5), &wide, &options(samples("4")), &Backend::Reference, &()).unwrap_err();
    assert!(error.to_string().contains("take fewer"), "{error}");
    assert!("2".parse::<Samples>().is_err());
}
