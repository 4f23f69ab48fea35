#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use glam::Vec3;

use super::*;
use crate::io::{self, Input, Up, ply};
use crate::random::Random;
use crate::scene::{Cap, Clip, Colors, Surfel};
use crate::surfels::{build, hierarchy};

/// Disks on a sphere around `center`, with 8-bit colours.
fn sphere(count: usize, center: [f64; 3], radius: f64) -> Points {
    let mut random = Random::stream(count as u64, 0);
    let mut direction = || Vec3::from_array(std::array::from_fn(|_| random.number() as f32 - 0.5)).normalize();
    let normals: Vec<Vec3> = (0..count).map(|_| direction()).collect();
    let place = |normal: &Vec3| [0, 1, 2].map(|k| center[k] + radius * f64::from(normal[k]));
    let size = (radius * 3.0 / (count as f64).sqrt()) as f32;
    Points {
        positions: normals.iter().map(place).collect(),
        normals: Some(normals.iter().map(Vec3::to_array).collect()),
        radii: Some((0..count).map(|k| size * (1.0 + 0.1 * (k % 5) as f32)).collect()),
        colors: Some(Colors::Srgb8((0..count).map(|k| [k as u8, (k / 3) as u8, 200, 255]).collect())),
        ..Points::default()
    }
}

/// Ellipses on a sphere. Some have a clip line, a cap or a shading normal.
fn ellipses(count: usize) -> Points {
    let points = sphere(count, [6.1e6, -2.5, 40.25], 3.0);
    let normals = points.normals.clone().unwrap();
    let axes = |normal: &[f32; 3]| {
        let surfel = Surfel::disk(Vec3::ZERO, Vec3::from_array(*normal), 0.2);
        [surfel.s, surfel.t.map(|c| 0.5 * c)]
    };
    let clip = |k: usize| if k.is_multiple_of(4) { Clip([[0.0, 1.0, 0.25], [0.0; 3]]) } else { Clip::NONE };
    let turned =
        |(k, [x, y, z]): (usize, &[f32; 3])| if k.is_multiple_of(3) { [*x, *y, z + 0.3] } else { [*x, *y, *z] };
    Points {
        axes: Some(normals.iter().map(axes).collect()),
        radii: None,
        clips: Some((0..count).map(clip).collect()),
        caps: Some((0..count).map(|k| Cap([-0.002 * (k % 3) as f32, 0.001, 0.0])).collect()),
        normals: Some(normals.iter().enumerate().map(turned).collect()),
        colors: Some(Colors::Linear((0..count).map(|k| [0.01 * k as f32, 0.5, 7.0, 0.25]).collect())),
        unsided: true,
        ..points
    }
}

/// The points of `one`, followed by those of `other` without the attributes that `one` lacks.
fn and(mut one: Points, other: &Points) -> Points {
    one.positions.extend(&other.positions);
    one.normals.iter_mut().for_each(|all| all.extend(other.normals.iter().flatten()));
    one.radii.iter_mut().for_each(|all| all.extend(other.radii.iter().flatten()));
    if let (Some(Colors::Srgb8(all)), Some(Colors::Srgb8(own))) = (&mut one.colors, &other.colors) {
        all.extend(own);
    }
    one
}

fn files(folder: &Path, inputs: &[Points]) -> Vec<PathBuf> {
    let write = |(k, points): (usize, &Points)| {
        let path = folder.join(format!("{k}.ply"));
        ply::write_points(&path, points, &()).unwrap();
        path
    };
    inputs.iter().enumerate().map(write).collect()
}

fn rows(paths: &[PathBuf]) -> Vec<Rows> {
    paths.iter().map(|path| Rows::open(Input::open(path, None).unwrap(), false).unwrap().unwrap()).collect()
}

/// The report of writing levels if `fits` points fit in memory.
fn made_of(files: &[Rows], fits: u64, path: &Path) -> Result<Report> {
    let sources = Sources { files, progress: &(), among: None };
    let survey = Survey::of(&sources)?;
    let folder = path.parent().unwrap();
    made(&sources, Runs { survey: &survey, folder, path, progress: &() }, (fits, 100))
}

/// Scenes with all features that surfels may have, at large and small coordinates, in one file and
/// in several.
fn scenes() -> Vec<(&'static str, Vec<Points>)> {
    let plain = || sphere(3000, [0.0; 3], 1.0);
    let stray = sphere(3, [3e9, 1.0, 0.0], 0.5);
    let bird = sphere(2, [9.0, 0.5, 0.0], 0.01);
    let mut unusable = and(plain(), &bird);
    (unusable.positions[7][1], unusable.positions[90][0]) = (f64::NAN, 1e30);
    unusable.closed = true;
    let none = Points { positions: vec![[f64::NAN; 3]; 3000], ..plain() };
    let one = Colors::Srgb8(vec![[9, 8, 7, 255]; 3000]);
    let mut clear = plain();
    if let Some(Colors::Srgb8(codes)) = &mut clear.colors {
        codes[1500][3] = 17;
    }
    let clusters = and(sphere(2500, [0.0; 3], 1e-3), &sphere(2500, [5e4, 5e4, 0.0], 1e-3));
    let nested = (0..5).map(|k| sphere(400, [1e-3f64.powi(k); 3], 1e-3f64.powi(k)));
    let mut many = plain();
    many.positions[..40].fill([0.1, 0.2, 0.3]);
    vec![
        ("plain", vec![plain()]),
        ("closed", vec![Points { closed: true, up: Some(Up::Z), ..plain() }]),
        ("at world coordinates", vec![sphere(2500, [4.5e5, 6.2e6, 80.5], 30.0)]),
        ("flat", vec![Points { colors: None, ..plain() }]),
        ("of one colour", vec![Points { colors: Some(one), ..plain() }]),
        ("with alpha", vec![clear]),
        ("ellipses", vec![ellipses(2000)]),
        ("mixed", vec![ellipses(900), Points { colors: None, ..sphere(900, [6.1e6, 0.0, 40.0], 2.0) }]),
        ("several", vec![plain(), Points { up: Some(Up::Z), ..sphere(2000, [4.0, 0.0, 1.0], 0.5) }, stray.clone()]),
        ("with strays", vec![and(plain(), &stray)]),
        ("unusable", vec![unusable]),
        ("closed beside none", vec![Points { closed: true, ..plain() }, none]),
        ("clusters", vec![clusters]),
        ("nested", vec![nested.reduce(|one, other| and(one, &other)).unwrap()]),
        ("with equal ones", vec![many]),
    ]
}

/// However few points fit in memory, the file is the one that is built in memory, and no other file
/// is left.
#[test]
fn files_are_those_that_are_made_in_memory() {
    for (name, inputs) in scenes() {
        let folder = tempfile::tempdir().unwrap();
        let paths = files(folder.path(), &inputs);
        let [plain, path] = ["plain.ply", "levels.ply"].map(|name| folder.path().join(name));
        let read = paths.iter().map(|path| io::read(path, &()).unwrap()).collect();
        let (scene, preparation) = build(read, &()).unwrap();
        let (scene, tree) = hierarchy::build(scene, &()).unwrap();
        ply::write_scene(&plain, &scene, None, &()).unwrap();
        let expected = std::fs::read(&plain).unwrap();
        let mut subtrees = Vec::new();
        for fits in [10_000, 900, 130, 41] {
            let report = made_of(&rows(&paths), fits, &path).unwrap();
            assert!(std::fs::read(&path).unwrap() == expected, "{name}, {fits}");
            assert_eq!((report.surfels, report.nodes), (scene.surfels.len() as u64, tree.nodes.len() as u64));
            assert_eq!(report.levels, tree.levels() as u64);
            let told = |all: &Preparation| {
                (all.points, all.dropped_non_finite, all.strays, all.replaced_colors, all.rounding.map(f64::to_bits))
            };
            assert_eq!(told(&report.preparation), told(&preparation), "{name}");
            subtrees.push(report.subtrees);
        }
        assert!(subtrees[0] == 1 && subtrees[1] > 2 && subtrees.is_sorted() && subtrees[3] > 60, "{name} {subtrees:?}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), paths.len() + 2);
        // By one thread, with the files in another order.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let turned: Vec<PathBuf> = paths.iter().rev().cloned().collect();
        pool.install(|| made_of(&rows(&turned), 300, &path).unwrap());
        assert!(std::fs::read(&path).unwrap() == expected, "{name}, turned");
    }
}

/// Inputs that cannot be built end in a one-line error, and leave no file.
#[test]
fn what_cannot_be_made_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("levels.ply");
    let told = |points: Points, fits: u64| {
        let paths = files(folder.path(), &[points]);
        let told = made_of(&rows(&paths), fits, &path).unwrap_err().to_string();
        assert!(!path.exists() && told.lines().count() == 1, "{told}");
        told
    };
    let mut equal = sphere(500, [0.0; 3], 1.0);
    equal.positions[..300].fill([0.1, 0.2, 0.3]);
    assert!(told(equal, 200).contains("300 points are too near"));
    let mut lacking = sphere(500, [0.0; 3], 1.0);
    lacking.radii.as_mut().unwrap()[70] = 0.0;
    assert!(told(lacking.clone(), 200).contains("epsplat surfels"));
    lacking.positions.iter_mut().for_each(|place| place[2] = f64::INFINITY);
    assert!(told(lacking, 200).contains("finite"));
    let mut tiny = sphere(500, [0.0; 3], 1.0);
    tiny.radii.as_mut().unwrap()[70] = 1e-30;
    assert!(told(tiny, 200).contains("half-axes"));
    let mut huge = sphere(500, [0.0; 3], 1.0);
    huge.radii.as_mut().unwrap()[70] = 1e9;
    assert!(told(huge, 200).contains("million times"));
    let files = rows(&files(folder.path(), &[sphere(500, [0.0; 3], 1.0)]));
    let little = write_levels(&files, 1 << 20, (&path, folder.path()), &()).unwrap_err().to_string();
    assert!(little.contains("takes at least") || little.contains("take at least"), "{little}");
}

/// Files that cannot be read in pieces, or whose pieces do not hold all attributes of a point.
#[test]
fn other_files_are_no_rows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("some.ply");
    let is_rows = || Rows::open(Input::open(&path, None).unwrap(), false).unwrap().is_some();
    let points = sphere(40, [0.0; 3], 1.0);
    ply::write_points(&path, &points, &()).unwrap();
    assert!(is_rows());
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
    let short = Rows::open(Input::open(&path, None).unwrap(), false).err().unwrap().to_string();
    assert!(short.contains("promises 40 vertices, the file ends after 39"), "{short}");
    for other in [
        Points { radii: None, ..points.clone() },
        Points { normals: None, ..points.clone() },
        Points { texture: Some(vec![[0.5; 2]; 40]), ..points.clone() },
        Points { beside: Some("mesh.obj".into()), ..points.clone() },
    ] {
        ply::write_points(&path, &other, &()).unwrap();
        assert!(!is_rows());
    }
    std::fs::write(&path, "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float radius\nend_header\n0 0 0 0 0 1 1\n").unwrap();
    assert!(!is_rows());
    let (scene, _) = build(vec![points], &()).unwrap();
    ply::write_scene(&path, &hierarchy::build(scene, &()).unwrap().0, None, &()).unwrap();
    assert!(!is_rows());
}
