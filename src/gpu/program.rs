//! Compiled kernels, and those that a device keeps.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex};

/// Bindings of a module's kernels, by entry point: the names of the variables each uses and their numbers.
pub type Bindings = BTreeMap<String, Vec<(String, u32)>>;

/// The compiled kernels of a render.
pub struct Program {
    pub(super) pipelines: BTreeMap<String, wgpu::ComputePipeline>,
    pub(super) draws: BTreeMap<String, wgpu::RenderPipeline>,
    pub(super) bindings: Bindings,
}

impl Program {
    /// The variables that an entry point or a draw binds: their names and numbers.
    pub fn variables(&self, stage: &str) -> &[(String, u32)] {
        self.bindings.get(stage).map_or(&[], Vec::as_slice)
    }
}

/// Programs by their text and constants: what was compiled once for a device is not compiled again.
#[derive(Default)]
pub(crate) struct Programs(pub(super) Mutex<HashMap<ProgramKey, Arc<Program>>>);

/// A module's text, its constants by name as bits, and in words its entry points, draws and whether its loops end.
pub(super) type ProgramKey = (String, Vec<(&'static str, u64)>, String);

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
