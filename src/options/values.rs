//! Option values that are parsed from text: numbers with commas between them, and switches.

use std::str::FromStr;

use crate::error::{Error, Result};

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

/// A linear colour with straight alpha: `R,G,B` or `R,G,B,A`; alpha is 1 unless given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rgba(pub [f32; 4]);

impl FromStr for Rgba {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let values: Vec<f32> = numbers(text)?.into_iter().map(|value| value as f32).collect();
        let color = match values[..] {
            [r, g, b] => [r, g, b, 1.0],
            [r, g, b, a] => [r, g, b, a],
            _ => return Err(Error::Usage("three or four numbers are needed: R,G,B[,A]".into())),
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
