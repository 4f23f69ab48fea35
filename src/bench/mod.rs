//! Benchmark studies: speed and error of the configurations and scenes listed in a TOML file.
//!
//! A [`Definition`] is such a file. [`run`] renders it, [`report::write`](crate::report::write)
//! writes the outcome as files, and [`table`] formats it as text. [`card`] runs accuracy,
//! determinism, throughput and studies on one adapter.

pub mod bandwidth;
pub mod card;
mod case;
pub mod config;
pub mod definition;
mod in_part;
mod judge;
pub mod machine;
mod reading;
mod runner;
mod staging;
pub mod table;
mod view;

pub use definition::Definition;
pub use runner::{Outcome, run};
