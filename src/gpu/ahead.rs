//! Translates kernels for a Vulkan device that is not there, such as a graphics card whose compiler
//! is.

use super::adapter::AdapterDescription;
use super::module::Module;
use super::sources::Sources;
use super::spirv;

/// A Vulkan device as far as the translation of kernels depends on it.
#[derive(Clone, Debug)]
pub struct Target {
    /// Its description. A software adapter divides by its own instructions.
    pub adapter: AdapterDescription,
    /// Its enabled features.
    pub features: wgpu::Features,
    /// Its limits; those of workgroups are checked.
    pub limits: wgpu::Limits,
}

/// A kernel in the form that a Vulkan device gets.
#[derive(Clone, Debug)]
pub struct Translated {
    /// Name of the entry point.
    pub name: &'static str,
    /// Its SPIR-V.
    pub words: Vec<u32>,
    /// Its bindings, all in descriptor set 0.
    pub entries: Vec<wgpu::BindGroupLayoutEntry>,
}

/// Translates the entry points `kernels` of the module of `files`. Sets those of `constants` that
/// the module declares.
///
/// # Errors
/// A message if the module is not valid, needs features that `target` lacks, or cannot be
/// translated.
pub fn translate(
    target: &Target,
    sources: &Sources,
    files: &[&str],
    kernels: &[&'static str],
    constants: &[(&str, f64)],
) -> Result<Vec<Translated>, String> {
    let capabilities = spirv::capabilities(target.features);
    let module = Module::settled(sources.text(files), capabilities, &target.adapter, true)?;
    let of = |&name: &&'static str| {
        let bindings = module.numbered(&[(wgpu::ShaderStages::COMPUTE, name)], true)?;
        let words = module
            .words(naga::ShaderStage::Compute, name, &bindings, constants, target.features, &target.limits)
            .map_err(|e| format!("the kernel {name} cannot be translated: {e}"))?;
        Ok(Translated { name, words, entries: bindings.entries })
    };
    kernels.iter().map(of).collect()
}
