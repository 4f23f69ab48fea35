//! The readers on valid files of random shape and on what mutation makes of them.
//!
//! Every input is read; what can be read goes on to surfels and a reference image of 16 x 16 pixels. Whatever the bytes:
//! nothing panics, hangs or takes memory that a header promised; an error is one line that names the file; a file left
//! as it was generated is read whole; an image holds no NaN.
//!
//! `EPSPLAT_FUZZ_SECONDS` is the time per format (2 if unset). Each input has a seed of its own, counted up from a start
//! that is printed: `EPSPLAT_FUZZ_SEED` repeats a run, or with the seed that a failure names that one input first.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod camera;
mod cameras;
mod copc;
#[cfg(feature = "e57")]
mod e57;
#[cfg(feature = "e57")]
#[path = "../common/e57_page.rs"]
mod e57_page;
mod las;
#[path = "../common/las_forms.rs"]
mod las_forms;
mod levels;
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
mod random;
mod render;
mod session;

use mutate::Grammar;
use random::Random;
use std::path::Path;

/// What became of an input that broke no promise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Its reader refused it, in one line.
    Refused,
    /// It was read, but holds nothing to draw or more than is worth drawing here, or is a camera that cannot be.
    Read,
    /// It was read and drawn.
    Drawn,
}

/// One format's reader under test.
pub struct Target {
    /// The format's name, also of its test.
    pub name: &'static str,
    /// Extension of the files.
    pub extension: &'static str,
    /// A valid file, and how many points it holds.
    pub generate: fn(&mut Random) -> (Vec<u8>, usize),
    /// How its files are best damaged.
    pub grammar: Grammar,
    /// Reads the file and uses what it holds. With `valid`, the number of points to be found, refusing is an error.
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
