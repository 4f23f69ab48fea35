//! The number types of a PLY vertex's colour, and what they mean.

use super::header::Scalar;
use crate::io::color_range::Number;
use crate::io::values::finite;

/// How the colour channels of vertices are encoded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Tint {
    /// 8-bit sRGB codes.
    #[default]
    Codes,
    /// Linear light, as epsplat writes it.
    Light,
    /// Colours of the first type and alphas of the second, whose range is found from all numbers of
    /// the scene.
    Numbers(Number, Number),
}

impl Tint {
    pub(super) fn of(color: [Scalar; 3], alpha: Option<Scalar>, own: bool) -> Self {
        let mut all = color.into_iter().chain(alpha);
        let number = |scalar| match scalar {
            Scalar::U8 | Scalar::I8 => Number::Byte,
            Scalar::U16 | Scalar::I16 => Number::WORD,
            Scalar::I32 | Scalar::U32 => Number::Integer(u32::MAX.into()),
            Scalar::F32 | Scalar::F64 => Number::Float,
        };
        if own && all.clone().all(Scalar::is_float) {
            return Self::Light;
        }
        if all.all(|scalar| number(scalar) == Number::Byte) {
            return Self::Codes;
        }
        let widest = color.into_iter().max_by_key(|scalar| (scalar.is_float(), scalar.size()));
        // Byte colours beside a wider alpha are interpreted like 16-bit integers.
        let of_color = match widest.map_or(Number::Byte, number) {
            Number::Byte => Number::WORD,
            wider => wider,
        };
        Self::Numbers(of_color, alpha.map_or(Number::Byte, number))
    }
}

/// Converts a number to an 8-bit code. A negative number is a code above 127 that was stored as a
/// signed byte.
pub(super) fn code(value: f64) -> u8 {
    // The casts saturate at the ends of the range.
    if value < 0.0 { (value as i8).cast_unsigned() } else { value as u8 }
}

/// Converts a colour number whose range is not known yet; NaN, which means that there is none,
/// stays. Negative numbers of signed bytes and 16-bit integers are codes that were stored as
/// signed.
pub(super) fn number(value: f64, scalar: Scalar) -> f32 {
    match scalar {
        _ if value.is_nan() => f32::NAN,
        Scalar::I8 if value < 0.0 => (value + 256.0) as f32,
        Scalar::I16 if value < 0.0 => (value + 65536.0) as f32,
        _ => finite(value),
    }
}
