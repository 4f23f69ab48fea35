//! The sequence: project, visibility, accumulate, resolve, on every backend.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::buffers::Buffer;
use crate::gpu::layout::{Band, MOST_ROUNDS, TILE, View};
use crate::gpu::timing::Timing;
use crate::gpu::{Gpu, Sources};
use crate::passes::accumulate::{ACCUMULATORS, AttributeBuffer};
use crate::passes::resolve::ImageBuffer;
use crate::passes::upload::SurfelBuffer;
use crate::passes::variant::Variant;
use crate::passes::visibility::VisibilityBuffer;
use crate::passes::{Recorder, Rows, accumulate, project, resolve, visibility};
use crate::progress::Progress;
use crate::scene::light::MAX_LIGHTS;
use crate::scene::{Camera, RenderOptions, Scene, SceneNeeds};

/// Who renders.
pub enum Backend {
    /// The compute kernels, on an adapter.
    Gpu {
        /// The open device.
        gpu: Box<Gpu>,
        /// The kernels' texts.
        sources: Sources,
    },
    /// The twins in f64, on the processor's threads.
    Reference,
}

impl Backend {
    /// The built-in kernels on `gpu`.
    pub fn gpu(gpu: Gpu) -> Self {
        Self::Gpu { gpu: Box::new(gpu), sources: Sources::default() }
    }
}

/// What a render did.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// `gpu` or `reference`.
    pub backend: &'static str,
    /// The adapter's name; of the reference, the processor threads.
    pub adapter: String,
    /// How sums were kept; the reference adds in f64.
    pub accumulator: &'static str,
    /// How often a sum of the accumulator that was asked for wrapped. If ever, the frame was rendered again with `fixed`,
    /// and `total_ms` holds both.
    pub overflows: u64,
    /// Surfels in the scene.
    pub surfels: u64,
    /// Splats that may touch a pixel.
    pub splats_drawn: u64,
    /// Image width.
    pub width: u32,
    /// Image height.
    pub height: u32,
    /// Milliseconds by pass, `NAME_ms`.
    pub passes: BTreeMap<String, f64>,
    /// Where the passes' times come from: `timestamps` or `wall`.
    pub clock: &'static str,
    /// Milliseconds from the uploaded scene to the frame in host memory.
    pub total_ms: f64,
    /// What the scene needed.
    pub needs: Vec<&'static str>,
}

/// Renders `scene`.
pub fn render(
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    backend: &Backend,
    progress: &dyn Progress,
) -> Result<(Frame, Report)> {
    if options.lights.len() > MAX_LIGHTS {
        return Err(Error::Usage(format!("a render has at most {MAX_LIGHTS} lights, not {}", options.lights.len())));
    }
    if u32::try_from(scene.surfels.len()).is_err() {
        return Err(Error::Usage(format!("a scene has at most 2^32 - 1 surfels, not {}", scene.surfels.len())));
    }
    match backend {
        Backend::Gpu { gpu, sources } => on_gpu(scene, camera, options, gpu, sources, progress),
        Backend::Reference => Ok(on_reference(scene, camera, options, progress)),
    }
}

fn on_gpu(
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    gpu: &Gpu,
    sources: &Sources,
    progress: &dyn Progress,
) -> Result<(Frame, Report)> {
    if options.maps.decision {
        return Err(Error::Usage("the decision map is made by the reference backend only".into()));
    }
    let color_range = scene.color_range();
    let needs = SceneNeeds::of(scene, &color_range, camera, options);
    let variant = Variant::of(&needs, options, scene.surfels.len() as u64)?;
    variant.accumulator.check(gpu)?;
    let program = variant.compile(gpu, sources)?;
    let bands = bands(gpu, camera, &variant)?;
    let view = View::new(scene, &scene.bounds(), &color_range, camera, options);
    let view = Buffer::uniform(gpu, "view", &view)?;
    let timing = Timing::new(gpu, 1 + 4 * bands.len() as u32)?;
    let mut recorder = Recorder { gpu, program: &program, view, variant: &variant, timing };

    let surfels = SurfelBuffer::upload(gpu, scene, &needs, progress)?;
    progress.begin("rendering rows", camera.height.into());
    let start = Instant::now();
    let splats = project::record(&mut recorder, surfels)?;
    let mut frame = Frame::new(camera, &options.maps);
    let mut buffers: Option<(u64, VisibilityBuffer, AttributeBuffer, ImageBuffer)> = None;
    let mut overflows = 0;
    for rows in &bands {
        // The last band may be lower, and a buffer's length is the number of its pixels.
        if buffers.as_ref().is_none_or(|(pixels, ..)| *pixels != rows.pixels) {
            drop(buffers.take());
            buffers = Some((
                rows.pixels,
                VisibilityBuffer::new(&recorder, rows.pixels)?,
                AttributeBuffer::new(&recorder, rows.pixels)?,
                ImageBuffer::new(&recorder, rows.pixels)?,
            ));
        }
        let Some((_, nearest, sums, image)) = &buffers else { continue };
        visibility::record(&mut recorder, &splats, rows, nearest)?;
        accumulate::record(&mut recorder, &splats, rows, nearest, sums)?;
        resolve::record(&mut recorder, rows, nearest, sums, image)?;
        resolve::read_back(&recorder, rows, image, &mut frame)?;
        overflows = sums.overflows(gpu)?;
        if overflows > 0 {
            break;
        }
        progress.advance(rows.count.into());
    }
    progress.end();
    if overflows > 0 {
        // The device's memory is free again before the second try.
        drop((buffers, splats));
        let exact = RenderOptions { accumulator: ACCUMULATORS[0].name, ..options.clone() };
        let (frame, report) = on_gpu(scene, camera, &exact, gpu, sources, progress)?;
        let total_ms = report.total_ms + start.elapsed().as_secs_f64() * 1e3;
        return Ok((frame, Report { overflows, total_ms, ..report }));
    }
    let total_ms = start.elapsed().as_secs_f64() * 1e3;
    let clock = if recorder.timing.on_device() { "timestamps" } else { "wall" };
    let passes = recorder.timing.finish(gpu)?;
    let report = Report {
        backend: "gpu",
        adapter: gpu.adapter.name.clone(),
        accumulator: variant.accumulator.name,
        overflows: 0,
        surfels: scene.surfels.len() as u64,
        splats_drawn: splats.drawn,
        width: camera.width,
        height: camera.height,
        passes: passes.into_iter().map(|(stage, ms)| (format!("{stage}_ms"), ms)).collect(),
        clock,
        total_ms,
        needs: needs.names(),
    };
    Ok((frame, report))
}

/// The image in bands of whole rows whose sums fit a binding.
pub(crate) fn bands(gpu: &Gpu, camera: &Camera, variant: &Variant) -> Result<Vec<Rows>> {
    let row_bytes = u64::from(camera.width) * u64::from(variant.sum_words().max(variant.pixel.image_words)) * 4;
    let rows_per_band = gpu.buffer_limit() / row_bytes;
    if rows_per_band == 0 {
        return Err(Error::Limit {
            adapter: gpu.adapter.name.clone(),
            limit: "max_storage_buffer_binding_size",
            available: gpu.buffer_limit(),
            needed: row_bytes,
            what: format!("for one row of {} pixels; choose a narrower image", camera.width),
        });
    }
    // A workgroup that draws a splat over the whole band must not tire its invocations.
    let most_pixels = u64::from(MOST_ROUNDS * TILE * TILE);
    let rows_per_band = rows_per_band.min(most_pixels / u64::from(camera.width)).min(u64::from(camera.height)) as u32;
    let mut bands = Vec::new();
    let mut first = 0;
    while first < camera.height {
        let count = rows_per_band.min(camera.height - first);
        let band = Band { first_row: first, rows: count, padding_0: 0, padding_1: 0 };
        let uniform = Buffer::uniform(gpu, "band", &band)?;
        bands.push(Rows { first, count, pixels: u64::from(count) * u64::from(camera.width), uniform });
        first += count;
    }
    Ok(bands)
}

/// Rows that one thread of the reference works on at a time.
const REFERENCE_ROWS: u32 = 8;

fn on_reference(scene: &Scene, camera: &Camera, options: &RenderOptions, progress: &dyn Progress) -> (Frame, Report) {
    let needs = SceneNeeds::of(scene, &scene.color_range(), camera, options);
    let start = Instant::now();
    let splats = project::reference_all(scene, camera, options);
    let project_ms = start.elapsed().as_secs_f64() * 1e3;

    let bands = camera.height.div_ceil(REFERENCE_ROWS);
    let (starts, members) = bin(&splats, bands as usize);
    progress.begin("rendering rows", camera.height.into());
    let spent: [AtomicU64; 3] = Default::default();
    let strip = |band: u32| {
        let first_row = band * REFERENCE_ROWS;
        let rows = REFERENCE_ROWS.min(camera.height - first_row);
        let range = starts[band as usize]..starts[band as usize + 1];
        let splats = || members[range.clone()].iter().map(|&index| &splats[index as usize]);
        let clock = Instant::now();
        let lap = |stage: usize, from: f64| {
            let now = clock.elapsed().as_secs_f64();
            spent[stage].fetch_add(((now - from) * 1e9) as u64, Ordering::Relaxed);
            now
        };
        let nearest = visibility::reference(splats(), camera, options.low_pass, first_row, rows);
        let seen = lap(0, 0.0);
        let sums = accumulate::reference(splats(), scene, camera, options, first_row, &nearest);
        let summed = lap(1, seen);
        let strip = Camera { height: rows, ..camera.clone() };
        let mut frame = Frame::new(&strip, &options.maps);
        resolve::reference(&sums, camera, options, first_row, &mut frame);
        lap(2, summed);
        progress.advance(rows.into());
        frame
    };
    // A few strips at a time: all of them beside the frame would double its memory.
    let mut frame = Frame::empty(camera, &options.maps);
    let group = 8 * rayon::current_num_threads() as u32;
    for first in (0..bands).step_by(group as usize) {
        let strips: Vec<Frame> = (first..bands.min(first + group)).into_par_iter().map(strip).collect();
        strips.into_iter().for_each(|strip| frame.append(strip));
    }
    progress.end();
    let threads = rayon::current_num_threads();
    let mut passes = BTreeMap::from([("project_ms".to_owned(), project_ms)]);
    for (stage, spent) in ["visibility_ms", "accumulate_ms", "resolve_ms"].into_iter().zip(&spent) {
        passes.insert(stage.to_owned(), spent.load(Ordering::Relaxed) as f64 * 1e-6 / threads as f64);
    }
    let report = Report {
        backend: "reference",
        adapter: format!("{threads} processor threads"),
        accumulator: "f64",
        overflows: 0,
        surfels: scene.surfels.len() as u64,
        splats_drawn: splats.len() as u64,
        width: camera.width,
        height: camera.height,
        passes,
        clock: "wall",
        total_ms: start.elapsed().as_secs_f64() * 1e3,
        needs: needs.names(),
    };
    (frame, report)
}

/// The splats of each band of rows, by count, scan, place: `members[starts[b]..starts[b + 1]]` are band b's, in order.
fn bin(splats: &[project::Splat], bands: usize) -> (Vec<usize>, Vec<u32>) {
    let range =
        |splat: &project::Splat| (splat.first[1] / REFERENCE_ROWS) as usize..=(splat.last[1] / REFERENCE_ROWS) as usize;
    let mut starts = vec![0; bands + 1];
    for splat in splats {
        range(splat).for_each(|band| starts[band + 1] += 1);
    }
    for band in 0..bands {
        starts[band + 1] += starts[band];
    }
    let mut next = starts.clone();
    let mut members = vec![0; starts[bands]];
    for (index, splat) in splats.iter().enumerate() {
        for band in range(splat) {
            members[next[band]] = index as u32;
            next[band] += 1;
        }
    }
    (starts, members)
}
