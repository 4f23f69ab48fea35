//! Pipelines of kernels: they are compiled, and dispatched with what they bind, by name.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use super::device::Gpu;
use super::layout::WORKGROUP;
use super::module::Module;
use super::program::{Compiled, Draw, PipelineKey, Program};
use super::sources::{Sources, Text};
use crate::error::{Error, Result};

impl Compiled {
    /// The entry points `stages` of the module of `files`, and `draws`.
    pub(crate) fn get(
        &self,
        gpu: &Gpu,
        (sources, files): (&Sources, &[&str]),
        stages: &[&str],
        draws: &[Draw],
        constants: &[(&'static str, f64)],
    ) -> Result<Arc<Program>> {
        let bits = constants.iter().map(|&(name, value)| (name, value.to_bits())).collect();
        let key = (sources.join(files), bits, format!("{stages:?} {draws:?} {}", sources.all_end(files)));
        // A poisoned lock means that another thread panicked while it looked; the list itself is whole.
        let programs = || self.programs.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(program) = programs().get(&key) {
            return Ok(program);
        }
        // Others compile meanwhile, at worst the same.
        let program = Arc::new(Program::compile(gpu, sources.text(files), stages, draws, constants)?);
        programs().insert(key, Arc::clone(&program));
        Ok(program)
    }

    /// The pipeline of this key, or what `make` makes.
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

/// The stack of a thread that compiles: that of a process's first thread, which compilers of drivers are tried on.
const COMPILER_STACK: usize = 8 << 20;

/// What `make` makes of each of `things`, in their order, on threads of their own. A thread of a pool would take up other work while it waits, on top of a driver's on a stack of
/// 2 MiB, and some that waits for these very kernels.
fn side_by_side<T: Sync, M: Send>(things: &[T], make: impl Fn(&T) -> M + Sync) -> Vec<M> {
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
        // Where there can be no thread more, this one does it all.
        if spawned.is_empty() {
            work();
        }
        // A scope does not wait for what threads drop at their ends, which may be the driver's; joining does.
        for thread in spawned {
            if let Err(panic) = thread.join() {
                std::panic::resume_unwind(panic);
            }
        }
    });
    made.into_inner().unwrap_or_else(PoisonError::into_inner).into_values().collect()
}

/// What `compile` makes on a thread of its own, and what `other` does with the device meanwhile; `compile` first where there can be no thread more.
pub(crate) fn beside<M: Send, O>(gpu: &Gpu, compile: impl Fn() -> M + Sync, other: impl FnOnce() -> O) -> (M, O) {
    // The context of OpenGL is one thread's as long as it compiles a kernel, and others do not wait for it for long.
    if gpu.adapter.api == "gl" {
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
    /// The pipeline of `module`, with `constants` and its own, and what it binds.
    fn pipeline(
        &self,
        gpu: &Gpu,
        module: &Module,
        constants: &[(&str, f64)],
    ) -> Result<(wgpu::RenderPipeline, Vec<(String, u32)>)> {
        let constants: Vec<_> = constants.iter().copied().chain(self.constant).collect();
        let bound = module
            .bind(gpu, &[(wgpu::ShaderStages::VERTEX, self.vertex), (wgpu::ShaderStages::FRAGMENT, self.fragment)])?;
        module.check_stages(gpu, [self.vertex, self.fragment], &self.targets)?;
        let vertex = module.entry(gpu, (naga::ShaderStage::Vertex, self.vertex), &bound, &constants)?;
        let fragment = module.entry(gpu, (naga::ShaderStage::Fragment, self.fragment), &bound, &constants)?;
        let targets: Vec<_> = self.targets.iter().cloned().map(Some).collect();
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(self.name),
            layout: Some(&bound.layout),
            vertex: wgpu::VertexState {
                module: &vertex.module(gpu),
                entry_point: Some(self.vertex),
                compilation_options: vertex.options(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState { topology: wgpu::PrimitiveTopology::TriangleList, ..Default::default() },
            depth_stencil: self.depth.clone(),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &fragment.module(gpu),
                entry_point: Some(self.fragment),
                compilation_options: fragment.options(),
                targets: &targets,
            }),
            multiview_mask: None,
            cache: None,
        });
        Ok((pipeline, bound.variables))
    }
}

/// What `make` makes, or what the device says against it: errors are told to the thread that made them.
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

/// The pipeline of one of a module's kernels, and what it binds.
fn compute(
    gpu: &Gpu,
    module: &Module,
    stage: &str,
    constants: &[(&str, f64)],
) -> Result<(wgpu::ComputePipeline, Vec<(String, u32)>)> {
    let bound = module.bind(gpu, &[(wgpu::ShaderStages::COMPUTE, stage)])?;
    let entry = module.entry(gpu, (naga::ShaderStage::Compute, stage), &bound, constants)?;
    let make = || {
        Ok(gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(stage),
            layout: Some(&bound.layout),
            module: &entry.module(gpu),
            entry_point: Some(stage),
            compilation_options: entry.options(),
            cache: None,
        }))
    };
    let pipeline = gpu.compiled.pipeline(entry.key(&bound), || watched(gpu, make))?;
    Ok((pipeline, bound.variables))
}

impl Program {
    /// Compiles the entry points `stages` of a module, and `draws`. Of `constants` those are set that it declares.
    pub(crate) fn compile(
        gpu: &Gpu,
        text: Text,
        stages: &[&str],
        draws: &[Draw],
        constants: &[(&str, f64)],
    ) -> Result<Self> {
        let mut program = Self { counts_loops: text.counts_loops, ..Self::default() };
        let module = watched(gpu, || Module::of(gpu, text))?;
        // Half of a first frame's time would else go by here.
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

    /// What `stage` binds: each of its variables as `binding` says.
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
        Ok(gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(stage), layout, entries: &entries }))
    }

    /// Dispatches `stage` over `grid`.
    pub(crate) fn dispatch<'a>(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        stage: &str,
        binding: &dyn Fn(&str) -> Option<wgpu::BindingResource<'a>>,
        grid: Grid<'_>,
    ) -> Result<()> {
        let Some(pipeline) = self.pipelines.get(stage) else {
            return Err(gpu.error(format!("there is no kernel {stage}")));
        };
        let group = self.group(gpu, stage, &pipeline.get_bind_group_layout(0), binding)?;
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        match grid {
            Grid::Of((x, y)) => pass.dispatch_workgroups(x, y, 1),
            Grid::In(buffer, at) => pass.dispatch_workgroups_indirect(buffer, at),
        }
        Ok(())
    }
}

impl Program {
    /// Draws the triangles of `vertices` vertices by the pipeline `name`.
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
    /// In x and y.
    Of((u32, u32)),
    /// As the device wrote them at this byte of a buffer.
    In(&'a wgpu::Buffer, u64),
}

/// The 2-D grid of workgroups for `invocations`, within the adapter's limit per dimension.
pub fn grid(gpu: &Gpu, invocations: u64) -> Result<(u32, u32)> {
    workgroup_grid(gpu, invocations.div_ceil(u64::from(WORKGROUP)))
}

/// A 2-D grid of at least `groups` workgroups, within the adapter's limit per dimension.
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
