//! From files to surfels. One program for many files of tests: what they share is compiled once, and so are kernels.

#[path = "../common/mod.rs"]
mod common;
#[path = "../coverage.rs"]
mod coverage;
#[path = "../hybrid.rs"]
mod hybrid;
#[path = "../inputs.rs"]
mod inputs;
#[path = "../sampling.rs"]
mod sampling;
#[path = "../scans.rs"]
mod scans;
#[path = "../simplify.rs"]
mod simplify;
#[path = "../strays.rs"]
mod strays;
#[path = "../truth.rs"]
mod truth;
