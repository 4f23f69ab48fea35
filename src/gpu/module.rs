//! Modules of WGSL, and their entry points as a device takes them.

use naga::valid::Capabilities;

use super::device::Gpu;
use super::interface::Interface;
use super::program::PipelineKey;
use super::sources::Text;
use super::spirv;
use crate::error::Result;

/// A module of kernels.
pub(super) struct Module {
    interface: Interface,
    counts_loops: bool,
    /// Where the device takes no SPIR-V: the text, which wgpu translates.
    text: Option<wgpu::ShaderModule>,
}

/// What a pipeline binds.
pub(super) struct Bound {
    /// Its variables' names and numbers.
    pub variables: Vec<(String, u32)>,
    pub layout: wgpu::PipelineLayout,
    entries: Vec<wgpu::BindGroupLayoutEntry>,
    /// The number that each has in the text.
    of_text: Vec<u32>,
}

/// An entry point to compile.
pub(super) struct Entry<'a> {
    name: &'a str,
    told: Told,
    constants: Vec<(&'a str, f64)>,
}

/// What the device is told of an entry point.
enum Told {
    Words(Vec<u32>),
    Text(wgpu::ShaderModule),
}

impl Entry<'_> {
    /// What tells its pipeline from others, as far as it is known here.
    pub fn key(&self, bound: &Bound) -> Option<PipelineKey> {
        match &self.told {
            Told::Words(words) => Some((words.clone(), bound.entries.clone())),
            Told::Text(_) => None,
        }
    }

    /// The module that has it.
    pub fn module(&self, gpu: &Gpu) -> wgpu::ShaderModule {
        match &self.told {
            Told::Words(words) => translated_here(gpu, self.name, words),
            Told::Text(text) => text.clone(),
        }
    }

    /// What remains to be set.
    pub fn options(&self) -> wgpu::PipelineCompilationOptions<'_> {
        wgpu::PipelineCompilationOptions { constants: &self.constants, ..Default::default() }
    }
}

impl Module {
    /// The module of a text.
    pub fn of(gpu: &Gpu, text: Text) -> Result<Self> {
        let Text { joined, counts_loops } = text;
        let spirv = gpu.takes_spirv();
        let capabilities = if spirv { spirv::capabilities(gpu.device.features()) } else { Capabilities::all() };
        let interface = Interface::of(&joined, capabilities);
        let interface = interface.map_err(|e| gpu.error(format!("a kernel is not valid WGSL: {e}")))?;
        let text = (!spirv).then(|| translated_by_wgpu(gpu, joined, counts_loops));
        Ok(Self { interface, counts_loops, text })
    }

    /// Fails unless a pipeline's stages and targets fit each other.
    pub fn check_stages(&self, gpu: &Gpu, stages: [&str; 2], targets: &[wgpu::ColorTargetState]) -> Result<()> {
        let fits = self.interface.check_stages(stages, targets);
        fits.map_err(|e| gpu.error(format!("what is drawn does not fit: {e}")))
    }

    /// What a pipeline of `entries` binds, each with the stage it is of.
    pub fn bind(&self, gpu: &Gpu, entries: &[(wgpu::ShaderStages, &str)]) -> Result<Bound> {
        let layout = self.interface.layout(entries).map_err(|e| gpu.error(format!("a kernel cannot be bound: {e}")))?;
        let of_text = layout.iter().map(|(_, entry)| entry.binding).collect();
        let (mut variables, mut entries) = (Vec::new(), Vec::new());
        for (place, (name, mut entry)) in layout.into_iter().enumerate() {
            if self.text.is_none() {
                // Numbers without gaps are those that Vulkan is told, whether wgpu numbers anew or not.
                entry.binding = place as u32;
            }
            variables.push((name, entry.binding));
            entries.push(entry);
        }
        let group =
            gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries });
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&group)],
            ..Default::default()
        });
        Ok(Bound { variables, layout, entries, of_text })
    }

    /// The entry point `name` of a pipeline that binds `bound`. Of `constants` those are set that the module declares.
    pub fn entry<'a>(
        &self,
        gpu: &Gpu,
        (stage, name): (naga::ShaderStage, &'a str),
        bound: &Bound,
        constants: &[(&'a str, f64)],
    ) -> Result<Entry<'a>> {
        let declared = self.interface.overrides();
        let constants: Vec<_> =
            constants.iter().copied().filter(|(name, _)| declared.iter().any(|d| d == name)).collect();
        if let Some(text) = &self.text {
            return Ok(Entry { name, told: Told::Text(text.clone()), constants });
        }
        let numbers = bound.of_text.iter().zip(&bound.entries).map(|(&of_text, entry)| (of_text, entry.binding));
        let options = spirv::options(gpu.device.features(), numbers, self.counts_loops);
        let words = spirv::translate(&self.interface, (stage, name), &constants, (&options, &gpu.device.limits()))
            .map_err(|e| gpu.error(format!("the kernel {name} cannot be translated: {e}")))?;
        Ok(Entry { name, told: Told::Words(words), constants: Vec::new() })
    }
}

fn translated_by_wgpu(gpu: &Gpu, text: String, counts_loops: bool) -> wgpu::ShaderModule {
    let descriptor =
        wgpu::ShaderModuleDescriptor { label: Some("epsplat"), source: wgpu::ShaderSource::Wgsl(text.into()) };
    let checks =
        wgpu::ShaderRuntimeChecks { force_loop_bounding: counts_loops, ..wgpu::ShaderRuntimeChecks::checked() };
    // SAFETY: of all run-time checks the bounds of loops alone are left out, and only where each loop ends (src/gpu/loops.rs).
    #[allow(unsafe_code)]
    unsafe {
        gpu.device.create_shader_module_trusted(descriptor, checks)
    }
}

fn translated_here(gpu: &Gpu, name: &str, words: &[u32]) -> wgpu::ShaderModule {
    // Metal alone asks for the workgroup's size.
    let entry = [wgpu::PassthroughShaderEntryPoint { name: name.into(), workgroup_size: (1, 1, 1) }];
    let descriptor = wgpu::ShaderModuleDescriptorPassthrough {
        label: Some(name),
        entry_points: entry.as_slice().into(),
        spirv: Some(words.into()),
        ..Default::default()
    };
    // SAFETY: what wgpu checks of WGSL and not of SPIR-V holds without it.
    // - The words are valid: `naga` wrote them, as it does for wgpu, of a module that it found valid for what the device's features
    //   allow and nothing else; the decorations beside them are of results of the kind that may have it.
    // - They bind what the pipeline's layout says: both are made of the same module's variables (`Interface::layout`), and other variables that
    //   the host sets are refused.
    // - No access leaves its variable: indices are restricted, but for those of buffers, which wgpu has the device itself bound (`robustBufferAccess`,
    //   which all of Vulkan has and wgpu asks for). What lies outside reads or writes another part of that buffer at worst, where wgpu's own translation holds the
    //   index within it on devices without `robustBufferAccess2`.
    // - Memory is defined: workgroups' starts at zero, and buffers' is wgpu's.
    // - Loops end: they are counted, but for those that are known to (src/gpu/loops.rs). Integers are not divided by zero: checked.
    // - Workgroups and their memory are within the device's limits: looked at (`spirv::translate`).
    // - What is drawn hands on what the next stage takes, and fills the targets: looked at (`check_stages`).
    #[allow(unsafe_code)]
    unsafe {
        gpu.device.create_shader_module_passthrough(descriptor)
    }
}
