//! Levels of detail: the files that `epsplat lod` writes, and the checks on such files.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use epsplat::io::{self, Points, ply};
use epsplat::low_level::scene::{Colors, Hierarchy, Scene};
use epsplat::low_level::surfels::{build, hierarchy};

fn epsplat(arguments: &[&str]) -> (i32, String, String) {
    let run = Command::new(env!("CARGO_BIN_EXE_epsplat")).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (run.status.code().unwrap(), text(run.stdout), text(run.stderr))
}

/// A path in a folder, as an argument.
fn path_in(folder: &tempfile::TempDir, name: &str) -> String {
    folder.path().join(name).to_str().unwrap().to_owned()
}

/// Writes a file of a sphere's surfels; returns its path and one for the file with levels of
/// detail.
fn spheres(folder: &tempfile::TempDir, count: &str) -> [String; 2] {
    let [surfels, levels] = ["sphere.ply", "levels.ply"].map(|name| path_in(folder, name));
    assert_eq!(epsplat(&["generate", "sphere", "--count", count, "-o", &surfels]).0, 0);
    [surfels, levels]
}

/// Points of a sphere far from the origin, with 8-bit or linear colours.
fn points(count: usize, linear: bool) -> Points {
    let scene = common::scenes::sphere(count, 1.5);
    let code = |k: usize| [k as u8, (k / 5) as u8, 90, 255];
    Points {
        positions: scene.surfels.iter().map(|surfel| surfel.center.map(|c| f64::from(c) + 1000.25)).collect(),
        normals: Some(scene.surfels.iter().map(|surfel| surfel.center).collect()),
        radii: Some(vec![scene.surfels[0].radius(); count]),
        colors: Some(match linear {
            true => Colors::Linear((0..count).map(|k| code(k).map(|c| 2.0 * f32::from(c))).collect()),
            false => Colors::Srgb8((0..count).map(code).collect()),
        }),
        ..Points::default()
    }
}

fn lod(points: Points) -> Scene {
    hierarchy::build(build(vec![points], &()).unwrap().0, &()).unwrap().0
}

/// A file keeps its tree. Files with dropped points, and several files together, are read as
/// clouds.
#[test]
fn a_file_keeps_levels_of_detail() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("levels.ply");
    for linear in [false, true] {
        let scene = lod(points(3000, linear));
        ply::write_scene(&path, &scene, None, &()).unwrap();
        let read = io::read(&path, &()).unwrap();
        assert_eq!(read.positions.len(), 3000);
        let (again, _) = build(vec![read], &()).unwrap();
        assert_eq!(again.surfels, scene.surfels);
        assert!(again.oriented && scene.oriented);
        let [made, kept] = [&scene, &again].map(|scene| scene.hierarchy.as_ref().unwrap());
        assert!(made.nodes == kept.nodes);
    }
    // Several files together, or a file with a dropped point, have no tree.
    let read = || io::read(&path, &()).unwrap();
    assert!(build(vec![read(), read()], &()).unwrap().0.hierarchy.is_none());
    let mut nearly = read();
    nearly.positions[5][1] = f64::NAN;
    assert!(build(vec![nearly], &()).unwrap().0.hierarchy.is_none());
}

#[test]
fn normals_without_a_side_stay_without_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("levels.ply");
    let scene = lod(Points { normals: None, radii: None, ..points(800, false) });
    assert!(!scene.oriented);
    ply::write_scene(&path, &scene, None, &()).unwrap();
    let (again, _) = build(vec![io::read(&path, &()).unwrap()], &()).unwrap();
    assert!(!again.oriented && again.hierarchy.is_some());
}

/// A file with an invalid tree is refused in one sentence.
#[test]
fn broken_trees_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("levels.ply");
    let whole = lod(points(500, false));
    let rejected = |change: &dyn Fn(&mut Hierarchy)| {
        let mut broken = whole.hierarchy.as_deref().unwrap().clone();
        change(&mut broken);
        let broken = Scene { hierarchy: Some(Arc::new(broken)), ..whole.clone() };
        ply::write_scene(&path, &broken, None, &()).unwrap();
        let (code, _, told) = epsplat(&["info", path.to_str().unwrap()]);
        assert_eq!(code, 1, "{told}");
        assert!(told.contains("levels.ply") && told.lines().count() == 1, "{told}");
        told
    };
    let nodes = &whole.hierarchy.as_ref().unwrap().nodes;
    let inner = nodes.iter().skip(1).position(|node| !node.leaf).unwrap() + 1;
    assert!(rejected(&|tree| tree.nodes[inner].first = 0).contains("children"));
    assert!(rejected(&|tree| tree.nodes[inner].first = u32::MAX).contains("children"));
    assert!(rejected(&|tree| tree.nodes[0].count = 200).contains("too many children"));
    assert!(rejected(&|tree| tree.nodes[inner].leaf = true).contains("node"));
    let last = nodes.len() - 1;
    assert!(rejected(&|tree| tree.nodes[last].count += 1).contains("points"));
    assert!(rejected(&|tree| tree.nodes[last].count = 0).contains("no children or points"));
    let told = rejected(&|tree| tree.nodes[3].surfel.center[0] = f32::INFINITY);
    assert!(told.contains("not finite"), "{told}");
    // Files truncated in the element `scene` and in the nodes.
    ply::write_scene(&path, &whole, None, &()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for (less, element) in [(40, "scene"), (400, "node")] {
        std::fs::write(&path, &bytes[..bytes.len() - less]).unwrap();
        let (code, _, told) = epsplat(&["info", path.to_str().unwrap()]);
        assert!(code == 1 && told.contains(element), "{told}");
    }
    std::fs::write(&path, &bytes).unwrap();
    let (code, text, _) = epsplat(&["info", path.to_str().unwrap()]);
    assert!(code == 0 && text.contains("nodes in"), "{text}");
}

#[test]
fn the_command_writes_what_it_says() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| path_in(&folder, name);
    let [surfels, levels] = spheres(&folder, "2000");
    let (code, text, told) = epsplat(&["lod", &surfels, "-o", &levels, "--json", "-"]);
    assert_eq!(code, 0, "{told}");
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    let read = io::read(Path::new(&levels), &()).unwrap();
    assert_eq!(report["surfels"], 2000);
    assert_eq!(report["nodes"], read.tree.unwrap().rows.len());
    // The order of the input surfels does not change the file.
    let mut turned = io::read(Path::new(&surfels), &()).unwrap();
    turned.positions.reverse();
    turned.normals.iter_mut().for_each(|all| all.reverse());
    turned.radii.iter_mut().for_each(|all| all.reverse());
    if let Some(Colors::Srgb8(codes)) = &mut turned.colors {
        codes.reverse();
    }
    ply::write_points(Path::new(&surfels), &turned, &()).unwrap();
    let again = path("again.ply");
    assert_eq!(epsplat(&["lod", &surfels, "-o", &again]).0, 0);
    assert!(std::fs::read(&levels).unwrap() == std::fs::read(&again).unwrap());
    let (code, _, told) = epsplat(&["lod", &surfels, "-o", &path("levels.txt")]);
    assert!(code == 2 && told.contains(".ply"), "{told}");
}

/// `--lod 0` draws the same bits as all surfels, with and without levels in the file.
///
/// A coarser cut has fewer surfels and a similar picture. Levels built on the fly equal those of
/// the file.
#[test]
fn a_cut_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| path_in(&folder, name);
    let [surfels, levels] = spheres(&folder, "20000");
    assert_eq!(epsplat(&["lod", &surfels, "-o", &levels]).0, 0);
    let draw = |file: &str, name: &str, more: &[&str]| {
        let output = path(name);
        let all = [&["render", file, "-o", &output, "--size", "160x160", "--backend", "reference"], more].concat();
        let (code, _, told) = epsplat(&all);
        assert_eq!(code, 0, "{told}");
        (image::open(&output).unwrap().to_rgba8(), told)
    };
    let flat = draw(&surfels, "flat.png", &[]).0;
    assert!(flat == draw(&levels, "all.png", &[]).0 && flat == draw(&levels, "zero.png", &["--lod", "0"]).0);
    // Everything is in view and every node is larger than this size, so the cut has all surfels.
    assert!(flat == draw(&levels, "finest.png", &["--lod", "0.000001px"]).0);
    let (coarse, told) = draw(&levels, "coarse.png", &["--lod", "80px"]);
    let drawn = |told: &str| -> u64 {
        let (_, rest) = told.split_once("of a cut of ").unwrap();
        assert!(rest.contains("in place of 20000 surfels"), "{told}");
        rest.split(' ').next().unwrap().parse().unwrap()
    };
    assert!(drawn(&told) < 15_000 && drawn(&told) > 500, "{told}");
    let squared = |other: &image::RgbaImage| {
        let off = flat.iter().zip(other.iter()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
        off.sum::<f64>() / flat.len() as f64
    };
    let psnr = |other: &image::RgbaImage| 10.0 * (255.0f64.powi(2) / squared(other)).log10();
    assert!(psnr(&coarse) > 30.0, "{}", psnr(&coarse));
    let (made, told) = draw(&surfels, "made.png", &["--lod", "80px"]);
    assert!(made == coarse && told.contains("epsplat lod"), "{told}");
    let (coarser, told) = draw(&levels, "coarser.png", &["--lod", "1%", "--lod-measure", "area"]);
    assert!(drawn(&told) < 2500 && psnr(&coarser) < psnr(&coarse), "{told}");
    for (arguments, words) in [
        (&["--lod", "4"][..], "a level of detail is 0"),
        (&["--lod", "1px", "--facing", "sphere"], "face the camera"),
        (&["--lod", "1px", "--separate", &surfels], "--separate"),
        (&["--lod", "1px", "--aov", "index"], "index"),
    ] {
        let output = path(if arguments.contains(&"--aov") { "refused.exr" } else { "refused.png" });
        let all = [&["render", &levels, "-o", &output, "--backend", "reference"], arguments].concat();
        let (code, _, told) = epsplat(&all);
        assert!(code == 2 && told.contains(words) && !Path::new(&output).exists(), "{arguments:?}: {told}");
    }
}

/// Seen from inside, cuts show the inside of a closed surface too. Seen from outside, culling back
/// faces leaves no holes at outlines.
#[test]
fn cuts_of_closed_scenes_are_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| path_in(&folder, name);
    let cube = concat!(env!("CARGO_MANIFEST_DIR"), "/data/cube.obj");
    let (surfels, levels) = (path("cube.ply"), path("levels.ply"));
    assert_eq!(epsplat(&["sample", cube, "-o", &surfels, "--count", "6000"]).0, 0);
    assert_eq!(epsplat(&["lod", &surfels, "-o", &levels]).0, 0);
    let draw = |view: &[&str], more: &[&str]| {
        let output = path("out.png");
        let all =
            [&["render", &levels, "-o", &output, "--size", "120x120", "--backend", "reference"], view, more].concat();
        let (code, _, told) = epsplat(&all);
        assert_eq!(code, 0, "{told}");
        image::open(&output).unwrap().to_rgba8()
    };
    let covered = |picture: &image::RgbaImage| picture.pixels().filter(|pixel| pixel.0[3] > 127).count();
    let inside = ["--eye", "0,0,0", "--target", "1,0.1,0"];
    assert_eq!(covered(&draw(&inside, &[])), 120 * 120);
    assert_eq!(covered(&draw(&inside, &["--lod", "1px"])), 120 * 120);
    let outside = ["--eye", "9,7,8", "--target", "0,0,0", "--fov", "20"];
    let [all, cut] = [&[][..], &["--lod", "40px"]].map(|lod| covered(&draw(&outside, lod)));
    assert!(all > 4000 && cut + 60 > all && cut < all + 400, "{all} {cut}");
}

/// With `--memory`, only the part of the file that the picture needs is read, and the picture is
/// the same. Options that exclude this are refused.
#[test]
fn memory_is_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| path_in(&folder, name);
    let [surfels, levels] = spheres(&folder, "20000");
    assert_eq!(epsplat(&["lod", &surfels, "-o", &levels]).0, 0);
    let view = ["--size", "90x90", "--backend", "reference", "--eye", "2,1,9", "--target", "0,0,0", "--json", "-"];
    let draw = |name: &str, more: &[&str]| {
        let output = path(name);
        let all = [&["render", &levels, "-o", &output], &view[..], more].concat();
        let (code, text, told) = epsplat(&all);
        assert_eq!(code, 0, "{told}");
        (image::open(&output).unwrap().to_rgba8(), serde_json::from_str::<serde_json::Value>(&text).unwrap())
    };
    let (whole, report) = draw("whole.png", &["--lod", "10px"]);
    assert!(report["read"].is_null());
    let (part, report) = draw("part.png", &["--lod", "10px", "--memory", "1GiB"]);
    assert!(whole == part && report["surfels"] == 20000, "{report}");
    let [taken, all] = [0, 1].map(|k| report["read"]["nodes"][k].as_u64().unwrap());
    assert!(taken > 100 && taken < all && report["read"]["points"][0].as_u64().unwrap() < 20000, "{report}");
    for (arguments, words) in [
        (&["--lod", "10px", "--memory", "324MiB"][..], "less than the 0."),
        (&["--lod", "0.0001px", "--memory", "330MiB"], "give --lod a larger size"),
        (&["--lod", "10px", "--memory", "2"], "not a size of memory"),
        (&["--lod", "0", "--memory", "2GiB"], "above 0"),
        (&["--memory", "2GiB"], "--lod"),
        (&["--lod", "10px", "--memory", "2GiB", "--outliers", "3"], "--outliers"),
        (&["--lod", "10px", "--memory", "2GiB", &surfels], "one file"),
    ] {
        let output = path("refused.png");
        let all =
            [&["render", &levels, "-o", &output, "--size", "300x300", "--backend", "reference"], arguments].concat();
        let (code, _, told) = epsplat(&all);
        assert!(code == 2 && told.contains(words) && !Path::new(&output).exists(), "{arguments:?}: {told}");
    }
    // If nothing is visible, the warning is about the whole scene.
    let away = ["--lod", "10px", "--memory", "1GiB", "--eye", "0,0,9", "--target", "0,0,12"];
    let output = path("away.png");
    let (code, _, told) = epsplat(&[&["render", &levels, "-o", &output, "--backend", "reference"], &away[..]].concat());
    assert!(code == 0 && told.contains("all lie behind the camera"), "{told}");
}

/// With `--memory`, points are sorted in temporary files and the result is the same. A folder of
/// tiles makes one tree. Options that exclude this are refused.
#[test]
fn trees_are_made_within_memory() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| path_in(&folder, name);
    let [surfels, levels] = spheres(&folder, "200000");
    let bounded = path("bounded.ply");
    assert_eq!(epsplat(&["lod", &surfels, "-o", &levels]).0, 0);
    // Memory for the threads, and for less than half of the points.
    let threads = std::thread::available_parallelism().unwrap().get();
    let memory = format!("{}MiB", 96 + 48 * threads + 15);
    let (code, text, told) = epsplat(&["lod", &surfels, "-o", &bounded, "--memory", &memory, "--json", "-"]);
    assert_eq!(code, 0, "{told}");
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(report["surfels"] == 200_000 && report["subtrees"].as_u64().unwrap() >= 8, "{report}");
    let same = || std::fs::read(&levels).unwrap() == std::fs::read(&bounded).unwrap();
    assert!(same());
    // Writes two tiles, and a file that is no tile, to one folder.
    let tiles = folder.path().join("tiles");
    std::fs::create_dir(&tiles).unwrap();
    let whole = io::read(Path::new(&surfels), &()).unwrap();
    let tile = |of: std::ops::Range<usize>| Points {
        positions: whole.positions[of.clone()].to_vec(),
        normals: whole.normals.as_ref().map(|all| all[of.clone()].to_vec()),
        radii: whole.radii.as_ref().map(|all| all[of.clone()].to_vec()),
        colors: match &whole.colors {
            Some(Colors::Srgb8(codes)) => Some(Colors::Srgb8(codes[of].to_vec())),
            _ => None,
        },
        ..whole.clone()
    };
    ply::write_points(&tiles.join("left.ply"), &tile(0..90_000), &()).unwrap();
    ply::write_points(&tiles.join("right.PLY"), &tile(90_000..200_000), &()).unwrap();
    std::fs::write(tiles.join("readme.txt"), "tiles").unwrap();
    let tiles = tiles.to_str().unwrap();
    for more in [&["--memory", &memory][..], &[]] {
        std::fs::remove_file(&bounded).unwrap();
        let (code, _, told) = epsplat(&[&["lod", tiles, "-o", &bounded], more].concat());
        assert!(code == 0 && same(), "{told}");
    }
    let empty = path("empty");
    std::fs::create_dir(&empty).unwrap();
    let bare = path("bare.ply");
    ply::write_points(Path::new(&bare), &Points { radii: None, ..tile(0..100) }, &()).unwrap();
    let refused = path("refused.ply");
    for (arguments, words) in [
        (&[&surfels[..], "--memory", "9MiB"][..], "take at least"),
        (&[&surfels, "--memory", "9"], "not a size of memory"),
        (&[&surfels, "--memory", "9GiB", "--cut", "0.1"], "--cut"),
        (&[&bare, "--memory", "9GiB"], "epsplat surfels"),
        (&[&levels, "--memory", "9GiB"], "epsplat surfels"),
        (&[&empty], "has no PLY"),
    ] {
        let (code, _, told) = epsplat(&[&["lod", "-o", &refused], arguments].concat());
        assert!(code == 2 && told.contains(words) && !Path::new(&refused).exists(), "{arguments:?}: {told}");
    }
    // The minimum that an error names is sufficient, whether or not the points were already read.
    for memory in ["1MiB".to_owned(), format!("{}MiB", 96 + 48 * threads + 10)] {
        let lod = |memory: &str| epsplat(&["lod", &surfels, "-o", &refused, "--memory", memory]);
        let (code, _, told) = lod(&memory);
        assert!(code == 2 && !Path::new(&refused).exists(), "{memory}: {told}");
        let least = told.split("less than the ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
        let (code, _, told) = lod(least);
        assert_eq!(code, 0, "{least}: {told}");
        assert!(std::fs::read(&refused).unwrap() == std::fs::read(&levels).unwrap());
        std::fs::remove_file(&refused).unwrap();
    }
}

/// Nodes at the camera plane and at outlines are always divided; a warning says if that exceeds the
/// requested number of splats.
#[test]
fn more_splats_than_asked_for_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let (bunny, output) = (concat!(env!("CARGO_MANIFEST_DIR"), "/data/bunny.obj"), path_in(&folder, "o.png"));
    for (splats, more) in [("1", true), ("20", true), ("3000", false)] {
        let line = ["render", bunny, "-o", &output, "--size", "48x48", "--backend", "reference", "--splats", splats];
        let (code, _, told) = epsplat(&line);
        assert_eq!((code, told.contains(&format!(" not the {splats} of --splats"))), (0, more), "{told}");
    }
}
