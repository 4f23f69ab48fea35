//! Compiled kernels, and the cache of them on a device.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use super::interface::Bindings;
use super::recent::Recent;

/// The compiled kernels of a module, by entry point.
#[derive(Default)]
pub struct Program {
    pub(super) pipelines: BTreeMap<String, wgpu::ComputePipeline>,
    pub(super) draws: BTreeMap<String, wgpu::RenderPipeline>,
    pub(super) bindings: Bindings,
    /// Whether every loop has a counter that ends it (`src/gpu/loops.rs`).
    pub(super) counts_loops: bool,
}

impl Program {
    /// Whether every loop has a counter that ends it, instead of a proof that it ends.
    pub fn counts_loops(&self) -> bool {
        self.counts_loops
    }

    /// The names and binding numbers of the variables that an entry point or a draw uses.
    pub fn variables(&self, stage: &str) -> &[(String, u32)] {
        self.bindings.get(stage).map_or(&[], Vec::as_slice)
    }
}

/// Programs in the cache. Each has up to about 15 pipelines, and a study uses a few programs at a
/// time.
const MOST_PROGRAMS: usize = 16;

/// Pipelines in the cache. On a CPU, Mesa needs about 3 MB for each.
const MOST_PIPELINES: usize = 128;

/// The caches of compiled programs and pipelines of a device. A full cache drops the least recently
/// used entry.
pub(crate) struct Compiled {
    /// Programs by source and constants.
    pub(super) programs: Mutex<Recent<ProgramKey, Arc<Program>>>,
    /// Compute pipelines by SPIR-V and bindings. Different programs share many of them.
    pub(super) pipelines: Mutex<Recent<PipelineKey, wgpu::ComputePipeline>>,
}

impl Default for Compiled {
    fn default() -> Self {
        Self { programs: Mutex::new(Recent::of(MOST_PROGRAMS)), pipelines: Mutex::new(Recent::of(MOST_PIPELINES)) }
    }
}

impl Compiled {
    /// Number of pipelines in the cache.
    #[cfg(test)]
    pub(crate) fn count_pipelines(&self) -> usize {
        self.pipelines.lock().unwrap_or_else(std::sync::PoisonError::into_inner).values().count()
    }

    /// For each program in the cache, whether its loops have counters.
    #[cfg(test)]
    pub(crate) fn count_loops(&self) -> Vec<bool> {
        let programs = self.programs.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        programs.values().map(|program| program.counts_loops()).collect()
    }
}

/// Key of a program: its source; its constants, by name, as bits; and a text that lists its entry
/// points and draws and says whether its loops are proven to end.
pub(super) type ProgramKey = (String, Vec<(&'static str, u64)>, String);

/// Key of a pipeline: its SPIR-V and the layout of its bindings.
pub(super) type PipelineKey = (Vec<u32>, Vec<wgpu::BindGroupLayoutEntry>, Vec<(String, u32)>);

/// A render pipeline to compile: the rasteriser's part of a program.
#[derive(Debug)]
pub struct Draw {
    /// Name of the pipeline.
    pub name: &'static str,
    /// Entry point of the vertex shader.
    pub vertex: &'static str,
    /// Entry point of the fragment shader.
    pub fragment: &'static str,
    /// Formats and blending of the targets.
    pub targets: Vec<wgpu::ColorTargetState>,
    /// Depth test, if any.
    pub depth: Option<wgpu::DepthStencilState>,
    /// An override constant to set besides those of the program.
    pub constant: Option<(&'static str, f64)>,
}
