//! COPC files with `--lod`: a picture reads only the nodes that it needs, and depends only on
//! camera and file.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::command::{DATA, Folder, fails, succeeds, text};
use std::path::{Path, PathBuf};

/// Centre (x, y) of the octree's root cube; its points lie near z = 500.
const CENTER: [f64; 2] = [637_937.7, 851_217.6];

fn file() -> String {
    Path::new(DATA).join("simple.copc.laz").to_str().unwrap().to_owned()
}

/// Renders the file and returns the report's field `read`.
fn read(output: &Path, more: &[&str]) -> serde_json::Value {
    let file = file();
    let run = succeeds(&[&["render", &file, "--size", "96x96", "--json", "-", "-o", text(output)], more].concat());
    let report: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    report["read"].clone()
}

/// A frame of a transforms.json that looks straight down at (x, y) from `height` above the points.
fn down(name: &str, [x, y]: [f64; 2], height: f64) -> String {
    let rows = [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, 500.0 + height], [0.0, 0.0, 0.0, 1.0]];
    format!(r#"{{"file_path": "{name}", "transform_matrix": {rows:?}}}"#)
}

/// Writes a transforms.json with frames of 96 x 96 pixels.
fn cameras(folder: &Folder, name: &str, frames: &[String]) -> PathBuf {
    let lens = r#""w": 96, "h": 96, "fl_x": 90, "fl_y": 90, "cx": 48, "cy": 48"#;
    folder.file(name, format!(r#"{{{lens}, "frames": [{}]}}"#, frames.join(", ")))
}

#[test]
fn a_picture_reads_what_it_takes() {
    let folder = Folder::new();
    let [all, fine, coarse] = ["all.png", "fine.png", "coarse.png"].map(|name| folder.path(name));
    assert_eq!(read(&all, &[]), serde_json::Value::Null);
    assert_eq!(read(&all, &["--lod", "0"]), serde_json::Value::Null);
    // A cut with all points equals the whole file, bit by bit.
    let whole = read(&fine, &["--lod", "0.01px"]);
    assert_eq!((&whole["points"], &whole["nodes"]), (&serde_json::json!([1065, 1065]), &serde_json::json!([65, 65])));
    assert_eq!(std::fs::read(&fine).unwrap(), std::fs::read(&all).unwrap());
    let some = read(&coarse, &["--lod", "30px"]);
    let parts = ["points", "nodes", "bytes"].map(|name| [0, 1].map(|at| some[name][at].as_u64().unwrap()));
    assert!(parts.iter().all(|[read, all]| *read > 0 && 2 * read < *all), "{some}");
    assert_ne!(std::fs::read(&coarse).unwrap(), std::fs::read(&all).unwrap());
    for most in [100, 300] {
        let some = read(&coarse, &["--splats", &most.to_string()]);
        assert!((most / 2..=most).contains(&some["points"][0].as_u64().unwrap()), "{some}");
    }
    // Together with another file, the COPC file is read whole, and levels are built.
    let bunny = Path::new(DATA).join("bunny.obj");
    let run = ["render", &file(), text(&bunny), "--lod", "30px", "--size", "32x32", "--json", "-", "-o", text(&coarse)];
    let report: serde_json::Value = serde_json::from_slice(&succeeds(&run).stdout).unwrap();
    assert!(report["read"].is_null() && report["cut"].as_u64().is_some(), "{report}");
}

#[test]
fn a_view_is_the_same_whatever_others_there_are() {
    let folder = Folder::new();
    let frames = [
        down("a", CENTER, 3000.0),
        down("b", [CENTER[0] - 1200.0, CENTER[1] - 1500.0], 700.0),
        down("c", [CENTER[0] + 300.0, CENTER[1] + 900.0], 1500.0),
    ];
    let render = |name: &str, frames: &[String]| {
        let (output, cameras) = (folder.path(name), cameras(&folder, &format!("{name}.json"), frames));
        let run = succeeds(&[
            "render",
            &file(),
            "--lod",
            "40px",
            "--cameras",
            text(&cameras),
            "--json",
            "-",
            "-o",
            text(&output),
        ]);
        let report: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
        let read: Vec<_> = report["views"].as_array().unwrap().iter().map(|view| view["read"].clone()).collect();
        (output, read)
    };
    let (together, read) = render("together", &frames);
    assert!(read.iter().all(|read| read["points"][0].as_u64().unwrap() < 1065), "{read:?}");
    assert!(read[0] != read[1] && read[1] != read[2], "{read:?}");
    for (frame, (name, read)) in frames.iter().zip(["a", "b", "c"].into_iter().zip(read)) {
        let (alone, own) = render("alone", std::slice::from_ref(frame));
        assert_eq!(own, [read]);
        let [one, other] =
            [alone, together.clone()].map(|folder| std::fs::read(folder.join(format!("{name}.png"))).unwrap());
        assert_eq!(one, other, "{name}");
    }
}

#[test]
fn a_view_of_nothing_is_told() {
    let folder = Folder::new();
    let [x, y] = CENTER;
    let (eye, target) = (format!("{x},{y},9000"), format!("{x},{y},20000"));
    let output = folder.path("a.png");
    let arguments =
        ["render", &file(), "--lod", "4px", "--eye", &eye, "--target", &target, "--up", "y", "-o", text(&output)];
    // The picture is empty, and a warning says why.
    let run = succeeds(&arguments);
    let said = String::from_utf8(run.stderr).unwrap();
    assert!(output.exists() && said.contains("behind"), "{said}");
    let damaged = folder.file("a.copc.laz", &std::fs::read(file()).unwrap()[..30_000]);
    fails(&["render", text(&damaged), "--lod", "4px", "-o", text(&output)], 1, &["a.copc.laz: a page of its octree"]);
}

/// With fewer points, disks are larger, but they still end near the border of the whole cloud.
#[test]
fn a_part_ends_where_the_cloud_does() {
    let folder = Folder::new();
    let cameras = cameras(&folder, "down.json", &[down("a", CENTER, 5000.0)]);
    // Sum of alpha outside the file's bounding box, which is at most 60 pixels wide and 83 high.
    let outside = |detail: &str| {
        let output = folder.path(detail);
        succeeds(&["render", &file(), "--lod", detail, "--cameras", text(&cameras), "-o", text(&output)]);
        let picture = image::open(output.join("a.png")).unwrap().to_rgba8();
        let is_inside = |x: u32, y: u32| (6..67).contains(&x) && (6..90).contains(&y);
        let alpha =
            |(x, y, pixel): (u32, u32, &image::Rgba<u8>)| if is_inside(x, y) { 0 } else { u64::from(pixel.0[3]) };
        picture.enumerate_pixels().map(alpha).sum::<u64>() as f64
    };
    // Disks that were not clipped would have three times as much alpha there.
    let [all, part] = ["0", "30px"].map(outside);
    assert!(all > 0.0 && part < 2.2 * all, "{all} {part}");
}
