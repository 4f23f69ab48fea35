//! Golden images: the f64 reference still renders them, and the GPU renders the same.
//!
//! After a change that is meant to alter images, run with `EPSPLAT_BLESS=1` and look at the new
//! images. A missing golden image fails the test.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::{Path, PathBuf};

use epsplat::io;
use epsplat::low_level::frame::Frame;
use epsplat::low_level::plan::Settings;
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::color::linear_to_srgb;
use epsplat::low_level::scene::{Camera, Colors, Lens, Light, Scene, Shading};
use epsplat::low_level::surfels::analytic::{Shape, generate};
use epsplat::low_level::surfels::build;
use glam::Vec3;

fn generated(shape: Shape, count: u64) -> Scene {
    let samples: Vec<_> = generate(shape, count).collect();
    let points = io::Points {
        positions: samples.iter().map(|s| s.position).collect(),
        normals: Some(samples.iter().map(|s| s.normal).collect()),
        radii: Some(samples.iter().map(|s| s.radius).collect()),
        colors: Some(Colors::Srgb8(samples.iter().map(|s| [s.color[0], s.color[1], s.color[2], 255]).collect())),
        ..io::Points::default()
    };
    build(vec![points], &()).unwrap().0
}

fn file(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name);
    build(vec![io::read(&path, &()).unwrap()], &()).unwrap().0
}

/// A view of whole disks, from which the golden images were made, even where they are clipped.
fn framed(scene: &Scene, size: (u32, u32), lens: Lens) -> Camera {
    let whole = Scene { clips: Vec::new(), ..scene.clone() };
    Camera::framing(size, lens, &whole, Camera::default_near(scene)).unwrap()
}

fn cases() -> Vec<(&'static str, Scene, Camera, Settings)> {
    let default = Settings::default();
    let mut cases = Vec::new();
    let mut case = |name, scene: Scene, size, lens, options| {
        let camera = framed(&scene, size, lens);
        cases.push((name, scene, camera, options));
    };
    // The README's picture.
    case(
        "autzen",
        file("autzen.laz"),
        (1024, 400),
        Lens::Fov(20.0),
        Settings { background: [1.0; 4], ..default.clone() },
    );
    case("bunny", file("bunny.obj"), (256, 256), Lens::Fov(45.0), default.clone());
    // The README's second picture, of glass.
    let glass = Settings {
        composite: "layers".parse().unwrap(),
        opacity: 0.5,
        samples: "4".parse().unwrap(),
        background: [1.0; 4],
        ..default.clone()
    };
    case("glass", file("bunny.obj"), (512, 512), Lens::Fov(45.0), glass);
    let toward = Vec3::new(-1.0, 1.0, 1.0).normalize();
    let lights = vec![Light::Directional { toward, intensity: 0.9 }, Light::Headlight { intensity: 0.2 }];
    let lit = Settings { lights, background: [0.1, 0.2, 0.4, 1.0], ..default.clone() };
    case("torus", generated(Shape::Torus, 20_000), (200, 150), Lens::OrthographicHeight(2.8), lit);
    let unlit = Settings { shading: Shading::Unlit, ..default.clone() };
    case("checkerboard", generated(Shape::Checkerboard, 40_000), (160, 120), Lens::Fov(60.0), unlit);
    case("sphere", generated(Shape::Sphere, 3000), (120, 120), Lens::Intrinsics([150.0, 120.0, 50.0, 70.0]), default);
    cases
}

fn codes(frame: &Frame) -> Vec<[i32; 4]> {
    let code = |v: f64| (v * 255.0).round() as i32;
    let pixel = |&[r, g, b, a]: &[f32; 4]| {
        let [r, g, b] = [r, g, b].map(|c| code(linear_to_srgb(c.into())));
        [r, g, b, code(a.into())]
    };
    frame.color.iter().map(pixel).collect()
}

/// The share of pixels that differ by more than one code in any channel.
fn differing(a: &Frame, b: &Frame) -> f64 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let differs = |(a, b): (&[i32; 4], &[i32; 4])| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 1);
    let (a, b) = (codes(a), codes(b));
    a.iter().zip(&b).filter(|pair| differs(*pair)).count() as f64 / a.len() as f64
}

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{name}.png"))
}

#[test]
fn the_reference_renders_the_golden_images() {
    let bless = std::env::var_os("EPSPLAT_BLESS").is_some();
    for (name, scene, camera, options) in cases() {
        let (frame, _) = render(&scene, &camera, &options, &Backend::Reference, &()).unwrap();
        if bless {
            io::png::write(&golden(name), &frame).unwrap();
        }
        let expected = io::png::read(&golden(name)).unwrap_or_else(|e| panic!("the golden image is missing: {e}"));
        // The platform's `exp` and `pow` may change a code by one.
        assert_eq!(differing(&frame, &expected), 0.0, "{name}");
        // Control: another kernel gives another image.
        let other = Settings { kernel: "ellipse:2,3".parse().unwrap(), ..options };
        let (frame, _) = render(&scene, &camera, &other, &Backend::Reference, &()).unwrap();
        assert!(differing(&frame, &expected) > 0.001, "{name}: a different kernel went unnoticed");
    }
}

#[test]
fn the_gpu_renders_the_golden_images() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    for (name, scene, camera, options) in cases() {
        let (frame, _) = render(&scene, &camera, &options, &backend, &()).unwrap();
        let expected = io::png::read(&golden(name)).unwrap_or_else(|e| panic!("the golden image is missing: {e}"));
        // At a few pixels on rims f32 may decide otherwise.
        let share = differing(&frame, &expected);
        assert!(share < 0.0005, "{name}: {:.3} % of the pixels differ", 100.0 * share);
    }
}

use crate::common;
