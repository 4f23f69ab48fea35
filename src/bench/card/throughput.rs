//! Times frames of spheres with growing numbers of surfels: frames that the caller waits for,
//! frames in flight, and each pass, whose bandwidth is compared with that of copies by a kernel.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::bytes::Moved;
use super::pace::{self, InFlight, Limits, OfScene, Ring, WarmUp, waited};
use super::{Card, sphere};
use crate::bench::bandwidth::Copier;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::plan::{Facts, PixelLayout, SceneNeeds, Settings};
use crate::render::{Backend, Renderer, Report};
use crate::report::Summary;
use crate::scene::Camera;

/// The fraction of the remaining time that this step may use.
const SHARE: f64 = 0.4;

/// Numbers of surfels: full run, quick run.
const SIZES: [&[u64]; 2] = [&[10_000, 100_000, 1_000_000, 10_000_000], &[1_000, 10_000]];

/// The largest number of timed frames: full run, quick run.
const FRAMES: [usize; 2] = [50, 3];

/// The smallest number of timed frames, however long they take.
const FEWEST_FRAMES: usize = 3;

/// Time after which a sphere gets no further frame, if it has [`FEWEST_FRAMES`].
const FRAMES_TIME: Duration = Duration::from_secs(10);

/// Warm-up: full run, quick run.
const WARM_UP: [Limits; 2] = [
    Limits { fewest: 3, frames: 200, time: Duration::from_secs(2) },
    Limits { fewest: 3, frames: 3, time: Duration::ZERO },
];

/// Number of frames in flight.
const DEPTH: usize = 3;

/// The most timed frames that fly: full run, quick run.
const FLYING: [f64; 2] = [100.0, 6.0];

/// The duration of these frames, seconds, if there are [`FLYING`] or fewer.
const FLIGHT: f64 = 3.0;

/// Side of the image, pixels.
const SIDE: u32 = 1024;

/// Frame times of one sphere, with the default options: lit by a headlight, without maps.
#[derive(Clone, Debug, Serialize)]
pub struct Throughput {
    /// Number of surfels in the scene, all of which are processed.
    pub surfels: u64,
    /// Number of splats that may touch a pixel and were not culled.
    pub splats_drawn: u64,
    /// Mean splat radius, pixels.
    pub footprint_px: f64,
    /// Width and height of the image, pixels.
    pub size: [u32; 2],
    /// Number of pixels that are not background.
    pub covered_pixels: u64,
    /// The frames before the timed ones.
    pub warm_up: WarmUp,
    /// Number of timed frames that the caller waited for.
    pub frames: usize,
    /// Time from the call until the caller has the frame's last byte, milliseconds.
    pub wait_ms: Summary,
    /// Median part of `wait_ms` outside all passes, milliseconds: recording, submission, gaps
    /// between passes, and read-back.
    pub rest_ms: f64,
    /// Frames that stay on the device, several at a time; `None` where they could not be recorded.
    pub in_flight: Option<InFlight>,
    /// The clock of the passes' times: `timestamps` (of the device) or `wall`.
    pub clock: &'static str,
    /// The passes by name.
    pub passes: BTreeMap<String, PassRecord>,
    /// Device memory that the renderer holds, bytes.
    pub device_bytes: u64,
    /// Names of the [`SceneNeeds`] that chose the kernels.
    pub needs: Vec<&'static str>,
}

impl Throughput {
    /// Sum of the passes' median times, milliseconds.
    pub fn passes_ms(&self) -> f64 {
        self.passes.values().map(|pass| pass.ms.median).sum()
    }
}

/// Time and bandwidth of one pass.
#[derive(Clone, Debug, Serialize)]
pub struct PassRecord {
    /// Time per frame, milliseconds.
    pub ms: Summary,
    /// The least bytes that the pass moves ([`Moved`]); `None` for a pass without a formula.
    pub least_bytes: Option<u64>,
    /// `least_bytes` per second of the median time, in GB/s (10^9 bytes).
    pub gb_per_second: Option<f64>,
    /// `gb_per_second` over the bandwidth of copies by a kernel, if measured. A value above 1 shows
    /// that caches helped.
    pub share_of_copy: Option<f64>,
}

impl PassRecord {
    /// Derives the bandwidth of a pass that took `ms`; `copy` is that of a kernel's copies in GB/s.
    pub fn of(ms: Summary, least_bytes: Option<u64>, copy: Option<f64>) -> Self {
        let gb_per_second = least_bytes.filter(|_| ms.median > 0.0).map(|bytes| bytes as f64 * 1e-6 / ms.median);
        let share_of_copy = gb_per_second.zip(copy).filter(|(_, copy)| *copy > 0.0).map(|(own, copy)| own / copy);
        Self { ms, least_bytes, gb_per_second, share_of_copy }
    }
}

/// Renders as many of the spheres as the time allows.
pub(super) fn measure(card: &mut Card<'_>) -> Result<()> {
    let deadline = card.budget.share(SHARE);
    let mut last: Option<(u64, Duration)> = None;
    for &surfels in SIZES[usize::from(card.asked.quick)] {
        // Estimate: the same time per surfel as for the last size.
        let expected = last.map(|(fewer, time)| time.mul_f64(surfels as f64 / fewer as f64));
        if Instant::now() + expected.unwrap_or_default() >= deadline {
            card.leave_out(format!("frames of {surfels} surfels: the remaining time is too short"));
            continue;
        }
        let start = Instant::now();
        match of_size(card, surfels) {
            Ok(found) => {
                let (ms, passes) = (found.wait_ms.median, found.passes_ms());
                let flown = found.in_flight.map_or(String::new(), |flown| format!(", {:.2} in flight", flown.ms));
                let drawn = found.splats_drawn;
                (card.told.say)(&format!(
                    "  {surfels} surfels, {drawn} drawn: {ms:.2} ms a frame{flown}, {passes:.2} in passes"
                ));
                card.record.throughput.push(found);
            }
            Err(limit @ Error::Limit { .. }) => card.leave_out(format!("frames of {surfels} surfels: {limit}")),
            Err(error) => card.problem(&format!("frames of {surfels} surfels"), error)?,
        }
        card.read_clocks(format!("after frames of {surfels} surfels"));
        card.write()?;
        last = Some((surfels, start.elapsed()));
    }
    Ok(())
}

fn of_size(card: &Card<'_>, surfels: u64) -> Result<Throughput> {
    let (form, staged) = (card.form(), sphere(surfels, None, SIDE, card.told.progress)?);
    let options = Settings::default();
    let (scene, camera) = (&staged.scene, &staged.cameras[0]);
    let backend: &Backend = &card.backend;
    let mut renderer = Renderer::new(scene, &options, backend)?;
    let warm_up = pace::warm_up(&mut renderer, camera, WARM_UP[form])?;
    let first = waited(&mut renderer, camera)?;
    let (mut frames, start) = (vec![(first.report, first.ms)], Instant::now());
    while frames.len() < FEWEST_FRAMES || frames.len() < FRAMES[form] && start.elapsed() < FRAMES_TIME {
        let next = waited(&mut renderer, camera)?;
        frames.push((next.report, next.ms));
    }
    let needs = SceneNeeds::of(&Facts::of(scene), &card.record.adapter, camera, &options);
    let copy = card.record.copy_of_memory(Copier::Kernel).map(|copy| copy.gb_per_second.max);
    let found = summarised(&frames, &first.frame, &needs, copy);
    let in_flight = in_flight(backend, &mut renderer, camera, (found.wait_ms.median, FLYING[form]))?;
    let bytes = renderer.device_bytes();
    let (footprint_px, device_bytes) = (staged.footprint_px, bytes.splats + bytes.pixels);
    Ok(Throughput { footprint_px, device_bytes, warm_up, in_flight, ..found })
}

/// Times frames in flight, at most `most` of them; a frame that is waited for takes `wait_ms`.
fn in_flight(
    backend: &Backend,
    renderer: &mut OfScene<'_, '_>,
    camera: &Camera,
    (wait_ms, most): (f64, f64),
) -> Result<Option<InFlight>> {
    let Backend::Gpu { gpu, .. } = backend else { return Ok(None) };
    let ring = Ring::new(gpu, renderer, camera, DEPTH)?;
    // The first block creates what frames in flight need.
    ring.fly(renderer, camera, DEPTH + 1)?;
    let frames = (FLIGHT * 1e3 / wait_ms.max(1e-3)).clamp(2.0 * DEPTH as f64, most);
    ring.fly(renderer, camera, frames as usize).map(Some)
}

/// Summarises repeated renders of `frame`, at least one: their reports, and the milliseconds that
/// the caller waited. What frames of other kinds measure is left at its default.
fn summarised(frames: &[(Report, f64)], frame: &Frame, needs: &SceneNeeds, copy: Option<f64>) -> Throughput {
    let summary = |of: &dyn Fn(&(Report, f64)) -> Option<f64>| {
        Summary::of(&frames.iter().filter_map(of).collect::<Vec<_>>()).unwrap_or_default()
    };
    let (surfels, splats_drawn, clock, names) = frames
        .first()
        .map(|(report, _)| (report.surfels, report.splats_drawn, report.clock, report.needs.clone()))
        .unwrap_or_default();
    // The background is transparent, so only covered pixels have alpha.
    let covered_pixels = frame.color.iter().filter(|pixel| pixel[3] > 0.0).count() as u64;
    let pixel = PixelLayout::of(needs);
    let least = Moved {
        surfels,
        drawn: splats_drawn,
        pixels: frame.color.len() as u64,
        covered: covered_pixels,
        sum_words: pixel.sum_words(needs).into(),
        image_words: pixel.image_words.into(),
        doubled: needs.doubled,
        culls: names.contains(&"cull"),
        gathers: names.contains(&"gather"),
    }
    .least();
    let named = frames.iter().flat_map(|(report, _)| report.passes.keys().cloned()).map(|key| {
        let ms = summary(&|(report, _)| report.passes.get(&key).copied());
        let name = key.trim_end_matches("_ms").to_owned();
        let bytes = least.get(name.as_str()).copied();
        (name, PassRecord::of(ms, bytes, copy))
    });
    Throughput {
        surfels,
        splats_drawn,
        footprint_px: 0.0,
        size: [frame.width, frame.height],
        covered_pixels,
        warm_up: WarmUp { frames: 0, seconds: 0.0, settled: false },
        frames: frames.len(),
        wait_ms: summary(&|(_, ms)| Some(*ms)),
        rest_ms: summary(&|(report, ms)| Some(ms - report.passes.values().sum::<f64>())).median,
        in_flight: None,
        clock,
        passes: named.collect(),
        device_bytes: 0,
        needs: names,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::gpu::AdapterDescription;

    #[test]
    fn a_share_is_of_what_copies_reach() {
        let ms = Summary { median: 2.0, ..Summary::default() };
        let pass = PassRecord::of(ms, Some(6_000_000), Some(12.0));
        assert_eq!((pass.gb_per_second, pass.share_of_copy), (Some(3.0), Some(0.25)));
        let pass = PassRecord::of(ms, None, Some(12.0));
        assert_eq!((pass.gb_per_second, pass.share_of_copy), (None, None));
        let pass = PassRecord::of(Summary::default(), Some(1), Some(12.0));
        assert_eq!((pass.gb_per_second, pass.share_of_copy), (None, None));
    }

    #[test]
    fn reports_become_medians_and_what_is_in_no_pass() {
        let staged = sphere(200, None, 16, &()).unwrap();
        let options = Settings::default();
        let (scene, camera) = (&staged.scene, &staged.cameras[0]);
        let mut renderer = Renderer::new(scene, &options, &Backend::Reference).unwrap();
        let (frame, report) = renderer.frame(camera, &()).unwrap();
        let needs = SceneNeeds::of(&Facts::of(scene), &AdapterDescription::core(), camera, &options);
        let frames = [8.0, 4.0, 6.0].map(|ms| {
            let passes = BTreeMap::from([("project_ms".to_owned(), 1.0), ("resolve_ms".to_owned(), ms / 2.0)]);
            (Report { passes, ..report.clone() }, ms)
        });
        let found = summarised(&frames, &frame, &needs, None);
        assert_eq!((found.wait_ms.median, found.frames, found.rest_ms), (6.0, 3, 2.0));
        assert_eq!((found.passes["resolve"].ms.median, found.passes_ms()), (3.0, 4.0));
        assert_eq!((found.surfels, found.splats_drawn), (200, report.splats_drawn));
        assert!(found.covered_pixels > 100 && found.covered_pixels < 256, "{}", found.covered_pixels);
        // Sums: weight, three colours and three normal components, stored in 8 pairs of words. The
        // image has four words per pixel.
        let resolve = found.passes["resolve"].least_bytes;
        assert_eq!(resolve, Some(found.covered_pixels * 4 * (1 + 16 + 4)));
    }
}
