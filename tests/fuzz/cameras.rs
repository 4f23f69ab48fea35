//! Fuzzes sets of cameras in a transforms.json.

use super::camera::{array, seen};
use super::mutate::Grammar;
use super::random::Random;
use super::session::sentence;
use super::{Outcome, Target};
use epsplat::io::cameras;
use glam::{DMat3, DVec3};
use std::path::Path;

pub const TARGET: Target = Target {
    name: "cameras",
    extension: "json",
    generate,
    grammar: Grammar {
        words: &[
            "null",
            "[]",
            "{}",
            "\"\"",
            "[[[[[[[[",
            "\"frames\":",
            "\"file_path\":",
            "\"../../../a\",",
            "\"/\",",
            "\"a\\nb\",",
            "\"transform_matrix\":",
            "\"camera_angle_x\":",
            "\"fl_x\":",
            "\"w\":",
            "\"h\":",
            "\"k1\":",
            "\"camera_model\":",
            "\"OPENCV\",",
            "\"is_fisheye\":true,",
            "1e-320",
            "1e308",
            "4294967296",
            "-",
            "\\u0007",
            "\u{85}",
        ],
        separators: b",:[]{}",
        text: 1 << 12,
        numbers: |_| Vec::new(),
    },
    execute,
};

/// A valid file of one to four cameras. It holds no points, so the returned count is ignored.
fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    let lens = |random: &mut Random| match random.below(3) {
        0 => format!("\"camera_angle_x\": {}, ", random.between(0.1, 3.0)),
        1 => format!(
            "\"w\": {}, \"h\": 16.0, \"fl_x\": {}, \"cx\": 8, ",
            1 + random.below(40),
            random.between(0.5, 99.0)
        ),
        _ => format!("\"camera_angle_y\": 1, \"camera_model\": \"PINHOLE\", \"k1\": {}, ", random.below(2)),
    };
    let frames: Vec<_> = (0..1 + random.below(4))
        .map(|number| {
            let mut vector =
                || DVec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(1.0, 2.0));
            let (turn, eye) = (vector(), vector() * 3.0);
            let turn = DMat3::from_rotation_x(turn.x) * DMat3::from_rotation_y(turn.y);
            let rows = (0..3).map(|row| array(turn.row(row).to_array().into_iter().chain([eye[row]])));
            let rows = rows.collect::<Vec<_>>().join(", ");
            let own = if random.one_in(3) { lens(random) } else { String::new() };
            let name =
                if random.one_in(8) { String::new() } else { format!("\"file_path\": \"./set/{number}.png\", ") };
            format!("{{{own}{name}\"transform_matrix\": [{rows}, [0, 0, 0, 1]]}}")
        })
        .collect();
    let shared = lens(random);
    (format!("{{{shared}\"frames\": [{}]}}", frames.join(",\n  ")).into_bytes(), 0)
}

fn execute(path: &Path, valid: Option<usize>) -> Result<Outcome, String> {
    read(path, path, valid)
}

/// Reads the set of cameras at `set` and draws its views; `file` is the file that errors name.
pub fn read(set: &Path, file: &Path, valid: Option<usize>) -> Result<Outcome, String> {
    let set = match cameras::read(set, (16, 16)) {
        Ok(set) => set,
        Err(error) if valid.is_some() => return Err(format!("a valid file is refused: {error}")),
        Err(error) => return sentence(&error, Some(file)).map(|()| Outcome::Refused),
    };
    let mut names = std::collections::HashSet::new();
    for camera in &set {
        let leaves = camera.name.split('/').any(|part| matches!(part, "" | "." | ".."));
        if leaves || camera.name.contains(char::is_control) || !names.insert(&camera.name) {
            return Err(format!("a picture would have the file name {:?}", camera.name));
        }
    }
    let outcomes = set.into_iter().map(|camera| seen(camera.camera, valid)).collect::<Result<Vec<_>, _>>()?;
    outcomes.first().copied().ok_or("a set holds no camera".into())
}
