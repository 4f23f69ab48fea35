//! Scenes of extreme sizes and distances: the GPU against the f64 reference.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::judged::judge;
use epsplat::io::Points;
use epsplat::low_level::plan::Settings;
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Epsilon, Lens, Scene, Up};
use epsplat::low_level::surfels::analytic::{Shape, generate};
use epsplat::low_level::surfels::build;
use glam::DVec3;

/// A unit sphere, scaled and shifted, with additional points.
fn sphere(scale: f64, shift: DVec3, more: &[DVec3]) -> Scene {
    let samples: Vec<_> = generate(Shape::Sphere, 3000).collect();
    let mut points = Points::default();
    points.positions.extend(samples.iter().map(|s| (DVec3::from_array(s.position) * scale + shift).to_array()));
    points.positions.extend(more.iter().map(|p| p.to_array()));
    let rest = more.len();
    let normals = samples.iter().map(|s| s.normal).chain(std::iter::repeat_n([0.0, 0.0, 1.0], rest));
    let radii = samples.iter().map(|s| (f64::from(s.radius) * scale) as f32).chain(std::iter::repeat_n(1.0, rest));
    points.normals = Some(normals.collect());
    points.radii = Some(radii.collect());
    build(vec![points], &()).unwrap().0
}

fn view(scale: f64, shift: DVec3) -> Camera {
    let eye = shift + DVec3::new(0.4, 0.3, 3.0) * scale;
    Camera::look_at((96, 80), Lens::Fov(45.0), eye, shift, Some(DVec3::Y), Up::Y, 0.01 * scale).unwrap()
}

fn check(name: &str, scene: &Scene, camera: &Camera, epsilon: Epsilon) {
    let Some(gpu) = common::gpu() else { return };
    let options = Settings { epsilon, ..Settings::default() };
    judge(name, (scene, camera), options, (0.3, 1.0), &Backend::gpu(gpu));
}

#[test]
fn a_far_outlier_does_not_hurt_the_rest() {
    for far in [1e6, 1e9, 1e11, 1e15] {
        let scene = sphere(1.0, DVec3::ZERO, &[DVec3::new(far, 0.0, 0.0)]);
        check(&format!("outlier at {far:e}"), &scene, &view(1.0, DVec3::ZERO), Epsilon::Relative(0.01));
    }
}

#[test]
fn small_large_and_distant_scenes_are_the_same_picture() {
    for scale in [1e-6, 1e-3, 1e6, 1e12] {
        let scene = sphere(scale, DVec3::ZERO, &[]);
        check(&format!("scale {scale:e}"), &scene, &view(scale, DVec3::ZERO), Epsilon::Relative(0.01));
    }
    // Map coordinates with surfels of millimetres.
    let shift = DVec3::new(6.26e6, 4.4e5, 1200.0);
    check("map", &sphere(0.05, shift, &[]), &view(0.05, shift), Epsilon::Relative(0.01));
}

#[test]
fn an_epsilon_that_accepts_everything_is_exact() {
    let scene = sphere(1.0, DVec3::ZERO, &[]);
    for epsilon in [Epsilon::Absolute(1e5), Epsilon::Absolute(1e300), Epsilon::Relative(1e9), Epsilon::Radius(1e30)] {
        check(&format!("{epsilon:?}"), &scene, &view(1.0, DVec3::ZERO), epsilon);
    }
}

#[test]
fn radii_of_all_sizes_are_right_and_none_is_larger_than_a_plane() {
    let mut points = Points { normals: Some(vec![]), radii: Some(vec![]), ..Points::default() };
    for (k, sample) in generate(Shape::Sphere, 3000).enumerate() {
        points.positions.push(sample.position);
        points.normals.as_mut().unwrap().push(sample.normal);
        // Ten points each have a radius of 1e-9, 1e-7, ... 1e9; all others keep the sphere's own
        // radius.
        let exponent = -9 + 2 * (k as i32 % 30);
        let odd = k % 30 < 10 && k / 30 % 10 == 0;
        points.radii.as_mut().unwrap().push(if odd { 10f32.powi(exponent) } else { sample.radius });
    }
    let (scene, preparation) = build(vec![points], &()).unwrap();
    assert_eq!(preparation.limited_radii, 20);
    assert!(preparation.notes().iter().any(|note| note.contains("20 points had a radius")));
    assert!(!scene.low.is_empty(), "disks of 1e-9 need more digits than f32 has");
    check("radii", &scene, &view(1.0, DVec3::ZERO), Epsilon::Relative(0.01));
    // A huge disk must not raise the default near depth, which stays below 1e-5.
    assert!(Camera::default_near(&scene) < 1e-5);
}

#[test]
fn scenes_too_small_for_f32_are_refused() {
    let of = |scale: f64| {
        let positions = generate(Shape::Sphere, 100).map(|sample| sample.position.map(|x| x * scale)).collect();
        build(vec![Points { positions, ..Points::default() }], &()).map_err(|error| error.to_string())
    };
    assert!(of(1e-14).is_ok());
    for scale in [1e-16, 1e-20, 1e-40, 1e-300] {
        let why = of(scale).unwrap_err();
        assert!(why.contains("1e-15 to 1e18") && why.contains("scale it"), "{why}");
    }
    check("1e-14", &sphere(1e-14, DVec3::ZERO, &[]), &view(1e-14, DVec3::ZERO), Epsilon::Relative(0.01));
}

#[test]
fn disks_larger_than_the_box_of_their_centres_are_the_scene() {
    let of = |width: f64, radius: f32| {
        let positions = (0..50).map(|k| [width * f64::from(k) / 49.0, 0.0, 0.0]).collect();
        let radii = Some(vec![radius; 50]);
        build(vec![Points { positions, radii, ..Points::default() }], &())
    };
    for width in [1e-17, 1e-9, 0.1] {
        let (scene, preparation) = of(width, 1.0).unwrap();
        assert_eq!((scene.largest_radius(), preparation.limited_radii), (1.0, 0), "{width}");
        let camera = Camera::framing((64, 64), Lens::Fov(45.0), &scene, Camera::default_near(&scene)).unwrap();
        let (frame, _) = render(&scene, &camera, &Settings::default(), &Backend::Reference, &()).unwrap();
        let covered = |pixel: usize| frame.color[pixel][3] > 0.0;
        assert!((0..64).all(|k| !covered(k) && !covered(63 * 64 + k) && !covered(64 * k) && !covered(64 * k + 63)));
        assert!((0..64 * 64).filter(|pixel| covered(*pixel)).count() > 500, "{width}");
    }
    assert!(of(1e-17, 1e-17).is_err());
}
