//! Code that the tests share: the adapter, sets of needs, random numbers, scenes and options, and
//! the derived error bounds.

#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod any_options;
pub mod any_scene;
pub mod command;
pub mod copc_made;
pub mod enclosure;
pub mod evaluated;
pub mod gaussians;
pub mod judged;
pub mod levels;
pub mod meshes;
pub mod modules;
pub mod network;
mod random;
pub mod scenes;
pub mod server;
pub mod solids;
pub mod variants;

pub use random::Random;

use std::sync::{Mutex, OnceLock, PoisonError};

use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Gpu;
use epsplat::low_level::gpu::layout::{ONE, View};
use epsplat::low_level::plan::{ACCUMULATORS, AccumulatorRow, check};
use epsplat::low_level::scene::Map;

/// One unit of a sum of the accumulator `fixed`, as a fraction of a full weight.
pub const UNIT: f64 = 1.0 / ONE as f64;

/// Whether a run takes the `k`th of many like cases: a plain run takes one in `of`, and a run with
/// `EPSPLAT_THOROUGH=1` takes all.
pub fn takes(k: usize, of: usize) -> bool {
    k.is_multiple_of(of) || std::env::var("EPSPLAT_THOROUGH").is_ok_and(|value| value == "1")
}

/// Opens the adapter under test. Without an adapter, returns `None` and says so on stderr, or
/// panics if `EPSPLAT_REQUIRE_ADAPTER` is 1.
pub fn gpu() -> Option<Gpu> {
    open(std::env::var("EPSPLAT_TEST_ADAPTER").ok().as_deref(), "EPSPLAT_REQUIRE_ADAPTER")
}

/// The same adapter, limited to the features that every WebGPU implementation has.
pub fn core_gpu() -> Option<Gpu> {
    static CORE: OnceLock<Gpu> = OnceLock::new();
    let open = || Gpu::open_core(std::env::var("EPSPLAT_TEST_ADAPTER").ok().as_deref()).unwrap();
    gpu().map(|_| CORE.get_or_init(open).clone())
}

/// Opens an OpenGL adapter even if there are others. Without one, returns `None` or panics as
/// [`gpu`] does, by `EPSPLAT_REQUIRE_OPENGL`.
pub fn opengl() -> Option<Gpu> {
    open(Some("gl"), "EPSPLAT_REQUIRE_OPENGL")
}

/// Opens the device of this name once for all tests of a program; otherwise most time would go to
/// compiling the same kernels.
fn open(name: Option<&str>, required: &str) -> Option<Gpu> {
    static OPENED: Mutex<Vec<(Option<String>, Gpu)>> = Mutex::new(Vec::new());
    // A poisoned lock means that another test panicked while opening a device; the list is intact.
    let mut opened = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, gpu)) = opened.iter().find(|(known, _)| known.as_deref() == name) {
        return Some(gpu.clone());
    }
    match Gpu::open(name) {
        Ok(gpu) => {
            opened.push((name.map(str::to_owned), gpu.clone()));
            Some(gpu)
        }
        Err(error) if std::env::var(required).is_ok_and(|v| v == "1") => panic!("{required}=1, but {error}"),
        Err(_) => {
            eprintln!("skipped: no adapter{}", name.map_or_else(String::new, |name| format!(" called {name}")));
            None
        }
    }
}

/// Returns the adapter, limited so that `fixed` uses the WGSL file `file`. Without the limit,
/// 64-bit atomics, or subgroups (by which tiles gather), could select another file.
pub fn gpu_for(file: &str) -> Option<Gpu> {
    let mut gpu = gpu()?;
    gpu.adapter.subgroups &= !file.starts_with("accum");
    gpu.adapter.atomics_u64 &=
        !["accumulator_fixed.wgsl", "accumulator_fixed_wide.wgsl", "terms_wide.wgsl"].contains(&file);
    Some(gpu)
}

/// Returns the accumulators that the adapter can run, and reports the others on stderr.
pub fn accumulators(gpu: &Gpu) -> Vec<&'static AccumulatorRow> {
    let able = |row: &&AccumulatorRow| {
        check::sums(&gpu.adapter, row.of).inspect_err(|why| eprintln!("skipped: {why}")).is_ok()
    };
    ACCUMULATORS.iter().filter(able).collect()
}

/// The frame's bits: float equality would equate -0 and 0, and a NaN never equals itself.
pub fn bits(frame: &Frame) -> Vec<u32> {
    let maps = [Map::Normal, Map::Depth, Map::Weight, Map::Count].into_iter().filter_map(|map| frame.map(map));
    frame.color.iter().flatten().chain(maps.flatten()).map(|value| value.to_bits()).collect()
}

/// Length of the depth interval behind the nearest depth `front` that the device measures, world
/// units.
pub fn depth_span(view: &View, front: f64) -> f64 {
    let world = f64::from(view.world);
    let of_radius = (f64::from(view.epsilon_deepest) * f64::from(view.world)).min(front * f64::from(view.epsilon_most));
    let absolute = f64::from(view.epsilon_absolute) * f64::from(view.world);
    let deepest = front * (1.0 + f64::from(view.epsilon_relative)) + absolute.max(of_radius);
    deepest.min(f64::from(view.farthest) * world) - front
}
