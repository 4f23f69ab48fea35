//! The f32 twin: an adapter that runs kernels on the processor, without a driver, and draws the
//! bits of all adapters.
//!
//! It runs the modules that devices run, after [`super::exact`] has put functions in place of the
//! operations that drivers compute differently. Sums and products of f32, each rounded to nearest,
//! comparisons and integers are left. A workgroup's invocations run in step, so a barrier needs no
//! work. Workgroups run on all threads, in any order, on which the kernels' results do not depend.
//! The twin knows what the built-in kernels use on core WebGPU: no 64-bit integers, textures,
//! matrices, nor functions that `arithmetic.wgsl` lacks.

mod commands;
mod device;
mod expressions;
mod group;
mod memory;
mod objects;
mod operations;
mod raster;
mod shape;
mod tally;

use rayon::prelude::*;

use self::device::Device;
use self::group::{Buffers, Group};
use self::objects::{Bound, Pipeline};
pub use self::tally::{Calls, KernelTally, Tally};
use super::adapter::AdapterDescription;

/// The name of the twin's interface, by which `--adapter` chooses it.
pub(super) const API: &str = "twin";

/// Describes the twin.
pub(super) fn adapter() -> AdapterDescription {
    AdapterDescription {
        name: "the f32 twin".into(),
        api: API.into(),
        kind: "software",
        driver: concat!("epsplat ", env!("CARGO_PKG_VERSION")).into(),
        vertex_storage: false,
        ..AdapterDescription::core()
    }
}

/// Opens the twin.
pub(super) fn open() -> (wgpu::Device, wgpu::Queue) {
    let device = Device::default();
    (wgpu::Device::from_custom(device.clone()), wgpu::Queue::from_custom(device))
}

/// Returns what the kernels have done since the last call, if `device` is the twin.
pub(super) fn tally(device: &wgpu::Device) -> Option<Tally> {
    device.as_custom::<Device>().map(Device::tally)
}

/// Runs a kernel over a grid of workgroups. Returns what it did.
fn dispatch(pipeline: &Pipeline, bound: &[Bound], grid: [u32; 3]) -> Result<KernelTally, String> {
    let (module, info) = (*pipeline.kernels.0).as_ref().map_err(Clone::clone)?;
    let found = module.entry_points.iter().position(|point| point.name == pipeline.entry);
    let index = found.ok_or_else(|| format!("there is no kernel {}", pipeline.entry))?;
    let bound_by = |variable: &naga::GlobalVariable| {
        let binding = variable.binding?.binding;
        let Bound { buffer, words, .. } = bound.iter().find(|bound| bound.binding == binding)?;
        buffer.0.get(words.clone())
    };
    let variables = module.global_variables.iter();
    let buffers: Buffers = variables.filter_map(|(handle, variable)| Some((handle, bound_by(variable)?))).collect();
    let size = module.entry_points[index].workgroup_size;
    let [across, down, deep] = grid.map(|count| count as usize);
    let run = |k: usize| {
        let id = [k % across, k / across % down, k / (across * down)].map(|place| place as u32);
        Group::new((module, info), size, (id, grid), &buffers)?.run(index)
    };
    let all = (0..across * down * deep).into_par_iter().map(run);
    let done = all.try_reduce(KernelTally::default, |a, b| Ok(a.and(b)));
    done.map_err(|error| format!("the kernel {}: {error}", pipeline.entry))
}
