//! `epsplat adapters`: lists the graphics adapters of this machine.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use epsplat::Result;
use epsplat::low_level::gpu::{AdapterDescription, adapters};
use serde::Serialize;

use super::{outputs, print, write_json};

/// List the adapters, with their limits and features, and the one that auto selects.
#[derive(Args)]
#[command(after_help = "Example:\n  epsplat adapters --json -")]
pub struct Arguments {
    /// Write the list as JSON to a file, or to stdout for -
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
}

#[derive(Serialize)]
struct List {
    /// Name of the adapter that `auto` selects; null if it selects the reference.
    auto: Option<String>,
    adapters: Vec<AdapterDescription>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    outputs::check([], &arguments.json)?;
    let adapters = adapters();
    let auto = adapters.iter().find(|a| a.usable).map(|a| a.name.clone());
    if let Some(path) = &arguments.json {
        return write_json(path, &List { auto, adapters });
    }
    let mut text = String::new();
    for adapter in &adapters {
        let has = |on: bool, name: &'static str| on.then_some(name);
        let features = [
            has(adapter.timestamps, "timestamps"),
            has(adapter.integers_u64, "u64"),
            has(adapter.atomics_u64, "u64 atomics"),
            has(adapter.atomics_f32, "f32 atomics"),
            has(adapter.subgroups, "subgroups"),
        ];
        let features = features.into_iter().flatten().collect::<Vec<_>>().join(", ");
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} ({}, {})", adapter.name, adapter.api, adapter.kind);
        let _ = writeln!(text, "  driver      {}", adapter.driver);
        let _ = writeln!(
            text,
            "  limits      {} MiB per binding, {} MiB per buffer, {} workgroups per dimension, {} storage buffers",
            adapter.max_storage_buffer_binding_size >> 20,
            adapter.max_buffer_size >> 20,
            adapter.max_compute_workgroups_per_dimension,
            adapter.max_storage_buffers_per_shader_stage,
        );
        let _ = writeln!(text, "  features    {}", if features.is_empty() { "core WebGPU" } else { &features });
        if !adapter.usable {
            let _ = writeln!(text, "  not usable: it cannot run the compute kernels");
        }
    }
    let _ = match auto {
        Some(name) => writeln!(text, "auto picks {name}"),
        None => writeln!(text, "auto picks the f64 reference: {}", epsplat::low_level::gpu::device::INSTALL_HINT),
    };
    print(&text)
}
