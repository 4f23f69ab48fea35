//! The pace of frames: a warm-up until their time settles, frames that the caller waits for, and
//! frames in flight.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::render::{Backend, Renderer, Report, Target};
use crate::scene::{Camera, Scene};

/// The renderer of a card's frames.
pub(super) type OfScene<'s, 'b> = Renderer<&'s Scene, &'b Backend>;

/// Frames of each half of the window in which times are compared.
const WINDOW: usize = 10;

/// The mean frame time is settled if it differs by at most this fraction between both halves.
const SETTLED: f64 = 0.03;

/// Untimed frames before the frames that are timed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WarmUp {
    /// Number of frames.
    pub frames: usize,
    /// Their duration, seconds, without the first frame, which compiles the kernels.
    pub seconds: f64,
    /// Whether the frame time settled within the limits of the warm-up.
    pub settled: bool,
}

/// The limits of a warm-up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// The fewest frames. The second frame has buffers of the sizes that the first measured.
    pub fewest: usize,
    /// The most frames.
    pub frames: usize,
    /// The time after which no frame is started.
    pub time: Duration,
}

/// Renders frames until the clock is up and their time settles, within `limits`.
pub(super) fn warm_up(renderer: &mut OfScene<'_, '_>, camera: &Camera, limits: Limits) -> Result<WarmUp> {
    renderer.frame(camera, &())?;
    let (start, mut times) = (Instant::now(), Vec::new());
    loop {
        times.push(waited(renderer, camera)?.ms);
        let (frames, spent) = (times.len() + 1, start.elapsed());
        // A frame time that has settled may still be that of a low clock, so half the time passes.
        let settled = settled(&times) && 2 * spent >= limits.time;
        let ended = settled || frames >= limits.frames || spent >= limits.time;
        if ended && frames >= limits.fewest {
            return Ok(WarmUp { frames, seconds: spent.as_secs_f64(), settled });
        }
    }
}

/// Whether the mean of the last [`WINDOW`] times is that of as many before.
fn settled(times: &[f64]) -> bool {
    let Some(first) = times.len().checked_sub(2 * WINDOW) else { return false };
    let (before, after) = times[first..].split_at(WINDOW);
    let [before, after] = [before, after].map(|times| times.iter().sum::<f64>());
    (after - before).abs() <= SETTLED * before
}

/// A frame that the caller waited for.
pub(super) struct Waited {
    /// The frame in host memory.
    pub frame: Frame,
    /// Its report.
    pub report: Report,
    /// Milliseconds from the call until the caller has the frame's last byte.
    pub ms: f64,
}

/// Renders a frame and waits for it.
pub(super) fn waited(renderer: &mut OfScene<'_, '_>, camera: &Camera) -> Result<Waited> {
    let start = Instant::now();
    let (frame, report) = renderer.frame(camera, &())?;
    Ok(Waited { frame, report, ms: start.elapsed().as_secs_f64() * 1e3 })
}

/// Frames that are recorded ahead and stay on the device.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct InFlight {
    /// The most frames that are submitted and not finished.
    pub depth: usize,
    /// Number of timed frames.
    pub frames: usize,
    /// Milliseconds per frame, from the first frame's recording to the end of the last.
    pub ms: f64,
}

/// A ring of images on the device, one for each frame in flight.
pub(super) struct Ring<'g> {
    gpu: &'g Gpu,
    images: Vec<Buffer<u32>>,
}

impl<'g> Ring<'g> {
    /// Creates `depth` images for frames of `camera`.
    pub fn new(gpu: &'g Gpu, renderer: &OfScene<'_, '_>, camera: &Camera, depth: usize) -> Result<Self> {
        let words = renderer.layout(camera)?.bytes / 4;
        let images = (0..depth.max(1)).map(|_| Buffer::storage(gpu, "image in flight", words));
        Ok(Self { gpu, images: images.collect::<Result<_>>()? })
    }

    /// Renders `frames` frames, at least one, and times them. A frame is recorded as soon as fewer
    /// than the ring's images are in flight; none is read back.
    ///
    /// # Errors
    /// Errors of the device, and a last frame that lacks splats.
    pub fn fly(&self, renderer: &mut OfScene<'_, '_>, camera: &Camera, frames: usize) -> Result<InFlight> {
        let (gpu, depth) = (self.gpu, self.images.len());
        gpu.wait()?;
        let start = Instant::now();
        let (mut running, mut last) = (VecDeque::new(), None);
        for number in 0..frames.max(1) {
            if running.len() == depth {
                let oldest = wgpu::PollType::Wait { submission_index: running.pop_front(), timeout: None };
                gpu.device.poll(oldest).map_err(|e| gpu.error(format!("waiting for a frame failed: {e}")))?;
            }
            let mut encoder = gpu.encoder();
            let target = Target::Buffer(&self.images[number % depth].raw, 0);
            last = Some(renderer.encode(camera, &mut encoder, target)?);
            running.push_back(gpu.queue.submit([encoder.finish()]));
        }
        gpu.wait()?;
        let ms = start.elapsed().as_secs_f64() * 1e3 / frames.max(1) as f64;
        let lacking = last.map(|ticket| ticket.read()).transpose()?.map_or(Vec::new(), |receipt| receipt.lacking);
        match lacking.first() {
            None => Ok(InFlight { depth, frames: frames.max(1), ms }),
            Some(what) => Err(gpu.error(format!("a frame in flight lacked {what}"))),
        }
    }

    /// Reads the image of the first frame in flight back.
    pub fn image(&self, renderer: &OfScene<'_, '_>, camera: &Camera) -> Result<Frame> {
        let words = self.images[0].read(self.gpu, self.images[0].len)?;
        renderer.layout(camera)?.frame(bytemuck::cast_slice(&words))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_settled_once_both_halves_of_the_window_agree() {
        let falling: Vec<f64> = (0..40).map(|k| 100.0 - f64::from(k)).collect();
        assert!(!settled(&falling) && !settled(&[1.0; 2 * WINDOW - 1]));
        assert!(settled(&[1.0; 2 * WINDOW]));
        let late = [&falling[..], &[61.0; 2 * WINDOW]].concat();
        assert!(settled(&late) && !settled(&late[..45]));
    }
}
