//! Colours of faces: from the numbers in the file to linear light.

use super::header::Scalar;
use crate::io::values::finite;
use crate::scene::color::{DEFAULT_COLOR, srgb_to_linear};

/// Property names of the channels red, green, blue and alpha, as programs write them.
const NAMES: [[&str; 3]; 4] = [
    ["red", "r", "diffuse_red"],
    ["green", "g", "diffuse_green"],
    ["blue", "b", "diffuse_blue"],
    ["alpha", "a", "diffuse_alpha"],
];

/// Index of the channel (0 to 3) that a property of this name holds.
pub(super) fn channel(name: &str) -> Option<usize> {
    NAMES.iter().position(|names| names.contains(&name))
}

/// The value that means full intensity, and the encoding of the values below it.
#[derive(Clone, Copy, PartialEq)]
enum Full {
    /// Linear light; full is 1.
    Light,
    /// sRGB codes; full is this value.
    Code(f64),
}

impl Full {
    /// Chooses the full value of a channel by its type and the `largest` value in the file: floats
    /// up to 1 are linear light; all others are codes whose full value is 255, 65535 or `largest`,
    /// whichever is the first that no value exceeds.
    fn of(scalar: Scalar, largest: f32) -> Self {
        match scalar {
            Scalar::F32 | Scalar::F64 if largest <= 1.0 => Self::Light,
            _ if largest <= 255.0 => Self::Code(255.0),
            _ if largest <= 65535.0 => Self::Code(65535.0),
            _ => Self::Code(largest.into()),
        }
    }
}

/// Converts colours of the file, whose channels have these types, to linear light with straight
/// alpha. Colours whose red, green or blue is not finite become [`DEFAULT_COLOR`].
pub(super) fn linear(mut colors: Vec<[f32; 4]>, channels: [Option<Scalar>; 4]) -> Vec<[f32; 4]> {
    let has_alpha = channels[3].is_some();
    for (channel, _) in channels.iter().enumerate().filter(|(_, scalar)| **scalar == Some(Scalar::I8)) {
        // Signed bytes hold unsigned codes: 128 to 255 are stored as -128 to -1.
        let codes = colors.iter_mut().map(|color| &mut color[channel]);
        codes.filter(|code| **code < 0.0).for_each(|code| *code += 256.0);
    }
    let largest = |from: usize, to: usize| {
        let all = colors.iter().flat_map(|color| &color[from..to]).copied();
        all.filter(|value| value.is_finite()).fold(0.0, f32::max)
    };
    let full = Full::of(channels[0].unwrap_or(Scalar::U8), largest(0, 3));
    let opaque = Full::of(channels[3].unwrap_or(Scalar::U8), largest(3, 4));
    let light = |value: f32| match full {
        Full::Light => finite(value.into()),
        Full::Code(most) => srgb_to_linear(f64::from(value) / most) as f32,
    };
    let alpha = |value: f32| match opaque {
        Full::Light => finite(value.into()),
        Full::Code(most) => finite(f64::from(value) / most),
    };
    let color = |[r, g, b, a]: &[f32; 4]| match [r, g, b].iter().all(|value| value.is_finite()) {
        true => [light(*r), light(*g), light(*b), if has_alpha { alpha(*a) } else { 1.0 }],
        false => DEFAULT_COLOR,
    };
    colors.iter().map(color).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_and_values_say_what_is_full() {
        let orange = [230.0, 120.0, 30.0].map(|code| srgb_to_linear(code / 255.0) as f32);
        for (scalar, [r, g, b], full) in [
            (Scalar::U8, [230.0, 120.0, 30.0], 255.0),
            (Scalar::U16, [230.0, 120.0, 30.0], 255.0),
            (Scalar::U16, [59110.0, 30840.0, 7710.0], 65535.0),
            (Scalar::I32, [230.0, 120.0, 30.0], 255.0),
            (Scalar::F64, [230.0, 120.0, 30.0], 255.0),
        ] {
            let rows = vec![[r, g, b, f32::NAN], [full; 4], [f32::NAN; 4]];
            let all = linear(rows, [Some(scalar), Some(scalar), Some(scalar), None]);
            assert_eq!((all[1], all[2]), ([1.0; 4], DEFAULT_COLOR));
            assert!((0..3).all(|k| (all[0][k] - orange[k]).abs() < 1e-6), "{scalar:?} {r}: {all:?}");
        }
        let signed = linear(vec![[-26.0, 120.0, 30.0, -1.0]], [Some(Scalar::I8); 4])[0];
        assert!((0..3).all(|k| (signed[k] - orange[k]).abs() < 1e-6) && signed[3] == 1.0, "{signed:?}");
        let light = linear(vec![[0.5, 0.25, 1.0, 0.5]], [Some(Scalar::F32); 4])[0];
        assert_eq!(light, [0.5, 0.25, 1.0, 0.5]);
    }
}
