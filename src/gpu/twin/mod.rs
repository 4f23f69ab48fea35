//! The f32 twin: an adapter that runs kernels on the processor, without a driver, and draws the
//! bits of all adapters.
//!
//! It runs the modules that devices run, after [`super::exact`] has put functions in place of the
//! operations that drivers compute differently. What is left are sums and products of f32, each
//! rounded to nearest, comparisons and integers. A workgroup's invocations run in step, so a
//! barrier needs no work, and atomic operations take place in the order of the invocations; the
//! kernels' results do not depend on that order. It knows what the built-in kernels use on core
//! WebGPU: no 64-bit integers, textures, matrices, nor functions that `arithmetic.wgsl` lacks.

mod commands;
mod device;
mod expressions;
mod group;
mod memory;
mod objects;
mod operations;
mod raster;
mod shape;

use std::collections::HashMap;

use self::device::Device;
use self::group::{Buffers, Group};
use self::objects::{Bound, Pipeline};
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

/// Runs a kernel over a grid of workgroups.
fn dispatch(pipeline: &Pipeline, bound: &[Bound], grid: [u32; 3]) -> Result<(), String> {
    let (module, info) = (*pipeline.kernels.0).as_ref().map_err(Clone::clone)?;
    let found = module.entry_points.iter().position(|point| point.name == pipeline.entry);
    let index = found.ok_or_else(|| format!("there is no kernel {}", pipeline.entry))?;
    let mut variables = HashMap::new();
    // The words of a buffer are taken once, although several variables may bind parts of it.
    let mut taken: Vec<(&Bound, Vec<u32>)> = Vec::new();
    for (handle, variable) in module.global_variables.iter() {
        let Some(binding) = variable.binding else { continue };
        let Some(bound) = bound.iter().find(|bound| bound.binding == binding.binding) else { continue };
        let known = taken.iter().position(|(other, _)| other.buffer.is(&bound.buffer));
        let place = known.unwrap_or_else(|| {
            taken.push((bound, bound.buffer.with(std::mem::take)));
            taken.len() - 1
        });
        variables.insert(handle, (place, bound.words.clone()));
    }
    let mut buffers = Buffers { variables, words: taken.iter_mut().map(|(_, words)| std::mem::take(words)).collect() };
    let size = module.entry_points[index].workgroup_size;
    let groups = (0..grid[2]).flat_map(|z| (0..grid[1]).flat_map(move |y| (0..grid[0]).map(move |x| [x, y, z])));
    let mut run = |id| Group::new((module, info), size, (id, grid), &mut buffers)?.run(index);
    let done = groups.into_iter().try_for_each(&mut run);
    for ((bound, _), words) in taken.into_iter().zip(buffers.words) {
        bound.buffer.with(|held| *held = words);
    }
    done.map_err(|error| format!("the kernel {}: {error}", pipeline.entry))
}
