//! Pipelines of kernels: compiled in parallel, and dispatched by name with the resources that they
//! bind.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use super::device::Gpu;
use super::layout::WORKGROUP;
use super::module::Module;
use super::program::{Compiled, Draw, PipelineKey, Program};
use super::sources::{Sources, Text};
use super::traffic::Traffic;
use crate::error::{Error, Result};

impl Compiled {
    /// Returns the program that has the entry points `stages` and the `draws` of the module of
    /// `files`. Compiles it unless the cache has it.
    pub(crate) fn get(
        &self,
        gpu: &Gpu,
        (sources, files): (&Sources, &[&str]),
        stages: &[&str],
        draws: &[Draw],
        constants: &[(&'static str, f64)],
    ) -> Result<Arc<Program>> {
        self.compiled(gpu, sources.text(files), stages, draws, constants)
    }

    /// Returns the program of the entry point `stage` of one file, which rounds no number: the
    /// arithmetic is not part of its module.
    pub(crate) fn without_arithmetic(
        &self,
        gpu: &Gpu,
        (sources, file): (&Sources, &str),
        stage: &str,
    ) -> Result<Arc<Program>> {
        self.compiled(gpu, sources.text_of(&[file]), &[stage], &[], &[])
    }

    fn compiled(
        &self,
        gpu: &Gpu,
        text: Text,
        stages: &[&str],
        draws: &[Draw],
        constants: &[(&'static str, f64)],
    ) -> Result<Arc<Program>> {
        let bits = constants.iter().map(|&(name, value)| (name, value.to_bits())).collect();
        let key = (text.joined.clone(), bits, format!("{stages:?} {draws:?} {} {}", text.counts_loops, text.divides));
        // A poisoned lock means that another thread panicked while it held the lock. The cache is
        // intact.
        let programs = || self.programs.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(program) = programs().get(&key) {
            return Ok(program);
        }
        // Other threads can compile meanwhile; at worst, two threads compile the same program.
        let program = self.timed(|| Program::compile(gpu, text, stages, draws, constants)).map(Arc::new)?;
        programs().insert(key, Arc::clone(&program));
        Ok(program)
    }

    /// The driver's cache that is kept on disk, if there is one.
    fn on_disk(&self) -> Option<&wgpu::PipelineCache> {
        self.stored.as_ref().map(|stored| &stored.cache)
    }

    /// Returns the cached pipeline of `key`, or makes one and caches it. Without a key, nothing is
    /// cached.
    fn pipeline(
        &self,
        key: Option<PipelineKey>,
        make: impl FnOnce() -> Result<wgpu::ComputePipeline>,
    ) -> Result<wgpu::ComputePipeline> {
        let pipelines = || self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = key.as_ref().and_then(|key| pipelines().get(key)) {
            return Ok(known);
        }
        let made = make()?;
        key.into_iter().for_each(|key| pipelines().insert(key, made.clone()));
        Ok(made)
    }
}

/// Stack size of a thread that compiles: that of a process's first thread, on which compilers of
/// drivers are usually tested.
pub(crate) const COMPILER_STACK: usize = 8 << 20;

/// Returns the result of `make` for each of `things`, in order, computed on several new threads.
///
/// Threads of a pool are not suitable. While such a thread waits, it takes up other work, on a
/// stack of 2 MiB that already holds the driver's frames. That work may wait for these very
/// kernels.
pub(crate) fn side_by_side<T: Sync, M: Send>(things: &[T], make: impl Fn(&T) -> M + Sync) -> Vec<M> {
    let (next, made) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    let work = || {
        loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            let Some(thing) = things.get(place) else { return };
            let result = make(thing);
            made.lock().unwrap_or_else(PoisonError::into_inner).insert(place, result);
        }
    };
    let threads = thread::available_parallelism().map_or(1, usize::from).min(things.len());
    thread::scope(|scope| {
        let spawned = |_| thread::Builder::new().stack_size(COMPILER_STACK).spawn_scoped(scope, work).ok();
        let spawned: Vec<_> = (0..threads).filter_map(spawned).collect();
        // If no thread can be started, the current thread does all the work.
        if spawned.is_empty() {
            work();
        }
        // Joins each thread, as a scope does not wait for the destructors of thread-local values,
        // which may be the driver's.
        for thread in spawned {
            if let Err(panic) = thread.join() {
                std::panic::resume_unwind(panic);
            }
        }
    });
    made.into_inner().unwrap_or_else(PoisonError::into_inner).into_values().collect()
}

/// Whether nothing else should use the device while a module is compiled. In OpenGL, a thread that
/// compiles holds the context, and other threads give up waiting for it after a short time.
pub(crate) fn compiles_alone(gpu: &Gpu) -> bool {
    gpu.adapter.api == "gl"
}

/// Runs `compile` on a new thread while the current thread runs `other`, which uses the device. If
/// no thread can be started, `compile` runs first.
pub(crate) fn beside<M: Send, O>(gpu: &Gpu, compile: impl Fn() -> M + Sync, other: impl FnOnce() -> O) -> (M, O) {
    if compiles_alone(gpu) {
        return (compile(), other());
    }
    thread::scope(|scope| {
        let compiling = thread::Builder::new().stack_size(COMPILER_STACK).spawn_scoped(scope, &compile);
        let Ok(compiling) = compiling else { return (compile(), other()) };
        let other = other();
        (compiling.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), other)
    })
}

impl Draw {
    /// Compiles this draw from `module`, with `constants` and the draw's own constant. Returns the
    /// pipeline, and the names and binding numbers of its variables.
    fn pipeline(
        &self,
        gpu: &Gpu,
        module: &Module,
        constants: &[(&str, f64)],
    ) -> Result<(wgpu::RenderPipeline, Vec<(String, u32)>)> {
        gpu.spare.will_draw();
        let constants: Vec<_> = constants.iter().copied().chain(self.constant).collect();
        let bound = module
            .bind(gpu, &[(wgpu::ShaderStages::VERTEX, self.vertex), (wgpu::ShaderStages::FRAGMENT, self.fragment)])?;
        module.check_stages(gpu, [self.vertex, self.fragment], &self.targets)?;
        let vertex = module.entry(gpu, (naga::ShaderStage::Vertex, self.vertex), &bound.bindings, &constants)?;
        let fragment = module.entry(gpu, (naga::ShaderStage::Fragment, self.fragment), &bound.bindings, &constants)?;
        let targets: Vec<_> = self.targets.iter().cloned().map(Some).collect();
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(self.name),
            layout: Some(&bound.layout),
            vertex: wgpu::VertexState {
                module: &vertex.module(gpu),
                entry_point: Some(self.vertex),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState { topology: wgpu::PrimitiveTopology::TriangleList, ..Default::default() },
            depth_stencil: self.depth.clone(),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &fragment.module(gpu),
                entry_point: Some(self.fragment),
                compilation_options: Default::default(),
                targets: &targets,
            }),
            multiview_mask: None,
            cache: gpu.compiled.on_disk(),
        });
        Ok((pipeline, bound.bindings.variables))
    }
}

/// Returns the result of `make`, or the first error that the device reports for it. Error scopes
/// are per thread, so the error reaches the thread that caused it.
fn watched<T>(gpu: &Gpu, make: impl FnOnce() -> Result<T>) -> Result<T> {
    let kinds = [wgpu::ErrorFilter::Validation, wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Internal];
    let scopes = kinds.map(|kind| gpu.device.push_error_scope(kind));
    let made = make();
    let told: Vec<_> = scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop())).collect();
    match told.first() {
        Some(error) => Err(gpu.error(format!("a kernel was refused: {error}"))),
        None => made,
    }
}

/// Compiles the entry point `stage` of a module. Returns the pipeline, and the names and binding
/// numbers of its variables.
fn compute(
    gpu: &Gpu,
    module: &Module,
    stage: &str,
    constants: &[(&str, f64)],
) -> Result<(wgpu::ComputePipeline, Vec<(String, u32)>)> {
    let bound = module.bind(gpu, &[(wgpu::ShaderStages::COMPUTE, stage)])?;
    let entry = module.entry(gpu, (naga::ShaderStage::Compute, stage), &bound.bindings, constants)?;
    let make = || {
        Ok(gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(stage),
            layout: Some(&bound.layout),
            module: &entry.module(gpu),
            entry_point: Some(stage),
            compilation_options: Default::default(),
            cache: gpu.compiled.on_disk(),
        }))
    };
    let pipeline = gpu.compiled.pipeline(entry.key(&bound.bindings), || watched(gpu, make))?;
    Ok((pipeline, bound.bindings.variables))
}

impl Program {
    /// Compiles the entry points `stages` of a module, and `draws`. Sets those of `constants` that
    /// the module declares.
    pub(crate) fn compile(
        gpu: &Gpu,
        text: Text,
        stages: &[&str],
        draws: &[Draw],
        constants: &[(&str, f64)],
    ) -> Result<Self> {
        let mut program = Self { counts_loops: text.counts_loops, ..Self::default() };
        let module = watched(gpu, || Module::of(gpu, text))?;
        // Compiles in parallel: sequentially, compilation would take half the time of a first
        // frame.
        let compiled = side_by_side(stages, |&stage| watched(gpu, || compute(gpu, &module, stage, constants)));
        for (&stage, compiled) in stages.iter().zip(compiled) {
            let (pipeline, variables) = compiled?;
            program.pipelines.insert(stage.to_owned(), pipeline);
            program.bindings.insert(stage.to_owned(), variables);
        }
        let drawn = side_by_side(draws, |draw| watched(gpu, || draw.pipeline(gpu, &module, constants)));
        for (draw, made) in draws.iter().zip(drawn) {
            let (pipeline, variables) = made?;
            program.draws.insert(draw.name.to_owned(), pipeline);
            program.bindings.insert(draw.name.to_owned(), variables);
        }
        Ok(program)
    }

    /// Creates the bind group of `stage`; `binding` returns the resource of each variable by its
    /// name.
    fn group<'a>(
        &self,
        gpu: &Gpu,
        stage: &str,
        layout: &wgpu::BindGroupLayout,
        binding: &dyn Fn(&str) -> Option<wgpu::BindingResource<'a>>,
    ) -> Result<wgpu::BindGroup> {
        let entry = |(name, number): &(String, u32)| {
            let resource =
                binding(name).ok_or_else(|| gpu.error(format!("the kernel {stage} needs a buffer {name}")))?;
            Ok(wgpu::BindGroupEntry { binding: *number, resource })
        };
        let entries = self.variables(stage).iter().map(entry).collect::<Result<Vec<_>>>()?;
        Traffic::count(Traffic { bind_groups: 1, ..Traffic::default() });
        Ok(gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(stage), layout, entries: &entries }))
    }

    /// Returns the pipeline of `stage`.
    fn pipeline(&self, gpu: &Gpu, stage: &str) -> Result<&wgpu::ComputePipeline> {
        self.pipelines.get(stage).ok_or_else(|| gpu.error(format!("there is no kernel {stage}")))
    }

    /// Dispatches `stage` over `grid`; `binding` returns the resource of each variable by its name.
    pub(crate) fn dispatch<'a>(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        stage: &str,
        binding: &dyn Fn(&str) -> Option<wgpu::BindingResource<'a>>,
        grid: Grid<'_>,
    ) -> Result<()> {
        let pipeline = self.pipeline(gpu, stage)?;
        let group = self.group(gpu, stage, &pipeline.get_bind_group_layout(0), binding)?;
        over(pass, pipeline, &group, grid);
        Ok(())
    }

    /// Dispatches `stage` as [`dispatch`](Self::dispatch) does, with the bind group that `groups`
    /// keeps for the pipeline and `place`.
    pub(crate) fn dispatch_kept<'a>(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        stage: &str,
        (groups, place): (&Groups, Place),
        binding: &dyn Fn(&str) -> Option<wgpu::BindingResource<'a>>,
        grid: Grid<'_>,
    ) -> Result<()> {
        let pipeline = self.pipeline(gpu, stage)?;
        let key = (pipeline.clone(), place);
        // A poisoned lock means that another thread panicked; the groups are intact.
        let mut kept = groups.0.lock().unwrap_or_else(PoisonError::into_inner);
        let group = match kept.entry(key) {
            Entry::Occupied(group) => group.into_mut(),
            Entry::Vacant(none) => none.insert(self.group(gpu, stage, &pipeline.get_bind_group_layout(0), binding)?),
        };
        over(pass, pipeline, group, grid);
        Ok(())
    }
}

/// The page, the band and the kind of lists that a dispatch is about.
pub(crate) type Place = (usize, usize, Option<usize>);

/// Bind groups that serve every frame as long as the buffers in them do.
#[derive(Default)]
pub(crate) struct Groups(Mutex<BTreeMap<(wgpu::ComputePipeline, Place), wgpu::BindGroup>>);

impl Groups {
    /// Drops all groups, and with them their hold on buffers. Callers do this before they replace a
    /// buffer.
    pub(crate) fn forget(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}

fn over(pass: &mut wgpu::ComputePass<'_>, pipeline: &wgpu::ComputePipeline, group: &wgpu::BindGroup, grid: Grid<'_>) {
    Traffic::count(Traffic { dispatches: 1, ..Traffic::default() });
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group, &[]);
    match grid {
        Grid::Of((x, y)) => pass.dispatch_workgroups(x, y, 1),
        Grid::In(buffer, at) => pass.dispatch_workgroups_indirect(buffer, at),
    }
}

impl Program {
    /// Draws `vertices` vertices as triangles with the pipeline `name`.
    pub(crate) fn draw<'a>(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::RenderPass<'_>,
        name: &str,
        binding: &dyn Fn(&str) -> Option<wgpu::BindingResource<'a>>,
        vertices: u32,
    ) -> Result<()> {
        let Some(pipeline) = self.draws.get(name) else {
            return Err(gpu.error(format!("there is no pipeline {name}")));
        };
        let group = self.group(gpu, name, &pipeline.get_bind_group_layout(0), binding)?;
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..vertices, 0..1);
        Ok(())
    }
}

/// The workgroups of a dispatch.
pub(crate) enum Grid<'a> {
    /// The number of workgroups in x and y.
    Of((u32, u32)),
    /// The device writes the number, at this byte offset of a buffer.
    In(&'a wgpu::Buffer, u64),
}

/// Returns a 2-D grid of workgroups with at least `invocations` invocations, within the adapter's
/// limit per dimension.
///
/// # Errors
/// [`Error::Limit`] if two dimensions are not enough.
pub fn grid(gpu: &Gpu, invocations: u64) -> Result<(u32, u32)> {
    workgroup_grid(gpu, invocations.div_ceil(u64::from(WORKGROUP)))
}

/// Returns a 2-D grid of at least `groups` workgroups, within the adapter's limit per dimension.
///
/// # Errors
/// [`Error::Limit`] if two dimensions are not enough.
pub fn workgroup_grid(gpu: &Gpu, groups: u64) -> Result<(u32, u32)> {
    let limit = u64::from(gpu.adapter.max_compute_workgroups_per_dimension);
    let rows = groups.div_ceil(limit).max(1);
    if rows > limit {
        return Err(Error::Limit {
            adapter: gpu.adapter.name.clone(),
            limit: "max_compute_workgroups_per_dimension",
            available: limit,
            needed: rows,
            what: format!("in two dimensions for {groups} workgroups"),
        });
    }
    Ok((groups.div_ceil(rows) as u32, rows as u32))
}
