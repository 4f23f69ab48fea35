//! Measures the copy bandwidth of a device: that of kernels, which is the yardstick for the bytes
//! per second of a pass, and that of the device's copy commands.
//!
//! A copy command may run on a unit of its own (a copy engine), which need not be as fast as the
//! kernels are. On one NVIDIA H200 it reached 849 GB/s, where memory is several times as fast.

use std::time::{Duration, Instant};

use serde::Serialize;

use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::timing::Timing;
use crate::report::Summary;

/// Target duration of a timed run, seconds: long enough that submission and waiting are negligible.
const RUN: f64 = 0.1;

/// Duration of the copies before the timed runs, in which a card raises its clock.
const WARM_UP: Duration = Duration::from_millis(200);

/// The largest number of copies in a timed run.
const MOST_COPIES: f64 = 512.0;

/// Device times are used if they are within these multiples of the host's time: the timestamps of
/// some drivers are taken before the work is done.
const TRUSTED: [f64; 2] = [0.5, 1.02];

/// Number of words, at the start and at the end, in which the copy is compared with its source.
const COMPARED: u64 = 1024;

/// The kernel that copies 16 bytes an invocation.
const KERNEL: &str = include_str!("copy.wgsl");

/// Invocations of a workgroup of the kernel.
const WORKGROUP: u64 = 256;

/// Workgroups in a row of the kernel's grid.
const ROW: u64 = 1 << 14;

/// Bytes that an invocation of the kernel copies.
const VECTOR: u64 = 16;

/// The unit of a device that copies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Copier {
    /// A compute kernel, `copy.wgsl`.
    Kernel,
    /// The command that copies buffers.
    Command,
}

/// Bandwidth of copies from one buffer to another. Each byte counts twice: read and written.
#[derive(Clone, Debug, Serialize)]
pub struct CopyBandwidth {
    /// The unit that copies.
    pub by: Copier,
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
    pub fn measure(gpu: &Gpu, by: Copier, bytes: u64, runs: u32) -> Result<Self> {
        let pair = Pair::new(gpu, by, bytes.min(gpu.buffer_limit()) / VECTOR * VECTOR / 4)?;
        // The first copies touch the memory and raise the clock, the next gives the time per copy.
        pair.warm_up(gpu)?;
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
        Ok(Self { by, buffer_bytes, copies, runs: runs.max(1), gb_per_second, wall_gb_per_second, clock })
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
    /// The kernel with both buffers bound; `None` if the command copies.
    kernel: Option<(wgpu::ComputePipeline, wgpu::BindGroup)>,
}

impl Pair {
    /// Creates two buffers of `words` words and fills the first.
    ///
    /// Neighbouring words differ, as a device may compress a buffer of zeros.
    fn new(gpu: &Gpu, by: Copier, words: u64) -> Result<Self> {
        let (from, into) = (Buffer::storage(gpu, "copied", words)?, Buffer::storage(gpu, "copy", words)?);
        from.write(gpu, words as usize, |range| range.map(scrambled).collect(), &())?;
        let kernel = (by == Copier::Kernel).then(|| kernel(gpu, &from, &into));
        gpu.check()?;
        Ok(Self { from, into, kernel })
    }

    /// Copies for [`WARM_UP`].
    fn warm_up(&self, gpu: &Gpu) -> Result<()> {
        let start = Instant::now();
        while start.elapsed() < WARM_UP {
            self.copy(gpu, 1)?;
        }
        Ok(())
    }

    /// Makes `copies` copies and returns the seconds by the host's clock and by the device's.
    fn copy(&self, gpu: &Gpu, copies: u32) -> Result<(f64, Option<f64>)> {
        let mut timing = Timing::new(gpu);
        let start = Instant::now();
        match &self.kernel {
            Some((pipeline, group)) => timing.pass(
                gpu,
                "copy",
                |_| {},
                |pass| {
                    pass.set_pipeline(pipeline);
                    pass.set_bind_group(0, group, &[]);
                    let groups = (self.from.bytes() / VECTOR).div_ceil(WORKGROUP);
                    let [across, down] = [groups.min(ROW), groups.div_ceil(ROW)].map(|count| count as u32);
                    (0..copies).for_each(|_| pass.dispatch_workgroups(across, down, 1));
                    Ok(())
                },
            )?,
            None => timing.around(gpu, "copy", |encoder| {
                for _ in 0..copies {
                    encoder.copy_buffer_to_buffer(&self.from.raw, 0, &self.into.raw, 0, self.from.bytes());
                }
            })?,
        }
        timing.flush(gpu)?;
        gpu.wait()?;
        let wall = start.elapsed().as_secs_f64();
        let on_device = timing.on_device();
        let ms = timing.finish(gpu)?.get("copy").copied();
        Ok((wall, ms.filter(|_| on_device).map(|ms| 1e-3 * ms)))
    }

    /// Fails if the first or last [`COMPARED`] words of the copy differ from the source.
    fn compare(&self, gpu: &Gpu) -> Result<()> {
        let (all, compared) = (self.into.len, COMPARED.min(self.into.len));
        let ends = Buffer::<u32>::storage(gpu, "ends of a copy", 2 * compared)?;
        let mut encoder = gpu.encoder();
        for (first, place) in [(0, 0), (all - compared, compared)] {
            encoder.copy_buffer_to_buffer(&self.into.raw, 4 * first, &ends.raw, 4 * place, 4 * compared);
        }
        gpu.submit(encoder);
        let indices = (0..compared).chain(all - compared..all);
        let same =
            ends.read(gpu, 2 * compared)?.into_iter().zip(indices).all(|(word, k)| word == scrambled(k as usize));
        if same { Ok(()) } else { Err(gpu.error("a buffer that was copied differs from its source")) }
    }
}

/// Compiles the kernel and binds both buffers.
fn kernel(gpu: &Gpu, from: &Buffer<u32>, into: &Buffer<u32>) -> (wgpu::ComputePipeline, wgpu::BindGroup) {
    let source = wgpu::ShaderSource::Wgsl(KERNEL.into());
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("copy"), source });
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("copy"),
        layout: None,
        module: &module,
        entry_point: None,
        compilation_options: Default::default(),
        cache: None,
    });
    let entry =
        |binding| wgpu::BindGroupEntry { binding, resource: if binding == 0 { from.bound() } else { into.bound() } };
    let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("copy"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[0, 1].map(entry),
    });
    (pipeline, group)
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
        for by in [Copier::Kernel, Copier::Command] {
            let found = CopyBandwidth::measure(&gpu, by, 4 << 20, 3).unwrap();
            assert_eq!((found.by, found.buffer_bytes, found.runs), (by, 4 << 20, 3));
            for speed in [found.gb_per_second, found.wall_gb_per_second] {
                assert!(speed.min > 0.0 && speed.max < 1e5, "{found:?}");
            }
        }
        // A buffer above the adapter's limit is shrunk to the limit.
        let small = gpu.with_buffer_limit(1 << 20);
        assert_eq!(CopyBandwidth::measure(&small, Copier::Kernel, 4 << 20, 1).unwrap().buffer_bytes, 1 << 20);
    }

    #[test]
    fn a_copy_that_was_not_made_is_noticed() {
        let Ok(gpu) = Gpu::open(None) else { return };
        for by in [Copier::Kernel, Copier::Command] {
            let pair = Pair::new(&gpu, by, 4096).unwrap();
            assert!(pair.compare(&gpu).is_err());
            pair.copy(&gpu, 1).unwrap();
            pair.compare(&gpu).unwrap();
        }
    }

    #[test]
    fn timestamps_that_cannot_be_do_not_count() {
        assert_eq!(trusted(1.0, Some(0.97)), Some(0.97));
        for device in [None, Some(0.0), Some(0.3), Some(1.5), Some(f64::NAN)] {
            assert_eq!(trusted(1.0, device), None, "{device:?}");
        }
    }
}
