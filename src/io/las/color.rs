//! What the colours of a LAS file mean, which their format leaves open.

use crate::io::values::SRGB16_TO_LINEAR;
use crate::scene::Colors;

/// Colours from 16-bit codes, decided over the whole file: `None` where all are zero; 8-bit sRGB where the codes are
/// 8-bit values, either as they are (none above 255) or widened (all `257 v`, or all `256 v`); else 16-bit sRGB codes,
/// as linear light.
pub(super) fn from_rgb(codes: Vec<[u16; 3]>) -> Option<Colors> {
    let (mut largest, mut repeated, mut shifted) = (0, true, true);
    for &code in codes.as_flattened() {
        largest = largest.max(code);
        repeated &= code == 257 * (code >> 8);
        shifted &= code & 0xff == 0;
    }
    let bytes = |shift: u32| codes.iter().map(|code| opaque(code.map(|v| (v >> shift) as u8))).collect();
    match largest {
        0 => None,
        1..=255 => Some(Colors::Srgb8(bytes(0))),
        _ if repeated || shifted => Some(Colors::Srgb8(bytes(8))),
        _ => Some(Colors::Linear(
            codes
                .iter()
                .map(|code| {
                    let [r, g, b] = code.map(|v| SRGB16_TO_LINEAR[usize::from(v)]);
                    [r, g, b, 1.0]
                })
                .collect(),
        )),
    }
}

fn opaque([r, g, b]: [u8; 3]) -> [u8; 4] {
    [r, g, b, 255]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::color::srgb_to_linear;

    #[test]
    fn eight_bit_codes_are_recognised() {
        let expected = Some(Colors::Srgb8(vec![[1, 2, 3, 255], [255, 0, 128, 255]]));
        for scale in [1, 256, 257] {
            assert_eq!(from_rgb(vec![[1, 2, 3].map(|v| v * scale), [255, 0, 128].map(|v| v * scale)]), expected);
        }
        assert_eq!(from_rgb(vec![[0; 3]; 4]), None);
        assert_eq!(from_rgb(vec![]), None);
    }

    #[test]
    fn sixteen_bit_codes_become_linear() {
        let light = |code: u16| srgb_to_linear(f64::from(code) / 65535.0) as f32;
        let expected = vec![[light(300), light(65535), light(12345), 1.0]];
        assert_eq!(from_rgb(vec![[300, 65535, 12345]]), Some(Colors::Linear(expected)));
    }
}
