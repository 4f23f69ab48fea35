//! The sides from which a camera may frame a scene.

use std::str::FromStr;

use glam::DVec3;

use super::Up;
use crate::error::{Error, Result};

/// The side from which a camera frames the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side {
    /// A compass direction, seen from [`ELEVATION`] above the horizon: 0 for north, 90 degrees for
    /// east and so on. North is level and nearest to +y, or to -z where y is up.
    Compass(u32),
    /// Straight from above, with north at the top.
    Above,
    /// From this direction, world coordinates of any length.
    Toward(DVec3),
}

/// The angle above the horizon of a view from a compass direction, degrees.
pub const ELEVATION: f64 = 30.0;

impl Side {
    /// The direction in which the camera looks, and the direction that is up in its image, both of
    /// length 1. `up` is the user's direction of up, if there is one, and `scene` the scene's.
    ///
    /// # Errors
    /// [`Error::Usage`] if a direction has no length, or if the camera would look along `up`.
    pub fn view(self, up: Option<DVec3>, scene: Up) -> Result<(DVec3, DVec3)> {
        let vertical = unit(up.unwrap_or(scene.axis()), "up")?;
        let toward = match self {
            Self::Compass(degrees) => {
                let (north, east) = compass(vertical);
                let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
                let (rise, run) = ELEVATION.to_radians().sin_cos();
                (north * cos + east * sin) * run + vertical * rise
            }
            Self::Above => return Ok((-vertical, compass(vertical).0)),
            Self::Toward(direction) => unit(direction, "--from")?,
        };
        let along = toward.cross(vertical).length() <= ALONG;
        match (along, up) {
            (false, _) => Ok((-toward, vertical)),
            (true, None) => Ok((-toward, scene.other())),
            (true, Some(_)) => Err(Error::Usage(
                "--from looks along --up, which leaves open what is at the top: give another --up".into(),
            )),
        }
    }
}

/// The sine of the angle between a view and up, below which up does not fix the image's roll.
const ALONG: f64 = 1e-3;

/// The directions of north and east for this direction of up; all have length 1.
fn compass(vertical: DVec3) -> (DVec3, DVec3) {
    let level = vertical.abs();
    let nearest = if level.y > level.x.max(level.z) { DVec3::NEG_Z } else { DVec3::Y };
    let east = nearest.cross(vertical).normalize();
    (vertical.cross(east), east)
}

/// `direction` with length 1.
pub(super) fn unit(direction: DVec3, name: &str) -> Result<DVec3> {
    (direction / direction.abs().max_element())
        .try_normalize()
        .ok_or_else(|| Error::Usage(format!("the direction of {name} has no length")))
}

impl FromStr for Side {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let vector = || -> Result<DVec3> {
            let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
            match numbers.as_deref() {
                Some(&[x, y, z]) if [x, y, z] != [0.0; 3] && DVec3::new(x, y, z).is_finite() => Ok(DVec3::new(x, y, z)),
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
