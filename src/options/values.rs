//! Option values that are parsed from text: numbers with commas between them, and switches.

use std::str::FromStr;

use crate::error::{Error, Result};
use crate::scene::color::decoded;

/// Parses finite numbers between commas.
///
/// # Errors
/// [`Error::Usage`] for anything else.
pub fn numbers(text: &str) -> Result<Vec<f64>> {
    let number = |part: &str| match part.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(Error::Usage(format!("{part:?} is not a finite number"))),
    };
    text.split(',').map(number).collect()
}

/// The least and the largest diameter of a point in the image, pixels: `MIN,MAX`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diameters(pub [f64; 2]);

impl FromStr for Diameters {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match numbers(text)?[..] {
            [least, most] if 0.0 <= least && least <= most && most > 0.0 => Ok(Self([least, most])),
            _ => Err(Error::Usage("two numbers are needed, the lesser first: MIN,MAX".into())),
        }
    }
}

/// A linear colour with straight alpha: `R,G,B` or `R,G,B,A` (alpha is 1 unless given), a name, or
/// an sRGB code `#RRGGBB`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rgba(pub [f32; 4]);

impl FromStr for Rgba {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if let Some(color) = named(text).or_else(|| coded(text)) {
            return Ok(Self(color));
        }
        let values = numbers(text).map_err(|_| Error::Usage(format!("{EXPECTED}, not {text:?}")))?;
        let values: Vec<f32> = values.into_iter().map(|value| value as f32).collect();
        let color = match values[..] {
            [r, g, b] => [r, g, b, 1.0],
            [r, g, b, a] => [r, g, b, a],
            _ => return Err(Error::Usage(EXPECTED.into())),
        };
        if color.iter().any(|channel| !channel.is_finite()) {
            return Err(Error::Usage("a colour must be finite".into()));
        }
        if !(0.0..=1.0).contains(&color[3]) {
            return Err(Error::Usage("alpha lies between 0 and 1".into()));
        }
        Ok(Self(color))
    }
}

/// The forms of a colour.
const EXPECTED: &str = "a colour is R,G,B[,A], #RRGGBB, white, black, gray or transparent";

/// Returns the linear colour with this name.
fn named(name: &str) -> Option<[f32; 4]> {
    match name {
        "white" => Some([1.0; 4]),
        "black" => Some([0.0, 0.0, 0.0, 1.0]),
        "gray" | "grey" => coded("#808080"),
        "transparent" => Some([0.0; 4]),
        _ => None,
    }
}

/// Returns the linear colour of an sRGB code `#RRGGBB`.
fn coded(text: &str) -> Option<[f32; 4]> {
    let code = text.strip_prefix('#').filter(|code| code.len() == 6)?;
    let code = code.bytes().all(|digit| digit.is_ascii_hexdigit()).then(|| u32::from_str_radix(code, 16).ok())??;
    let [_, r, g, b] = code.to_be_bytes();
    Some(decoded([r, g, b, 255]))
}

/// A switch: `on` or `off`; studies may write `true` or `false`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switch(pub bool);

impl FromStr for Switch {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "on" | "true" => Ok(Self(true)),
            "off" | "false" => Ok(Self(false)),
            _ => Err(Error::Usage(format!("it is on or off, not {text:?}"))),
        }
    }
}

/// The height of an orthographic image: a number of world units, or `fit` for that which shows the
/// whole scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ortho {
    /// The height that shows the whole scene.
    Fit,
    /// A height in world units.
    Height(f64),
}

impl FromStr for Ortho {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match (text, text.parse()) {
            ("fit", _) => Ok(Self::Fit),
            (_, Ok(height)) => Ok(Self::Height(height)),
            _ => Err(Error::Usage(format!("it is fit or a height in world units, not {text:?}"))),
        }
    }
}

/// An end of a range: a number or a percentile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// A value.
    Value(f64),
    /// The value below which this share of all values lies, percent.
    Percent(f64),
}

/// The values at the ends of a range: `LOW,HIGH`, as numbers or percentiles such as `2%`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueRange(pub [End; 2]);

impl Default for ValueRange {
    fn default() -> Self {
        Self([End::Percent(2.0), End::Percent(98.0)])
    }
}

impl FromStr for ValueRange {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let end = |part: &str| match part.trim().strip_suffix('%') {
            Some(share) => share.trim().parse().ok().filter(|share| (0.0..=100.0).contains(share)).map(End::Percent),
            None => part.trim().parse().ok().filter(|value: &f64| value.is_finite()).map(End::Value),
        };
        let ends = text.split_once(',').and_then(|(low, high)| Some([end(low)?, end(high)?]));
        let ordered = |ends: &[End; 2]| match ends {
            [End::Value(low), End::Value(high)] | [End::Percent(low), End::Percent(high)] => low <= high,
            _ => true,
        };
        ends.filter(ordered).map(Self).ok_or_else(|| {
            Error::Usage(format!(
                "it is two numbers or percentages, the lesser first, such as 0,255 or 2%,98%, not {text:?}"
            ))
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn colours_are_numbers_names_or_codes() {
        let color = |text: &str| text.parse::<Rgba>().map(|color| color.0).ok();
        assert_eq!(color("0.5,0,1"), Some([0.5, 0.0, 1.0, 1.0]));
        assert_eq!(color("white"), color("#FFFFFF"));
        assert_eq!(color("transparent"), Some([0.0; 4]));
        // The code 128 is 21.6 % of the light of white.
        assert!((color("gray").unwrap()[0] - 0.2159).abs() < 1e-4 && color("#808080") == color("grey"));
        for wrong in ["whit", "#fff", "#gggggg", "1,2", "0,0,0,2", "nan,0,0", "", "#+12345"] {
            assert_eq!(color(wrong), None, "{wrong}");
        }
    }
}
