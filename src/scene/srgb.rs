//! The transfer functions of sRGB (IEC 61966-2-1).

use std::sync::LazyLock;

/// The sRGB transfer function from a code in [0, 1] to linear light.
pub fn srgb_to_linear(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// The inverse of [`srgb_to_linear`]; values outside [0, 1] are clamped.
pub fn linear_to_srgb(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.0031308 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Linear light for each 8-bit sRGB code. Host and device share this table, so both blend the same
/// values.
pub static SRGB8_TO_LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| srgb_to_linear(code as f64 / 255.0) as f32));

/// The nearest 8-bit sRGB code of linear light; 0 for NaN.
pub fn srgb8_of(linear: f32) -> u8 {
    let Codes { least, of_bits } = &*CODES;
    if linear >= least[254] {
        return 255;
    }
    if linear >= least[0] {
        let mut code = of_bits[((linear.to_bits() - least[0].to_bits()) >> BUCKET) as usize];
        // This loop ends, as the threshold of the last code is larger.
        while least[code as usize] <= linear {
            code += 1;
        }
        return code;
    }
    0
}

/// The low bits of an f32 that the lookup table ignores: an interval of 1/256 of a power of two
/// contains at most two codes.
const BUCKET: u32 = 15;

/// The lookup tables of [`srgb8_of`], as evaluating the power function is much slower.
struct Codes {
    /// For each code from 1 on, the least linear light that [`linear_to_srgb`] rounds to it.
    least: [f32; 255],
    /// The code of every `1 << BUCKET`th f32, from the first threshold on.
    of_bits: Vec<u8>,
}

static CODES: LazyLock<Codes> = LazyLock::new(|| {
    let code = |linear: f32| (linear_to_srgb(linear.into()) * 255.0).round() as usize;
    let least = std::array::from_fn(|index| {
        // Non-negative f32 are in the order of their bits, so this bisects them.
        let (mut below, mut least) = (0, 1f32.to_bits());
        while least - below > 1 {
            let middle = below.midpoint(least);
            *if code(f32::from_bits(middle)) > index { &mut least } else { &mut below } = middle;
        }
        f32::from_bits(least)
    });
    let bits = (least[0].to_bits()..=least[254].to_bits()).step_by(1 << BUCKET);
    let of_bits = bits.map(|bits| least.partition_point(|least| *least <= f32::from_bits(bits)) as u8);
    Codes { least, of_bits: of_bits.collect() }
});

/// For each code from 1 to 255 the least f32 that is stored as it: linear light that becomes an
/// sRGB code, and alpha that becomes a plain one. The last entries are infinite.
pub(crate) static CODE_THRESHOLDS: LazyLock<[[f32; 256]; 2]> = LazyLock::new(|| {
    let of_light = std::array::from_fn(|index| CODES.least.get(index).copied().unwrap_or(f32::INFINITY));
    let of_alpha = std::array::from_fn(|index| {
        let code = index as f64 + 1.0;
        let near = ((code - 0.5) / 255.0) as f32;
        // Rounding to f32 moves the threshold by at most one step.
        let reaches = |alpha: &f32| f64::from(*alpha) * 255.0 + 0.5 >= code;
        let least = [near.next_down(), near, near.next_up()].into_iter().find(reaches);
        least.filter(|_| index < 255).unwrap_or(f32::INFINITY)
    });
    [of_light, of_alpha]
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_that_are_looked_up_are_the_nearest() {
        let plain = |linear: f32| (linear_to_srgb(linear.into()) * 255.0).round() as u8;
        let at_ends =
            CODES.least.iter().flat_map(|least| (-4i32..5).map(|step| least.to_bits().wrapping_add_signed(step)));
        let spread = (0..1 << 16).map(|k| 0x3000_0000 + k * 0x1100);
        for linear in
            at_ends.chain(spread).map(f32::from_bits).chain([-1.0, -0.0, 0.0, 1e-40, 7.0, f32::NAN, f32::INFINITY])
        {
            assert_eq!(srgb8_of(linear), plain(linear), "{linear}");
        }
    }

    #[test]
    fn thresholds_give_the_codes_of_pictures() {
        let [light, alpha] = &*CODE_THRESHOLDS;
        for code in 1..=255u8 {
            let (light, alpha) = (light[code as usize - 1], alpha[code as usize - 1]);
            assert_eq!([light.next_down(), light].map(srgb8_of), [code - 1, code]);
            let plain = |alpha: f32| (f64::from(alpha) * 255.0 + 0.5) as u8;
            assert_eq!([alpha.next_down(), alpha].map(plain), [code - 1, code]);
        }
        assert!(light[255].is_infinite() && alpha[255].is_infinite());
    }

    #[test]
    fn few_codes_are_passed_over() {
        assert!(CODES.of_bits.len() < 4096);
        assert!(CODES.of_bits.windows(2).all(|next| (0..=1).contains(&(next[1] - next[0]))));
        assert_eq!((CODES.of_bits[0], CODES.of_bits.last()), (1, Some(&254)));
    }

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
