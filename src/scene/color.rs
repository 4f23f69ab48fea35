//! Colours: 8-bit values are sRGB, everything that is blended is linear.

use glam::DVec3;

use super::harmonics::Harmonics;
pub(crate) use super::srgb::CODE_THRESHOLDS;
pub use super::srgb::{SRGB8_TO_LINEAR, linear_to_srgb, srgb_to_linear, srgb8_of};
use super::texture::Textured;

/// The colours of a scene or of one input, with straight alpha.
#[derive(Clone, Debug, PartialEq)]
pub enum Colors {
    /// One linear colour for all surfels.
    Constant([f32; 4]),
    /// An 8-bit sRGB colour for each surfel; alpha is linear.
    Srgb8(Vec<[u8; 4]>),
    /// A linear colour for each surfel; any finite value.
    Linear(Vec<[f32; 4]>),
    /// Texture coordinates for each surfel.
    Textured(Textured),
    /// A view-dependent colour for each surfel.
    Harmonics(Harmonics),
}

/// The default colour: a light grey that shading can darken and highlights cannot clip.
pub const DEFAULT_COLOR: [f32; 4] = [0.7, 0.7, 0.7, 1.0];

/// The nearest 8-bit sRGB codes of a linear colour with straight alpha; values outside [0, 1] are
/// clamped.
pub fn srgb8([r, g, b, a]: [f32; 4]) -> [u8; 4] {
    // The cast truncates and saturates at 0 and 255.
    [srgb8_of(r), srgb8_of(g), srgb8_of(b), (f64::from(a) * 255.0 + 0.5) as u8]
}

/// The linear colour of 8-bit sRGB codes, straight alpha.
pub fn decoded([r, g, b, a]: [u8; 4]) -> [f32; 4] {
    let table = &*SRGB8_TO_LINEAR;
    [table[r as usize], table[g as usize], table[b as usize], f32::from(a) / 255.0]
}

impl Default for Colors {
    /// [`DEFAULT_COLOR`] for all surfels.
    fn default() -> Self {
        Self::Constant(DEFAULT_COLOR)
    }
}

impl Colors {
    /// The linear colour of surfel `index`, straight alpha.
    ///
    /// For a texture it is the mean over the disk, for harmonics the constant term.
    pub fn linear(&self, index: usize) -> [f32; 4] {
        match self {
            Self::Constant(color) => *color,
            Self::Srgb8(codes) => decoded(codes[index]),
            Self::Linear(colors) => colors[index],
            Self::Textured(textured) => textured.colors()[index],
            Self::Harmonics(harmonics) => {
                let [r, g, b, a] = harmonics.colors()[index];
                [r.max(0.0), g.max(0.0), b.max(0.0), a]
            }
        }
    }

    /// The linear colour of surfel `index`, straight alpha, seen along a unit `direction` from the
    /// eye.
    pub fn seen(&self, index: usize, direction: DVec3) -> [f64; 4] {
        match self {
            Self::Harmonics(harmonics) => harmonics.seen(index, direction),
            _ => self.linear(index).map(f64::from),
        }
    }
}

/// The weighted mean of straight colours, computed premultiplied as in blending.
pub(crate) fn mean_color(colors: impl Iterator<Item = ([f32; 4], f64)>) -> [f32; 4] {
    let (mut sum, mut weights) = ([0.0; 4], 0.0);
    for (color, weight) in colors {
        let [r, g, b, alpha] = color.map(f64::from);
        let covers = weight * alpha;
        sum = [sum[0] + covers * r, sum[1] + covers * g, sum[2] + covers * b, sum[3] + covers];
        weights += weight;
    }
    let [r, g, b, alpha] = sum;
    if alpha > 0.0 { [r / alpha, g / alpha, b / alpha, alpha / weights].map(|c| c as f32) } else { [0.0; 4] }
}
