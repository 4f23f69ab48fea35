//! Benchmark studies: what each speed costs in error, measured on scenes and configurations that a TOML file lists.
//!
//! [`Definition`] is such a file, [`run`] renders it, [`report::write`](crate::report::write) makes files of the outcome
//! and [`table`] text. [`card`] is one run of all that shows what an adapter does.

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
