//! What a picture is: which fragments are one surface, how they are blended, lit and filtered.

use std::str::FromStr;

use crate::error::Error;

/// The depth tolerance: a fragment counts as the visible surface if `z <= nearest + epsilon` (paper 000, section 5.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Epsilon {
    /// A fraction of the nearest depth at the pixel.
    Relative(f64),
    /// World units.
    Absolute(f64),
    /// A multiple of the fragment's own surfel's shorter half-axis.
    Radius(f64),
    /// The lesser of a multiple of that half-axis and a fraction of the nearest depth: disks that are coarse for their scene do not
    /// reach through it.
    Bounded {
        /// The multiple.
        radius: f64,
        /// The fraction.
        relative: f64,
    },
}

/// The smallest relative tolerance in force: visibility and attribute pass must agree that the nearest fragment is
/// visible even if their compilers contract its depth differently (four units in the last place of f32).
pub const LEAST_EPSILON: f64 = 4.0 / 16_777_216.0;

impl Epsilon {
    /// The parts (relative, absolute, of the radius): the farthest accepted depth of a surfel of radius r is
    /// `nearest * (1 + relative) + absolute + of_radius * r`.
    pub fn parts(self) -> (f64, f64, f64) {
        match self {
            Self::Relative(e) => (e.max(LEAST_EPSILON), 0.0, 0.0),
            Self::Absolute(e) => (LEAST_EPSILON, e, 0.0),
            Self::Radius(k) | Self::Bounded { radius: k, .. } => (LEAST_EPSILON, 0.0, k),
        }
    }

    /// The fraction of the nearest depth that what depends on the radius does not exceed.
    pub fn most(self) -> f64 {
        match self {
            Self::Bounded { relative, .. } => relative,
            _ => f64::INFINITY,
        }
    }

    /// The farthest depth that is accepted of a surfel whose shorter half-axis is `radius`, where the `nearest` is known; world units.
    pub fn farthest(self, nearest: f64, radius: f64) -> f64 {
        let (relative, absolute, of_radius) = self.parts();
        nearest * (1.0 + relative) + (absolute + of_radius * radius).min(nearest * self.most())
    }
}

/// The parts of `KIND:AMOUNT`, an amount that is finite and not negative.
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
                "an epsilon is rel:E (fraction of depth), abs:E (world units), radius:K (times the surfel's) or the lesser of two, \
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
            ("radius", value) => Ok(Self::Radius(value)),
            _ => Err(bad()),
        }
    }
}

/// What a pixel shows of its fragments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Blend {
    /// The weighted mean of those within epsilon of the nearest depth (paper 000, Eq. 7).
    #[default]
    Weighted,
    /// The colour of the nearest one alone, as with a depth test; of several at one depth that of the greatest colour.
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

/// Which surfels are left out by the side that they show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cull {
    /// Those that face away, where nobody can see one: the scene is closed ([`Scene::closed`](super::Scene::closed)) and the eye
    /// outside its box.
    #[default]
    Auto,
    /// None.
    None,
    /// Those that face away.
    Back,
}

impl FromStr for Cull {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "auto" => Ok(Self::Auto),
            "none" => Ok(Self::None),
            "back" => Ok(Self::Back),
            _ => Err(Error::Usage(format!("surfels are culled auto, none or back, not {text:?}"))),
        }
    }
}

/// How many samples of coverage, depth and blending a pixel has: on a grid of 1x1, 2x2, 2x4 or 4x4.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Samples {
    /// Samples of a pixel, across.
    pub across: u32,
    /// And down.
    pub down: u32,
}

impl Samples {
    /// One, at the pixel's centre.
    pub const ONE: Self = Self { across: 1, down: 1 };

    /// How many they are.
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

/// The weight of a fragment over the unit disk of its surfel, rho in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kernel {
    /// `exp(-rho^2 / (2 sigma^2))` (paper 000, Eq. 11), cut off at the rim.
    Gaussian {
        /// Standard deviation, in radii.
        sigma: f64,
    },
    /// `psi_E(rho) = exp(-a rho^n)` (paper 000, Eq. 12, where b cancels).
    Ellipse {
        /// Drop-off: the weight at the rim is `exp(-a)`.
        a: f64,
        /// Steepness: higher values have a wider plateau.
        n: f64,
        /// `(psi_E - exp(-a)) / (1 - exp(-a))` instead, which ends at 0: no step at the rim.
        smooth: bool,
    },
    /// `1 - rho`.
    Hat,
    /// 1.
    Constant,
}

/// The least weight of a fragment. It keeps "depth written implies weight > 0" true for kernels that end at 0, and is
/// large enough that a pixel reached by a kernel's tail alone keeps 14 bits of its attributes in 24-bit sums.
pub const LEAST_WEIGHT: f64 = 1.0 / 1024.0;

/// The least weight of a fragment that a low-pass has spread over its pixel: the weight of a splat of a millionth of a
/// pixel is as small a share of that of a large one. It is a whole unit of every accumulator, and a floor as high as
/// [`LEAST_WEIGHT`] would flatten the filter itself.
pub const LEAST_FILTERED_WEIGHT: f64 = 1.0 / 16_777_216.0;

/// A kernel without its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum KernelShape {
    Gaussian,
    Ellipse,
    Hat,
    Constant,
}

impl Kernel {
    /// The weight at squared radius `rho2` in [0, 1], at least [`LEAST_WEIGHT`].
    pub fn weight(self, rho2: f64) -> f64 {
        let weight = match self {
            Self::Gaussian { sigma } => (-0.5 * rho2 / (sigma * sigma)).exp(),
            Self::Ellipse { a, n, smooth } => {
                let step = if smooth { (-a).exp() } else { 0.0 };
                ((-a * rho2.powf(0.5 * n)).exp() - step) / (1.0 - step)
            }
            Self::Hat => 1.0 - rho2.sqrt(),
            Self::Constant => 1.0,
        };
        weight.max(LEAST_WEIGHT)
    }

    /// Which it is.
    pub fn shape(self) -> KernelShape {
        match self {
            Self::Gaussian { .. } => KernelShape::Gaussian,
            Self::Ellipse { .. } => KernelShape::Ellipse,
            Self::Hat => KernelShape::Hat,
            Self::Constant => KernelShape::Constant,
        }
    }
}

impl FromStr for Kernel {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let bad = || {
            Error::Usage(format!(
                "a kernel is gaussian[:SIGMA] (0.05 to 10), ellipse:A,N[,smooth] (A from 0 to 16, N from 0.1 to 100), \
                 hat or constant, not {text:?}"
            ))
        };
        let number = |text: &str| text.trim().parse::<f64>().map_err(|_| bad());
        let kernel = match text.split_once(':') {
            None => match text {
                "gaussian" => Self::Gaussian { sigma: 1.0 / 3.0 },
                "hat" => Self::Hat,
                "constant" => Self::Constant,
                _ => return Err(bad()),
            },
            Some(("gaussian", sigma)) => Self::Gaussian { sigma: number(sigma)? },
            Some(("ellipse", numbers)) => match numbers.split(',').collect::<Vec<_>>()[..] {
                [a, n] => Self::Ellipse { a: number(a)?, n: number(n)?, smooth: false },
                [a, n, "smooth"] => Self::Ellipse { a: number(a)?, n: number(n)?, smooth: true },
                _ => return Err(bad()),
            },
            Some(_) => return Err(bad()),
        };
        let usable = match kernel {
            Self::Gaussian { sigma } => (0.05..=10.0).contains(&sigma),
            Self::Ellipse { a, n, smooth } => {
                (if smooth { 0.01 } else { 0.0 }..=16.0).contains(&a) && (0.1..=100.0).contains(&n)
            }
            Self::Hat | Self::Constant => true,
        };
        if usable { Ok(kernel) } else { Err(bad()) }
    }
}

/// What is done about splats that are near a pixel in size or below.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LowPass {
    /// Nothing: a pixel's centre lies in the disk or not.
    #[default]
    None,
    /// The larger of the object-space kernel and a round one of 0.71 pixels (Botsch et al. 2005): no splat falls between
    /// the pixels' centres.
    Max,
    /// The kernel convolved with the pixel (EWA, Zwicker et al. 2001): no aliasing either.
    Ewa,
}

/// How a resolved pixel gets its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shading {
    /// The blended colour as it is.
    Unlit,
    /// The blended colour times the lights' irradiance at the blended normal.
    Lambert,
    /// Lambert's light and white highlights (Phong 1975), [`HIGHLIGHT`] times a light's irradiance times `max(0, r . v)^shininess`,
    /// where r is the light's direction mirrored at the normal and v the direction toward the eye. Phong's own term stops short where a
    /// light sets behind the surface; with the irradiance as a factor (Lewis 1994) it ends there at 0.
    Phong,
}

/// What a highlight of [`Shading::Phong`] adds, of a light's irradiance, where the light is mirrored into the eye.
/// With one light of 1 it does not clip the colour of surfels that have none (`DEFAULT_COLOR`).
pub const HIGHLIGHT: f64 = 0.3;

/// Exponents that [`RenderOptions::shininess`](crate::plan::RenderOptions::shininess) may have: with more, the cosine's rounding in f32 would show.
pub const SHININESS_RANGE: (f32, f32) = (1.0, 1000.0);

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn options_are_read_and_refused() {
        assert_eq!("rel:0.01".parse::<Epsilon>().unwrap(), Epsilon::Relative(0.01));
        assert_eq!("abs:2".parse::<Epsilon>().unwrap(), Epsilon::Absolute(2.0));
        for bad in ["", "rel", "rel:", "rel:-1", "abs:nan", "abs:inf", "radii:1"] {
            assert!(bad.parse::<Epsilon>().is_err(), "{bad}");
        }
        assert_eq!("ellipse:6,3".parse::<Kernel>().unwrap(), Kernel::Ellipse { a: 6.0, n: 3.0, smooth: false });
        for bad in [
            "",
            "ellipse",
            "ellipse:6",
            "ellipse:17,3",
            "ellipse:6,0",
            "gaussian:0",
            "ellipse:6,3,1",
            "hat:1",
            "ellipse:0,3,smooth",
        ] {
            assert!(bad.parse::<Kernel>().is_err(), "{bad}");
        }
    }

    #[test]
    fn the_ellipse_kernel_is_the_papers() {
        let kernel = Kernel::Ellipse { a: 6.0, n: 3.0, smooth: false };
        assert_eq!(kernel.weight(0.0), 1.0);
        assert!((kernel.weight(0.25) - (-6.0f64 / 8.0).exp()).abs() < 1e-15);
        assert!((kernel.weight(1.0) - (-6.0f64).exp()).abs() < 1e-15);
    }

    #[test]
    fn every_kernel_falls_from_one_and_never_below_the_floor() {
        for text in
            ["gaussian", "gaussian:0.2", "ellipse:6,3", "ellipse:6,3,smooth", "ellipse:16,0.5", "hat", "constant"]
        {
            let kernel: Kernel = text.parse().unwrap();
            assert_eq!(kernel.weight(0.0), 1.0, "{text}");
            let weights: Vec<_> = (0..=100).map(|i| kernel.weight(f64::from(i) / 100.0)).collect();
            assert!(weights.windows(2).all(|w| w[0] >= w[1]) && weights[100] >= LEAST_WEIGHT, "{text}");
        }
        assert_eq!("ellipse:6,3,smooth".parse::<Kernel>().unwrap().weight(1.0), LEAST_WEIGHT);
        assert_eq!(Kernel::Hat.weight(0.25), 0.5);
        let sigma = 0.4;
        assert!((Kernel::Gaussian { sigma }.weight(sigma * sigma) - (-0.5f64).exp()).abs() < 1e-15);
    }
}
