//! Files as strangers' programs write them, that were once drawn wrong or refused for the wrong
//! reason: each a small one that stands for its kind, with the right value. Files of other formats
//! and types of each kind are made in `tests/readers`.
//!
//! Two meshes far from each other, one of these kinds, are in `tests/pictures/far.rs`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod pictures;
mod values;

use std::path::PathBuf;

use crate::common::command::{Folder, epsplat, succeeds, text};
use serde_json::Value;

/// One of the files.
fn case(name: &str) -> String {
    format!("{}/tests/commands/cases/files/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// The outcome of `epsplat info` on a file, with these options.
fn info(path: &str, options: &[&str]) -> Value {
    serde_json::from_slice(&succeeds(&[&["info", path, "--json", "-"], options].concat()).stdout).unwrap()
}

/// All that `epsplat info` tells people of a file.
fn told(path: &str) -> String {
    String::from_utf8(succeeds(&["info", path]).stdout).unwrap()
}

/// The picture of these arguments of `epsplat render`, without light: sRGB codes and alphas, row by
/// row; and what it told.
fn drawn(folder: &Folder, arguments: &[&str]) -> (image::RgbaImage, String) {
    let path: PathBuf = folder.path("drawn.png");
    let fixed = ["--shading", "unlit", "-o", text(&path)];
    let output = epsplat(&[&["render"], arguments, &fixed].concat());
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{arguments:?}: {told}");
    (image::open(&path).unwrap().to_rgba8(), told)
}

/// The codes of the pixels that the picture covers wholly.
fn covered(image: &image::RgbaImage) -> Vec<[u8; 3]> {
    let opaque = image.pixels().filter(|pixel| pixel.0[3] == 255);
    opaque.map(|pixel| [pixel.0[0], pixel.0[1], pixel.0[2]]).collect()
}
