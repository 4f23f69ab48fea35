//! Outputs: they never overwrite inputs, are whole or absent however a run ends, and respect the
//! machine's limits.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../common/mod.rs"]
mod common;

mod formats;
mod limits;
mod maps;
mod rule;
mod second_hand;
#[cfg(unix)]
mod signals;
#[cfg(unix)]
mod strangers;
#[cfg(target_os = "linux")]
mod tried;
