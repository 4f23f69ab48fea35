//! Levels of detail. One program for many files of tests: what they share is compiled once, and so are kernels.

#[path = "../common/mod.rs"]
mod common;
#[path = "../cuts.rs"]
mod cuts;
#[path = "../fades.rs"]
mod fades;
#[path = "../lod.rs"]
mod lod;
#[path = "../octrees.rs"]
mod octrees;
#[path = "../parts.rs"]
mod parts;
