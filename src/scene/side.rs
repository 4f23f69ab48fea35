//! The sides from which a camera may frame a scene.

use std::str::FromStr;

use glam::DVec3;

use super::Up;
use crate::error::{Error, Result};

/// The side from which a camera frames the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side {
    /// A compass direction, seen from [`ELEVATION`] above the horizon: of 0 for north, 90 degrees
    /// for east and so on. North is +y where z is up, and -z where y is up.
    Compass(u32),
    /// Straight from above, with +y at the top, or +z where y is up.
    Above,
    /// From this direction, world coordinates of any length.
    Toward(DVec3),
}

/// The angle above the horizon of a view from a compass direction, degrees.
pub const ELEVATION: f64 = 30.0;

impl Side {
    /// The direction from the scene to the camera, in a scene with this direction of up.
    pub(super) fn direction(self, up: Up) -> DVec3 {
        let (north, east) = match up {
            Up::Z => (DVec3::Y, DVec3::X),
            Up::Y => (DVec3::NEG_Z, DVec3::X),
        };
        match self {
            Self::Compass(degrees) => {
                let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
                let (rise, run) = ELEVATION.to_radians().sin_cos();
                (north * cos + east * sin) * run + up.axis() * rise
            }
            Self::Above => up.axis(),
            Self::Toward(direction) => direction,
        }
    }
}

impl FromStr for Side {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let vector = || -> Result<DVec3> {
            let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
            match numbers.as_deref() {
                Some([x, y, z]) if [x, y, z].iter().all(|number| number.is_finite()) => Ok(DVec3::new(*x, *y, *z)),
                _ => Err(Error::Usage(format!(
                    "a side is north, east, south, west, above or a direction X,Y,Z, not {text:?}"
                ))),
            }
        };
        Ok(match text {
            "north" => Self::Compass(0),
            "east" => Self::Compass(90),
            "south" => Self::Compass(180),
            "west" => Self::Compass(270),
            "above" => Self::Above,
            _ => Self::Toward(vector()?),
        })
    }
}
