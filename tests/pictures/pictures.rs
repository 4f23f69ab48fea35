//! Default views, and the notes for pictures that show little.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::command::{DATA, Folder, succeeds, text};
use std::fs;
use std::process::Output;

fn said(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Renders with the reference at 64x48 pixels and returns the standard error.
fn render(folder: &Folder, arguments: &[&str]) -> String {
    let out = folder.path("x.png");
    said(&succeeds(
        &[&["render"], arguments, &["--backend", "reference", "--size", "64x48", "-o", text(&out)]].concat(),
    ))
}

#[test]
fn an_empty_picture_says_why() {
    let folder = Folder::new();
    let sphere = folder.path("sphere.ply");
    succeeds(&["generate", "sphere", "--count", "2000", "-o", text(&sphere)]);
    let at = |eye: &str, target: &str| render(&folder, &[text(&sphere), "--eye", eye, "--target", target]);
    let behind = at("0,0,5", "0,0,9");
    assert!(behind.contains("warning: nothing shows: of 2000 surfels all lie behind the camera"), "{behind}");
    let outside = at("0,0,-5", "9,0,-5.1");
    assert!(outside.contains("lie outside the image") || outside.contains("behind"), "{outside}");
    let small = at("0,0,100000", "0.01,0.01,0");
    assert!(small.contains("between the centres of its pixels"), "{small}");
    assert!(!at("0,0,5", "0,0,0").contains("nothing shows"));
    // For many pictures, one warning covers all empty ones.
    let away = "[[1,0,0,0],[0,1,0,0],[0,0,1,-5],[0,0,0,1]]";
    let seen = "[[1,0,0,0],[0,1,0,0],[0,0,1,5],[0,0,0,1]]";
    let frame = |name: &str, pose: &str| format!(r#"{{"file_path": "{name}", "transform_matrix": {pose}}}"#);
    let frames = [frame("a", seen), frame("b", away), frame("c", away)].join(",");
    let cameras = folder.path("transforms.json");
    fs::write(&cameras, format!(r#"{{"camera_angle_x": 0.7, "w": 32, "h": 32, "frames": [{frames}]}}"#)).unwrap();
    let views = folder.path("views");
    let arguments =
        ["render", text(&sphere), "--cameras", text(&cameras), "--backend", "reference", "-o", text(&views)];
    let many = said(&succeeds(&arguments));
    assert!(many.contains("b.png, the first of 2 empty pictures"), "{many}");
}

/// The number of border pixels that are not background.
fn cut(path: &std::path::Path) -> usize {
    let image = image::open(path).unwrap().to_rgba8();
    let (w, h) = image.dimensions();
    image.enumerate_pixels().filter(|(x, y, p)| (*x == 0 || *y == 0 || x + 1 == w || y + 1 == h) && p.0[3] > 0).count()
}

#[test]
fn the_border_cuts_no_disk_of_a_default_picture() {
    let folder = Folder::new();
    let tetrahedron = folder.path("t.obj");
    fs::write(&tetrahedron, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n").unwrap();
    let big = folder.path("big.ply");
    succeeds(&["generate", "torus", "--count", "60", "-o", text(&big)]);
    for input in [text(&tetrahedron), text(&big), &format!("{DATA}/cube.obj")] {
        render(&folder, &[input]);
        assert_eq!(cut(&folder.path("x.png")), 0, "{input}");
    }
    // Control: a view that cuts disks.
    render(&folder, &[text(&big), "--eye", "0,0,1.6", "--target", "0,0,0"]);
    assert!(cut(&folder.path("x.png")) > 0);
}

#[test]
fn a_stray_point_is_told_and_shrinks_neither_picture_nor_box() {
    let folder = Folder::new();
    let points: Vec<String> = (0..400)
        .map(|k| {
            let (z, angle) = (1.0 - (2.0 * f64::from(k) + 1.0) / 400.0, 2.399_963 * f64::from(k));
            let r = (1.0 - z * z).sqrt();
            format!("{} {} {}", 7e5 + 5.0 * r * angle.cos(), 6.26e6 + 5.0 * r * angle.sin(), 100.0 + 5.0 * z)
        })
        .collect();
    let file = |name: &str, strays: &[&str]| {
        let header = "ply\nformat ascii 1.0\nelement vertex ";
        let properties = "property double x\nproperty double y\nproperty double z\nend_header\n";
        let all = [&points.iter().map(String::as_str).collect::<Vec<_>>()[..], strays].concat();
        fs::write(folder.path(name), format!("{header}{}\n{properties}{}\n", all.len(), all.join("\n"))).unwrap();
        folder.path(name)
    };
    let (alone, strayed) = (file("alone.ply", &[]), file("strayed.ply", &["0 0 0", "0 0 0"]));
    let shown = |path: &std::path::Path| {
        let said = render(&folder, &[text(path)]);
        let image = image::open(folder.path("x.png")).unwrap().to_rgba8();
        (image.pixels().filter(|p| p.0[3] > 0).count(), said)
    };
    let ((expected, quiet), (found, told)) = (shown(&alone), shown(&strayed));
    assert!(found.abs_diff(expected) * 50 < expected, "{found} {expected}");
    assert!(told.contains("2 points stray") && !quiet.contains("stray"), "{told}");
    let info = succeeds(&["info", text(&strayed), "--json", "-"]);
    let info: serde_json::Value = serde_json::from_slice(&info.stdout).unwrap();
    assert_eq!(info["min"], serde_json::json!([0.0, 0.0, 0.0]));
    assert!(info["max"][1].as_f64().unwrap() > 6.26e6 + 4.9, "{info}");
}
