//! The kernels: against their f64 twins, against each other, and as texts. One program for many files of tests: what they share is compiled once, and so are kernels.

#[path = "../accumulators.rs"]
mod accumulators;
#[path = "../common/mod.rs"]
mod common;
#[path = "../determinism.rs"]
mod determinism;
#[path = "../double.rs"]
mod double;
#[path = "../extremes.rs"]
mod extremes;
#[path = "../index.rs"]
mod index;
#[path = "../layout/main.rs"]
mod layout;
#[path = "../long_lists.rs"]
mod long_lists;
#[path = "../lowpass.rs"]
mod lowpass;
#[path = "../optimisations.rs"]
mod optimisations;
#[path = "../plans.rs"]
mod plans;
#[path = "../rounding.rs"]
mod rounding;
#[path = "../shaders.rs"]
mod shaders;
#[path = "../slots.rs"]
mod slots;
#[path = "../sources.rs"]
mod sources;
#[path = "../sums.rs"]
mod sums;
#[path = "../tiles.rs"]
mod tiles;
#[path = "../twins.rs"]
mod twins;
