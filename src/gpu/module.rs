//! WGSL modules, and their entry points in the form that the device takes: SPIR-V or WGSL.

use naga::valid::Capabilities;

use super::adapter::AdapterDescription;
use super::device::Gpu;
use super::exact::Needs;
use super::interface::Interface;
use super::program::PipelineKey;
use super::sources::Text;
use super::spirv;
use super::twin;
use crate::error::Result;

/// A parsed module of kernels.
pub(super) struct Module {
    interface: Interface,
    counts_loops: bool,
    /// The workgroup variables that kernels set before they read them.
    set_memory: Vec<String>,
}

/// The bindings of a pipeline, on its device.
pub(super) struct Bound {
    pub bindings: Numbered,
    pub layout: wgpu::PipelineLayout,
}

/// The bindings of a pipeline.
pub(super) struct Numbered {
    /// Names and binding numbers of its variables.
    pub variables: Vec<(String, u32)>,
    pub entries: Vec<wgpu::BindGroupLayoutEntry>,
    /// The binding number of each variable in the WGSL source.
    of_text: Vec<u32>,
}

/// An entry point, ready to be compiled to a pipeline.
pub(super) struct Entry<'a> {
    name: &'a str,
    told: Told,
}

/// The shader code that the device gets.
enum Told {
    Words(Vec<u32>),
    Text(wgpu::ShaderModule),
}

impl Entry<'_> {
    /// Returns the key of the pipeline in the cache; `None` for WGSL, which is not cached.
    pub fn key(&self, bindings: &Numbered) -> Option<PipelineKey> {
        match &self.told {
            Told::Words(words) => Some((words.clone(), bindings.entries.clone(), bindings.variables.clone())),
            Told::Text(_) => None,
        }
    }

    /// Returns the shader module that contains the entry point.
    pub fn module(&self, gpu: &Gpu) -> wgpu::ShaderModule {
        match &self.told {
            Told::Words(words) => translated_here(gpu, self.name, words),
            Told::Text(text) => text.clone(),
        }
    }
}

impl Module {
    /// Parses and validates a module for a device.
    pub fn of(gpu: &Gpu, text: Text) -> Result<Self> {
        let spirv = gpu.takes_spirv();
        let capabilities = if spirv { spirv::capabilities(gpu.device.features()) } else { Capabilities::all() };
        Self::settled(text, capabilities, &gpu.adapter, spirv).map_err(|what| gpu.error(what))
    }

    /// Parses and validates a module that may use `capabilities`, and replaces the operations whose
    /// bits depend on `adapter`. `spirv` says whether the device takes SPIR-V.
    ///
    /// # Errors
    /// A message if the text is not valid, or cannot be rewritten.
    pub fn settled(
        text: Text,
        capabilities: Capabilities,
        adapter: &AdapterDescription,
        spirv: bool,
    ) -> Result<Self, String> {
        let interface = Interface::of(&text.joined, capabilities).map_err(|invalid| {
            let told = invalid.told(|line| text.place_of(line));
            format!("a kernel is not valid WGSL: {told}")
        })?;
        let needs = Needs {
            division: text.divides || !adapter.rounds_division(),
            integers: text.divides || !adapter.rounds_integers(),
            barriers: !spirv && adapter.api != twin::API,
        };
        let interface = interface
            .settled(capabilities, needs)
            .map_err(|e| format!("the arithmetic of a kernel cannot be settled: {e}"))?;
        Ok(Self { interface, counts_loops: text.counts_loops, set_memory: text.set_memory })
    }

    /// Checks that a draw's two stages and its targets match.
    pub fn check_stages(&self, gpu: &Gpu, stages: [&str; 2], targets: &[wgpu::ColorTargetState]) -> Result<()> {
        let fits = self.interface.check_stages(stages, targets);
        fits.map_err(|e| gpu.error(format!("the stages of a draw do not match: {e}")))
    }

    /// Returns the bindings of a pipeline of `entries`, each with its stage.
    pub fn bind(&self, gpu: &Gpu, entries: &[(wgpu::ShaderStages, &str)]) -> Result<Bound> {
        let bindings = self.numbered(entries, gpu.takes_spirv()).map_err(|what| gpu.error(what))?;
        let descriptor = wgpu::BindGroupLayoutDescriptor { label: None, entries: &bindings.entries };
        let group = gpu.device.create_bind_group_layout(&descriptor);
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&group)],
            ..Default::default()
        });
        Ok(Bound { bindings, layout })
    }

    /// Returns the bindings of a pipeline of `entries`, each with its stage. With `spirv`, they are
    /// numbered without gaps: then they are the same whether or not wgpu renumbers them.
    ///
    /// # Errors
    /// A message if a variable cannot be bound.
    pub fn numbered(&self, entries: &[(wgpu::ShaderStages, &str)], spirv: bool) -> Result<Numbered, String> {
        let layout = self.interface.layout(entries).map_err(|e| format!("a kernel cannot be bound: {e}"))?;
        let of_text = layout.iter().map(|(_, entry)| entry.binding).collect();
        let (mut variables, mut entries) = (Vec::new(), Vec::new());
        for (place, (name, mut entry)) in layout.into_iter().enumerate() {
            if spirv {
                entry.binding = place as u32;
            }
            variables.push((name, entry.binding));
            entries.push(entry);
        }
        Ok(Numbered { variables, entries, of_text })
    }

    /// Prepares the entry point `name` of a pipeline that binds `bindings`. Sets those of
    /// `constants` that the module declares.
    pub fn entry<'a>(
        &self,
        gpu: &Gpu,
        (stage, name): (naga::ShaderStage, &'a str),
        bindings: &Numbered,
        constants: &[(&'a str, f64)],
    ) -> Result<Entry<'a>> {
        let failed = |e: String| gpu.error(format!("the kernel {name} cannot be translated: {e}"));
        if !gpu.takes_spirv() {
            let text = self.interface.text_of((stage, name), &self.declared(constants)).map_err(failed)?;
            return Ok(Entry { name, told: Told::Text(translated_by_wgpu(gpu, text, self.counts_loops)) });
        }
        let (features, limits) = (gpu.device.features(), gpu.device.limits());
        let words = self.words(stage, name, bindings, constants, features, &limits).map_err(failed)?;
        Ok(Entry { name, told: Told::Words(words) })
    }

    /// Returns the SPIR-V of the entry point `name` that binds `bindings`, for a device with these
    /// features and limits. Sets those of `constants` that the module declares.
    ///
    /// # Errors
    /// A message if the translator refuses the module, or its workgroup is too large.
    pub fn words(
        &self,
        stage: naga::ShaderStage,
        name: &str,
        bindings: &Numbered,
        constants: &[(&str, f64)],
        features: wgpu::Features,
        limits: &wgpu::Limits,
    ) -> Result<Vec<u32>, String> {
        let numbers = bindings.of_text.iter().zip(&bindings.entries).map(|(&of_text, entry)| (of_text, entry.binding));
        let options = spirv::options(features, numbers, self.counts_loops);
        let constants = self.declared(constants);
        spirv::translate(&self.interface, (stage, name), &constants, (options, limits), &self.set_memory)
    }

    /// Returns those of `constants` that the module declares.
    fn declared<'a>(&self, constants: &[(&'a str, f64)]) -> Vec<(&'a str, f64)> {
        let declared = self.interface.overrides();
        constants.iter().copied().filter(|(name, _)| declared.iter().any(|d| d == name)).collect()
    }
}

fn translated_by_wgpu(gpu: &Gpu, text: String, counts_loops: bool) -> wgpu::ShaderModule {
    let descriptor =
        wgpu::ShaderModuleDescriptor { label: Some("epsplat"), source: wgpu::ShaderSource::Wgsl(text.into()) };
    let checks =
        wgpu::ShaderRuntimeChecks { force_loop_bounding: counts_loops, ..wgpu::ShaderRuntimeChecks::checked() };
    // SAFETY: of all run-time checks the bounds of loops alone are left out, and only where each
    // loop ends (src/gpu/loops.rs).
    #[allow(unsafe_code)]
    unsafe {
        gpu.device.create_shader_module_trusted(descriptor, checks)
    }
}

fn translated_here(gpu: &Gpu, name: &str, words: &[u32]) -> wgpu::ShaderModule {
    // Only Metal reads the workgroup's size.
    let entry = [wgpu::PassthroughShaderEntryPoint { name: name.into(), workgroup_size: (1, 1, 1) }];
    let descriptor = wgpu::ShaderModuleDescriptorPassthrough {
        label: Some(name),
        entry_points: entry.as_slice().into(),
        spirv: Some(words.into()),
        ..Default::default()
    };
    // SAFETY: what wgpu checks of WGSL and not of SPIR-V holds without it.
    // - The words are valid: `naga` wrote them, as it does for wgpu, from a module that it
    //   validated for exactly what the device's features allow. The decorations that are added here
    //   are on results that may have them.
    // - The bindings match the pipeline's layout: both come from the variables of the same module
    //   (`Interface::layout`), and other variables that the host sets are refused.
    // - No access leaves its variable: indices are restricted, except those of buffers, which the
    //   device itself bounds (`robustBufferAccess`: all of Vulkan has it, and wgpu asks for it). An
    //   index outside reads or writes another part of the same buffer at worst; wgpu's own
    //   translation would clamp it on devices without `robustBufferAccess2`.
    // - Memory is initialised: workgroup memory is zeroed in the kernel, or is that of a built-in
    //   kernel that sets it before it reads it, and wgpu initialises buffers.
    // - Loops end: they have counters, unless they are proven to end (src/gpu/loops.rs). Integer
    //   division by zero is checked.
    // - Workgroups and their memory are within the device's limits: `spirv::translate` checks that.
    // - The fragment shader reads only what the vertex shader writes, and fills the targets:
    //   `check_stages` checks that.
    #[allow(unsafe_code)]
    unsafe {
        gpu.device.create_shader_module_passthrough(descriptor)
    }
}
