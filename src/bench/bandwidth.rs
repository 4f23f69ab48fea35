//! How fast a device copies its own memory: what the bytes per second of a pass are held against.

use std::time::Instant;

use serde::Serialize;

use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::timing::Timing;
use crate::report::Summary;

/// Seconds that a timed run takes, about: beside it, handing over the work and noticing its end are nothing.
const RUN: f64 = 0.1;

/// Copies of a timed run, at most.
const MOST_COPIES: f64 = 512.0;

/// Timestamps count if they say between so much of the host's time and so much: those of some drivers are taken before the work.
const TRUSTED: [f64; 2] = [0.5, 1.02];

/// Words of the copy that are compared with their source.
const COMPARED: u64 = 1024;

/// How fast a device copies from one buffer to another. Each byte counts twice, as it is read and written.
#[derive(Clone, Debug, Serialize)]
pub struct CopyBandwidth {
    /// Bytes of the buffer that is copied.
    pub buffer_bytes: u64,
    /// Copies of it in a timed run, one after the other.
    pub copies: u32,
    /// Timed runs.
    pub runs: u32,
    /// Bytes read and written, 10^9 a second.
    pub gb_per_second: Summary,
    /// The same by the host's clock, from the submission until the device is done.
    pub wall_gb_per_second: Summary,
    /// Whose clock the first are by: `timestamps` of the device, or `wall`.
    pub clock: &'static str,
}

impl CopyBandwidth {
    /// Measures it on `gpu` in `runs` runs, with a buffer of `bytes` or of as many as the adapter grants.
    ///
    /// # Errors
    /// Whatever a device may report, and a copy that differs from its source.
    pub fn measure(gpu: &Gpu, bytes: u64, runs: u32) -> Result<Self> {
        let pair = Pair::new(gpu, bytes.min(gpu.buffer_limit()) / 4)?;
        // The first touches the memory, the second tells how long one takes.
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

/// The seconds by the `device`'s clock, if it has one and they can be.
fn trusted(wall: f64, device: Option<f64>) -> Option<f64> {
    device.filter(|device| (TRUSTED[0] * wall..=TRUSTED[1] * wall).contains(device))
}

/// A buffer and its copy.
struct Pair {
    from: Buffer<u32>,
    into: Buffer<u32>,
}

impl Pair {
    /// Of so many words, no two next to each other the same: what is 0 all over may be kept in less room.
    fn new(gpu: &Gpu, words: u64) -> Result<Self> {
        let (from, into) = (Buffer::storage(gpu, "copied", words)?, Buffer::storage(gpu, "copy", words)?);
        from.write(gpu, words as usize, |range| range.map(scrambled).collect(), &())?;
        Ok(Self { from, into })
    }

    /// Seconds that so many copies take: by the host's clock, and by the device's.
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

    /// Fails if the start of the copy is not that of its source.
    fn compare(&self, gpu: &Gpu) -> Result<()> {
        let same = self.into.read(gpu, COMPARED)?.into_iter().enumerate().all(|(index, word)| word == scrambled(index));
        if same { Ok(()) } else { Err(gpu.error("a buffer that was copied differs from its source")) }
    }
}

/// The word of a buffer at `index`: a step of the golden ratio.
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
        // A buffer that is larger than the adapter grants is as large as it grants.
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
