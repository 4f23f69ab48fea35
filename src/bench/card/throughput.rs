//! Times each pass in frames of spheres with growing numbers of surfels, and compares the pass's
//! bandwidth with that of copies.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::bytes::Moved;
use super::{Card, sphere};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::plan::{Facts, PixelLayout, SceneNeeds, Settings};
use crate::render::{Backend, Renderer, Report};
use crate::report::Summary;

/// The fraction of the remaining time that this step may use.
const SHARE: f64 = 0.4;

/// Numbers of surfels: full run, quick run.
const SIZES: [&[u64]; 2] = [&[10_000, 100_000, 1_000_000, 10_000_000], &[1_000, 10_000]];

/// The largest number of timed frames: full run, quick run.
const FRAMES: [u32; 2] = [15, 3];

/// The smallest number of timed frames, however long they take.
const FEWEST_FRAMES: usize = 3;

/// Time after which a sphere gets no further frame, if it has [`FEWEST_FRAMES`].
const FRAMES_TIME: Duration = Duration::from_secs(10);

/// Untimed frames: the first finds the buffer sizes, the second allocates the buffers.
const WARM_UP: usize = 2;

/// Side of the image, pixels.
const SIDE: u32 = 1024;

/// Frame times of one sphere, with the default options: lit by a headlight, without maps.
#[derive(Clone, Debug, Serialize)]
pub struct Throughput {
    /// Number of surfels in the scene.
    pub surfels: u64,
    /// Number of splats that may touch a pixel and were not culled.
    pub splats_drawn: u64,
    /// Mean splat radius, pixels.
    pub footprint_px: f64,
    /// Width and height of the image, pixels.
    pub size: [u32; 2],
    /// Number of pixels that are not background.
    pub covered_pixels: u64,
    /// Number of timed frames.
    pub frames: usize,
    /// Time from the uploaded scene to the frame in host memory, milliseconds.
    pub total_ms: Summary,
    /// Median time outside all passes, milliseconds: submission and readback.
    pub rest_ms: f64,
    /// Surfels of the scene per second of the median frame time.
    pub splats_per_second: f64,
    /// The clock of the passes' times: `timestamps` (of the device) or `wall`.
    pub clock: &'static str,
    /// The passes by name.
    pub passes: BTreeMap<String, PassRecord>,
    /// Device memory that the renderer holds, bytes.
    pub device_bytes: u64,
    /// Names of the [`SceneNeeds`] that chose the kernels.
    pub needs: Vec<&'static str>,
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
    /// `gb_per_second` over the median copy bandwidth, if measured. A value above 1 shows that
    /// caches helped.
    pub share_of_copy: Option<f64>,
}

impl PassRecord {
    /// Derives the bandwidth of a pass that took `ms`; `copy` is the copy bandwidth in GB/s.
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
                let (ms, rate) = (found.total_ms.median, found.splats_per_second * 1e-6);
                (card.told.say)(&format!("  {surfels} surfels: {ms:.2} ms a frame, {rate:.3} million splats a second"));
                card.record.throughput.push(found);
            }
            Err(limit @ Error::Limit { .. }) => card.leave_out(format!("frames of {surfels} surfels: {limit}")),
            Err(error) => card.problem(&format!("frames of {surfels} surfels"), error)?,
        }
        card.write()?;
        last = Some((surfels, start.elapsed()));
    }
    Ok(())
}

fn of_size(card: &Card<'_>, surfels: u64) -> Result<Throughput> {
    let staged = sphere(surfels, None, SIDE, card.told.progress)?;
    let options = Settings::default();
    let (scene, camera) = (&staged.scene, &staged.cameras[0]);
    let backend: &Backend = &card.backend;
    let mut renderer = Renderer::new(scene, &options, backend)?;
    for _ in 0..WARM_UP {
        renderer.frame(camera, &())?;
    }
    let (frame, report) = renderer.frame(camera, &())?;
    let (mut reports, start) = (vec![report], Instant::now());
    for _ in 1..FRAMES[usize::from(card.asked.quick)] {
        if reports.len() >= FEWEST_FRAMES && start.elapsed() > FRAMES_TIME {
            break;
        }
        reports.push(renderer.frame(camera, &())?.1);
    }
    let needs = SceneNeeds::of(&Facts::of(scene), &card.record.adapter, camera, &options);
    let copy = card.record.copy_bandwidth.as_ref().map(|copy| copy.gb_per_second.median);
    let mut found = summarised(&reports, &frame, &needs, copy);
    let bytes = renderer.device_bytes();
    (found.footprint_px, found.device_bytes) = (staged.footprint_px, bytes.splats + bytes.pixels);
    Ok(found)
}

/// Summarises the `reports` of repeated renders of `frame`. There is at least one report.
fn summarised(reports: &[Report], frame: &Frame, needs: &SceneNeeds, copy: Option<f64>) -> Throughput {
    let summary = |of: &dyn Fn(&Report) -> Option<f64>| {
        Summary::of(&reports.iter().filter_map(of).collect::<Vec<_>>()).unwrap_or_default()
    };
    let (surfels, splats_drawn, clock, names) = reports
        .first()
        .map(|report| (report.surfels, report.splats_drawn, report.clock, report.needs.clone()))
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
    let named = reports.iter().flat_map(|report| report.passes.keys().cloned()).map(|key| {
        let ms = summary(&|report| report.passes.get(&key).copied());
        let name = key.trim_end_matches("_ms").to_owned();
        let bytes = least.get(name.as_str()).copied();
        (name, PassRecord::of(ms, bytes, copy))
    });
    let total_ms = summary(&|report| Some(report.total_ms));
    let rest_ms = summary(&|report| Some(report.total_ms - report.passes.values().sum::<f64>())).median;
    let per_second = if total_ms.median > 0.0 { 1e3 / total_ms.median } else { 0.0 };
    Throughput {
        surfels,
        splats_drawn,
        footprint_px: 0.0,
        size: [frame.width, frame.height],
        covered_pixels,
        frames: reports.len(),
        total_ms,
        rest_ms,
        splats_per_second: surfels as f64 * per_second,
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
        let reports = [8.0, 4.0, 6.0].map(|total_ms| Report {
            passes: BTreeMap::from([("project_ms".to_owned(), 1.0), ("resolve_ms".to_owned(), total_ms / 2.0)]),
            total_ms,
            ..report.clone()
        });
        let found = summarised(&reports, &frame, &needs, None);
        assert_eq!((found.total_ms.median, found.frames, found.rest_ms), (6.0, 3, 2.0));
        assert_eq!(found.passes["resolve"].ms.median, 3.0);
        assert!((found.splats_per_second - 200.0 / 6e-3).abs() < 1e-6);
        assert!(found.covered_pixels > 100 && found.covered_pixels < 256, "{}", found.covered_pixels);
        // Sums: weight, three colours and three normal components, stored in 8 pairs of words. The
        // image has four words per pixel.
        let resolve = found.passes["resolve"].least_bytes;
        assert_eq!(resolve, Some(found.covered_pixels * 4 * (1 + 16 + 4)));
    }
}
