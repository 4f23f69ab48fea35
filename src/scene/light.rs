//! Lights of the shading models.

use std::str::FromStr;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::error::Error;

/// A white light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Light {
    /// Shines from the eye along each pixel's ray and lights both sides of a surface:
    /// `intensity * |n . toward|`.
    Headlight {
        /// Factor on the surface's colour at normal incidence.
        intensity: f32,
    },
    /// Infinitely far away; lights the side of the normal: `intensity * max(0, n . toward)`.
    Directional {
        /// Unit vector toward the light, world space.
        toward: Vec3,
        /// Factor on the surface's colour at normal incidence.
        intensity: f32,
    },
}

/// The most lights in one render, as they are stored in a uniform.
pub const MAX_LIGHTS: usize = 8;

impl Light {
    /// Factor on the surface's colour at normal incidence.
    pub fn intensity(&self) -> f32 {
        match *self {
            Self::Headlight { intensity } | Self::Directional { intensity, .. } => intensity,
        }
    }
}

impl FromStr for Light {
    type Err = Error;

    /// Parses `headlight[:INTENSITY]` or `x,y,z[:INTENSITY]`, the direction toward the light.
    fn from_str(text: &str) -> Result<Self, Error> {
        let bad = || Error::Usage(format!("a light is headlight[:INTENSITY] or x,y,z[:INTENSITY], not {text:?}"));
        let (kind, intensity) = match text.split_once(':') {
            Some((kind, intensity)) => (kind, intensity.parse::<f32>().map_err(|_| bad())?),
            None => (text, 1.0),
        };
        if !(intensity.is_finite() && intensity >= 0.0) {
            return Err(bad());
        }
        if kind == "headlight" {
            return Ok(Self::Headlight { intensity });
        }
        let mut parts = kind.split(',').map(|part| part.trim().parse::<f32>());
        let mut next = || parts.next().ok_or_else(bad)?.map_err(|_| bad());
        let toward = Vec3::new(next()?, next()?, next()?);
        // Dividing by the largest component first prevents squares from overflowing.
        let toward = (toward / toward.abs().max_element()).normalize_or_zero();
        if parts.next().is_some() || toward == Vec3::ZERO {
            return Err(bad());
        }
        Ok(Self::Directional { toward, intensity })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn lights_are_read_and_refused() {
        assert_eq!("headlight".parse::<Light>().unwrap(), Light::Headlight { intensity: 1.0 });
        assert_eq!("0,0,2:0.5".parse::<Light>().unwrap(), Light::Directional { toward: Vec3::Z, intensity: 0.5 });
        for bad in ["", "sun", "0,0,0", "1,2", "1,2,3,4", "headlight:x", "headlight:-1", "nan,0,0"] {
            assert!(bad.parse::<Light>().is_err(), "{bad}");
        }
    }
}
