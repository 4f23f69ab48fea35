//! The commands, the studies and the README.
//! One program: shared code and kernels are compiled once.

mod bench;
mod card;
mod cases;
mod cli;
#[path = "../common/mod.rs"]
mod common;
mod readme;
mod report;
