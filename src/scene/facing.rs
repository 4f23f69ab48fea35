//! Points that face the camera: splats without normals.

use std::str::FromStr;

use super::{Camera, Projection, Samples};
use crate::error::{Error, Result};

/// How points that face the camera are drawn (Schuetz and Wimmer 2015): each as a shape around its position in a plane parallel to the
/// image, of its surfel's longer half-axis, held within limits in pixels. The surfel's own plane is no matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facing {
    /// What the splat is.
    pub shape: PointShape,
    /// The least and the largest diameter in the image, pixels; at least a sample's. A point of one pixel is the pixel that it lies in.
    pub pixels: [f64; 2],
}

/// The shapes of points that face the camera. Those with a depth come nearer by their height times the radius: where points overlap,
/// each pixel then shows the one whose axis is nearest, about (section III).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PointShape {
    /// Flat, `-1 <= u, v < 1`.
    Square,
    /// Flat, `u² + v² <= 1`, as all that follow.
    Circle,
    /// Of height `√(1 - u² - v²)`.
    Sphere,
    /// Of height `1 - √(u² + v²)`.
    Cone,
    /// Of height `1 - u² - v²`.
    Paraboloid,
}

/// By name.
pub const POINT_SHAPES: [(&str, PointShape); 5] = [
    ("square", PointShape::Square),
    ("circle", PointShape::Circle),
    ("sphere", PointShape::Sphere),
    ("cone", PointShape::Cone),
    ("paraboloid", PointShape::Paraboloid),
];

impl PointShape {
    /// Height in radii at a squared distance from the axis, of at most 1, in radii.
    pub fn height(self, rho2: f64) -> f64 {
        match self {
            Self::Square | Self::Circle => 0.0,
            Self::Sphere => (1.0 - rho2).max(0.0).sqrt(),
            Self::Cone => 1.0 - rho2.sqrt(),
            Self::Paraboloid => 1.0 - rho2,
        }
    }

    /// Whether it comes nearer than its plane.
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
    /// The paper's limits of a point's diameter, pixels (section III.A).
    pub const LIMITS: [f64; 2] = [1.0, 50.0];

    /// World length of the radius that a point is drawn with, of its own `radius` at the depth `z` of a view by `camera`, whose pixels
    /// are the `samples`.
    pub fn radius(&self, radius: f64, z: f64, camera: &Camera, samples: Samples) -> f64 {
        let widening = match camera.projection {
            Projection::Pinhole => z,
            Projection::Orthographic => 1.0,
        };
        let [least, most] = self.pixels.map(|diameter| 0.5 * diameter * f64::from(samples.down) * widening / camera.fy);
        // No smaller than a sample, at which it shows.
        radius.max(least).min(most).max(0.5 * widening / camera.fx.min(camera.fy))
    }
}

/// How large points that face the camera are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PointSize {
    /// Times the radius that each has, or, in a cloud without radii, that of all.
    Radius(f64),
    /// World units: the radius of all.
    Absolute(f64),
    /// The diameter of all in the image, pixels.
    Pixels(f64),
}

impl Default for PointSize {
    /// As large as they are.
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
