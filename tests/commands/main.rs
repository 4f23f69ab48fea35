//! The commands, the studies and the README.
//! All in one test program, so that shared code and kernels are compiled once.

mod attributes;
mod bench;
mod card;
mod cases;
mod cli;
#[path = "../common/mod.rs"]
mod common;
mod examples;
#[cfg(feature = "gltf")]
mod gltf;
mod machines;
mod mpi;
mod own_kernel;
mod prose;
mod readme;
mod release;
mod report;
mod rooms;
mod stored;
