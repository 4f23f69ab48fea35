//! The strength of eye-dome lighting.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// The strength of eye-dome lighting ([`eye_dome`](crate::passes::eye_dome)): a positive factor on
/// the slopes that darken a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EyeDome(pub f64);

/// The largest strength, at which the slightest slope is black.
const STRONGEST: f64 = 1e3;

impl FromStr for EyeDome {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let strength = text.parse().ok().filter(|strength| *strength > 0.0 && *strength <= STRONGEST);
        let wrong = || {
            Error::Usage(format!("the strength of eye-dome lighting is above 0 and at most {STRONGEST}, not {text:?}"))
        };
        strength.map(Self).ok_or_else(wrong)
    }
}
