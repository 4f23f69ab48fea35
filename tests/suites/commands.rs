//! The commands, the studies and the README. One program for many files of tests: what they share is compiled once, and so are kernels.

#[path = "../bench.rs"]
mod bench;
#[path = "../card.rs"]
mod card;
#[path = "../cases/main.rs"]
mod cases;
#[path = "../cli.rs"]
mod cli;
#[path = "../common/mod.rs"]
mod common;
#[path = "../readme.rs"]
mod readme;
#[path = "../report.rs"]
mod report;
