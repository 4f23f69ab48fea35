//! Counts what the host asks of the device for a frame.

use std::cell::Cell;
use std::ops::{Add, Sub};

use serde::Serialize;

/// Requests of the host to the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Traffic {
    /// Submissions of commands.
    pub submits: u64,
    /// Times that the host waited until the device had finished.
    pub waits: u64,
    /// Dispatches of a kernel.
    pub dispatches: u64,
    /// Bind groups created.
    pub bind_groups: u64,
    /// Bytes that the host wrote to buffers.
    pub bytes_written: u64,
    /// Bytes that the host read from buffers.
    pub bytes_read: u64,
}

thread_local! {
    /// The traffic of this thread so far. A frame runs on one thread, so other threads that compile
    /// or draw do not count.
    static SO_FAR: Cell<Traffic> = const { Cell::new(Traffic::ZERO) };
}

impl Traffic {
    const ZERO: Self = Self { submits: 0, waits: 0, dispatches: 0, bind_groups: 0, bytes_written: 0, bytes_read: 0 };

    /// Returns the traffic of this thread so far.
    pub fn so_far() -> Self {
        SO_FAR.get()
    }

    /// Adds `more` to the traffic of this thread.
    pub(super) fn count(more: Self) {
        SO_FAR.set(SO_FAR.get() + more);
    }
}

impl Traffic {
    fn with(self, other: Self, by: impl Fn(u64, u64) -> u64) -> Self {
        Self {
            submits: by(self.submits, other.submits),
            waits: by(self.waits, other.waits),
            dispatches: by(self.dispatches, other.dispatches),
            bind_groups: by(self.bind_groups, other.bind_groups),
            bytes_written: by(self.bytes_written, other.bytes_written),
            bytes_read: by(self.bytes_read, other.bytes_read),
        }
    }
}

impl Add for Traffic {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
}

impl Sub for Traffic {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }
}
