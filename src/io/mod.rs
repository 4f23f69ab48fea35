//! Files: one format each; every reader ends in [`Points`], every writer appears whole or not at all.

pub mod points;

pub use points::{Points, Up};
