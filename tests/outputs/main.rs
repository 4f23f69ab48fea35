//! What a command writes: never over what it reads, whole or not at all whatever ends it, and no more than the machine has
//! room for.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../common/mod.rs"]
mod common;

mod limits;
mod rule;
mod second_hand;
#[cfg(unix)]
mod signals;
#[cfg(unix)]
mod strangers;
#[cfg(target_os = "linux")]
mod tried;
