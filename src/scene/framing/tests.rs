//! Tests of framing.

#![allow(clippy::unwrap_used)]
use super::*;
use crate::scene::side::ELEVATION;
use crate::scene::{Colors, Surfel, Up};

#[test]
fn every_point_is_in_the_image_and_the_scene_fills_and_centres_it() {
    let mut surfels = Vec::new();
    for corner in 0..8u32 {
        let pick = |bit: u32, low: f32, high: f32| if corner >> bit & 1 == 0 { low } else { high };
        let center = glam::Vec3::new(pick(0, -3.0, 9.0), pick(1, 2.0, 4.0), pick(2, 1.0, 1.5));
        surfels.push(Surfel::disk(center, glam::Vec3::Z, 0.01));
    }
    let colors = Colors::Constant([1.0; 4]);
    for (up, size) in [(Up::Y, (640, 480)), (Up::Z, (100, 900)), (Up::Z, (1024, 64))] {
        let scene = Scene {
            origin: DVec3::new(4e5, 5e6, 0.0),
            surfels: surfels.clone(),
            low: vec![],
            colors: colors.clone(),
            oriented: true,
            up,
            ..Scene::default()
        };
        let off = Lens::Intrinsics([700.0, 700.0, -200.0, 1500.0]);
        for lens in [Lens::Fov(45.0), off] {
            let camera = Camera::framing(size, lens, &scene, 1e-3).unwrap();
            let (mut low, mut high) = (glam::DVec2::INFINITY, glam::DVec2::NEG_INFINITY);
            for surfel in &scene.surfels {
                let p = camera.to_camera(scene.origin + glam::Vec3::from_array(surfel.center).as_dvec3());
                let depth = if camera.projection == Projection::Pinhole { p.z } else { 1.0 };
                assert!(p.z > camera.near);
                let image = glam::DVec2::new(camera.fx * p.x / depth + camera.cx, camera.fy * p.y / depth + camera.cy);
                (low, high) = (low.min(image), high.max(image));
            }
            let size = glam::DVec2::new(f64::from(size.0), f64::from(size.1));
            let filled = (high - low) / size;
            assert!(filled.max_element() > 0.9499 && filled.max_element() < 0.96, "{filled}");
            let off = ((low + high) * 0.5 / size - 0.5).abs();
            assert!(off.max_element() < 0.03, "{off}");
        }
    }
}

/// Each side has the whole scene in view, and sees what lies on that side in front.
#[test]
fn a_scene_is_framed_from_each_side() {
    let at = |x: f32, y: f32, z: f32| Surfel::disk(glam::Vec3::new(x, y, z), glam::Vec3::Z, 0.1);
    let surfels: Vec<_> = (0..8).map(|k| at((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32)).collect();
    for (up, north) in [(Up::Z, DVec3::Y), (Up::Y, DVec3::NEG_Z)] {
        let scene = Scene { surfels: surfels.clone(), up, ..Scene::default() };
        let view = |text: &str| {
            let side = Some(text.parse::<Side>().unwrap());
            Camera::framing_from((64, 64), Lens::Fov(45.0), &scene, 1e-3, (side, None)).unwrap().0
        };
        let elevation = ELEVATION.to_radians();
        let sides =
            [("north", north), ("south", -north), ("east", DVec3::X), ("west", -DVec3::X), ("above", up.axis())];
        for (name, toward) in sides {
            let camera = view(name);
            let forward = camera.rotation.row(2);
            let expected = if name == "above" { 1.0 } else { elevation.cos() };
            assert!((forward.dot(-toward) - expected).abs() < 1e-9, "{name} {forward}");
            assert!(surfels.iter().all(|surfel| {
                let p = camera.to_camera(DVec3::from_array(surfel.center.map(f64::from)));
                let image = [camera.fx * p.x / p.z + camera.cx, camera.fy * p.y / p.z + camera.cy];
                p.z > 0.0 && image.iter().all(|at| (0.0..64.0).contains(at))
            }));
        }
        let top = -view("above").rotation.row(1);
        assert!((top.dot(north) - 1.0).abs() < 1e-9, "{top}");
        assert!((view("1,0,0").rotation.row(2) + DVec3::X).length() < 1e-9);
        // The user's up decides where north is, whatever the scene's is.
        let given = |text: &str, up| {
            let side = Some(text.parse::<Side>().unwrap());
            Camera::framing_from((64, 64), Lens::Fov(45.0), &scene, 1e-3, (side, Some(up)))
        };
        for (up, north) in [(DVec3::Z * 7.0, DVec3::Y), (DVec3::Y, DVec3::NEG_Z)] {
            let rotation = given("north", up).unwrap().0.rotation;
            assert!((rotation.row(2).dot(-north) - elevation.cos()).abs() < 1e-9, "{rotation}");
            let rotation = given("above", up).unwrap().0.rotation;
            assert!((rotation.row(1) + north).length() < 1e-9, "{rotation}");
        }
        assert!(given("1,0,0", -DVec3::X).unwrap_err().to_string().contains("give another --up"));
    }
    assert!("up".parse::<Side>().is_err() && "1,2".parse::<Side>().is_err() && "nan,0,0".parse::<Side>().is_err());
}

#[test]
fn no_disk_is_cut_by_the_border_and_no_stray_counts() {
    let normals = [glam::Vec3::Z, glam::Vec3::X, glam::Vec3::new(1.0, 1.0, -1.0)];
    let mut surfels: Vec<_> = (0..60)
        .map(|k| {
            let at = glam::Vec3::new((k % 5) as f32, (k / 5 % 4) as f32, (k / 20) as f32);
            Surfel::disk(at, normals[k % 3], 0.2 + 0.3 * (k % 4) as f32)
        })
        .collect();
    let largest = 1e9;
    surfels.push(Surfel::disk(glam::Vec3::ONE, glam::Vec3::Z, largest));
    surfels.push(Surfel::disk(glam::Vec3::splat(1e6), glam::Vec3::Z, 1.0));
    let colors = Colors::Constant([1.0; 4]);
    let scene =
        Scene { origin: DVec3::ZERO, surfels, low: vec![], colors, oriented: true, up: Up::Y, ..Scene::default() };
    for size in [(640, 480), (100, 900)] {
        let camera = Camera::framing(size, Lens::Fov(45.0), &scene, 1e-3).unwrap();
        let (mut low, mut high) = (glam::DVec2::INFINITY, glam::DVec2::NEG_INFINITY);
        for surfel in &scene.surfels[..60] {
            let [p, s, t] = [surfel.center, surfel.s, surfel.t].map(|v| glam::Vec3::from_array(v).as_dvec3());
            for step in 0..256 {
                let (sin, cos) = (f64::from(step) / 256.0 * std::f64::consts::TAU).sin_cos();
                let rim = camera.to_camera(p + s * cos + t * sin);
                assert!(rim.z > camera.near);
                let image =
                    glam::DVec2::new(camera.fx * rim.x / rim.z + camera.cx, camera.fy * rim.y / rim.z + camera.cy);
                (low, high) = (low.min(image), high.max(image));
            }
        }
        let size = glam::DVec2::new(f64::from(size.0), f64::from(size.1));
        assert!(low.min_element() > 0.0 && (size - high).min_element() > 0.0, "{low} {high}");
        let filled = (high - low) / size;
        assert!(filled.max_element() > 0.97, "{filled}");
    }
}

#[test]
fn huge_disks_far_apart_are_framed() {
    let at = |y: f32, normal| Surfel::disk(glam::Vec3::new(0.0, y, y), normal, 2.6e9);
    let surfels = vec![at(0.0, glam::Vec3::new(0.3, -0.7, 0.2)), at(-2.1e9, glam::Vec3::new(-0.1, 0.2, 0.9))];
    let colors = Colors::Constant([1.0; 4]);
    // Low parts that move both centres outside the box of their f32 centres.
    let low = vec![[-1e-9, 1e-9, -1e-9], [1e-9, -1e-9, 1e-9]];
    let scene = Scene { origin: DVec3::ZERO, surfels, low, colors, oriented: true, up: Up::Z, ..Scene::default() };
    let camera = Camera::framing((64, 48), Lens::Fov(45.0), &scene, 1.0).unwrap();
    for surfel in &scene.surfels {
        let p = camera.to_camera(glam::Vec3::from_array(surfel.center).as_dvec3());
        assert!(p.z > 2.6e9 * 0.05 && p.z < 1e11, "{p}");
    }
}

#[test]
fn one_point_is_framed_by_its_radius() {
    let surfels = vec![Surfel::disk(glam::Vec3::ONE, glam::Vec3::Z, 0.5)];
    let scene = Scene {
        origin: DVec3::ZERO,
        surfels,
        low: vec![],
        colors: Colors::Constant([1.0; 4]),
        oriented: true,
        up: Up::Y,
        ..Scene::default()
    };
    let camera = Camera::framing((64, 64), Lens::Fov(45.0), &scene, 1e-6).unwrap();
    let p = camera.to_camera(DVec3::ONE);
    assert!(p.truncate().length() < 1e-9 && (p.z - 1.5).abs() < 1e-6, "{p}");
}

#[test]
fn a_fitted_orthographic_view_shows_the_whole_scene_and_no_more() {
    let at = |x: f32, y: f32, z: f32| Surfel::disk(glam::Vec3::new(x, y, z), glam::Vec3::Z, 0.5);
    let surfels: Vec<_> =
        (0..8).map(|k| at((k & 1) as f32 * 9.0, (k >> 1 & 1) as f32 * 4.0, (k >> 2) as f32)).collect();
    let scene = Scene { surfels, up: Up::Z, ..Scene::default() };
    for (size, name, expected) in [
        // Ten by five units from above, disks included, with a margin of 5 %.
        ((200, 100), "top", 5.0 / FILL),
        ((100, 100), "top", 10.0 / FILL),
        // From the front, disks are lines as wide as they are from above, and one unit high.
        ((100, 100), "front", 10.0 / FILL),
        ((1000, 100), "front", 1.0 / FILL),
    ] {
        let side = Some(name.parse::<Side>().unwrap());
        let height = fitted_height(size, (&scene, &()), (side, None)).unwrap();
        assert!((height - expected).abs() < 1e-9, "{size:?} {name}: {height} for {expected}");
    }
    // A single point has its radius alone.
    let one = Scene { surfels: vec![at(3.0, 3.0, 3.0)], ..Scene::default() };
    let height = fitted_height((10, 10), (&one, &()), (Some(Side::Above), None)).unwrap();
    assert!((height - 1.0 / FILL).abs() < 1e-9, "{height}");
}
