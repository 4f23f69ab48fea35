//! The kernels: against their f64 twins, against each other, and as WGSL texts.
//! All in one test program, so that shared code and kernels are compiled once.

mod accumulators;
mod arithmetic;
mod branches;
#[path = "../common/mod.rs"]
mod common;
mod determinism;
mod double;
mod extremes;
mod imports;
mod index;
mod layout;
mod long_lists;
mod lowpass;
mod optimisations;
mod plans;
mod registers;
mod rounding;
mod shaders;
mod slots;
mod sources;
mod spread;
mod sums;
mod tiles;
mod twins;
