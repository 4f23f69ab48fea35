//! Keeps the device state of a scene from frame to frame, and retries a frame until its buffers
//! fit.

use std::collections::BTreeMap;
use std::time::Instant;

use super::encode::Recorded;
use super::exchange::{Among, Rows};
use super::kernels::Kernels;
use super::report::{DeviceBytes, Report};
use super::run::{Run, Tally};
use super::sequence;
use super::store::Store;
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::kernel::beside;
use crate::gpu::layout::View;
use crate::gpu::{Gpu, Sources, Traffic};
use crate::passes::source::Source;
use crate::passes::upload::upload;
use crate::passes::{asks_for_order, finish, tiles};
use crate::plan::known::MOST_TRIES;
use crate::plan::{Facts, Fetch, Known, Optimisation, Organisation, Plan, Settings, tuning};
use crate::progress::Progress;
use crate::scene::Camera;

/// The facts of a scene, the sizes measured in its frames so far, and its kernels and buffers.
pub(super) struct Kept {
    pub(super) facts: Facts,
    pub(super) options: Settings,
    pub(super) known: Known,
    /// State that only recorded frames ([`encode`](super::encode)) use.
    pub(super) recorded: Recorded,
    /// Width and height of the last frame, in samples.
    pub(super) size: Option<(u32, u32)>,
    pub(super) kernels: Option<Kernels>,
    pub(super) store: Option<Store>,
}

impl Kept {
    /// Creates the state of a scene with nothing on the device yet.
    pub(super) fn new(facts: Facts, options: Settings) -> Self {
        let (known, recorded) = (Known::default(), Recorded::default());
        Self { facts, options, known, recorded, size: None, kernels: None, store: None }
    }

    /// Device memory of the last frame.
    pub(super) fn device_bytes(&self) -> DeviceBytes {
        let (splats, pixels) = self.store.as_ref().map_or((0, 0), Store::bytes);
        DeviceBytes { splats, pixels }
    }

    /// Renders a frame, with retries until all buffers are large enough. If an exchange ends its
    /// bands, it has no rows.
    pub(super) fn frame(
        &mut self,
        (gpu, sources): (&Gpu, &Sources),
        source: &dyn Source,
        (camera, among): (&Camera, Option<Among<'_>>),
        bar: &dyn Progress,
    ) -> Result<(Frame, Report)> {
        let (image, camera) = (camera, &camera.sampled(self.options.samples)?);
        self.look_at(gpu, camera);
        let (mut total_ms, mut all_passes, mut traffic) = (0.0, BTreeMap::new(), Traffic::default());
        let mut number = 0;
        while number < MOST_TRIES + self.known.times_cut {
            let first = number == 0;
            number += 1;
            let plan = Plan::of(&self.facts, &gpu.adapter, camera, &self.options, &self.known)?;
            // Retries do not advance the progress bar.
            let progress = if first { bar } else { &() };
            self.prepare((gpu, sources), source, (&plan, camera), progress)?;
            let (Some(kernels), Some(store)) = (&self.kernels, &mut self.store) else { continue };
            if first {
                progress.begin("rendering rows", camera.height.into());
            }
            let (start, before) = (Instant::now(), Traffic::so_far());
            store.set_view(gpu, &View::new(&self.facts, camera, &self.options));
            let mut run = Run::new(gpu, &plan, kernels, store, &mut self.known);
            run.among = among;
            let mut frame = match among.is_some_and(|among| !among.exchange.shows_all()) {
                true => Frame::sparse(image, self.options.maps),
                false => Frame::empty(image, self.options.maps),
            };
            let all = run.steps(&sequence::steps(&plan), &mut frame, progress)?;
            let spent = start.elapsed();
            total_ms += spent.as_secs_f64() * 1e3;
            let tally = all.then(|| run.tally());
            let clock = if run.timing.on_device() { "timestamps" } else { "wall" };
            let order = &run.store.order;
            for (pass, ms) in run.timing.finish(gpu)? {
                *all_passes.entry(pass).or_insert(0.0) += ms;
            }
            traffic = traffic + (Traffic::so_far() - before);
            let complete = tally.as_ref().is_some_and(|tally| tally.complete);
            let complete = match among.filter(|_| all) {
                Some(among) => among.exchange.agree(&Rows::none(among.render), None, complete)?,
                None => complete,
            };
            if let Some(tally) = tally.filter(|_| complete) {
                finish(&mut frame, &plan.needs, &source.provenance(), order);
                bar.end();
                let report = self.report(gpu, &plan, image, (tally, clock, all_passes, total_ms));
                gpu.compiled.save();
                return Ok((frame, Report { compile_ms: gpu.compiled.take_ms(), traffic, ..report }));
            }
        }
        bar.end();
        Err(Run::never_fits(gpu))
    }

    /// Forgets what earlier views and other image sizes required, and samples how many tiles a
    /// splat touches.
    pub(super) fn look_at(&mut self, gpu: &Gpu, camera: &Camera) {
        self.known.forget_view();
        let size = Some((camera.width, camera.height));
        if self.size != size {
            self.known.forget_image();
            self.size = size;
        }
        let options = &self.options;
        let shares = tuning::fetch(&gpu.adapter, options) == Fetch::Shared;
        if shares && options.organisation == Organisation::Auto && options.has(Optimisation::Gathering) {
            self.known.touched_tiles = tiles::touched(&self.facts, camera, options);
        }
    }

    /// Compiles the kernels of a first frame.
    pub(super) fn warm(&mut self, (gpu, sources): (&Gpu, &Sources), camera: &Camera) -> Result<()> {
        self.look_at(gpu, camera);
        let plan = Plan::of(&self.facts, &gpu.adapter, camera, &self.options, &self.known)?;
        let large = tiles::likely(&self.facts, camera, (&plan.needs, &self.options));
        Kernels::new(sources, &plan, &self.options, self.facts.surfels).compile(gpu, &plan, large)
    }

    /// Compiles the kernels and creates the buffers of `plan` that do not exist yet; the kernels
    /// are compiled while the scene is uploaded. If both fail, the error of the kernels is
    /// returned.
    pub(super) fn prepare(
        &mut self,
        (gpu, sources): (&Gpu, &Sources),
        source: &dyn Source,
        (plan, camera): (&Plan, &Camera),
        progress: &dyn Progress,
    ) -> Result<()> {
        let surfels = self.facts.surfels;
        let kernels = self.kernels.take().filter(|kernels| kernels.serve(plan, &self.options, surfels));
        let kernels = kernels.unwrap_or_else(|| {
            // Bind groups keep pipelines, which take memory.
            self.store.iter().for_each(|store| store.groups.forget());
            Kernels::new(sources, plan, &self.options, surfels)
        });
        if self.store.as_ref().is_some_and(|store| !store.serves(&plan.needs)) {
            // Frees the old buffers before new ones are allocated.
            self.store = None;
            self.known.forget_buffers();
        }
        let store = match &mut self.store {
            Some(store) => {
                kernels.compile(gpu, plan, false)?;
                store
            }
            None => {
                let ordered = self.options.has(Optimisation::Order) || asks_for_order(&plan.needs);
                let next = self.plan_of_cut(gpu, plan, camera);
                let large = tiles::likely(&self.facts, camera, (&plan.needs, &self.options));
                let compile = || {
                    kernels.compile(gpu, plan, large)?;
                    if let Some(next) = &next {
                        // Warm-up only: errors are reported by the compilation that is used.
                        let _ = Kernels::new(sources, next, &self.options, surfels).compile(gpu, next, false);
                    }
                    Ok(())
                };
                let stored = || {
                    let uploaded = upload(gpu, source, &plan.needs, (&self.facts, ordered), progress)?;
                    Store::new(gpu, uploaded, &plan.needs)
                };
                let (compiled, stored): (Result<()>, _) = beside(gpu, compile, stored);
                compiled?;
                self.store.insert(stored?)
            }
        };
        self.kernels = Some(kernels);
        store.fit(gpu, plan, &self.known)
    }

    /// If `plan` only measures a cut, guesses the plan that will follow it: that of a cut that fits
    /// one page.
    fn plan_of_cut(&self, gpu: &Gpu, plan: &Plan, camera: &Camera) -> Option<Plan> {
        let known = Known { cut: Some(vec![1]), ..self.known.clone() };
        let next = || Plan::of(&self.facts, &gpu.adapter, camera, &self.options, &known).ok();
        plan.looks_for_cut().then(next)?
    }

    fn report(
        &self,
        gpu: &Gpu,
        plan: &Plan,
        camera: &Camera,
        (tally, clock, passes, total_ms): (Tally, &'static str, BTreeMap<&'static str, f64>, f64),
    ) -> Report {
        let raster = plan.needs.surface.raster();
        Report {
            backend: if raster.is_some() { "raster" } else { "gpu" },
            adapter: gpu.adapter.name.clone(),
            accumulator: raster.map_or(plan.needs.accumulator.name(), |raster| raster.format.name()),
            overflows: self.known.overflows,
            surfels: self.facts.surfels,
            splats_drawn: tally.drawn.min(tally.cut.unwrap_or(self.facts.surfels)),
            cut: tally.cut,
            triangles: self.facts.mesh.triangles,
            width: camera.width,
            height: camera.height,
            passes: passes.into_iter().map(|(stage, ms)| (format!("{stage}_ms"), ms)).collect(),
            clock,
            total_ms,
            compile_ms: 0.0,
            traffic: Traffic::default(),
            needs: plan.needs.names(),
            tail: None,
            kernel: None,
        }
    }
}
