//! What the colours of a LAS file mean, which their format leaves open.

use crate::io::values::SRGB16_TO_LINEAR;
use crate::scene::Colors;

/// What 16-bit codes are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coding {
    /// No colours: all are zero.
    None,
    /// 8-bit sRGB, shifted to the left by so many bits.
    Bytes(u32),
    /// 16-bit sRGB.
    Words,
}

impl Coding {
    /// By all codes of a file, or by those that say it for all: 8-bit values are as they are (none above 255) or widened (all `257 v`, or all `256 v`).
    pub(super) fn of(codes: &[[u16; 3]]) -> Self {
        let (mut largest, mut repeated, mut shifted) = (0, true, true);
        for &code in codes.as_flattened() {
            largest = largest.max(code);
            repeated &= code == 257 * (code >> 8);
            shifted &= code & 0xff == 0;
        }
        match largest {
            0 => Self::None,
            1..=255 => Self::Bytes(0),
            _ if repeated || shifted => Self::Bytes(8),
            _ => Self::Words,
        }
    }
}

/// Colours from 16-bit codes: 8-bit sRGB, or of 16-bit codes linear light.
pub(super) fn from_rgb(codes: Vec<[u16; 3]>, coding: Coding) -> Option<Colors> {
    let bytes = |shift: u32| codes.iter().map(|code| opaque(code.map(|v| (v >> shift).min(255) as u8))).collect();
    match coding {
        Coding::None => None,
        Coding::Bytes(shift) => Some(Colors::Srgb8(bytes(shift))),
        Coding::Words => Some(Colors::Linear(
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
        let from_rgb = |codes: Vec<[u16; 3]>| {
            let coding = Coding::of(&codes);
            from_rgb(codes, coding)
        };
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
        let codes = vec![[300, 65535, 12345]];
        assert_eq!(Coding::of(&codes), Coding::Words);
        assert_eq!(from_rgb(codes.clone(), Coding::Words), Some(Colors::Linear(expected)));
        // What others said of them all.
        assert_eq!(from_rgb(codes, Coding::Bytes(0)), Some(Colors::Srgb8(vec![[255; 4]])));
    }
}
