//! From files to surfels.
//! All in one test program, so that shared code and kernels are compiled once.

#[path = "../common/mod.rs"]
mod common;
mod coverage;
mod hybrid;
mod inputs;
mod sampling;
mod scans;
mod shares;
mod simplify;
mod strays;
mod truth;
