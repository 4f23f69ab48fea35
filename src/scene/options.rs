//! Options of the picture: depth tolerance, blending, culling, sampling, low-pass and shading.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// The depth tolerance: a fragment belongs to the visible surface if `z <= nearest + epsilon`
/// (paper 000, section 5.3).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Epsilon {
    /// A fraction of the nearest depth at the pixel.
    Relative(f64),
    /// World units, along the camera's axis.
    Absolute(f64),
    /// World units along the pixel's view ray: paper 000 moves its splats "along the perspective
    /// projector" (section 5.3).
    Ray(f64),
    /// A multiple of the shorter half-axis of the fragment's surfel.
    Radius(f64),
    /// The smaller of a multiple of that half-axis and a fraction of the nearest depth: disks that
    /// are coarse for their scene do not reach through it.
    Bounded {
        /// The multiple of the half-axis.
        radius: f64,
        /// The fraction of the nearest depth.
        relative: f64,
    },
}

/// The smallest relative tolerance in effect, four units in the last place of f32. Visibility and
/// attribute pass must agree that the nearest fragment is visible, even if their compilers contract
/// its depth differently.
pub const LEAST_EPSILON: f64 = 4.0 / 16_777_216.0;

impl Epsilon {
    /// The coefficients (relative, absolute, of_radius) of the tolerance.
    ///
    /// The farthest accepted depth for a surfel of radius r is at most
    /// `nearest * (1 + relative) + absolute + of_radius * r`.
    pub fn parts(self) -> (f64, f64, f64) {
        match self {
            Self::Relative(e) => (e.max(LEAST_EPSILON), 0.0, 0.0),
            Self::Absolute(e) | Self::Ray(e) => (LEAST_EPSILON, e, 0.0),
            Self::Radius(k) | Self::Bounded { radius: k, .. } => (LEAST_EPSILON, 0.0, k),
        }
    }

    /// The upper limit of the part that depends on the radius, as a fraction of the nearest depth.
    pub fn most(self) -> f64 {
        match self {
            Self::Bounded { relative, .. } => relative,
            _ => f64::INFINITY,
        }
    }

    /// The farthest accepted depth, world units, for a surfel with the shorter half-axis `radius`.
    ///
    /// `along` is the depth that the pixel's ray gains per unit of length
    /// ([`Camera::along_axis`](super::Camera::along_axis)).
    pub fn farthest(self, nearest: f64, radius: f64, along: f64) -> f64 {
        let (relative, absolute, of_radius) = self.parts();
        let absolute = if matches!(self, Self::Ray(_)) { absolute * along } else { absolute };
        nearest * (1.0 + relative) + (absolute + of_radius * radius).min(nearest * self.most())
    }
}

/// Splits `KIND:AMOUNT`; None if the amount is negative or not finite.
pub(crate) fn kind_and_amount(text: &str) -> Option<(&str, f64)> {
    let (kind, amount) = text.split_once(':')?;
    let amount: f64 = amount.parse().ok()?;
    (amount.is_finite() && amount >= 0.0).then_some((kind, amount))
}

impl FromStr for Epsilon {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let bad = || {
            Error::Usage(format!(
                "an epsilon is rel:E (fraction of depth), abs:E (world units along the camera's axis), ray:E (along the ray), radius:K (times the surfel's shorter half-axis) or the lesser of two, \
                 radius:K,rel:E, not {text:?}"
            ))
        };
        if let Some((radius, relative)) = text.split_once(',') {
            return match (kind_and_amount(radius), kind_and_amount(relative)) {
                (Some(("radius", radius)), Some(("rel", relative))) => Ok(Self::Bounded { radius, relative }),
                _ => Err(bad()),
            };
        }
        match kind_and_amount(text).ok_or_else(bad)? {
            ("rel", value) => Ok(Self::Relative(value)),
            ("abs", value) => Ok(Self::Absolute(value)),
            ("ray", value) => Ok(Self::Ray(value)),
            ("radius", value) => Ok(Self::Radius(value)),
            _ => Err(bad()),
        }
    }
}

/// The blending of a pixel's fragments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Blend {
    /// The weighted mean of the fragments within epsilon of the nearest depth (paper 000, Eq. 7).
    #[default]
    Weighted,
    /// The colour of the nearest fragment alone, as with a depth test. Among several at one depth,
    /// the greatest colour shows.
    Nearest,
}

impl FromStr for Blend {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "weighted" => Ok(Self::Weighted),
            "nearest" => Ok(Self::Nearest),
            _ => Err(Error::Usage(format!("fragments are blended weighted or nearest, not {text:?}"))),
        }
    }
}

/// Which surfels are left out because of the side that they show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Cull {
    /// Leaves out surfels that face away if none of them can be visible: the scene is closed
    /// ([`Scene::closed`](super::Scene::closed)) and the eye is outside its box.
    #[default]
    Auto,
    /// Draws all surfels.
    None,
    /// Leaves out all surfels that face away.
    Back,
    /// Leaves out nodes of levels of detail if all normals below them face away, and nothing else.
    Cones,
}

impl FromStr for Cull {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "auto" => Ok(Self::Auto),
            "none" => Ok(Self::None),
            "back" => Ok(Self::Back),
            "cones" => Ok(Self::Cones),
            _ => Err(Error::Usage(format!("surfels are culled auto, none, back or cones, not {text:?}"))),
        }
    }
}

/// Samples per pixel for coverage, depth and blending: a grid of 1x1, 2x2, 2x4 or 4x4.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Samples {
    /// Columns of samples in a pixel.
    pub across: u32,
    /// Rows of samples in a pixel.
    pub down: u32,
}

impl Samples {
    /// One sample, at the pixel's centre.
    pub const ONE: Self = Self { across: 1, down: 1 };

    /// Four, on a grid of 2 x 2.
    pub const FOUR: Self = Self { across: 2, down: 2 };

    /// The number of samples in a pixel.
    pub fn count(self) -> u32 {
        self.across * self.down
    }
}

impl Default for Samples {
    fn default() -> Self {
        Self::ONE
    }
}

impl FromStr for Samples {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let [across, down] = match text {
            "1" => [1, 1],
            "4" => [2, 2],
            "8" => [2, 4],
            "16" => [4, 4],
            _ => return Err(Error::Usage(format!("a pixel has 1, 4, 8 or 16 samples, not {text:?}"))),
        };
        Ok(Self { across, down })
    }
}

/// The low-pass filter for splats near or below the size of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LowPass {
    /// No filter: a disk covers a pixel if it contains the pixel's centre.
    #[default]
    None,
    /// The larger of the object-space kernel and a round one of 0.71 pixels (Botsch et al. 2005),
    /// so no splat falls between the pixels' centres.
    Max,
    /// The kernel convolved with the pixel (EWA, Zwicker et al. 2001), which also avoids aliasing.
    Ewa,
    /// As [`Max`](Self::Max), with the round kernel of Gaussian surfels
    /// ([`gaussian`](super::gaussian)): `exp(-d^2)`, d in pixels, or in samples if a pixel has
    /// several.
    Gaussians,
}

impl FromStr for LowPass {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "none" => Ok(Self::None),
            "max" => Ok(Self::Max),
            "ewa" => Ok(Self::Ewa),
            "gaussians" => Ok(Self::Gaussians),
            _ => Err(Error::Usage(format!("splats are filtered by none, max, ewa or gaussians, not {text:?}"))),
        }
    }
}

/// The shading of a resolved pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shading {
    /// The blended colour, without lights.
    Unlit,
    /// The blended colour times the irradiance of the lights at the blended normal.
    Lambert,
    /// Lambert shading plus white highlights (Phong 1975): [`HIGHLIGHT`] times a light's irradiance
    /// times `max(0, r . v)^shininess`, where r is the light's direction mirrored at the normal and
    /// v the direction to the eye. Phong's own term ends abruptly where a light sets behind the
    /// surface; with the irradiance as a factor (Lewis 1994) it falls to 0 there.
    Phong,
}

impl FromStr for Shading {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "unlit" => Ok(Self::Unlit),
            "lambert" => Ok(Self::Lambert),
            "phong" => Ok(Self::Phong),
            _ => Err(Error::Usage(format!("shading is unlit, lambert or phong, not {text:?}"))),
        }
    }
}

impl FromStr for ShadingAt {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "pixel" => Ok(Self::Pixel),
            "splat" => Ok(Self::Splat),
            _ => Err(Error::Usage(format!("light falls on a pixel or a splat, not {text:?}"))),
        }
    }
}

/// The place where shading is evaluated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ShadingAt {
    /// At each pixel, with its blended normal.
    #[default]
    Pixel,
    /// At each splat's centre; the lit colours are blended (paper 000, section 5.3).
    Splat,
}

/// The strength of a [`Shading::Phong`] highlight, as a fraction of the light's irradiance, where
/// the mirrored light points at the eye. With one light of intensity 1, it does not clip the
/// default colour (`DEFAULT_COLOR`).
pub const HIGHLIGHT: f64 = 0.3;

/// The allowed range of [`Settings::shininess`](crate::plan::Settings::shininess): above
/// it, the rounding of the cosine in f32 would be visible.
pub const SHININESS_RANGE: (f32, f32) = (1.0, 1000.0);

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn options_are_read_and_refused() {
        assert_eq!("rel:0.01".parse::<Epsilon>().unwrap(), Epsilon::Relative(0.01));
        assert_eq!("abs:2".parse::<Epsilon>().unwrap(), Epsilon::Absolute(2.0));
        assert_eq!("ray:2".parse::<Epsilon>().unwrap(), Epsilon::Ray(2.0));
        for bad in ["", "rel", "rel:", "rel:-1", "abs:nan", "abs:inf", "ray:-1", "radii:1"] {
            assert!(bad.parse::<Epsilon>().is_err(), "{bad}");
        }
    }
}
