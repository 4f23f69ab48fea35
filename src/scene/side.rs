//! The sides from which a camera may frame a scene.

use std::str::FromStr;

use glam::DVec3;

use super::Up;
use crate::error::{Error, Result};

/// The side from which a camera frames the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side {
    /// A compass direction. North is level and nearest to +y, or to -z where y is up.
    Compass {
        /// Angle of the camera's direction from north, clockwise seen from above: 90 for east,
        /// degrees.
        azimuth: f64,
        /// Angle of the camera's direction above the horizon, degrees: less than 90 from it.
        elevation: f64,
    },
    /// Straight from above, with north at the top.
    Above,
    /// Straight from below, with north at the top.
    Below,
    /// From this direction, world coordinates of any length.
    Toward(DVec3),
}

/// The angle above the horizon of a view from a compass direction, degrees.
pub const ELEVATION: f64 = 30.0;

/// The elevation at which the three axes of a cube have equal lengths in an orthographic image,
/// degrees: the arc tangent of 1/sqrt(2).
const ISOMETRIC: f64 = 35.264_389_682_754_654;

/// The names of sides with their azimuth and elevation, degrees.
const NAMED: [(&[&str], f64, f64); 13] = [
    (&["north", "n"], 0.0, ELEVATION),
    (&["northeast", "ne"], 45.0, ELEVATION),
    (&["east", "e"], 90.0, ELEVATION),
    (&["southeast", "se"], 135.0, ELEVATION),
    (&["south", "s"], 180.0, ELEVATION),
    (&["southwest", "sw"], 225.0, ELEVATION),
    (&["west", "w"], 270.0, ELEVATION),
    (&["northwest", "nw"], 315.0, ELEVATION),
    (&["front"], 180.0, 0.0),
    (&["back"], 0.0, 0.0),
    (&["right"], 90.0, 0.0),
    (&["left"], 270.0, 0.0),
    (&["iso"], 135.0, ISOMETRIC),
];

impl Side {
    /// A compass direction, or straight from above or below for an elevation of 90 or -90 degrees,
    /// where north is at the top and the azimuth is left out.
    ///
    /// # Errors
    /// [`Error::Usage`] for an azimuth that is not finite, or an elevation beyond 90 degrees.
    pub fn at(azimuth: f64, elevation: f64) -> Result<Self> {
        match elevation {
            _ if !azimuth.is_finite() => Err(Error::Usage("an azimuth is a finite number of degrees".into())),
            90.0 => Ok(Self::Above),
            -90.0 => Ok(Self::Below),
            _ if elevation.abs() < 90.0 => Ok(Self::Compass { azimuth, elevation }),
            _ => Err(Error::Usage(format!("an elevation lies between -90 and 90 degrees, {elevation} does not"))),
        }
    }

    /// Whether the view is within a degree of the vertical, so that up barely fixes its roll.
    pub fn is_steep(self) -> bool {
        match self {
            Self::Compass { elevation, .. } => elevation.abs() > 89.0,
            Self::Above | Self::Below => true,
            Self::Toward(_) => false,
        }
    }

    /// The direction in which the camera looks, and the direction that is up in its image, both of
    /// length 1. `up` is the user's direction of up, if there is one, and `scene` the scene's.
    ///
    /// # Errors
    /// [`Error::Usage`] if a direction has no length, or if the camera would look along `up`.
    pub fn view(self, up: Option<DVec3>, scene: Up) -> Result<(DVec3, DVec3)> {
        let vertical = unit(up.unwrap_or(scene.axis()), "up")?;
        let toward = match self {
            Self::Compass { azimuth, elevation } => {
                let (north, east) = compass(vertical);
                let (sin, cos) = azimuth.to_radians().sin_cos();
                let (rise, run) = elevation.to_radians().sin_cos();
                return Ok((-((north * cos + east * sin) * run + vertical * rise), vertical));
            }
            Self::Above => return Ok((-vertical, compass(vertical).0)),
            Self::Below => return Ok((vertical, compass(vertical).0)),
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
        let name = text.to_ascii_lowercase();
        let named = NAMED.iter().find(|(names, ..)| names.contains(&name.as_str()));
        match (named, name.as_str()) {
            (Some((_, azimuth, elevation)), _) => Self::at(*azimuth, *elevation),
            (None, "above" | "top") => Ok(Self::Above),
            (None, "below" | "bottom") => Ok(Self::Below),
            (None, _) => {
                let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
                let direction = match numbers.as_deref() {
                    Some(&[x, y, z]) => Some(DVec3::new(x, y, z)),
                    _ => None,
                };
                let usable = direction.filter(|direction| *direction != DVec3::ZERO && direction.is_finite());
                usable.map(Self::Toward).ok_or_else(|| {
                    Error::Usage(format!(
                        "a side is front, back, left, right, top, bottom, iso, a compass direction (north, sw, ...) or a \
                         direction X,Y,Z, not {text:?}"
                    ))
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The direction from the scene to the camera, seen from the side with this name.
    fn toward(name: &str, up: Up) -> DVec3 {
        -name.parse::<Side>().unwrap().view(None, up).unwrap().0
    }

    #[test]
    fn names_are_sides_of_both_conventions() {
        let level = [("front", [0.0, -1.0]), ("back", [0.0, 1.0]), ("left", [-1.0, 0.0]), ("right", [1.0, 0.0])];
        for (name, [x, y]) in level {
            assert!((toward(name, Up::Z) - DVec3::new(x, y, 0.0)).length() < 1e-12, "{name}");
            assert!((toward(name, Up::Y) - DVec3::new(x, 0.0, -y)).length() < 1e-12, "{name}");
        }
        assert!((toward("iso", Up::Z) - DVec3::new(1.0, -1.0, 1.0).normalize()).length() < 1e-12);
        let (rise, run) = ELEVATION.to_radians().sin_cos();
        let half = run * 0.5f64.sqrt();
        assert!((toward("SW", Up::Z) - DVec3::new(-half, -half, rise)).length() < 1e-12);
        assert_eq!([toward("top", Up::Z), toward("bottom", Up::Y)], [DVec3::Z, -DVec3::Y]);
    }

    #[test]
    fn elevations_end_at_the_vertical() {
        assert_eq!(Side::at(10.0, 90.0).unwrap(), Side::Above);
        assert_eq!(Side::at(10.0, -90.0).unwrap(), Side::Below);
        let steep = -Side::at(0.0, 89.0).unwrap().view(None, Up::Z).unwrap().0;
        assert!((steep.z - 89f64.to_radians().sin()).abs() < 1e-12 && steep.y > 0.0);
        assert!(Side::at(0.0, 91.0).is_err() && Side::at(f64::NAN, 0.0).is_err() && Side::at(0.0, f64::NAN).is_err());
    }
}
