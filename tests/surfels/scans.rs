//! Scans in `epsplat render`: the up direction, the report of the view, limits of radii, and the
//! removal of outliers.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::command::{DATA, Folder, fails, ply, succeeds, text};

/// The line that reports the chosen view.
fn view(output: &std::process::Output) -> String {
    let stderr = String::from_utf8(output.stderr.clone()).unwrap();
    let lines: Vec<_> = stderr.lines().filter(|line| line.starts_with("view: ")).collect();
    assert!(lines.len() <= 1, "{stderr}");
    lines.first().map_or(String::new(), |line| (*line).to_owned())
}

#[test]
fn the_view_that_was_chosen_is_told_in_words_that_give_it_again() {
    let folder = Folder::new();
    let small = ["--size", "48x36", "--backend", "reference"];
    let draw = |input: &str, name: &str, more: &[&str]| {
        let image = folder.path(name);
        let output = succeeds(&[&["render", input, "-o", text(&image)], &small[..], more].concat());
        (view(&output), std::fs::read(image).unwrap())
    };
    let bunny = format!("{DATA}/bunny.obj");
    for (up, why) in [
        (None, "(as the file or its format says)"),
        (Some("-z"), "(as asked for)"),
        (Some("1,2,-0.5"), "(as asked for)"),
    ] {
        let more: Vec<_> = up.into_iter().flat_map(|up| ["--up", up]).collect();
        let (told, picture) = draw(&bunny, "chosen.png", &more);
        assert!(told.ends_with(why) && told.contains(&format!("--up {} (", up.unwrap_or("y"))), "{told}");
        let words: Vec<_> = told["view: ".len()..told.find(" (").unwrap()].split(' ').collect();
        let (again, same) = draw(&bunny, "again.png", &words);
        let given = again.replace("(as asked for)", why);
        assert!(given == told && same == picture, "{told} {again}");
    }
    // The control: another up direction gives another picture, and names of axes mean their
    // vectors.
    let of = |up: &str| draw(&bunny, "up.png", &["--up", up]).1;
    assert!(of("z") != of("y") && of("z") == of("0,0,1") && of("-x") == of("-1,0,0"));
    assert!(of("y") == draw(&bunny, "default.png", &[]).1);
    for (up, words) in [("w", "none of x, y, z"), ("0,0,0", "up is zero")] {
        fails(&["render", &bunny, "-o", text(&folder.path("x.png")), "--up", up], 2, &[words]);
    }
    let rows: String = (0..400).map(|i| format!("{} {} 0\n", i % 20, i / 20)).collect();
    let flat = folder.file("flat.ply", ply("x y z", 400, &rows));
    assert!(draw(text(&flat), "flat.png", &[]).0.ends_with("--up z (a guess, as the points lie flat)"));
    let json = folder.path("view.json");
    draw(text(&flat), "flat.png", &["--json", text(&json)]);
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    assert_eq!((&report["view"]["up"], report["width"].as_u64()), (&serde_json::json!([0.0, 0.0, 1.0]), Some(48)));
}

/// A view straight down is rotated by a tiny component across up: a warning names the up direction
/// that puts north at the top.
#[test]
fn a_top_view_that_is_turned_is_told() {
    let folder = Folder::new();
    let rows: String = (0..400).map(|i| format!("{} {} 0\n", i % 20, i / 20)).collect();
    let flat = folder.file("flat.ply", ply("x y z", 400, &rows));
    let image = folder.path("view.png");
    let told = |target: &str, up: &[&str]| {
        let view = ["--eye", "10,10,50", "--target", target, "--size", "48x36", "--backend", "reference"];
        let output = succeeds(&[&["render", text(&flat), "-o", text(&image)], &view[..], up].concat());
        String::from_utf8(output.stderr).unwrap()
    };
    // The view direction is 0.5 degrees off the vertical, toward (sin 40, cos 40).
    let turned = told("10.257,10.306,0", &["--up", "z"]);
    assert!(
        turned.contains("warning: the view is only 0.5 degrees off") && turned.contains("north (+y) is 40 degrees"),
        "{turned}"
    );
    assert!(turned.contains("view: --eye 10,10,50 --target 10.257,10.306,0 --up z (as asked for)"), "{turned}");
    // The scene's own up direction gives the same warning. There is none for a view straight down,
    // from the side or with north up.
    assert!(told("10.257,10.306,0", &[]).contains("is 40 degrees from its top"));
    for (target, up) in [("10,10,0", &[][..]), ("30,10,0", &["--up", "z"]), ("10.257,10.306,0", &["--up", "y"])] {
        let told = told(target, up);
        assert!(!told.contains("warning: the view"), "{told}");
    }
}

#[test]
fn up_stays_what_it_was_in_what_is_written() {
    let folder = Folder::new();
    let made = folder.path("made.ply");
    let drawn = |input: &str| {
        let image = folder.path("view.png");
        // The image is large enough that no disk is clipped, which would move the camera away.
        view(&succeeds(&["render", input, "-o", text(&image), "--size", "640x640", "--backend", "reference"]))
    };
    let up = || epsplat::io::read(&made, &()).unwrap().up.unwrap().name();
    // The cloud is as tall as wide, so the guess would be y without the PLY comment `up z`.
    let rows: String = (0..1000).map(|i| format!("{} {} {}\n", i % 10, i / 10 % 10, i / 100)).collect();
    let tall = folder.file("tall.ply", ply("x y z", 1000, &rows).replace("end_header", "comment up z\nend_header"));
    for command in [&["surfels"][..], &["surfels", "--size", "ellipse"], &["simplify", "--tolerance", "rel:0.1"]] {
        succeeds(&[command, &[text(&tall), "-o", text(&made)]].concat());
        assert_eq!(up(), "z", "{command:?}");
    }
    // The control: without the comment the scene is tipped over.
    let unsaid = folder.file("unsaid.ply", ply("x y z", 1000, &rows));
    assert!(drawn(text(&unsaid)).ends_with("--up y (a guess)"));
    // A scan and the surfels made from it have the same camera.
    let scan = format!("{DATA}/autzen.laz");
    succeeds(&["surfels", &scan, "-o", text(&made)]);
    let (scan, surfels) = (drawn(&scan), drawn(text(&made)));
    assert!(scan == surfels && scan.ends_with("--up z (as the file or its format says)"), "{scan} {surfels}");
    // OBJ files have y up, even if flat.
    let floor = folder.file("floor.obj", "v 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n");
    succeeds(&["sample", text(&floor), "-o", text(&made), "--count", "500"]);
    assert_eq!(up(), "y");
    for (shape, expected) in [("sphere", "y"), ("torus", "z"), ("plane", "z"), ("checkerboard", "z")] {
        succeeds(&["generate", shape, "--count", "300", "-o", text(&made)]);
        assert_eq!(up(), expected, "{shape}");
    }
}

#[test]
fn render_limits_radii_and_drops_outliers_as_surfels_does() {
    let folder = Folder::new();
    let image = folder.path("i.png");
    let rows: String = (0..900).map(|i| format!("{} {} {}\n", i % 30, i / 30, (i % 7) as f64 * 0.01)).collect();
    let cloud = folder.file("cloud.ply", ply("x y z", 902, &(rows + "15 15 9\n40 15 0\n")));
    let told = |more: &[&str]| {
        let small = ["--size", "32x32", "--backend", "reference"];
        let output = succeeds(&[&["render", text(&cloud), "-o", text(&image)], &small[..], more].concat());
        String::from_utf8(output.stderr).unwrap()
    };
    let limited = "larger surfels than their neighbours allow";
    assert!(told(&[]).contains(limited) && !told(&["--max-radius", "inf"]).contains(limited));
    assert!(told(&["--outliers", "5"]).contains("2 points were dropped: they lie too far from their neighbours"));
    let refuses = |more: &[&str], words: &[&str]| {
        fails(&[&["render", text(&cloud), "-o", text(&image)], more].concat(), 2, words);
    };
    refuses(&["--max-radius", "0.5"], &["at least 1"]);
    refuses(&["--outliers=-1"], &["not negative"]);
}
