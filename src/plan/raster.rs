//! Options of the rasteriser's path, the baseline for the compute kernels.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// Sums are made by the rasteriser's blender instead of in storage buffers; see `passes::raster`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Raster {
    /// The format of the sums.
    pub format: BlendFormat,
    /// How fragments of the visible surface are identified.
    pub depth: RasterDepth,
}

/// The format of the blended targets, four channels each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum BlendFormat {
    /// 8 bits; sums saturate at [`BlendFormat::MOST_WEIGHTS_8`] full weights.
    Rgba8Unorm,
    /// 11 significant bits.
    Rgba16Float,
    /// 24 significant bits; not every adapter blends it.
    Rgba32Float,
}

impl BlendFormat {
    /// Every format by name.
    pub const ALL: [(Self, &'static str); 3] =
        [(Self::Rgba8Unorm, "rgba8unorm"), (Self::Rgba16Float, "rgba16float"), (Self::Rgba32Float, "rgba32float")];

    /// Number of full weights that an 8-bit sum can hold: terms are divided by it, which costs
    /// three bits.
    pub const MOST_WEIGHTS_8: u32 = 8;

    /// Bytes per pixel of one four-channel target, as adapters count them.
    pub fn bytes(self) -> u32 {
        match self {
            // WebGPU counts `Rgba8Unorm` as eight bytes too.
            Self::Rgba8Unorm | Self::Rgba16Float => 8,
            Self::Rgba32Float => 16,
        }
    }

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(format, _)| *format == self).map_or("", |(_, name)| name)
    }
}

/// How the rasteriser's path decides which fragments belong to the visible surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum RasterDepth {
    /// Each fragment writes its own depth and compares it with the nearest in the shader, as the
    /// compute kernels do.
    Exact,
    /// The rasteriser interpolates and compares depths, which the visibility pass moves away by
    /// epsilon: along the camera's axis (Botsch et al. 2005), or along the view ray if epsilon is
    /// measured along it (paper 000, section 5.3).
    Offset,
}

impl RasterDepth {
    /// Every mode by name.
    pub const ALL: [(Self, &'static str); 2] = [(Self::Exact, "exact"), (Self::Offset, "offset")];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(depth, _)| *depth == self).map_or("", |(_, name)| name)
    }
}

fn named<T: Copy>(all: &[(T, &'static str)], what: &str, text: &str) -> Result<T, Error> {
    all.iter().find(|(_, name)| *name == text).map(|(value, _)| *value).ok_or_else(|| {
        let names = all.iter().map(|(_, name)| *name).collect::<Vec<_>>().join(", ");
        Error::Usage(format!("{what} is one of {names}, not {text:?}"))
    })
}

impl FromStr for BlendFormat {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        named(&Self::ALL, "a blend format", text)
    }
}

impl FromStr for RasterDepth {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        named(&Self::ALL, "a raster depth", text)
    }
}

impl Default for Raster {
    fn default() -> Self {
        Self { format: BlendFormat::Rgba16Float, depth: RasterDepth::Exact }
    }
}
