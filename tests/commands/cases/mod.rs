//! Small files, as other programs write them, that epsplat once drew wrong or refused for the wrong
//! reason.
//!
//! Each stands for its kind and is tested for the right value. `tests/readers` generates the other
//! formats and types of each kind, and `tests/pictures/far.rs` tests two meshes far from each
//! other.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod pictures;
mod values;

use std::path::PathBuf;

use crate::common::command::{Folder, epsplat, succeeds, text};
use serde_json::Value;

/// Path of one of the files.
fn case(name: &str) -> String {
    format!("{}/tests/commands/cases/files/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// JSON output of `epsplat info` on a file, with these options.
fn info(path: &str, options: &[&str]) -> Value {
    serde_json::from_slice(&succeeds(&[&["info", path, "--json", "-"], options].concat()).stdout).unwrap()
}

/// The text that `epsplat info` prints for a file.
fn told(path: &str) -> String {
    String::from_utf8(succeeds(&["info", path]).stdout).unwrap()
}

/// Renders unlit with these arguments; returns the image (sRGB codes and alpha) and stderr.
fn drawn(folder: &Folder, arguments: &[&str]) -> (image::RgbaImage, String) {
    let path: PathBuf = folder.path("drawn.png");
    let fixed = ["--shading", "unlit", "-o", text(&path)];
    let output = epsplat(&[&["render"], arguments, &fixed].concat());
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{arguments:?}: {told}");
    (image::open(&path).unwrap().to_rgba8(), told)
}

/// The codes of the fully opaque pixels.
fn covered(image: &image::RgbaImage) -> Vec<[u8; 3]> {
    let opaque = image.pixels().filter(|pixel| pixel.0[3] == 255);
    opaque.map(|pixel| [pixel.0[0], pixel.0[1], pixel.0[2]]).collect()
}
