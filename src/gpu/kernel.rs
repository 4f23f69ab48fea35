//! WGSL: joined files are compiled, bindings are found by name, overrides set by name.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, PoisonError};

use rayon::prelude::*;

use super::device::Gpu;
use super::layout::WORKGROUP;
use super::program::{Bindings, Draw, Program, Programs};
use super::sources::Sources;
use crate::error::{Error, Result};

/// Parses and validates a module; the names of its overrides and the bindings of its entry points.
pub fn reflect(text: &str) -> std::result::Result<(naga::Module, Bindings, Vec<String>), String> {
    let module = naga::front::wgsl::parse_str(text).map_err(|e| e.emit_to_string(text))?;
    let info = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::all())
        .validate(&module)
        .map_err(|e| e.emit_to_string(text))?;
    let mut bindings = Bindings::new();
    for (index, entry) in module.entry_points.iter().enumerate() {
        let uses = info.get_entry_point(index);
        let used = module.global_variables.iter().filter(|(handle, _)| !uses[*handle].is_empty());
        let named = used.filter_map(|(_, variable)| Some((variable.name.clone()?, variable.binding.as_ref()?.binding)));
        bindings.insert(entry.name.clone(), named.collect());
    }
    let overrides = module.overrides.iter().filter_map(|(_, o)| o.name.clone()).collect();
    Ok((module, bindings, overrides))
}

/// The module of `files` of `sources`, whose joined text is `text`.
fn module(gpu: &Gpu, sources: &Sources, files: &[&str], text: String) -> wgpu::ShaderModule {
    let descriptor =
        wgpu::ShaderModuleDescriptor { label: Some("epsplat"), source: wgpu::ShaderSource::Wgsl(text.into()) };
    if !sources.all_end(files) {
        return gpu.device.create_shader_module(descriptor);
    }
    let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..wgpu::ShaderRuntimeChecks::checked() };
    // SAFETY: of all run-time checks the bounds of loops alone are left out, and each loop of these files ends (see above).
    #[allow(unsafe_code)]
    unsafe {
        gpu.device.create_shader_module_trusted(descriptor, checks)
    }
}

impl Programs {
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
        // A poisoned lock means that another thread panicked while it compiled; the map itself is whole.
        let mut programs = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(program) = programs.get(&key) {
            return Ok(Arc::clone(program));
        }
        let program = Arc::new(Program::compile(gpu, (sources, files), stages, draws, constants)?);
        programs.insert(key, Arc::clone(&program));
        Ok(program)
    }
}

impl Draw {
    /// The pipeline in `module`, with `constants` and its own, of those that are `declared`.
    fn pipeline(
        &self,
        gpu: &Gpu,
        module: &wgpu::ShaderModule,
        constants: &[(&str, f64)],
        declared: &[String],
    ) -> wgpu::RenderPipeline {
        let own = self.constant.filter(|(name, _)| declared.iter().any(|d| d == name));
        let constants: Vec<_> = constants.iter().copied().chain(own).collect();
        let compilation_options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
        let targets: Vec<_> = self.targets.iter().cloned().map(Some).collect();
        gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(self.name),
            layout: None,
            vertex: wgpu::VertexState {
                module,
                entry_point: Some(self.vertex),
                compilation_options: compilation_options.clone(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState { topology: wgpu::PrimitiveTopology::TriangleList, ..Default::default() },
            depth_stencil: self.depth.clone(),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module,
                entry_point: Some(self.fragment),
                compilation_options,
                targets: &targets,
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

impl Program {
    /// Compiles the entry points `stages` of the module of `files`, and `draws`. Of `constants` those are set that it declares.
    fn compile(
        gpu: &Gpu,
        (sources, files): (&Sources, &[&str]),
        stages: &[&str],
        draws: &[Draw],
        constants: &[(&str, f64)],
    ) -> Result<Self> {
        let text = sources.join(files);
        let (_, mut bindings, declared) =
            reflect(&text).map_err(|e| gpu.error(format!("a kernel is not valid WGSL: {e}")))?;
        let constants: Vec<_> =
            constants.iter().copied().filter(|(name, _)| declared.iter().any(|d| d == name)).collect();
        let guard = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let module = module(gpu, sources, files, text);
        let refused = |error| gpu.error(format!("the driver refused a kernel: {error}"));
        // Each on a thread of its own: half of a first frame's time would else go by here.
        let pipelines = stages.par_iter().map(|&stage| {
            // Errors are told to the thread that made them.
            let guard = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
            let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(stage),
                layout: None,
                module: &module,
                entry_point: Some(stage),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &constants,
                    // Nothing here is read before it is written, and workgroup memory starts at zero by WGSL.
                    ..Default::default()
                },
                cache: None,
            });
            pollster::block_on(guard.pop()).map_or(Ok((stage.to_owned(), pipeline)), |error| Err(refused(error)))
        });
        let pipelines = pipelines.collect::<Result<BTreeMap<_, _>>>()?;
        let mut drawn = BTreeMap::new();
        for draw in draws {
            drawn.insert(draw.name.to_owned(), draw.pipeline(gpu, &module, &constants, &declared));
            let of = |entry: &str| bindings.get(entry).cloned().unwrap_or_default();
            let both: BTreeSet<_> = of(draw.vertex).into_iter().chain(of(draw.fragment)).collect();
            bindings.insert(draw.name.to_owned(), both.into_iter().collect());
        }
        if let Some(error) = pollster::block_on(guard.pop()) {
            return Err(refused(error));
        }
        Ok(Self { pipelines, draws: drawn, bindings, counts_loops: !sources.all_end(files) })
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
