//! What a caller may choose about a render.

use std::str::FromStr;

use super::Light;
use crate::error::Error;

/// The depth tolerance: a fragment counts as the visible surface if `z <= nearest + epsilon` (paper 000, section 5.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Epsilon {
    /// A fraction of the nearest depth at the pixel.
    Relative(f64),
    /// World units.
    Absolute(f64),
}

/// The smallest relative tolerance in force: visibility and attribute pass must agree that the nearest fragment is
/// visible even if their compilers contract its depth differently (four units in the last place of f32).
pub const LEAST_EPSILON: f64 = 4.0 / 16_777_216.0;

impl Epsilon {
    /// (relative, absolute) parts: the farthest accepted depth is `nearest * (1 + relative) + absolute`.
    pub fn parts(self) -> (f64, f64) {
        match self {
            Self::Relative(e) => (e.max(LEAST_EPSILON), 0.0),
            Self::Absolute(e) => (LEAST_EPSILON, e),
        }
    }
}

impl FromStr for Epsilon {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let bad =
            || Error::Usage(format!("an epsilon is rel:E (fraction of depth) or abs:E (world units), not {text:?}"));
        let (kind, value) = text.split_once(':').ok_or_else(bad)?;
        let value: f64 = value.parse().map_err(|_| bad())?;
        if !(value.is_finite() && value >= 0.0) {
            return Err(bad());
        }
        match kind {
            "rel" => Ok(Self::Relative(value)),
            "abs" => Ok(Self::Absolute(value)),
            _ => Err(bad()),
        }
    }
}

/// The weight of a fragment over the unit disk of its surfel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kernel {
    /// `psi_E(rho) = exp(-a rho^n)` (paper 000, Eq. 12, where b cancels).
    Ellipse {
        /// Drop-off: the weight at the rim is `exp(-a)`.
        a: f64,
        /// Steepness: higher values have a wider plateau.
        n: f64,
    },
}

impl Kernel {
    /// The weight at squared radius `rho2` in [0, 1].
    pub fn weight(self, rho2: f64) -> f64 {
        let Self::Ellipse { a, n } = self;
        (-a * rho2.powf(0.5 * n)).exp()
    }
}

impl FromStr for Kernel {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let bad =
            || Error::Usage(format!("a kernel is ellipse:A,N with A from 0 to 16 and N from 0.1 to 100, not {text:?}"));
        let (a, n) = text.strip_prefix("ellipse:").and_then(|rest| rest.split_once(',')).ok_or_else(bad)?;
        let (a, n): (f64, f64) = (a.trim().parse().map_err(|_| bad())?, n.trim().parse().map_err(|_| bad())?);
        // Beyond exp(-16) a rim weight is under one unit of the 24-bit sums.
        if (0.0..=16.0).contains(&a) && (0.1..=100.0).contains(&n) { Ok(Self::Ellipse { a, n }) } else { Err(bad()) }
    }
}

/// How a resolved pixel gets its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shading {
    /// The blended colour as it is.
    Unlit,
    /// The blended colour times the lights' irradiance at the blended normal.
    Lambert,
}

/// Maps beside the colour. Every one is normalised by the weight sum; all but `decision` exist on every backend.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Maps {
    /// Camera-space z, world units; +inf where nothing is.
    pub depth: bool,
    /// Unit normal in world space; 0 where nothing is. Normals that were estimated have no side of their own and are
    /// turned toward the viewer; given ones stay as they are.
    pub normal: bool,
    /// The sum of weights; 0 where nothing is.
    pub weight: bool,
    /// Accepted fragments.
    pub count: bool,
    /// Reference only: the smallest relative distance of any fragment of the pixel to a yes-or-no decision (disk rim,
    /// epsilon, near depth). Where it is tiny, f32 may rightly decide otherwise.
    pub decision: bool,
}

/// Everything a caller may choose, scene and camera apart.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Depth tolerance.
    pub epsilon: Epsilon,
    /// Blending kernel.
    pub kernel: Kernel,
    /// Shading model.
    pub shading: Shading,
    /// Lights of the Lambert model.
    pub lights: Vec<Light>,
    /// What lies behind the scene: linear RGB and straight alpha.
    pub background: [f32; 4],
    /// Maps wanted beside the colour.
    pub maps: Maps,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            epsilon: Epsilon::Relative(0.01),
            kernel: Kernel::Ellipse { a: 6.0, n: 3.0 },
            shading: Shading::Lambert,
            lights: vec![Light::Headlight { intensity: 1.0 }],
            background: [0.0; 4],
            maps: Maps::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn options_are_read_and_refused() {
        assert_eq!("rel:0.01".parse::<Epsilon>().unwrap(), Epsilon::Relative(0.01));
        assert_eq!("abs:2".parse::<Epsilon>().unwrap(), Epsilon::Absolute(2.0));
        for bad in ["", "rel", "rel:", "rel:-1", "abs:nan", "abs:inf", "radius:1"] {
            assert!(bad.parse::<Epsilon>().is_err(), "{bad}");
        }
        assert_eq!("ellipse:6,3".parse::<Kernel>().unwrap(), Kernel::Ellipse { a: 6.0, n: 3.0 });
        for bad in ["", "ellipse", "ellipse:6", "ellipse:17,3", "ellipse:6,0", "gaussian", "ellipse:6,3,1"] {
            assert!(bad.parse::<Kernel>().is_err(), "{bad}");
        }
    }

    #[test]
    fn the_ellipse_kernel_is_the_papers() {
        let kernel = Kernel::Ellipse { a: 6.0, n: 3.0 };
        assert_eq!(kernel.weight(0.0), 1.0);
        assert!((kernel.weight(0.25) - (-6.0f64 / 8.0).exp()).abs() < 1e-15);
        assert!((kernel.weight(1.0) - (-6.0f64).exp()).abs() < 1e-15);
    }
}
