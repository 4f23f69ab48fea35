//! Fuzzes camera files.

use super::mutate::Grammar;
use super::random::Random;
use super::render::{SIZE, draw, shaded};
use super::session::sentence;
use super::{Outcome, Target};
use epsplat::io::Points;
use epsplat::io::camera::{self, CameraFile, Pose};
use epsplat::low_level::scene::camera::check_size;
use epsplat::low_level::scene::{Camera, Scene, Shading};
use epsplat::low_level::surfels::analytic::{Shape, generate as sample};
use epsplat::low_level::surfels::build;
use glam::{DMat3, DVec3};
use std::path::Path;
use std::sync::LazyLock;

pub const TARGET: Target = Target {
    name: "camera",
    extension: "json",
    generate,
    grammar: Grammar {
        words: &[
            "null",
            "true",
            "[]",
            "{}",
            "\"\"",
            "[[[[[[[[",
            "\"model\":",
            "\"orthographic\",",
            "\"width\":",
            "\"height\":",
            "\"fx\":",
            "\"fov\":",
            "\"eye\":",
            "\"target\":",
            "\"up\":",
            "\"near\":",
            "\"height_world\":",
            "[0,0,1],",
            "1,",
            "\"a\\nb\":1,",
            "\\n",
            "\\u0007",
            "\\ud800",
            "\"model\":\"a\\nb\",",
            "1e-320",
            "-",
            "\u{feff}",
            "\u{85}",
        ],
        separators: b",:[]{}",
        text: 1 << 12,
        numbers: |_| Vec::new(),
    },
    execute,
};

pub fn array(values: impl IntoIterator<Item = f64>) -> String {
    format!("[{}]", values.into_iter().map(|value| value.to_string()).collect::<Vec<_>>().join(", "))
}

/// A valid camera file with random fields in random order. It holds no points, so the returned
/// count is ignored.
fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    let mut fields = Vec::new();
    let mut size = random.one_in(2);
    match random.below(4) {
        0 => fields.push(format!("\"fov\": {}", random.between(1.0, 179.0))),
        1 => {
            fields.push("\"model\": \"orthographic\"".into());
            fields.push(format!("\"height_world\": {}", random.between(0.1, 9.0)));
        }
        2 => {
            size = true;
            if random.one_in(2) {
                fields.push("\"model\": \"orthographic\"".into());
            }
            fields.push(format!("\"fx\": {}, \"cx\": 8, \"cy\": 7.5", random.between(0.5, 99.0)));
            if random.one_in(2) {
                fields.push(format!("\"fy\": {}", random.between(0.5, 99.0)));
            }
        }
        _ => {}
    }
    if size {
        fields.push(format!("\"width\": {}, \"height\": {}", 1 + random.below(40), 1 + random.below(40)));
    }
    if random.one_in(3) {
        fields.push(format!("\"near\": {}", random.between(1e-6, 1.0)));
    }
    let mut vector = || DVec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(1.0, 2.0));
    let (eye, up) = (vector() * 3.0, vector());
    match random.below(3) {
        0 => {
            fields.push(format!("\"eye\": {}, \"target\": [0, 0, 0]", array(eye.to_array())));
            if random.one_in(2) && eye.normalize().cross(up.normalize()).length() > 0.01 {
                fields.push(format!("\"up\": {}", array(up.to_array())));
            }
        }
        which => {
            let turn = DMat3::from_rotation_x(eye.x) * DMat3::from_rotation_y(eye.y);
            let rows = (0..3).map(|row| array(turn.row(row).to_array().into_iter().chain([eye[row]])));
            let name = if which == 1 { "camera_to_world" } else { "world_to_camera" };
            fields.push(format!("\"{name}\": [{}, [0, 0, 0, 1]]", rows.collect::<Vec<_>>().join(", ")));
        }
    }
    for last in (1..fields.len()).rev() {
        fields.swap(last, random.below(last + 1));
    }
    let space = random.pick(&[", ", ",", ",\n    "]);
    (format!("{{ {} }}", fields.join(space)).into_bytes(), 0)
}

static SCENE: LazyLock<Scene> = LazyLock::new(|| {
    let samples: Vec<_> = sample(Shape::Sphere, 60).collect();
    let points = Points {
        positions: samples.iter().map(|s| s.position).collect(),
        normals: Some(samples.iter().map(|s| s.normal).collect()),
        radii: Some(samples.iter().map(|s| s.radius).collect()),
        ..Points::default()
    };
    build(vec![points], &()).unwrap().0
});

fn execute(path: &Path, valid: Option<usize>) -> Result<Outcome, String> {
    let file = match camera::read(path) {
        Ok(file) => file,
        Err(error) if valid.is_some() => return Err(format!("a valid file is refused: {error}")),
        Err(error) => return sentence(&error, Some(path)).map(|()| Outcome::Refused),
    };
    seen(file, valid)
}

/// Draws the view of a camera file.
pub fn seen(file: CameraFile, valid: Option<usize>) -> Result<Outcome, String> {
    let scene = &*SCENE;
    let near = file.near.unwrap_or_else(|| Camera::default_near(scene));
    let posed = file.size.map_or(Ok(()), |(width, height)| check_size(width, height)).and_then(|()| match file.pose {
        Pose::Rigid(rotation, eye) => Camera::posed(SIZE, file.lens, eye, rotation, near),
        Pose::LookAt(eye, target, up) => Camera::look_at(SIZE, file.lens, eye, target, up, scene.up, near),
    });
    match posed {
        Ok(camera) => draw(scene, &camera, &shaded(Shading::Lambert)),
        Err(error) if valid.is_some() => Err(format!("a valid camera is refused: {error}")),
        Err(error) => sentence(&error, None).map(|()| Outcome::Read),
    }
}
