//! Levels of detail.
//! All in one test program, so that shared code and kernels are compiled once.

#[path = "../common/mod.rs"]
mod common;
mod cuts;
mod fades;
mod lod;
mod octrees;
mod parts;
#[cfg(feature = "http")]
mod tiles;
