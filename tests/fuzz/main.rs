//! Fuzzes the readers with valid files of random shape and with mutations of them.
//!
//! Each input is read, and if that succeeds, turned into surfels and drawn by the reference at 16 x
//! 16 pixels. For any bytes: nothing panics, hangs or allocates memory because a header promises
//! data; an error is one line that names the file; an unmodified file is read completely; an image
//! has no NaN.
//!
//! `EPSPLAT_FUZZ_SECONDS` is the time per format (default 2). Each input has its own seed, counted
//! up from a start that is printed. `EPSPLAT_FUZZ_SEED` sets that start: it repeats a run, or
//! begins with the input of a seed that a failure names.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod camera;
mod cameras;
mod colmap;
mod copc;
#[cfg(feature = "e57")]
mod e57;
#[cfg(feature = "e57")]
#[path = "../common/e57_page.rs"]
mod e57_page;
#[cfg(feature = "gltf")]
mod gltf;
mod las;
#[path = "../common/las_forms.rs"]
mod las_forms;
mod levels;
#[cfg(feature = "gltf")]
#[path = "../common/gltf_made.rs"]
mod made;
mod materials;
mod memory;
mod mutate;
#[path = "../common/random.rs"]
mod numbers;
mod obj;
mod packed;
#[cfg(feature = "pcd")]
mod pcd;
mod ply;
mod polygons;
mod random;
mod render;
mod session;
mod tables;
mod vpc;

use mutate::Grammar;
use random::Random;
use std::path::Path;

/// The outcome for an input that broke no promise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The reader refused it with a one-line error.
    Refused,
    /// It was read, but has nothing to draw, too much to draw here, or an impossible camera.
    Read,
    /// It was read and drawn.
    Drawn,
}

/// The reader of one format under test.
pub struct Target {
    /// The format's name, also used for its test.
    pub name: &'static str,
    /// File extension.
    pub extension: &'static str,
    /// Generates a valid file; returns it and its number of points.
    pub generate: fn(&mut Random) -> (Vec<u8>, usize),
    /// Hints on how to damage its files.
    pub grammar: Grammar,
    /// Reads the file and uses its content. With `valid`, the expected number of points, a refusal
    /// is an error.
    pub execute: fn(&Path, Option<usize>) -> Result<Outcome, String>,
}

#[test]
fn ply() {
    session::run(&ply::TARGET);
}

#[test]
fn las() {
    session::run(&las::TARGET);
}

#[test]
fn levels() {
    session::run(&levels::TARGET);
}

#[test]
fn packed() {
    session::run(&packed::TARGET);
}

#[test]
fn copc() {
    session::run(&copc::TARGET);
}

#[test]
fn materials() {
    session::run(&materials::TARGET);
}

#[test]
fn text() {
    session::run(&tables::TEXT);
}

#[test]
fn ptx() {
    session::run(&tables::PTX);
}

#[test]
fn stl() {
    session::run(&polygons::STL);
}

#[test]
fn off() {
    session::run(&polygons::OFF);
}

#[test]
fn obj() {
    session::run(&obj::TARGET);
}

#[test]
fn camera() {
    session::run(&camera::TARGET);
}

#[test]
fn cameras() {
    session::run(&cameras::TARGET);
}

#[test]
fn vpc() {
    session::run(&vpc::TARGET);
}

#[test]
fn colmap() {
    session::run(&colmap::TARGET);
}

#[cfg(feature = "gltf")]
#[test]
fn gltf() {
    session::run(&gltf::TEXT);
}

#[cfg(feature = "gltf")]
#[test]
fn glb() {
    session::run(&gltf::BINARY);
}

#[cfg(feature = "pcd")]
#[test]
fn pcd() {
    session::run(&pcd::TARGET);
}

#[cfg(feature = "e57")]
#[test]
fn e57() {
    session::run(&e57::TARGET);
}
