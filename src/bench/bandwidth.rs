//! Measures the copy bandwidth of a device, the yardstick for the bytes per second of a pass.

use std::time::Instant;

use serde::Serialize;

use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::timing::Timing;
use crate::report::Summary;

/// Target duration of a timed run, seconds: long enough that submission and waiting are negligible.
const RUN: f64 = 0.1;

/// The largest number of copies in a timed run.
const MOST_COPIES: f64 = 512.0;

/// Device times are used if they are within these multiples of the host's time: the timestamps of
/// some drivers are taken before the work is done.
const TRUSTED: [f64; 2] = [0.5, 1.02];

/// Number of words, from the start, in which the copy is compared with its source.
const COMPARED: u64 = 1024;

/// Bandwidth of copies from one buffer to another. Each byte counts twice: read and written.
#[derive(Clone, Debug, Serialize)]
pub struct CopyBandwidth {
    /// Size of the buffer that is copied, bytes.
    pub buffer_bytes: u64,
    /// Copies in a timed run, one after the other.
    pub copies: u32,
    /// Number of timed runs.
    pub runs: u32,
    /// Bytes read and written per second, in GB/s (10^9 bytes), by [`clock`](Self::clock).
    pub gb_per_second: Summary,
    /// The same bandwidth by the host's clock, from submission until the device is idle.
    pub wall_gb_per_second: Summary,
    /// The clock of `gb_per_second`: `timestamps` (of the device) or `wall`.
    pub clock: &'static str,
}

impl CopyBandwidth {
    /// Measures `gpu` in `runs` runs on a buffer of `bytes` bytes, or of the adapter's buffer limit
    /// if that is smaller.
    ///
    /// # Errors
    /// Any error of the device, and a copy that differs from its source.
    pub fn measure(gpu: &Gpu, bytes: u64, runs: u32) -> Result<Self> {
        let pair = Pair::new(gpu, bytes.min(gpu.buffer_limit()) / 4)?;
        // The first copy touches the memory, the second gives the time per copy.
        pair.copy(gpu, 1)?;
        let (once, _) = pair.copy(gpu, 1)?;
        let copies = (RUN / once.max(1e-9)).clamp(1.0, MOST_COPIES) as u32;
        let mut times = Vec::new();
        for _ in 0..runs.max(1) {
            times.push(pair.copy(gpu, copies)?);
        }
        pair.compare(gpu)?;
        let buffer_bytes = pair.from.bytes();
        let moved = 2.0 * buffer_bytes as f64 * f64::from(copies);
        let speed = |seconds: f64| moved * 1e-9 / seconds.max(1e-9);
        let summary = |speeds: &[f64]| Summary::of(speeds).unwrap_or_default();
        let wall_gb_per_second = summary(&times.iter().map(|(wall, _)| speed(*wall)).collect::<Vec<_>>());
        let by_device: Option<Vec<f64>> =
            times.iter().map(|&(wall, device)| trusted(wall, device).map(speed)).collect();
        let (gb_per_second, clock) = match by_device {
            Some(speeds) => (summary(&speeds), "timestamps"),
            None => (wall_gb_per_second, "wall"),
        };
        Ok(Self { buffer_bytes, copies, runs: runs.max(1), gb_per_second, wall_gb_per_second, clock })
    }
}

/// Returns the `device` time if it is plausible beside the `wall` time, both in seconds.
fn trusted(wall: f64, device: Option<f64>) -> Option<f64> {
    device.filter(|device| (TRUSTED[0] * wall..=TRUSTED[1] * wall).contains(device))
}

/// A buffer and the buffer that it is copied to.
struct Pair {
    from: Buffer<u32>,
    into: Buffer<u32>,
}

impl Pair {
    /// Creates two buffers of `words` words and fills the first.
    ///
    /// Neighbouring words differ, as a device may compress a buffer of zeros.
    fn new(gpu: &Gpu, words: u64) -> Result<Self> {
        let (from, into) = (Buffer::storage(gpu, "copied", words)?, Buffer::storage(gpu, "copy", words)?);
        from.write(gpu, words as usize, |range| range.map(scrambled).collect(), &())?;
        Ok(Self { from, into })
    }

    /// Makes `copies` copies and returns the seconds by the host's clock and by the device's.
    fn copy(&self, gpu: &Gpu, copies: u32) -> Result<(f64, Option<f64>)> {
        let mut timing = Timing::new(gpu);
        let start = Instant::now();
        timing.around(gpu, "copy", |encoder| {
            for _ in 0..copies {
                encoder.copy_buffer_to_buffer(&self.from.raw, 0, &self.into.raw, 0, self.from.bytes());
            }
        })?;
        timing.flush(gpu)?;
        gpu.wait()?;
        let wall = start.elapsed().as_secs_f64();
        let on_device = timing.on_device();
        let ms = timing.finish(gpu)?.get("copy").copied();
        Ok((wall, ms.filter(|_| on_device).map(|ms| 1e-3 * ms)))
    }

    /// Fails if the first [`COMPARED`] words of the copy differ from the source.
    fn compare(&self, gpu: &Gpu) -> Result<()> {
        let same = self.into.read(gpu, COMPARED)?.into_iter().enumerate().all(|(index, word)| word == scrambled(index));
        if same { Ok(()) } else { Err(gpu.error("a buffer that was copied differs from its source")) }
    }
}

/// The test pattern: `index` times 2^32 over the golden ratio, modulo 2^32.
fn scrambled(index: usize) -> u32 {
    (index as u32).wrapping_mul(0x9e37_79b9)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic)]
mod tests {
    use super::*;

    #[test]
    fn a_device_copies_its_memory_at_some_speed() {
        let required = std::env::var("EPSPLAT_REQUIRE_ADAPTER").is_ok_and(|value| value == "1");
        let gpu = match Gpu::open(None) {
            Ok(gpu) => gpu,
            Err(error) if required => panic!("an adapter is required, but {error}"),
            Err(_) => return,
        };
        let found = CopyBandwidth::measure(&gpu, 4 << 20, 3).unwrap();
        assert_eq!((found.buffer_bytes, found.runs), (4 << 20, 3));
        for speed in [found.gb_per_second, found.wall_gb_per_second] {
            assert!(speed.min > 0.0 && speed.max < 1e5, "{found:?}");
        }
        // A buffer above the adapter's limit is shrunk to the limit.
        let small = gpu.with_buffer_limit(1 << 20);
        assert_eq!(CopyBandwidth::measure(&small, 4 << 20, 1).unwrap().buffer_bytes, 1 << 20);
    }

    #[test]
    fn a_copy_that_was_not_made_is_noticed() {
        let Ok(gpu) = Gpu::open(None) else { return };
        let pair = Pair::new(&gpu, 4096).unwrap();
        assert!(pair.compare(&gpu).is_err());
        pair.copy(&gpu, 1).unwrap();
        pair.compare(&gpu).unwrap();
    }

    #[test]
    fn timestamps_that_cannot_be_do_not_count() {
        assert_eq!(trusted(1.0, Some(0.97)), Some(0.97));
        for device in [None, Some(0.0), Some(0.3), Some(1.5), Some(f64::NAN)] {
            assert_eq!(trusted(1.0, device), None, "{device:?}");
        }
    }
}
