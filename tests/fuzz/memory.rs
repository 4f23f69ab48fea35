//! How much memory the process has asked for.

/// Peak of the memory in use and of the address space, bytes; zeros where the system does not say.
#[derive(Clone, Copy, Debug, Default)]
pub struct Peak {
    pub resident: u64,
    pub reserved: u64,
}

/// More than any of the small inputs may take, in use or asked for. A chunk of a damaged LAZ file may be decoded into
/// 256 MiB before it turns out to be short; an allocator's arenas reserve address space for each thread.
pub fn bound() -> Peak {
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get() as u64);
    Peak { resident: 1 << 30, reserved: (2 << 30) + threads * (1 << 28) }
}

impl Peak {
    /// Up to now.
    pub fn now() -> Self {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let bytes = |name: &str| {
            let line = status.lines().find_map(|line| line.strip_prefix(name))?;
            Some(line.split_whitespace().next()?.parse::<u64>().ok()? << 10)
        };
        Self { resident: bytes("VmHWM:").unwrap_or(0), reserved: bytes("VmPeak:").unwrap_or(0) }
    }

    /// Whether less than the bound has come on top of `before`.
    pub fn within_bound_of(self, before: Self) -> bool {
        let bound = bound();
        self.resident.saturating_sub(before.resident) < bound.resident
            && self.reserved.saturating_sub(before.reserved) < bound.reserved
    }
}
