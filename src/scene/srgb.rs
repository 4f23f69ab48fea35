//! The transfer functions of sRGB (IEC 61966-2-1).

use std::sync::LazyLock;

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
