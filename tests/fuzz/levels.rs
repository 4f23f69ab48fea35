//! Fuzzes files with levels of detail as `epsplat lod` writes them: curved and clipped surfels
//! under nodes, read whole and in parts.

use std::path::Path;

use epsplat::io::ply::{self, Levels};
use epsplat::io::{Input, Points};
use epsplat::low_level::plan::Settings;
use epsplat::low_level::render::taken;
use epsplat::low_level::scene::{Camera, Colors, Detail, Lens, Shading};
use epsplat::low_level::surfels::{build, hierarchy};

use super::mutate::Grammar;
use super::random::{Place, Random};
use super::session::sentence;
use super::{Outcome, Target, render};

pub const TARGET: Target = Target {
    name: "levels",
    extension: "ply",
    generate,
    grammar: Grammar {
        words: &[
            "element node",
            "element vertex",
            "comment epsplat",
            "binary_little_endian",
            "first",
            "count",
            "leaf",
            "cap_uu",
            "cap_vv",
            "clip1_u",
            "clip2_w",
            "\nproperty float cap_uv\n",
            "\nproperty uint first\n",
            "\nelement node 4294967295\n",
            "\nend_header\n",
            "nan",
            "inf",
        ],
        separators: b"",
        text: 1 << 11,
        numbers: |_| Vec::new(),
    },
    execute,
};

/// A tree over a cloud, either on a bent sheet or anywhere in space.
fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    let count = 24 + random.below(120);
    let place = [Place::Unit, Place::Survey][random.below(2)];
    let bent = random.one_in(2);
    let mut position = || {
        let [x, y, z] = place.point(random);
        if bent { [x, y, z * 0.01 + 0.3 * (x * x - y * y).clamp(-1.0, 1.0)] } else { [x, y, z] }
    };
    let positions: Vec<[f64; 3]> = (0..count).map(|_| position()).collect();
    let code = |random: &mut Random| [random.bits() as u8, random.bits() as u8, 9, 255];
    let colors = random.one_in(2).then(|| Colors::Srgb8((0..count).map(|_| code(random)).collect()));
    let normals = random.one_in(3).then(|| vec![[0.0, 0.6, 0.8]; count]);
    let points = Points { positions, colors, normals, ..Points::default() };
    let (scene, _) = build(vec![points], &()).unwrap();
    let (scene, _) = hierarchy::build(scene, &()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("levels.ply");
    ply::write_scene(&path, &scene, None, &()).unwrap();
    (std::fs::read(&path).unwrap(), count)
}

/// Reads and draws the whole file, then only the part that a coarse picture needs.
fn execute(path: &Path, valid: Option<usize>) -> Result<Outcome, String> {
    let whole = render::points(path, valid)?;
    let levels = match Input::open(path, None).and_then(Levels::open) {
        Ok(levels) => levels,
        Err(error) => return sentence(&error, Some(path)).map(|()| whole),
    };
    let Some(levels) = levels else {
        return if valid.is_some() { Err("a valid file is not read in parts".into()) } else { Ok(whole) };
    };
    let box_ = &levels.whole;
    let Ok(camera) = Camera::look_at(
        render::SIZE,
        Lens::Fov(60.0),
        box_.origin + glam::DVec3::new(0.1, 0.2, 4.0),
        box_.origin,
        None,
        epsplat::low_level::scene::Up::Y,
        1e-3,
    ) else {
        return Ok(whole);
    };
    let options = Settings { detail: Detail::Pixels(3.0), ..render::shaded(Shading::Unlit) };
    match taken(&levels, &[(&camera, &options)], |_| Ok(()), &()) {
        Ok((scene, _)) if scene.surfels.len() < 2000 => render::draw(&scene, &camera, &options),
        Ok(_) => Ok(whole),
        Err(error) if valid.is_some() => Err(format!("a valid file is refused in parts: {error}")),
        Err(error) => sentence(&error, Some(path)).map(|()| Outcome::Refused),
    }
}
