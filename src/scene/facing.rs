//! Points that face the camera: splats without normals.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{Camera, Projection, Samples};
use crate::error::{Error, Result};

/// The drawing of points that face the camera (Schuetz and Wimmer 2015).
///
/// Each point is a shape around its position, in a plane parallel to the image. The radius is the
/// longer half-axis of the point's surfel, limited in pixels; the surfel's own plane is ignored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Facing {
    /// The shape of each splat.
    pub shape: PointShape,
    /// The smallest and largest diameter in the image, pixels; never less than a sample. A point of
    /// one pixel fills the pixel in which it lies.
    pub pixels: [f64; 2],
}

/// The shapes of points that face the camera.
///
/// A shape with a height is nearer to the camera by its height times the radius. Where points
/// overlap, each pixel then shows approximately the point whose axis is nearest to the pixel
/// (section III).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum PointShape {
    /// Flat, `-1 <= u, v < 1`.
    Square,
    /// Flat, `u² + v² <= 1`; the shapes below have this outline too.
    Circle,
    /// Height `√(1 - u² - v²)`.
    Sphere,
    /// Height `1 - √(u² + v²)`.
    Cone,
    /// Height `1 - u² - v²`.
    Paraboloid,
}

/// All shapes with their names.
pub const POINT_SHAPES: [(&str, PointShape); 5] = [
    ("square", PointShape::Square),
    ("circle", PointShape::Circle),
    ("sphere", PointShape::Sphere),
    ("cone", PointShape::Cone),
    ("paraboloid", PointShape::Paraboloid),
];

impl PointShape {
    /// The height in radii at a squared distance `rho2` from the axis, in squared radii, at most 1.
    pub fn height(self, rho2: f64) -> f64 {
        match self {
            Self::Square | Self::Circle => 0.0,
            Self::Sphere => (1.0 - rho2).max(0.0).sqrt(),
            Self::Cone => 1.0 - rho2.sqrt(),
            Self::Paraboloid => 1.0 - rho2,
        }
    }

    /// Whether the shape has a height above its plane.
    pub fn rises(self) -> bool {
        !matches!(self, Self::Square | Self::Circle)
    }
}

impl FromStr for PointShape {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let named = POINT_SHAPES.iter().find(|(name, _)| *name == text).map(|(_, shape)| *shape);
        let all = || POINT_SHAPES.map(|(name, _)| name).join(", ");
        named.ok_or_else(|| Error::Usage(format!("points that face the camera are {}, not {text:?}", all())))
    }
}

impl Facing {
    /// The paper's limits for a point's diameter, pixels (section III.A).
    pub const LIMITS: [f64; 2] = [1.0, 50.0];

    /// The radius with which a point is drawn, world units.
    ///
    /// `radius` is its own radius, `z` its depth, and the pixels of `camera` are the `samples` of
    /// the image's pixels.
    pub fn radius(&self, radius: f64, z: f64, camera: &Camera, samples: Samples) -> f64 {
        let widening = match camera.projection {
            Projection::Pinhole => z,
            Projection::Orthographic => 1.0,
        };
        let [least, most] = self.pixels.map(|diameter| 0.5 * diameter * f64::from(samples.down) * widening / camera.fy);
        // At least half a sample's width, so that every point is visible.
        radius.max(least).min(most).max(0.5 * widening / camera.fx.min(camera.fy))
    }
}

/// The size of points that face the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PointSize {
    /// A factor on the radius of each point, or on the common radius of a cloud without radii.
    Radius(f64),
    /// One radius for all points, world units.
    Absolute(f64),
    /// One diameter in the image for all points, pixels.
    Pixels(f64),
}

impl Default for PointSize {
    /// Every point in its own size.
    fn default() -> Self {
        Self::Radius(1.0)
    }
}

impl FromStr for PointSize {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let bad = || {
            Error::Usage(format!(
                "a point size is radius:F (times its own), abs:R (the radius in world units) or pixels:D (the diameter), not {text:?}"
            ))
        };
        match super::options::kind_and_amount(text).ok_or_else(bad)? {
            ("radius", factor) => Ok(Self::Radius(factor)),
            ("abs", radius) => Ok(Self::Absolute(radius)),
            ("pixels", diameter) if diameter > 0.0 => Ok(Self::Pixels(diameter)),
            _ => Err(bad()),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn shapes_and_sizes_are_read_and_refused() {
        for (name, shape) in POINT_SHAPES {
            assert_eq!(name.parse::<PointShape>().unwrap(), shape);
            assert_eq!((shape.height(0.0), shape.height(1.0)), (f64::from(u8::from(shape.rises())), 0.0));
        }
        assert!("disk".parse::<PointShape>().is_err());
        assert_eq!("abs:2".parse::<PointSize>().unwrap(), PointSize::Absolute(2.0));
        for bad in ["", "2", "radius:-1", "pixels:0", "pixels:nan", "rel:1"] {
            assert!(bad.parse::<PointSize>().is_err(), "{bad}");
        }
    }
}
