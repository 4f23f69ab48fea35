//! Map coordinates do not jitter.
//!
//! With strays, distant clusters, offsets of 1e12 or cameras far away, the picture equals that of
//! the undisturbed scene near zero.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use common::scenes::shuffled;
use epsplat::io::Points;
use epsplat::low_level::metrics::{Comparison, compare};
use epsplat::low_level::plan::{Organisation, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Cull, Epsilon, Lens, LowPass, Map, Maps, Scene, Texture, Up};
use epsplat::low_level::surfels::analytic::{Shape, generate};
use epsplat::low_level::surfels::{Preparation, build, build_textured};
use glam::DVec3;

/// A place in UTM coordinates.
const MAP: DVec3 = DVec3::new(7e5, 6.26e6, 120.0);

/// Spheres of radius 10 around `centers`, and points at `strays`. All points are on a lattice of
/// 2^-16, so that f64 coordinates of up to 2^36 represent them exactly.
fn points(centers: &[DVec3], strays: &[DVec3]) -> Points {
    let samples: Vec<_> = generate(Shape::Sphere, 4000).collect();
    let on_lattice = |x: f64| (x * 65536.0).round() / 65536.0;
    let mut points = Points { normals: Some(vec![]), radii: Some(vec![]), texture: Some(vec![]), ..Points::default() };
    for center in centers {
        for sample in &samples {
            let place = DVec3::from_array(sample.position.map(|x| on_lattice(10.0 * x)));
            points.positions.push((*center + place).to_array());
            points.normals.as_mut().unwrap().push(sample.normal);
            points.radii.as_mut().unwrap().push(sample.radius * 10.0);
            points.texture.as_mut().unwrap().push([0.05 * place.x as f32, 0.05 * place.y as f32]);
        }
    }
    for stray in strays {
        points.positions.push(stray.to_array());
        points.normals.as_mut().unwrap().push([0.0, 0.0, 1.0]);
        points.radii.as_mut().unwrap().push(0.5);
        points.texture.as_mut().unwrap().push([0.0, 0.0]);
    }
    points
}

fn scene(centers: &[DVec3], strays: &[DVec3]) -> (Scene, Preparation) {
    build(vec![points(centers, strays)], &()).unwrap()
}

/// A camera 30 units away, or `away` times as far with a longer lens.
fn camera(target: DVec3, away: f64) -> Camera {
    let eye = target + DVec3::new(4.0, 3.0, 29.0) * away;
    let fov = 2.0 * (0.4f64 / away).atan().to_degrees();
    Camera::look_at((128, 112), Lens::Fov(fov), eye, target, Some(DVec3::Y), Up::Y, 1.0).unwrap()
}

/// Compares the device's picture of `scene` with the f64 reference of a single sphere at zero,
/// where no precision is lost.
fn against_alone(scene: &Scene, center: DVec3, away: f64, options: &Settings) -> Option<Comparison> {
    let gpu = common::gpu()?;
    let maps = Maps::ON_DEVICE;
    let options = Settings { maps, ..options.clone() };
    let decided = Settings { maps: maps.and(&[Map::Decision]), ..options.clone() };
    let (alone, _) = self::scene(&[DVec3::ZERO], &[]);
    let (expected, _) = render(&alone, &camera(DVec3::ZERO, away), &decided, &Backend::Reference, &()).unwrap();
    let (frame, _) = render(scene, &camera(center, away), &options, &Backend::gpu(gpu), &()).unwrap();
    let comparison = compare(&frame, &expected).unwrap();
    eprintln!("{:?}", comparison);
    Some(comparison)
}

fn is_the_same(name: &str, scene: &Scene, center: DVec3, away: f64) {
    for low_pass in [LowPass::None, LowPass::Ewa] {
        // From far away, an epsilon of one radius would be below the precision of depths, and the
        // sphere's back is within a relative 1e-6 of its front.
        let (epsilon, cull) = (Epsilon::Relative(0.01), if away > 1e5 { Cull::Back } else { Cull::Auto });
        let options = Settings { low_pass, epsilon, cull, ..Settings::default() };
        let Some(comparison) = against_alone(scene, center, away, &options) else { return };
        assert!(comparison.rmse_decided.unwrap() < 1e-6, "{name}: {comparison:?}");
        assert!(comparison.excused.unwrap() < 0.02, "{name}: {comparison:?}");
    }
}

#[test]
fn a_stray_leaves_the_scene_as_it_is() {
    for strays in
        [vec![DVec3::ZERO], vec![DVec3::ZERO; 2], vec![DVec3::splat(1e12), DVec3::ZERO], vec![DVec3::splat(1e18)]]
    {
        let (scene, preparation) = scene(&[MAP], &strays);
        assert_eq!(preparation.strays, strays.len() as u64);
        assert!(preparation.notes().iter().any(|note| note.contains("stray")), "{:?}", preparation.notes());
        is_the_same(&format!("{strays:?}"), &scene, MAP, 1.0);
        // If strays counted, the origin would be between them and the scene.
        assert!((scene.origin - MAP).length() < 20.0, "{}", scene.origin);
    }
}

#[test]
fn distant_clusters_are_each_as_they_are() {
    for apart in [DVec3::new(3e5, -2e5, 1e3), DVec3::new(1e8, 1e8, -1e8)] {
        let other = MAP + apart.round();
        let (scene, preparation) = scene(&[MAP, other], &[]);
        assert_eq!((preparation.strays, preparation.rounding), (0, None));
        for center in [MAP, other] {
            is_the_same(&format!("{apart}"), &scene, center, 1.0);
        }
        // The control: centres in f32 only.
        let single = Scene { low: vec![], ..scene };
        if let Some(comparison) = against_alone(&single, other, 1.0, &Settings::default()) {
            assert!(comparison.rmse_decided.unwrap() > 1e-3, "{apart}: {comparison:?}");
        }
    }
}

#[test]
fn offsets_of_1e12_and_cameras_far_away_change_nothing() {
    // At 2^36 the lattice's points are exact; at 1e12 an f64 has a resolution of 2^-13.
    let far = DVec3::new(2f64.powi(36), -(2f64.powi(36)), 2f64.powi(35));
    is_the_same("2^36", &scene(&[far], &[]).0, far, 1.0);
    let (rounded, _) = scene(&[DVec3::splat(1e12)], &[]);
    assert!(rounded.low.is_empty() && rounded.origin.distance(DVec3::splat(1e12)) < 20.0);
    for (away, center) in [(1e4, MAP), (1e6, DVec3::ZERO)] {
        is_the_same(&format!("from {away:e}"), &scene(&[center], &[]).0, center, away);
    }
}

#[test]
fn what_no_digits_are_left_for_is_told() {
    let (_, preparation) = scene(&[DVec3::ZERO, DVec3::new(3e15, 3.3e15, 1e15)], &[]);
    let error = preparation.rounding.unwrap();
    assert!(error > 0.1 && error < 40.0, "{error}");
    assert!(preparation.notes().iter().any(|note| note.contains("err by up to")), "{:?}", preparation.notes());
}

#[test]
fn doubled_centres_have_the_same_bits_in_any_order_and_organisation() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let other = MAP + DVec3::new(3e5, -2e5, 1e3);
    let (scene, _) = scene(&[MAP, other], &[DVec3::ZERO]);
    assert_eq!(scene.low.len(), scene.surfels.len());
    let frame = |scene: &Scene, organisation| {
        let options = Settings { organisation, ..Settings::default() };
        bits(&render(scene, &camera(other, 1.0), &options, &backend, &()).unwrap().0)
    };
    let expected = frame(&scene, Organisation::Auto);
    for organisation in [Organisation::Scatter, Organisation::Tile] {
        assert!(frame(&shuffled(&scene, 5), organisation) == expected, "{organisation:?}");
    }
}

#[test]
fn a_texture_far_away_is_where_it_is_near_zero() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let texels = (0..64 * 64).map(|k: u32| [(k % 64 * 4) as u8, (k / 64 * 4) as u8, 128, 255]).collect();
    let texture = Texture::new(64, 64, texels).unwrap();
    let painted = |centers: &[DVec3]| build_textured(vec![points(centers, &[])], vec![texture.clone()], &()).unwrap().0;
    let options = Settings { maps: Maps::of(&[Map::Decision]), ..Settings::default() };
    let expected =
        render(&painted(&[DVec3::ZERO]), &camera(DVec3::ZERO, 1.0), &options, &Backend::Reference, &()).unwrap().0;
    let other = MAP + DVec3::new(3e5, -2e5, 1e3);
    let far = painted(&[MAP, other]);
    assert!(!far.low.is_empty());
    let options = Settings::default();
    let error = |scene: &Scene| {
        let frame = render(scene, &camera(other, 1.0), &options, &backend, &()).unwrap().0;
        compare(&frame, &expected).unwrap().rmse_decided.unwrap()
    };
    let near_one = error(&far);
    assert!(near_one < 1e-5, "{near_one}");
    assert!(error(&Scene { low: vec![], ..far }) > 1e-3);
}

/// A scan of 20,000 points, 100 by 80 by 10, with additional points `beside`.
///
/// Returns the scene, the preparation, and the fraction of the picture's width or height that the
/// scan fills.
fn filled(beside: &[DVec3]) -> (Scene, Preparation, f64) {
    let at = |k: usize, step: f64| (k as f64 * step).fract();
    let scan = (0..20_000)
        .map(|k| MAP + DVec3::new(100.0 * at(k, 0.618_034), 80.0 * at(k, 0.754_878), 10.0 * at(k, 0.569_84)));
    let positions: Vec<_> = scan.clone().chain(beside.iter().map(|p| MAP + *p)).map(|p| p.to_array()).collect();
    let (scene, preparation) = build(vec![Points { positions, up: Some(Up::Z), ..Points::default() }], &()).unwrap();
    let camera = Camera::framing((400, 300), Lens::Fov(45.0), &scene, 1e-3).unwrap();
    let image: Vec<_> = scan.map(|p| camera.to_camera(p)).map(|p| p.truncate() * camera.fx / p.z).collect();
    let low = image.iter().fold(glam::DVec2::INFINITY, |low, p| low.min(*p));
    let high = image.iter().fold(glam::DVec2::NEG_INFINITY, |high, p| high.max(*p));
    (scene, preparation, ((high - low) / glam::DVec2::new(400.0, 300.0)).max_element())
}

#[test]
fn a_few_points_at_some_extents_do_not_shrink_the_picture() {
    let (_, preparation, alone) = filled(&[]);
    assert!(preparation.strays == 0 && alone > 0.9, "{preparation:?} {alone}");
    let birds = [DVec3::new(50.0, 40.0, 200.0), DVec3::new(-300.0, 900.0, 5.0), DVec3::new(-302.0, 901.0, 5.0)];
    let (_, preparation, share) = filled(&birds);
    assert_eq!(preparation.strays, 3);
    assert!((share - alone).abs() < 0.01, "{share} {alone}");
    assert!(preparation.notes().iter().any(|note| note.starts_with("3 points stray")), "{:?}", preparation.notes());
    // Scanners write missing returns at one position, many times.
    let (_, preparation, share) = filled(&vec![DVec3::new(50.0, 40.0, -700.0); 500]);
    assert!(preparation.strays == 500 && (share - alone).abs() < 0.01, "{preparation:?} {share}");
}

#[test]
fn what_is_real_stays_in_the_picture() {
    let all_shown = |beside: Vec<DVec3>, what: &str| {
        let (scene, preparation, share) = filled(&beside);
        assert_eq!(preparation.strays, 0, "{what}");
        let camera = Camera::framing((400, 300), Lens::Fov(45.0), &scene, 1e-3).unwrap();
        for p in beside {
            let p = camera.to_camera(MAP + p);
            let image = p.truncate() * camera.fx / p.z;
            assert!(image.x.abs() < 200.0 && image.y.abs() < 150.0, "{what} {image}");
        }
        share
    };
    // A mast of few points, each near the next, up to three times the width of the scan.
    let mast = (1..=30).map(|k| DVec3::new(50.0, 40.0, 10.0 * f64::from(k))).collect();
    assert!(all_shown(mast, "mast") < 0.6);
    // A distant hut with more points than a group of strays may have.
    all_shown((0..25).map(|k| DVec3::new(400.0 + f64::from(k % 5), f64::from(k / 5), 3.0)).collect(), "hut");
    // One point close beside the scan.
    all_shown(vec![DVec3::new(118.0, 40.0, 5.0)], "kerb");
}

#[test]
fn a_far_disk_that_reaches_the_others_is_no_stray() {
    let points = |radius: f32| {
        let mut points = points(&[MAP], &[MAP + DVec3::new(70.0, 0.0, 0.0)]);
        *points.radii.as_mut().unwrap().last_mut().unwrap() = radius;
        build(vec![points], &()).unwrap().1.strays
    };
    assert_eq!((points(0.5), points(60.0)), (1, 0));
}
