//! The receipt of a recorded frame: whether it was complete, what it counted, and its times.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::count::{Capacities, lacks};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::timing::times;

/// States of a part's tray.
const PENDING: u8 = 0;
const READY: u8 = 1;
const FAILED: u8 = 2;

/// The counts and times of a part of a recorded frame, which the host may read.
pub(super) struct Part {
    tray: wgpu::Buffer,
    bytes: u64,
    state: Arc<AtomicU8>,
    capacities: Capacities,
    /// The number of counts.
    count: u64,
    /// Whether each band counts its own splats.
    adds: bool,
    /// The stages with timestamps.
    stages: Vec<&'static str>,
}

impl Part {
    /// Maps the first `bytes` of `tray` once the commands of `encoder` were submitted and ran.
    pub fn mapped_on_submit(
        (tray, bytes): (wgpu::Buffer, u64),
        encoder: &wgpu::CommandEncoder,
        (capacities, count, adds): (Capacities, u64, bool),
        stages: Vec<&'static str>,
    ) -> Self {
        let state = Arc::new(AtomicU8::new(PENDING));
        let told = Arc::clone(&state);
        encoder.map_buffer_on_submit(&tray, wgpu::MapMode::Read, ..bytes, move |mapped| {
            told.store(if mapped.is_ok() { READY } else { FAILED }, Ordering::Release);
        });
        Self { tray, bytes, state, capacities, count, adds, stages }
    }
}

/// Tickets of incomplete frames that were read: the number of the part that lacked something, and
/// the number of measurements before the frame.
pub(super) type Lessons = Arc<Mutex<Vec<(usize, u64)>>>;

/// The receipt of a frame that [`Renderer::encode`](crate::Renderer::encode) recorded.
///
/// After its commands were submitted, the host can ask whether the frame was complete. An answer
/// also teaches the renderer: if the frame was incomplete, the next frame that is encoded first
/// measures the sizes of its buffers again. A ticket that is dropped costs nothing.
pub struct Ticket {
    gpu: Gpu,
    verdict: wgpu::Buffer,
    /// The parts by number, each with the number of measurements before it.
    parts: Vec<(usize, (Part, u64))>,
    lessons: Lessons,
}

/// The counts and times of a recorded frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Receipt {
    /// Whether the picture has all its splats.
    pub complete: bool,
    /// The buffers that were too small, in words; empty if the frame is complete.
    pub lacking: Vec<&'static str>,
    /// Number of splats that may touch a pixel. In an image that is drawn in several bands, a splat
    /// may count in each of them.
    pub splats_drawn: u64,
    /// Number of surfels and nodes in the cut, if a cut is drawn instead of all surfels.
    pub cut: Option<u64>,
    /// Milliseconds by pass, as `NAME_ms`; empty if the device has no timestamps.
    pub passes: BTreeMap<String, f64>,
}

/// The longest time from the end of a frame's commands until its counts are told to be there, if
/// another thread polls the device.
const LATEST_CALLBACK: Duration = Duration::from_millis(500);

impl Ticket {
    pub(super) fn new(gpu: &Gpu, verdict: &wgpu::Buffer, parts: Vec<(usize, (Part, u64))>, lessons: &Lessons) -> Self {
        Self { gpu: gpu.clone(), verdict: verdict.clone(), parts, lessons: Arc::clone(lessons) }
    }

    /// The verdict on the device: four u32 words. Word 0 is 1 if the frame is complete and 0 if
    /// not. Word 1 has the bits of what was too small: 1 slots of splats, 2 lists of splats, 4
    /// slots of the cut, 8 bits of sums, 16 places of fragments. Words 2 and 3 are 0.
    ///
    /// The frames of a renderer share the buffer, which has the usages `STORAGE` and `COPY_SRC`:
    /// commands that read the verdict of this frame belong between those of this frame and of the
    /// next.
    pub fn verdict(&self) -> &wgpu::Buffer {
        &self.verdict
    }

    /// Waits until the frame was drawn, and returns what it counted.
    ///
    /// # Errors
    /// [`Error::Usage`] if the frame's commands were not submitted, and errors of the device.
    pub fn read(mut self) -> Result<Receipt> {
        self.gpu.wait()?;
        let start = Instant::now();
        // Another thread that polls the device may still be about to run the callback of this read.
        loop {
            if let Some(receipt) = self.receipt()? {
                return Ok(receipt);
            }
            if start.elapsed() > LATEST_CALLBACK {
                return Err(Error::Usage(
                    "the commands of this frame were not submitted: submit the encoder before the ticket is read"
                        .into(),
                ));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Returns what the frame counted if it was drawn already, without waiting; else None. Once it
    /// has returned a receipt, it returns None.
    ///
    /// # Errors
    /// Errors of the device.
    pub fn try_read(&mut self) -> Result<Option<Receipt>> {
        self.gpu.device.poll(wgpu::PollType::Poll).map_err(|e| self.gpu.error(format!("polling failed: {e}")))?;
        self.gpu.check()?;
        self.receipt()
    }

    fn receipt(&mut self) -> Result<Option<Receipt>> {
        let states: Vec<u8> = self.parts.iter().map(|(_, (part, _))| part.state.load(Ordering::Acquire)).collect();
        if states.contains(&FAILED) {
            return Err(self.gpu.error("the counts of a frame could not be read"));
        }
        if self.parts.is_empty() || states.contains(&PENDING) {
            return Ok(None);
        }
        let mut receipt =
            Receipt { complete: true, lacking: Vec::new(), splats_drawn: 0, cut: None, passes: BTreeMap::new() };
        let mut lacking = 0;
        for (number, (part, measured)) in std::mem::take(&mut self.parts) {
            let of_part = self.take(part, number == 0, &mut receipt)?;
            if of_part != 0 {
                self.lessons.lock().unwrap_or_else(PoisonError::into_inner).push((number, measured));
            }
            lacking |= of_part;
        }
        receipt.complete = lacking == 0;
        receipt.lacking = named(lacking);
        Ok(Some(receipt))
    }

    /// Adds the times of `part` to `receipt`, and its counts if it `is_colour`. Returns the bits of
    /// what it lacks.
    fn take(&self, part: Part, is_colour: bool, receipt: &mut Receipt) -> Result<u32> {
        let view = part.tray.slice(..part.bytes).get_mapped_range();
        let view = view.map_err(|e| self.gpu.error(format!("reading back failed: {e}")))?;
        let (counts, ticks) = view.split_at(8 * part.count as usize);
        let counts: Vec<[u32; 2]> = counts.chunks_exact(8).map(bytemuck::pod_read_unaligned).collect();
        let ticks: Vec<u64> = ticks.chunks_exact(8).map(bytemuck::pod_read_unaligned).collect();
        drop(view);
        part.tray.unmap();
        self.gpu.keep_tray(part.tray);
        for (stage, ms) in times(&self.gpu, &part.stages, &ticks) {
            *receipt.passes.entry(format!("{stage}_ms")).or_default() += ms;
        }
        let mut lacking = 0;
        for of_band in counts.chunks_exact(part.capacities.limits().len().max(1)) {
            let counted = part.capacities.compared(of_band);
            lacking |= counted.lacking;
            if is_colour {
                receipt.splats_drawn = counted.drawn + if part.adds { receipt.splats_drawn } else { 0 };
                receipt.cut = counted.cuts.map(|cuts| cuts.iter().sum());
            }
        }
        Ok(lacking)
    }
}

/// The names of the bits of [`lacks`].
fn named(lacking: u32) -> Vec<&'static str> {
    let all = [
        (lacks::SLOTS, "slots of splats"),
        (lacks::LISTS, "lists of splats"),
        (lacks::CUT, "slots of the cut"),
        (lacks::BITS, "bits of sums"),
        (lacks::FRAGMENTS, "places of fragments"),
    ];
    all.into_iter().filter(|(bit, _)| lacking & bit != 0).map(|(_, name)| name).collect()
}
