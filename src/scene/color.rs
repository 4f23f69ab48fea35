//! Colour: 8-bit values are sRGB, everything that is blended is linear.

use std::sync::LazyLock;

use super::texture::Textured;

/// The sRGB transfer function from a code in [0, 1] to linear light (IEC 61966-2-1).
pub fn srgb_to_linear(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// The inverse of [`srgb_to_linear`]; values outside [0, 1] are clamped.
pub fn linear_to_srgb(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.0031308 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Linear light for each 8-bit sRGB code: the table that host and device share, so that both blend the same values.
pub static SRGB8_TO_LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| srgb_to_linear(code as f64 / 255.0) as f32));

/// The colours of a scene or of one input, with straight alpha.
#[derive(Clone, Debug, PartialEq)]
pub enum Colors {
    /// Every surfel has this linear colour.
    Constant([f32; 4]),
    /// One 8-bit sRGB colour each; alpha is linear.
    Srgb8(Vec<[u8; 4]>),
    /// One linear colour each; any finite value.
    Linear(Vec<[f32; 4]>),
    /// A place in a texture each.
    Textured(Textured),
}

/// The colour of surfels that come without one: a light grey that shading can darken and highlights cannot clip.
pub const DEFAULT_COLOR: [f32; 4] = [0.7, 0.7, 0.7, 1.0];

impl Colors {
    /// The linear colour of surfel `index`, straight alpha; of a texture the mean over its disk.
    pub fn linear(&self, index: usize) -> [f32; 4] {
        match self {
            Self::Constant(color) => *color,
            Self::Srgb8(codes) => {
                let [r, g, b, a] = codes[index];
                let table = &*SRGB8_TO_LINEAR;
                [table[r as usize], table[g as usize], table[b as usize], f32::from(a) / 255.0]
            }
            Self::Linear(colors) => colors[index],
            Self::Textured(textured) => textured.colors()[index],
        }
    }
}

/// The weighted mean of straight colours, premultiplied as splats are blended.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transfer_functions_are_inverse_and_monotone() {
        let mut last = -1.0;
        for code in 0..=255 {
            let linear = f64::from(SRGB8_TO_LINEAR[code]);
            assert!(linear > last);
            last = linear;
            assert_eq!((linear_to_srgb(linear) * 255.0).round() as usize, code);
        }
        assert_eq!(SRGB8_TO_LINEAR[255], 1.0);
    }
}
