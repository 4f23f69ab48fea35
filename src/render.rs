//! The sequence: project, visibility, accumulate, resolve, on every backend.

mod pixels;
mod reference;

use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;

pub(crate) use pixels::bands;
use pixels::{PixelBuffers, Sums, rows_per_band};

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::buffers::{counts, page_len};
use crate::gpu::layout::{BATCH, Splat, View};
use crate::gpu::timing::Timing;
use crate::gpu::{Gpu, Sources};
use crate::passes::covered::Covered;
use crate::passes::cull::Part;
use crate::passes::project::SplatBuffer;
use crate::passes::tiles::{Listed, Tiles};
use crate::passes::upload::SurfelBuffer;
use crate::passes::variant::Variant;
use crate::passes::{Recorder, accumulate, cull, project, raster, resolve, tiles, visibility};
use crate::plan::{Accumulator, Facts, Optimisation, Organisation, RenderOptions, SceneNeeds};
use crate::progress::Progress;
use crate::scene::light::MAX_LIGHTS;
use crate::scene::{Camera, Scene};

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
    /// `gpu` (compute kernels), `raster` (the rasteriser) or `reference`.
    pub backend: &'static str,
    /// The adapter's name; of the reference, the processor threads.
    pub adapter: String,
    /// How sums were kept: an accumulator, the rasteriser's format, or the reference's `f64`.
    pub accumulator: &'static str,
    /// Fragments that made a sum of the accumulator that was asked for wrap. If any, the frame was rendered again with `fixed`,
    /// and `total_ms` holds both.
    pub overflows: u64,
    /// Surfels in the scene.
    pub surfels: u64,
    /// Splats that may touch a pixel. Those that were left out because they are hidden are not counted.
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

/// Device memory of a render, bytes: its buffers and textures, and what the host reads frames through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceBytes {
    /// Of the surfels and their splats.
    pub splats: u64,
    /// Of the pixels: nearest depths, sums, image.
    pub pixels: u64,
}

/// Renders `scene` once.
///
/// # Errors
/// Those of [`Renderer::new`] and [`Renderer::frame`].
pub fn render(
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    backend: &Backend,
    progress: &dyn Progress,
) -> Result<(Frame, Report)> {
    Renderer::new(scene, options, backend)?.frame(camera, progress)
}

/// A scene on a backend, and what stays from frame to frame: the uploaded surfels and the buffers. (The device itself
/// keeps its compiled kernels.) The second frame costs its passes alone.
pub struct Renderer<'a> {
    scene: &'a Scene,
    options: &'a RenderOptions,
    backend: &'a Backend,
    facts: Facts,
    splats: Option<SplatBuffer>,
    pixels: Option<PixelBuffers>,
    tiles: Option<Tiles>,
    /// There were too many splats for tiles to gather.
    crowded: bool,
    /// The last frame had no large splats, so that the next does not stop to look for them.
    none_large: bool,
    held: DeviceBytes,
}

impl<'a> Renderer<'a> {
    /// A renderer of `scene`; nothing is uploaded yet.
    ///
    /// # Errors
    /// [`Error::Usage`] for options, scenes and backends that do not go together.
    pub fn new(scene: &'a Scene, options: &'a RenderOptions, backend: &'a Backend) -> Result<Self> {
        if options.lights.len() > MAX_LIGHTS {
            return Err(Error::Usage(format!(
                "a render has at most {MAX_LIGHTS} lights, not {}",
                options.lights.len()
            )));
        }
        if u32::try_from(scene.surfels.len()).is_err() {
            return Err(Error::Usage(format!("a scene has at most 2^32 - 1 surfels, not {}", scene.surfels.len())));
        }
        if options.maps.decision && !matches!(backend, Backend::Reference) {
            return Err(Error::Usage("the decision map is made by the reference backend only".into()));
        }
        Ok(Self {
            scene,
            options,
            backend,
            facts: Facts::of(scene),
            splats: None,
            pixels: None,
            tiles: None,
            crowded: false,
            none_large: false,
            held: DeviceBytes::default(),
        })
    }

    /// One frame.
    ///
    /// # Errors
    /// A limit of the adapter, and whatever a device may report.
    pub fn frame(&mut self, camera: &Camera, progress: &dyn Progress) -> Result<(Frame, Report)> {
        match self.backend {
            Backend::Gpu { gpu, sources } if self.options.has(Optimisation::UncountedLoops) => {
                self.on_gpu(gpu, sources, camera, progress)
            }
            Backend::Gpu { gpu, sources } => self.on_gpu(gpu, &sources.clone().with_counted_loops(), camera, progress),
            Backend::Reference => Ok(reference::frame(self.scene, camera, self.options, progress)),
        }
    }

    /// Device memory that the last frame was rendered with; none for the reference.
    pub fn device_bytes(&self) -> DeviceBytes {
        self.held
    }

    fn on_gpu(
        &mut self,
        gpu: &Gpu,
        sources: &Sources,
        camera: &Camera,
        progress: &dyn Progress,
    ) -> Result<(Frame, Report)> {
        let needs = SceneNeeds::of(self.scene, &self.facts.color, camera, self.options)
            .with_copies(self.facts.copies && self.options.draws_copies_once())
            .with_atomics_u64(gpu.adapter.atomics_u64 && self.options.has(Optimisation::Pairs))
            .with_long_words(gpu.adapter.integers_u64 && self.options.has(Optimisation::LongWords));
        let surfels = self.scene.surfels.len() as u64;
        let rows = rows_per_band(gpu, camera, &Variant::of(&needs, self.options, surfels)?)?;
        let shared = gpu.adapter.subgroups && gpu.adapter.kind == "software" && self.options.has(Optimisation::Sharing);
        let bands = camera.height.div_ceil(rows);
        let gather = bands == 1
            && surfels <= page_len(gpu, size_of::<Splat>())
            && !self.crowded
            && self.options.has(Optimisation::Gathering)
            && match self.options.organisation {
                Organisation::Auto => shared && tiles::gathers(self.scene, camera, self.options),
                Organisation::Tile => true,
                Organisation::Scatter => false,
            };
        // What is drawn first hides what is drawn later in the same band alone.
        let culled = bands == 1
            && self.options.has(Optimisation::Culling)
            && 6 * self.scene.surfels.len() > camera.pixels()
            && page_len(gpu, size_of::<Splat>()) >= BATCH.into();
        let needs = needs.with_culling(culled).with_subgroups(shared).with_gather(gather);
        let variant = Variant::of(&needs, self.options, surfels)?;
        match needs.raster {
            Some(raster) => raster::check(gpu, raster, &needs, camera)?,
            None => variant.accumulator.check(gpu)?,
        }
        let program = variant.compile(gpu, sources)?;
        let core = self.options.has(Optimisation::Order).then_some(&self.facts.core);
        let mut splats = match self.splats.take() {
            Some(splats) => splats,
            None => {
                let surfels = SurfelBuffer::upload(gpu, self.scene, &needs, core, progress)?;
                SplatBuffer::new(gpu, surfels, needs.low_pass)?
            }
        };
        if !needs.cull {
            splats.make_room_for_all(gpu)?;
        }
        let pixels = match self.pixels.take() {
            Some(pixels) if pixels.made_for == PixelBuffers::key(camera, &variant) => pixels,
            other => {
                // The old ones make room first.
                drop((other, self.tiles.take()));
                self.none_large = false;
                PixelBuffers::new(gpu, self, camera, &variant)?
            }
        };
        let mut tiles = match self.tiles.take() {
            Some(tiles) => Some(tiles.of_variant(variant.compile_tiles(gpu, sources)?)),
            None => None,
        };
        let fresh = tiles.is_none() && (needs.gather || !self.none_large);
        progress.begin("rendering rows", camera.height.into());
        let start = Instant::now();
        pixels.view.set(gpu, &self.view(camera));
        let timing = Timing::new(gpu);
        let mut recorder = Recorder { gpu, program: &program, view: &pixels.view, variant: &variant, timing };
        let mut frame = Frame::new(camera, &self.options.maps);
        let parts: &'static [Part] = if needs.cull { &[Part::Near, Part::Far] } else { &[Part::All] };
        if let ([first, ..], Sums::Targets(options, targets)) = (&pixels.bands[..], &pixels.sums) {
            project::record(&mut recorder, &splats, Part::All)?;
            raster::record(&mut recorder, *options, &splats, first, targets)?;
        }
        for rows in &pixels.bands {
            if let Some(nearest) = pixels.sums.nearest() {
                for &part in parts {
                    // Bands share their splats.
                    if rows.first == 0 {
                        if needs.cull {
                            cull::record(&mut recorder, &splats, part, (rows, nearest))?;
                            splats.make_room(gpu, part)?;
                        }
                        project::record(&mut recorder, &splats, part)?;
                    }
                    visibility::record(&mut recorder, (&splats, part), rows, nearest)?;
                    if part == Part::Near {
                        visibility::occlude(&mut recorder, part, rows, nearest)?;
                    }
                }
                if fresh && rows.first == 0 && (needs.gather || needs.tiles && splats.has_large(gpu)?) {
                    let kernels = variant.compile_tiles(gpu, sources)?;
                    let mut new = Tiles::new(gpu, (kernels, &needs), (camera.width, &pixels.bands))?;
                    let room = new.make_room(&mut recorder, Listed::Large, &splats, &pixels.bands, nearest)?;
                    tiles = room.then_some(new);
                }
                match &tiles {
                    Some(tiles) => tiles::visibility(&mut recorder, &splats, rows, tiles, nearest)?,
                    None => visibility::record_large(&mut recorder, &splats, rows, nearest)?,
                }
                visibility::occlude(&mut recorder, Part::All, rows, nearest)?;
            }
            match &pixels.sums {
                Sums::Gathered(nearest) => {
                    let room = match &mut tiles {
                        Some(tiles) if fresh => {
                            tiles.make_room(&mut recorder, Listed::Small, &splats, &pixels.bands, nearest)?
                        }
                        Some(_) => true,
                        None => false,
                    };
                    let Some(tiles) = tiles.as_ref().filter(|_| room) else {
                        // Their sums are stored from here on.
                        (self.crowded, self.splats) = (true, Some(splats));
                        return self.on_gpu(gpu, sources, camera, progress);
                    };
                    tiles::resolve(&mut recorder, &splats, rows, tiles, (nearest, &pixels.image))?;
                }
                Sums::Storage(nearest, sums) => {
                    accumulate::record(&mut recorder, &splats, rows, nearest, sums)?;
                    match &tiles {
                        Some(tiles) => tiles::accumulate(&mut recorder, &splats, rows, tiles, (nearest, sums))?,
                        None => accumulate::record_large(&mut recorder, &splats, rows, nearest, sums)?,
                    }
                    let mut sums = vec![("sums", sums.sums.bound()), ("added", sums.sums.bound())];
                    sums.extend(splats.surfels.texture());
                    resolve::record(&mut recorder, rows, (nearest.covered(rows), sums), &pixels.image)?;
                }
                Sums::Targets(_, targets) => {
                    let covered = Covered::new(&targets.covered, 0);
                    resolve::record(&mut recorder, rows, (covered, targets.bindings()), &pixels.image)?;
                }
            }
            resolve::read_back(&recorder, rows, &pixels.image, &mut frame)?;
            progress.advance(rows.count.into());
        }
        progress.end();
        let total_ms = start.elapsed().as_secs_f64() * 1e3;
        let wrapped = match &pixels.sums {
            Sums::Storage(_, sums) => Some(sums.counter()),
            Sums::Gathered(_) | Sums::Targets(..) => None,
        };
        let of_tiles = tiles.iter().flat_map(Tiles::counters);
        let counters: Vec<_> = splats.counters().chain(of_tiles).chain(wrapped).collect();
        let mut counted = counts(gpu, &counters)?.into_iter();
        let tally = splats.tally(&mut counted);
        let listed = tiles.as_ref().is_none_or(|tiles| tiles.held(&mut counted));
        let overflows: u64 = counted.next().map_or(0, |[wrapped, _]| wrapped.into());
        self.none_large = tally.most_large == 0;
        if !listed || needs.cull && !tally.held {
            if !tally.held {
                splats.forget_room();
            }
            // The next try measures the room that it needs.
            (self.splats, self.pixels) = (Some(splats), Some(pixels));
            let (frame, report) = self.on_gpu(gpu, sources, camera, progress)?;
            return Ok((frame, Report { total_ms: report.total_ms + total_ms, ..report }));
        }
        if overflows > 0 {
            // The device's memory is free again before the second try.
            drop((pixels, splats));
            let exact = RenderOptions { accumulator: Accumulator::Fixed, ..self.options.clone() };
            let mut again = Renderer::new(self.scene, &exact, self.backend)?;
            let (frame, report) = again.frame(camera, progress)?;
            self.held = again.held;
            return Ok((frame, Report { overflows, total_ms: report.total_ms + total_ms, ..report }));
        }
        let clock = if recorder.timing.on_device() { "timestamps" } else { "wall" };
        let passes = recorder.timing.finish(gpu)?;
        let report = Report {
            backend: if needs.raster.is_some() { "raster" } else { "gpu" },
            adapter: gpu.adapter.name.clone(),
            accumulator: needs.raster.map_or(variant.accumulator.name, |raster| raster.format.name()),
            overflows: 0,
            surfels: self.scene.surfels.len() as u64,
            splats_drawn: tally.drawn,
            width: camera.width,
            height: camera.height,
            passes: passes.into_iter().map(|(stage, ms)| (format!("{stage}_ms"), ms)).collect(),
            clock,
            total_ms,
            needs: needs.names(),
        };
        let of_tiles = tiles.as_ref().map_or(0, Tiles::bytes);
        self.held = DeviceBytes { splats: splats.bytes(), pixels: pixels.bytes() + of_tiles };
        (self.splats, self.pixels, self.tiles) = (Some(splats), Some(pixels), tiles);
        Ok((frame, report))
    }

    fn view(&self, camera: &Camera) -> View {
        View::new(self.scene, &self.facts, camera, self.options)
    }
}
