//! Compiles the kernels of a frame. There are up to three modules: one for all passes, one for the
//! tiles, compiled when tiles draw something or most likely will, and one that chooses a cut.

use std::sync::{Arc, OnceLock};

use crate::error::Result;
use crate::gpu::kernel::{compiles_alone, side_by_side};
use crate::gpu::program::Program;
use crate::gpu::{Gpu, Sources};
use crate::passes::accumulate::SPREAD;
use crate::passes::select::CHOOSING;
use crate::passes::{constants, modules, raster};
use crate::plan::known::Listed;
use crate::plan::pass::{Making, Module};
use crate::plan::steps::Kernel;
use crate::plan::{Plan, SceneNeeds, Settings};

/// The kernels of one plan, compiled on first use.
pub struct Kernels {
    /// The needs and constants that the kernels are compiled for.
    made: (SceneNeeds, Vec<(&'static str, u64)>),
    sources: Sources,
    constants: Vec<(&'static str, f64)>,
    modules: Vec<(Module, OnceLock<Arc<Program>>)>,
}

impl Kernels {
    /// Creates the kernels of `plan` without compiling any.
    pub fn new(sources: &Sources, plan: &Plan, options: &Settings, surfels: u64) -> Self {
        let constants = constants(&Making { needs: &plan.needs, options, surfels });
        let modules = modules(&plan.needs).into_iter().map(|module| (module, OnceLock::new())).collect();
        let made = (plan.needs, bits(&constants));
        Self { made, sources: sources.clone(), constants, modules }
    }

    /// Compiles, in parallel, the modules of the kernels that `plan` is certain to dispatch: until
    /// the cut is known, only the one that chooses it. `large` says that tiles most likely draw
    /// some splats; their module is compiled too, but an error of it is left to its first use.
    pub fn compile(&self, gpu: &Gpu, plan: &Plan, large: bool) -> Result<()> {
        let drawn = !plan.looks_for_cut();
        let listed = plan.large_by_tiles && !plan.looks_for_lists[Listed::Large as usize];
        let certain = |index: usize| match &self.modules[index].0 {
            _ if index == 0 => drawn,
            module if module.kernels.contains(&CHOOSING[0]) => true,
            module if module.kernels.contains(&SPREAD) => drawn,
            _ => drawn && (listed || plan.needs.surface.gathers()),
        };
        let wanted: Vec<usize> = (0..self.modules.len()).filter(|&index| certain(index) || (large && drawn)).collect();
        let compile = |&index: &usize| self.compiled(gpu, index).map(drop);
        let made: Vec<Result<()>> = match compiles_alone(gpu) {
            true => wanted.iter().map(compile).collect(),
            false => side_by_side(&wanted, compile),
        };
        wanted.into_iter().zip(made).filter(|(index, _)| certain(*index)).try_for_each(|(_, made)| made)
    }

    /// Returns whether these kernels serve `plan` too.
    pub fn serve(&self, plan: &Plan, options: &Settings, surfels: u64) -> bool {
        let making = Making { needs: &plan.needs, options, surfels };
        self.made.0 == plan.needs && self.made.1 == bits(&constants(&making))
    }

    /// Whether the modules of `other` have the same text, entry points and constants.
    #[cfg(feature = "bench")]
    pub fn are_those_of(&self, other: &Self) -> bool {
        let same = |((own, _), (others, _)): (&(Module, _), &(Module, _))| {
            let texts = [(&self.sources, own), (&other.sources, others)].map(|(sources, of)| sources.text(&of.files));
            own.kernels == others.kernels && texts[0] == texts[1]
        };
        let both = self.modules.iter().zip(&other.modules);
        self.made.1 == other.made.1 && self.modules.len() == other.modules.len() && both.into_iter().all(same)
    }

    /// Compiles and returns the module of all passes.
    pub fn first(&self, gpu: &Gpu) -> Result<&Program> {
        self.compiled(gpu, 0)
    }

    /// Compiles and returns the module that has `kernel`.
    pub fn of(&self, gpu: &Gpu, kernel: &Kernel) -> Result<&Program> {
        let module = self.modules.iter().position(|(module, _)| module.kernels.contains(kernel));
        self.compiled(gpu, module.ok_or_else(|| gpu.error(format!("there is no kernel {}", kernel.name)))?)
    }

    fn compiled(&self, gpu: &Gpu, index: usize) -> Result<&Program> {
        let (module, program) = &self.modules[index];
        if let Some(program) = program.get() {
            return Ok(program);
        }
        let draws = match self.made.0.surface.raster() {
            Some(raster) if index == 0 => raster::draws(raster, &self.made.0),
            _ => Vec::new(),
        };
        let stages: Vec<_> = module.kernels.iter().map(|kernel| kernel.name).collect();
        let made = gpu.compiled.get(gpu, (&self.sources, &module.files), &stages, &draws, &self.constants)?;
        Ok(program.get_or_init(|| made))
    }
}

fn bits(constants: &[(&'static str, f64)]) -> Vec<(&'static str, u64)> {
    constants.iter().map(|&(name, value)| (name, value.to_bits())).collect()
}
