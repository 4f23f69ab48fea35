//! The points that views see, against rays.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::command::{DATA, Folder, fails, ply, succeeds, text};
use epsplat::low_level::truth::Surface;
use epsplat::options::Epsilon;
use epsplat::{Camera, DeviceOptions, Lens, Points, RenderOptions, Scene, SceneOptions, Up, View};
use glam::DVec3;
use std::path::Path;

/// The depth, in units of the direction, at which a ray first meets a scene.
type Cast<'a> = &'a dyn Fn(DVec3, DVec3) -> Option<f64>;

/// Cameras on a circle around `target`.
fn cameras(target: DVec3, distance: f64, size: (u32, u32)) -> Vec<Camera> {
    let eye = |k: u32| {
        let (sin, cos) = (f64::from(k) * 1.05 + 0.2).sin_cos();
        target + distance * DVec3::new(sin, 0.25, cos)
    };
    let look = |k| Camera::look_at(size, Lens::Fov(45.0), eye(k), target, Some(DVec3::Y), Up::Y, 0.01).unwrap();
    (0..6).map(look).collect()
}

/// The image point of `point` and its depth.
fn project(camera: &Camera, point: DVec3) -> (f64, f64, f64) {
    let at = camera.to_camera(point);
    (camera.fx * at.x / at.z + camera.cx, camera.fy * at.y / at.z + camera.cy, at.z)
}

/// Whether rays say that a camera sees the point; None within 2 pixels of an outline, at more than
/// 80 degrees from the view, and outside the image.
fn truth(camera: &Camera, cast: Cast, point: DVec3, normal: DVec3) -> Option<bool> {
    let (x, y, depth) = project(camera, point);
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let slope = normal.normalize().dot((camera.eye - point).normalize()).abs();
    if !(depth > 0.0 && (3.0..width - 3.0).contains(&x) && (3.0..height - 3.0).contains(&y))
        || slope < 80f64.to_radians().cos()
    {
        return None;
    }
    // The default tolerance is 1 % of the depth, or a radius of about 0.7 % of it: surfaces that
    // are about so far apart decide nothing.
    let hides = |dx: f64, dy: f64| {
        let hit = cast(camera.eye, camera.ray(x + dx, y + dy))? / depth;
        (!(0.985..0.995).contains(&hit)).then_some(hit < 0.985)
    };
    let seen = hides(0.0, 0.0)?;
    let around = [(-2.0, 0.0), (2.0, 0.0), (0.0, -2.0), (0.0, 2.0), (-1.4, -1.4), (1.4, 1.4), (-1.4, 1.4), (1.4, -1.4)];
    around.iter().all(|&(dx, dy)| hides(dx, dy) == Some(seen)).then_some(!seen)
}

/// Precision and recall of the points that views see, over all points and views that `truth`
/// decides; `shift` moves the cameras of the rays.
fn measured(inputs: &[Points], cast: Cast, cameras: &[Camera], epsilon: Option<Epsilon>, shift: DVec3) -> [f64; 2] {
    let scene = Scene::from_points(inputs.to_vec(), &SceneOptions::default());
    let mut options = RenderOptions::default();
    options.surface.epsilon = epsilon;
    let (mut both, mut found, mut there) = (0u32, 0u32, 0u32);
    for camera in cameras {
        let view = View::from(camera.clone());
        let visible = scene.visible(&[view], &options, &DeviceOptions::default(), &()).unwrap();
        let of_rays = Camera { eye: camera.eye + shift, ..camera.clone() };
        assert_eq!(visible.points[0], visible.views.iter().flatten().map(|count| u64::from(*count)).sum::<u64>());
        for (points, counts) in inputs.iter().zip(&visible.views) {
            let normals = points.normals.as_ref().unwrap();
            for ((position, normal), count) in points.positions.iter().zip(normals).zip(counts) {
                let normal = DVec3::from_array(normal.map(f64::from));
                if let Some(seen) = truth(&of_rays, cast, DVec3::from_array(*position), normal) {
                    both += u32::from(seen && *count > 0);
                    found += u32::from(*count > 0);
                    there += u32::from(seen);
                }
            }
        }
    }
    assert!(there > 500 && found > 500, "{there} {found}");
    [f64::from(both) / f64::from(found), f64::from(both) / f64::from(there)]
}

fn check(name: &str, inputs: &[Points], cast: Cast, cameras: &[Camera]) {
    let [precision, recall] = measured(inputs, cast, cameras, None, DVec3::ZERO);
    eprintln!("{name}: precision {precision:.4}, recall {recall:.4}");
    assert!(precision >= 0.99 && recall >= 0.99, "{name}: {precision} {recall}");
    // Controls: a tolerance that sees through everything, and cameras elsewhere.
    let [through, _] = measured(inputs, cast, cameras, Some(Epsilon::Relative(10.0)), DVec3::ZERO);
    let aside = (cameras[0].eye - cameras[1].eye) * 0.5;
    let [shifted, found] = measured(inputs, cast, cameras, None, aside);
    eprintln!("{name}: controls {through:.4}, {shifted:.4} and {found:.4}");
    assert!(through < 0.9 && shifted.min(found) < 0.98, "{name}: {through} {shifted} {found}");
}

#[test]
fn vertices_of_a_mesh_are_seen_where_rays_reach_them() {
    let path = Path::new(DATA).join("bunny.obj");
    let (points, surface) = (epsplat::io::read(&path, &()).unwrap(), Surface::read(&path, &()).unwrap());
    let cast = |start, direction| surface.first_hit(start, direction, 0.0).map(|hit| hit.distance);
    check("bunny", &[points], &cast, &cameras(DVec3::new(0.0, 4.8, 0.0), 18.0, (400, 400)));
}

/// The square of edge 4 at z = 2, and the sphere of radius 1 around the origin behind it.
#[test]
fn a_sphere_behind_a_square_is_seen_from_its_sides() {
    let golden = 2.399_963_229_728_653;
    let on_sphere = |k: u32| {
        let y = 1.0 - 2.0 * (f64::from(k) + 0.5) / 6000.0;
        let (sin, cos) = (golden * f64::from(k)).sin_cos();
        let across = (1.0 - y * y).sqrt();
        DVec3::new(across * cos, y, across * sin)
    };
    let cloud = |positions: Vec<DVec3>, normals: Vec<DVec3>, radius: f32| Points {
        radii: Some(vec![radius; positions.len()]),
        positions: positions.into_iter().map(|at| at.to_array()).collect(),
        normals: Some(normals.into_iter().map(|normal| normal.as_vec3().to_array()).collect()),
        ..Points::default()
    };
    let sphere: Vec<DVec3> = (0..6000).map(on_sphere).collect();
    let square: Vec<DVec3> = (0..6400u32)
        .map(|k| DVec3::new(f64::from(k % 80) * 0.05 - 1.975, f64::from(k / 80) * 0.05 - 1.975, 2.0))
        .collect();
    let facing = vec![DVec3::Z; square.len()];
    let inputs = [cloud(sphere.clone(), sphere, 0.06), cloud(square, facing, 0.05)];
    let cast = |start: DVec3, d: DVec3| {
        let (b, c) = (start.dot(d) / d.length_squared(), (start.length_squared() - 1.0) / d.length_squared());
        let ball = (b * b >= c).then(|| -b - (b * b - c).sqrt());
        let at = (2.0 - start.z) / d.z;
        let hit = start + d * at;
        let flat = (hit.x.abs() <= 2.0 && hit.y.abs() <= 2.0).then_some(at);
        [ball, flat].into_iter().flatten().filter(|at| *at > 0.0).min_by(f64::total_cmp)
    };
    check("sphere", &inputs, &cast, &cameras(DVec3::ZERO, 9.0, (400, 400)));
}

/// Two points on one line of sight, 1 and 2 units before the camera, at map coordinates; and one
/// beside the image.
#[test]
fn points_keep_their_order_and_coordinates() {
    let folder = Folder::new();
    let row = |x: &str, z: &str| format!("{x} 5411000.3 {z} 0 0 1 0.1\n");
    let rows = [row("445000.7", "8"), row("445000.7", "9"), row("445900", "8"), row("445001.2", "8")].concat();
    let header = ply("x y z nx ny nz radius", 4, &rows).replace("property float x", "property double x");
    let header =
        header.replace("property float y", "property double y").replace("property float z", "property double z");
    let cloud = folder.file("c.ply", header);
    let view = r#"{"eye": [445000.7, 5411000.3, 10], "target": [445000.7, 5411000.3, 0], "up": [0, 1, 0],
        "width": 101, "height": 101, "fov": 60}"#;
    let cameras = folder.file("cameras.json", format!("[{view}, {view}]").replacen("60", "20", 1));
    let (seen, report) = (folder.path("seen.ply"), folder.path("seen.json"));
    let base = ["visible", text(&cloud), "--cameras", text(&cameras), "--backend", "reference", "-o", text(&seen)];
    let line = [&base[..], &["--json", text(&report)]].concat();
    succeeds(&line);
    // The nearer point hides the one behind it, and the wide view also sees the one beside it.
    let points = epsplat::io::read(&seen, &()).unwrap();
    assert_eq!(points.positions, [[445000.7, 5411000.3, 9.0], [445001.2, 5411000.3, 8.0]]);
    let bytes = std::fs::read(&seen).unwrap();
    let head = String::from_utf8_lossy(&bytes).into_owned();
    assert!(head.contains("property double x") && head.contains("property uint views\nend_header"), "{head}");
    // The attribute is the last of each row.
    let row = 3 * 8 + 4 * 4 + 4;
    let counts =
        [bytes.len() - row, bytes.len()].map(|end| u32::from_le_bytes(bytes[end - 4..end].try_into().unwrap()));
    assert_eq!(counts, [2, 1]);
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    assert_eq!((&report["points"], &report["written"]), (&4.into(), &2.into()));
    assert_eq!((&report["views"][0]["points"], &report["views"][1]["points"]), (&1.into(), &2.into()));

    succeeds(&[&base[..], &["--least", "2"]].concat());
    assert_eq!(epsplat::io::read(&seen, &()).unwrap().positions, [[445000.7, 5411000.3, 9.0]]);
    fails(&[&base[..6], &["-o", text(&cloud)]].concat(), 2, &["would overwrite the input"]);
    let away = folder.file(
        "away.json",
        format!("[{view}]").replace("10], \"target\"", "-10], \"target\"").replace(" 0], \"up\"", " -20], \"up\""),
    );
    let output =
        succeeds(&["visible", text(&cloud), "--cameras", text(&away), "--backend", "reference", "-o", text(&seen)]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("warning: no view sees any"));
}
