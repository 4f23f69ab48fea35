//! How much memory the process has requested.

/// Peaks of resident memory and of address space, bytes; zeros if the system does not report them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Peak {
    pub resident: u64,
    pub reserved: u64,
}

/// The limit on the growth of both peaks, which no small input may exceed.
///
/// A chunk of a damaged LAZ file may be decoded into 256 MiB before it proves too short. An
/// allocator's arenas reserve address space for each thread.
pub fn bound() -> Peak {
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get() as u64);
    Peak { resident: 1 << 30, reserved: (2 << 30) + threads * (1 << 28) }
}

impl Peak {
    /// The peak up to now.
    pub fn now() -> Self {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let bytes = |name: &str| {
            let line = status.lines().find_map(|line| line.strip_prefix(name))?;
            Some(line.split_whitespace().next()?.parse::<u64>().ok()? << 10)
        };
        Self { resident: bytes("VmHWM:").unwrap_or(0), reserved: bytes("VmPeak:").unwrap_or(0) }
    }

    /// Whether the growth since `before` is less than the limit.
    pub fn within_bound_of(self, before: Self) -> bool {
        let bound = bound();
        self.resident.saturating_sub(before.resident) < bound.resident
            && self.reserved.saturating_sub(before.reserved) < bound.reserved
    }
}
