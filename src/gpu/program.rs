//! Compiled kernels, and those that a device keeps.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use super::interface::Bindings;
use super::recent::Recent;

/// The compiled kernels of a render.
#[derive(Default)]
pub struct Program {
    pub(super) pipelines: BTreeMap<String, wgpu::ComputePipeline>,
    pub(super) draws: BTreeMap<String, wgpu::RenderPipeline>,
    pub(super) bindings: Bindings,
    /// Every loop has a counter that ends it (`src/gpu/loops.rs`).
    pub(super) counts_loops: bool,
}

impl Program {
    /// Whether every loop has a counter that ends it, rather than a proof that it does.
    pub fn counts_loops(&self) -> bool {
        self.counts_loops
    }

    /// The variables that an entry point or a draw binds: their names and numbers.
    pub fn variables(&self, stage: &str) -> &[(String, u32)] {
        self.bindings.get(stage).map_or(&[], Vec::as_slice)
    }
}

/// Programs that are kept, with their pipelines, of which each has up to about 15: a study has a few at a time.
const MOST_PROGRAMS: usize = 16;

/// Pipelines that are kept beside them. Mesa takes about 3 MB for each where processors draw.
const MOST_PIPELINES: usize = 128;

/// What was compiled for a device is not compiled again, as long as it is asked for now and then.
pub(crate) struct Compiled {
    /// By their text and constants.
    pub(super) programs: Mutex<Recent<ProgramKey, Arc<Program>>>,
    /// Those of programs by what the device was told: many are the same in different programs.
    pub(super) pipelines: Mutex<Recent<PipelineKey, wgpu::ComputePipeline>>,
}

impl Default for Compiled {
    fn default() -> Self {
        Self { programs: Mutex::new(Recent::of(MOST_PROGRAMS)), pipelines: Mutex::new(Recent::of(MOST_PIPELINES)) }
    }
}

impl Compiled {
    /// Pipelines that are kept by what the device was told.
    #[cfg(test)]
    pub(crate) fn count_pipelines(&self) -> usize {
        self.pipelines.lock().unwrap_or_else(std::sync::PoisonError::into_inner).values().count()
    }

    /// Whether each program that was compiled counts its loops.
    #[cfg(test)]
    pub(crate) fn count_loops(&self) -> Vec<bool> {
        let programs = self.programs.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        programs.values().map(|program| program.counts_loops()).collect()
    }
}

/// A module's text, its constants by name as bits, and in words its entry points, draws and whether its loops end.
pub(super) type ProgramKey = (String, Vec<(&'static str, u64)>, String);

/// A kernel in SPIR-V, and what it binds.
pub(super) type PipelineKey = (Vec<u32>, Vec<wgpu::BindGroupLayoutEntry>);

/// A render pipeline to compile: the rasteriser's part of a program.
#[derive(Debug)]
pub struct Draw {
    /// Its name.
    pub name: &'static str,
    /// The vertex shader.
    pub vertex: &'static str,
    /// The fragment shader.
    pub fragment: &'static str,
    /// What is blended into.
    pub targets: Vec<wgpu::ColorTargetState>,
    /// How depths are compared.
    pub depth: Option<wgpu::DepthStencilState>,
    /// Set beside the program's constants.
    pub constant: Option<(&'static str, f64)>,
}
