//! The sequence: project, visibility, accumulate, resolve, on every backend.

pub mod inspect;
mod kernels;
mod reference;
mod run;
pub mod sequence;
mod store;
mod targets;

use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;

use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::layout::View;
use crate::gpu::{Gpu, Sources};
use crate::passes::tiles;
use crate::passes::upload::upload;
use crate::plan::known::MOST_TRIES;
use crate::plan::{Facts, Known, Optimisation, Organisation, Plan, RenderOptions, check, tuning};
use crate::progress::Progress;
use crate::scene::{Camera, Scene};
use kernels::Kernels;
use run::Run;
use store::Store;

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

/// A scene on a backend, and what stays from frame to frame: the uploaded surfels, the buffers, the kernels, and what earlier frames
/// have shown. The second frame costs its passes alone.
pub struct Renderer<'a> {
    scene: &'a Scene,
    options: &'a RenderOptions,
    backend: &'a Backend,
    facts: Facts,
    known: Known,
    /// Width and height of the last frame.
    size: Option<(u32, u32)>,
    kernels: Option<Kernels>,
    store: Option<Store>,
}

impl<'a> Renderer<'a> {
    /// A renderer of `scene`; nothing is uploaded yet.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) for options, scenes and backends that do not go together.
    pub fn new(scene: &'a Scene, options: &'a RenderOptions, backend: &'a Backend) -> Result<Self> {
        check::options(options, matches!(backend, Backend::Reference))?;
        let facts = Facts::of(scene);
        check::scene(&facts, options, matches!(backend, Backend::Reference))?;
        let known = Known::default();
        Ok(Self { scene, options, backend, facts, known, size: None, kernels: None, store: None })
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
            Backend::Reference => Ok(reference::frame(self.scene, &self.facts, camera, self.options, progress)),
        }
    }

    /// Device memory that the last frame was rendered with; none for the reference.
    pub fn device_bytes(&self) -> DeviceBytes {
        let (splats, pixels) = self.store.as_ref().map_or((0, 0), Store::bytes);
        DeviceBytes { splats, pixels }
    }

    /// Tries until what is known of the view is enough.
    fn on_gpu(&mut self, gpu: &Gpu, sources: &Sources, camera: &Camera, bar: &dyn Progress) -> Result<(Frame, Report)> {
        self.look_at(gpu, camera);
        let mut total_ms = 0.0;
        for number in 0..MOST_TRIES {
            let plan = Plan::of(&self.facts, &gpu.adapter, camera, self.options, &self.known)?;
            // A second try adds nothing to the bar.
            let progress = if number == 0 { bar } else { &() };
            self.prepare(gpu, sources, &plan, progress)?;
            let (Some(kernels), Some(store)) = (&self.kernels, &mut self.store) else { continue };
            if number == 0 {
                progress.begin("rendering rows", camera.height.into());
            }
            let start = Instant::now();
            store.set_view(gpu, &View::new(&self.facts, camera, self.options));
            let mut run = Run::new(gpu, &plan, kernels, store, &mut self.known);
            let mut frame = Frame::new(camera, &self.options.maps);
            let all = run.steps(&sequence::steps(&plan), &mut frame, progress)?;
            let spent = start.elapsed();
            total_ms += spent.as_secs_f64() * 1e3;
            if !all {
                continue;
            }
            let tally = run.tally()?;
            if tally.complete {
                bar.end();
                let clock = if run.timing.on_device() { "timestamps" } else { "wall" };
                let passes = run.timing.finish(gpu)?;
                let report = self.report(gpu, &plan, camera, (tally.drawn, clock, passes, total_ms));
                return Ok((frame, report));
            }
        }
        bar.end();
        Err(Run::never_fits(gpu))
    }

    /// Forgets what held for another size of image, and looks at how large splats are.
    fn look_at(&mut self, gpu: &Gpu, camera: &Camera) {
        self.known.forget_view();
        let size = Some((camera.width, camera.height));
        if self.size != size {
            self.known.forget_image();
            self.size = size;
        }
        let options = self.options;
        let matters = options.organisation == Organisation::Auto && tuning::shares(&gpu.adapter);
        if matters && options.has(Optimisation::Gathering) && options.has(Optimisation::Sharing) {
            self.known.touched_tiles = tiles::touched(&self.facts, camera, options);
        }
    }

    /// Compiles the kernels and makes the buffers of `plan`, as far as they are not there.
    fn prepare(&mut self, gpu: &Gpu, sources: &Sources, plan: &Plan, progress: &dyn Progress) -> Result<()> {
        let surfels = self.facts.surfels;
        if !self.kernels.as_ref().is_some_and(|kernels| kernels.serve(plan, self.options, surfels)) {
            self.kernels = Some(Kernels::new(gpu, sources, plan, self.options, surfels)?);
        }
        if self.store.as_ref().is_some_and(|store| !store.serves(&plan.needs)) {
            // The old ones make room first.
            self.store = None;
            self.known.forget_buffers();
        }
        let store = match &mut self.store {
            Some(store) => store,
            empty => {
                let core = self.options.has(Optimisation::Order).then_some(&self.facts.core);
                let uploaded = upload(gpu, self.scene, &plan.needs, core, progress)?;
                empty.insert(Store::new(gpu, uploaded, &plan.needs)?)
            }
        };
        store.fit(gpu, plan, &self.known)
    }

    fn report(
        &self,
        gpu: &Gpu,
        plan: &Plan,
        camera: &Camera,
        (splats_drawn, clock, passes, total_ms): (u64, &'static str, BTreeMap<&'static str, f64>, f64),
    ) -> Report {
        let raster = plan.needs.raster;
        Report {
            backend: if raster.is_some() { "raster" } else { "gpu" },
            adapter: gpu.adapter.name.clone(),
            accumulator: raster.map_or(plan.needs.accumulator.name(), |raster| raster.format.name()),
            overflows: self.known.overflows,
            surfels: self.facts.surfels,
            splats_drawn,
            width: camera.width,
            height: camera.height,
            passes: passes.into_iter().map(|(stage, ms)| (format!("{stage}_ms"), ms)).collect(),
            clock,
            total_ms,
            needs: plan.needs.names(),
        }
    }
}
