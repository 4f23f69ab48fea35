//! WGSL: named files are joined into one module per set of needs, bindings are found by name, overrides set by name.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use super::device::Gpu;
use super::layout::WORKGROUP;
use super::loops;
use crate::error::{Error, Result};

macro_rules! wgsl {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../wgsl/", $name)))),*]
    };
}

/// Every file of `wgsl/`.
pub const FILES: &[(&str, &str)] = wgsl![
    "accumulate.wgsl",
    "accumulator_cas.wgsl",
    "accumulator_fixed.wgsl",
    "accumulator_fixed32.wgsl",
    "accumulator_fixed64.wgsl",
    "accumulator_fixed_pairs.wgsl",
    "accumulator_fixed_wide.wgsl",
    "accumulator_float.wgsl",
    "accumulator_packed64.wgsl",
    "accumulator_raster.wgsl",
    "bin.wgsl",
    "blend.wgsl",
    "camera_orthographic.wgsl",
    "camera_pinhole.wgsl",
    "color_constant.wgsl",
    "color_linear.wgsl",
    "color_srgb8.wgsl",
    "color_sums.wgsl",
    "color_textured.wgsl",
    "copies.wgsl",
    "copies_absent.wgsl",
    "count.wgsl",
    "covered.wgsl",
    "count_absent.wgsl",
    "center.wgsl",
    "center_doubled.wgsl",
    "cull.wgsl",
    "cull_absent.wgsl",
    "depth.wgsl",
    "depth_absent.wgsl",
    "depth_whole.wgsl",
    "double.wgsl",
    "epsilon.wgsl",
    "epsilon_radius.wgsl",
    "filter.wgsl",
    "footprint.wgsl",
    "image_color.wgsl",
    "image_maps.wgsl",
    "kernel_constant.wgsl",
    "kernel_ellipse.wgsl",
    "kernel_gaussian.wgsl",
    "kernel_hat.wgsl",
    "layout.wgsl",
    "lowpass_ewa.wgsl",
    "lowpass_max.wgsl",
    "lowpass_none.wgsl",
    "normal.wgsl",
    "normal_absent.wgsl",
    "normal_map.wgsl",
    "normal_map_absent.wgsl",
    "occlusion.wgsl",
    "project.wgsl",
    "raster.wgsl",
    "raster_exact.wgsl",
    "raster_offset.wgsl",
    "raster_targets_1.wgsl",
    "raster_targets_2.wgsl",
    "raster_targets_3.wgsl",
    "records.wgsl",
    "resolve.wgsl",
    "rows.wgsl",
    "shade_lambert.wgsl",
    "shade_phong.wgsl",
    "shade_unlit.wgsl",
    "splat_plain.wgsl",
    "splat_shared.wgsl",
    "srgb.wgsl",
    "terms.wgsl",
    "terms_wide.wgsl",
    "texture.wgsl",
    "texture_absent.wgsl",
    "tile.wgsl",
    "tile_add.wgsl",
    "tile_add_wide.wgsl",
    "tile_deposit.wgsl",
    "tile_deposit_pairs.wgsl",
    "tile_filter.wgsl",
    "tile_filter_absent.wgsl",
    "tile_reach.wgsl",
    "tile_small.wgsl",
    "tile_small_absent.wgsl",
    "tile_sums.wgsl",
    "visibility.wgsl",
    "weight_map.wgsl",
    "weight_map_absent.wgsl",
    "words.wgsl",
    "words_long.wgsl",
];

/// The kernels' texts. The built-in ones, of which a researcher (or a test that must fail) may replace parts.
#[derive(Clone, Debug)]
pub struct Sources {
    texts: BTreeMap<&'static str, Cow<'static, str>>,
    counts_loops: bool,
}

impl Default for Sources {
    fn default() -> Self {
        Self { texts: FILES.iter().map(|&(name, text)| (name, Cow::Borrowed(text))).collect(), counts_loops: false }
    }
}

impl Sources {
    /// Replaces the one place in `file` that reads `from`; an error if there is not exactly one.
    pub fn replace(mut self, file: &str, from: &str, to: &str) -> Result<Self> {
        let text = self.texts.get_mut(file).ok_or_else(|| Error::Usage(format!("there is no kernel file {file}")))?;
        if text.matches(from).count() != 1 {
            return Err(Error::Usage(format!("{file} must hold {from:?} once, to be replaced")));
        }
        *text = Cow::Owned(text.replacen(from, to, 1));
        Ok(self)
    }

    /// The same, of which every loop is counted, those that are known to end too.
    pub(crate) fn with_counted_loops(self) -> Self {
        Self { counts_loops: true, ..self }
    }

    /// Whether all loops of `files` are known to end, and so need not be counted.
    pub(super) fn all_end(&self, files: &[&str]) -> bool {
        let ends = |file: &&str| match self.texts.get(file) {
            Some(Cow::Borrowed(text)) => loops::all_end(file, text),
            _ => false,
        };
        !self.counts_loops && files.iter().all(ends)
    }

    /// One module of `files`: WGSL's module scope is free of order, so joining is concatenation.
    pub fn join(&self, files: &[&str]) -> String {
        files.iter().map(|name| self.texts.get(name).map_or("", |text| text)).collect::<Vec<_>>().join("\n")
    }
}

/// Bindings of a module's kernels, by entry point: the names of the variables each uses and their numbers.
pub type Bindings = BTreeMap<String, Vec<(String, u32)>>;

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

/// Programs by their text and constants: what was compiled once for a device is not compiled again.
#[derive(Default)]
pub(crate) struct Programs(Mutex<HashMap<ProgramKey, Arc<Program>>>);

/// A module's text, its constants by name as bits, and in words its entry points, draws and whether its loops end.
type ProgramKey = (String, Vec<(&'static str, u64)>, String);

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

/// A render pipeline to compile: the rasteriser's part of a program.
#[derive(Debug)]
pub(crate) struct Draw {
    pub(crate) name: &'static str,
    pub(crate) vertex: &'static str,
    pub(crate) fragment: &'static str,
    pub(crate) targets: Vec<wgpu::ColorTargetState>,
    pub(crate) depth: Option<wgpu::DepthStencilState>,
    /// Set beside the program's constants.
    pub(crate) constant: Option<(&'static str, f64)>,
}

/// The compiled kernels of a render.
pub struct Program {
    pipelines: BTreeMap<String, wgpu::ComputePipeline>,
    draws: BTreeMap<String, wgpu::RenderPipeline>,
    bindings: Bindings,
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
        let module = loops::module(gpu, sources, files, text);
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
            let extra = draw.constant.filter(|(name, _)| declared.iter().any(|d| d == name));
            let constants: Vec<_> = constants.iter().copied().chain(extra).collect();
            let compilation_options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
            let targets: Vec<_> = draw.targets.iter().cloned().map(Some).collect();
            let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(draw.name),
                layout: None,
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(draw.vertex),
                    compilation_options: compilation_options.clone(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState {
                    topology: wgpu::PrimitiveTopology::TriangleList,
                    ..Default::default()
                },
                depth_stencil: draw.depth.clone(),
                multisample: Default::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(draw.fragment),
                    compilation_options,
                    targets: &targets,
                }),
                multiview_mask: None,
                cache: None,
            });
            let of = |entry: &str| bindings.get(entry).cloned().unwrap_or_default();
            let both: BTreeSet<_> = of(draw.vertex).into_iter().chain(of(draw.fragment)).collect();
            bindings.insert(draw.name.to_owned(), both.into_iter().collect());
            drawn.insert(draw.name.to_owned(), pipeline);
        }
        if let Some(error) = pollster::block_on(guard.pop()) {
            return Err(refused(error));
        }
        Ok(Self { pipelines, draws: drawn, bindings })
    }

    /// What `stage` binds of `bound`, by name: each of its variables must be among them, others are ignored.
    fn group(
        &self,
        gpu: &Gpu,
        stage: &str,
        layout: &wgpu::BindGroupLayout,
        bound: &[(&str, wgpu::BindingResource<'_>)],
    ) -> Result<wgpu::BindGroup> {
        let variables = self.bindings.get(stage).map_or(&[][..], Vec::as_slice);
        let mut entries = Vec::with_capacity(variables.len());
        for (name, binding) in variables {
            let (_, resource) = bound
                .iter()
                .find(|(given, _)| given == name)
                .ok_or_else(|| gpu.error(format!("the kernel {stage} needs a buffer {name}")))?;
            entries.push(wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() });
        }
        Ok(gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(stage), layout, entries: &entries }))
    }

    /// Dispatches `stage` over `grid`.
    pub(crate) fn dispatch(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        stage: &str,
        bound: &[(&str, wgpu::BindingResource<'_>)],
        grid: Grid<'_>,
    ) -> Result<()> {
        let Some(pipeline) = self.pipelines.get(stage) else {
            return Err(gpu.error(format!("there is no kernel {stage}")));
        };
        let group = self.group(gpu, stage, &pipeline.get_bind_group_layout(0), bound)?;
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
    pub(crate) fn draw(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::RenderPass<'_>,
        name: &str,
        bound: &[(&str, wgpu::BindingResource<'_>)],
        vertices: u32,
    ) -> Result<()> {
        let Some(pipeline) = self.draws.get(name) else {
            return Err(gpu.error(format!("there is no pipeline {name}")));
        };
        let group = self.group(gpu, name, &pipeline.get_bind_group_layout(0), bound)?;
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..vertices, 0..1);
        Ok(())
    }
}

/// Buffers and textures by the names of the variables they are bound to.
pub(crate) type Bound<'a> = Vec<(&'a str, wgpu::BindingResource<'a>)>;

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
    let limit = u64::from(gpu.limits.max_compute_workgroups_per_dimension);
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
