//! Counts what the kernels do: atomic operations, and the invocations that take part in each call.
//!
//! The counts compare kernels without a card. They change a little with the number of threads where
//! the order of a list does.

use std::collections::BTreeMap;

/// The invocations that a card runs in step. NVIDIA's and AMD's cards have 32.
const SUBGROUP: usize = 32;

/// The calls of a function.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Calls {
    /// The number of invocations that called it.
    pub lanes: u64,
    /// The number of invocations in the subgroups of 32 that called it, whether they took part or
    /// waited.
    pub slots: u64,
}

impl Calls {
    /// Returns the share of the invocations that took part.
    pub fn at_work(self) -> f64 {
        self.lanes as f64 / self.slots.max(1) as f64
    }
}

/// The counts of one kernel.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct KernelTally {
    /// The number of atomic operations on each storage buffer, by its name in WGSL.
    pub atomics: BTreeMap<String, u64>,
    /// The calls of each function, by its name in WGSL.
    pub calls: BTreeMap<String, Calls>,
}

impl KernelTally {
    /// Counts a call by the invocations of a workgroup in `mask`.
    pub(super) fn called(&mut self, function: &str, mask: &[bool]) {
        let calls = self.calls.entry(function.to_owned()).or_default();
        for subgroup in mask.chunks(SUBGROUP) {
            let lanes = subgroup.iter().filter(|on| **on).count();
            calls.lanes += lanes as u64;
            calls.slots += if lanes > 0 { subgroup.len() as u64 } else { 0 };
        }
    }

    /// Returns the sum of both.
    pub(super) fn and(mut self, other: Self) -> Self {
        for (name, count) in other.atomics {
            *self.atomics.entry(name).or_default() += count;
        }
        for (name, more) in other.calls {
            let calls = self.calls.entry(name).or_default();
            calls.lanes += more.lanes;
            calls.slots += more.slots;
        }
        self
    }
}

/// The counts of all kernels, by their names.
pub type Tally = BTreeMap<String, KernelTally>;
