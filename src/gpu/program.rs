//! Compiled kernels, and the cache of them on a device.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::interface::Bindings;
use super::recent::Recent;
use super::stored::Stored;

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
    /// The cache on disk, if there is one.
    pub(super) stored: Option<Stored>,
    /// Whether pipelines were made since the file was written.
    unsaved: AtomicBool,
    clock: Mutex<Clock>,
}

/// The time in which kernels are compiled, by however many threads.
#[derive(Default)]
struct Clock {
    /// Programs that are being compiled.
    running: u32,
    /// When the oldest of them began, or when the time was last taken.
    since: Option<Instant>,
    /// The time since it was last taken, before `since`.
    spent: Duration,
}

impl Clock {
    /// Adds the time since `since`, which becomes `next`.
    fn turn(&mut self, next: Option<Instant>) {
        self.spent += self.since.map(|since| since.elapsed()).unwrap_or_default();
        self.since = next;
    }
}

impl Default for Compiled {
    fn default() -> Self {
        Self {
            programs: Mutex::new(Recent::of(MOST_PROGRAMS)),
            pipelines: Mutex::new(Recent::of(MOST_PIPELINES)),
            stored: None,
            unsaved: AtomicBool::default(),
            clock: Mutex::default(),
        }
    }
}

impl Drop for Compiled {
    fn drop(&mut self) {
        self.save();
    }
}

impl Compiled {
    /// Compiles by `compile`, and counts the time.
    pub(super) fn timed<T>(&self, compile: impl FnOnce() -> T) -> T {
        // A poisoned lock means that another thread panicked; the numbers are intact.
        let clock = || self.clock.lock().unwrap_or_else(PoisonError::into_inner);
        let begin = |clock: &mut Clock| {
            clock.running += 1;
            clock.since.get_or_insert_with(Instant::now);
        };
        begin(&mut clock());
        let made = compile();
        let mut clock = clock();
        clock.running -= 1;
        if clock.running == 0 {
            clock.turn(None);
        }
        self.unsaved.store(true, Ordering::Relaxed);
        made
    }

    /// Returns the milliseconds in which kernels were compiled since the last call.
    pub(crate) fn take_ms(&self) -> f64 {
        let mut clock = self.clock.lock().unwrap_or_else(PoisonError::into_inner);
        let next = clock.since.map(|_| Instant::now());
        clock.turn(next);
        std::mem::take(&mut clock.spent).as_secs_f64() * 1e3
    }

    /// Writes the cache on disk if there is one and pipelines were made since it was written.
    pub(crate) fn save(&self) {
        if let Some(stored) = &self.stored
            && self.unsaved.swap(false, Ordering::Relaxed)
        {
            stored.save();
        }
    }

    /// Number of pipelines in the cache.
    #[cfg(test)]
    pub(crate) fn count_pipelines(&self) -> usize {
        self.pipelines.lock().unwrap_or_else(PoisonError::into_inner).values().count()
    }

    /// For each program in the cache, whether its loops have counters.
    #[cfg(test)]
    pub(crate) fn count_loops(&self) -> Vec<bool> {
        let programs = self.programs.lock().unwrap_or_else(PoisonError::into_inner);
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
