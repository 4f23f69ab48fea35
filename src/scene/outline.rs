//! Polygons instead of disks.

use std::f64::consts::PI;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// A regular polygon inscribed in each unit disk, with a corner at the end of the first half-axis.
///
/// Splats are drawn with this outline; kernel and size are the disk's. (Paper 001, section 3,
/// figure 2, where a splat is "a simple polygon".)
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "u32")]
pub struct Outline(u32);

impl Outline {
    /// The smallest and largest number of sides. With 16 sides a polygon deviates from its disk by
    /// at most `1 - cos(pi / 16)` = 0.02 of the radius.
    pub const SIDES: [u32; 2] = [3, 16];

    /// A polygon with this number of sides.
    ///
    /// # Errors
    /// [`Error::Usage`] if the number is not within [`Self::SIDES`].
    pub fn of_sides(sides: u32) -> Result<Self> {
        let [least, most] = Self::SIDES;
        let known = (least..=most).contains(&sides);
        known.then_some(Self(sides)).ok_or_else(|| Error::Usage(format!("an outline has {least} to {most} sides")))
    }

    /// The number of sides.
    pub fn sides(self) -> u32 {
        self.0
    }

    /// Half the central angle of a side, radians. Its cosine is the distance from the centre to a
    /// side.
    pub fn half_angle(self) -> f64 {
        PI / f64::from(self.0)
    }

    /// The distance of (u, v) to the nearest side in radii, positive inside and negative outside.
    pub fn inside(self, u: f64, v: f64) -> f64 {
        let half = self.half_angle();
        let to_side = |side: u32| {
            let (sin, cos) = (f64::from(2 * side + 1) * half).sin_cos();
            half.cos() - (u * cos + v * sin)
        };
        (0..self.0).map(to_side).fold(f64::INFINITY, f64::min)
    }
}

impl TryFrom<u32> for Outline {
    type Error = Error;

    fn try_from(sides: u32) -> Result<Self> {
        Self::of_sides(sides)
    }
}

impl FromStr for Outline {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let sides = text.parse().map_err(|_| Error::Usage(format!("{text:?} is no number of sides")))?;
        Self::of_sides(sides)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn polygons_are_those_of_their_corners() {
        let square: Outline = "4".parse().unwrap();
        // Corners at (1, 0), (0, 1), (-1, 0), (0, -1): |u| + |v| = 1.
        for (u, v) in [(0.2, 0.3), (-0.9, 0.05), (0.5, -0.5), (0.0, 1.0), (0.7, 0.7), (-0.3, 1.2)] {
            let expected = (1.0 - (f64::abs(u) + f64::abs(v))) * 0.5f64.sqrt();
            assert!((square.inside(u, v) - expected).abs() < 1e-15, "{u} {v}");
        }
        let triangle = Outline::of_sides(3).unwrap();
        assert!(triangle.inside(1.0, 0.0).abs() < 1e-15 && (triangle.inside(-0.5, 0.1)).abs() < 1e-15);
        assert!(triangle.inside(-0.51, 0.0) < 0.0 && triangle.inside(0.0, 0.0) == (PI / 3.0).cos());
        for wrong in ["2", "17", "-3", "four", "3.5"] {
            assert!(wrong.parse::<Outline>().is_err(), "{wrong}");
        }
    }
}
