//! The device: the backend, its adapter and its limit of memory.

use std::str::FromStr;

use crate::error::Error;
use crate::plan::BackendName;

/// A backend, or None for the best available one: the kernels on an adapter, else the f64
/// reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Chosen(pub Option<BackendName>);

impl FromStr for Chosen {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        if text == "auto" { Ok(Self(None)) } else { text.parse().map(|name| Self(Some(name))) }
    }
}

/// The backend, its adapter and its limit of memory.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[cfg_attr(feature = "cli", command(next_help_heading = "Device"))]
// Brackets in help texts hold defaults, not links.
#[allow(rustdoc::broken_intra_doc_links)]
pub struct DeviceOptions {
    /// Backend: auto, gpu, raster or reference [default: auto]
    ///
    /// gpu: compute kernels on an adapter; raster: the adapter's rasteriser and blender, for
    /// comparison; reference: the kernels' f64 twins on the processor; auto: gpu on the best
    /// adapter, or reference if there is none
    #[cfg_attr(feature = "cli", arg(long, value_parser = backends(), default_value = "auto", hide_default_value = true, hide_possible_values = true))]
    pub backend: Chosen,
    /// API (vulkan, gl, metal, dx12) or part of an adapter's name, as `epsplat adapters` lists
    /// them; twin: the kernels on the processor, without a driver, slowly
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME", hide_short_help = true))]
    pub adapter: Option<String>,
    /// Limit the memory of host and device together, such as 2GiB
    ///
    /// Needs --lod or --splats, and one file of `epsplat lod` as the only input. Only the part of
    /// it that the picture shows is read. A picture that needs more memory is an error
    #[cfg_attr(feature = "cli", arg(long, value_name = "SIZE", value_parser = super::parse::memory, requires = "cut", hide_short_help = true))]
    pub memory: Option<u64>,
    /// The place of this process among those of its machine: equally good adapters, such as the
    /// cards of a node, are dealt to them in turn.
    #[cfg_attr(feature = "cli", arg(skip))]
    pub turn: usize,
}

#[cfg(feature = "cli")]
fn backends() -> impl clap::builder::TypedValueParser<Value = Chosen> {
    use clap::builder::{PossibleValuesParser, TypedValueParser};
    PossibleValuesParser::new(["auto", "gpu", "raster", "reference"]).map(|name| Chosen(name.parse().ok()))
}
