//! Blending kernels: the weight of a fragment by its position in its surfel's disk (paper 000,
//! section 4.2).
//!
//! rho is the distance from the disk's centre in radii: 1 at the rim, where every kernel is cut
//! off. The papers use other units:
//!
//! - Paper 000 has kernels over r < b = 1.5. `psi_E` is the same in both, as b cancels; its
//!   Gaussian of sigma is that of sigma / 1.5 here.
//! - Paper 001 has `exp(-r^2 / h^2)` with h the *radial falloff factor*, in radii: the Gaussian of
//!   sigma = h / sqrt(2).

use std::f64::consts::LN_2;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// The weight of a fragment over the unit disk of its surfel, rho in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
        /// Subtracts the step at the rim: `(psi_E - exp(-a)) / (1 - exp(-a))` ends at 0.
        smooth: bool,
    },
    /// `(1 - rho)^power`: 1 gives the hat function, 1.5 Potree's weight of points that face the
    /// camera.
    Cone {
        /// The exponent.
        power: f64,
    },
    /// 1.
    Constant,
}

/// The family of a kernel, without its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum KernelShape {
    Gaussian,
    Ellipse,
    Cone,
    Constant,
}

impl KernelShape {
    /// Its name among a picture's needs.
    pub fn need(self) -> &'static str {
        match self {
            Self::Gaussian => "kernel-gaussian",
            Self::Ellipse => "kernel-ellipse",
            Self::Cone => "kernel-cone",
            Self::Constant => "kernel-constant",
        }
    }
}

/// The least weight of any fragment: at least one unit of every accumulator, so that "depth written
/// implies weight > 0" holds.
///
/// A pixel reached only by such fragments keeps at least 16 bits of its attributes, as sums keep
/// extra bits for small weights ([`wide_bits`](crate::plan::wide_bits)): 20 in scenes of a million
/// surfels, 24 in those of 60,000.
pub const LEAST_WEIGHT: f64 = 1.0 / 16_777_216.0;

/// The least weight, before a low-pass, of kernels that fall below it only at the rim or not at
/// all. A pixel reached only by rims of disks then keeps 14 bits of its attributes in 24-bit sums.
pub const LEAST_AT_RIM: f64 = 1.0 / 1024.0;

/// The distance from the rim, in radii, at which [`Kernel::floor`] evaluates kernels that end at 0.
const AT_RIM: f64 = 0.01;

impl Kernel {
    /// The weight at the squared radius `rho2`, at least [`floor`](Self::floor).
    pub fn weight(self, rho2: f64) -> f64 {
        let weight = match self {
            Self::Gaussian { sigma } => (-0.5 * rho2 / (sigma * sigma)).exp(),
            Self::Ellipse { a, n, smooth } => {
                let step = if smooth { (-a).exp() } else { 0.0 };
                ((-a * rho2.powf(0.5 * n)).exp() - step) / (1.0 - step)
            }
            Self::Cone { power } => (1.0 - rho2.sqrt()).max(0.0).powf(power),
            Self::Constant => 1.0,
        };
        weight.max(self.floor())
    }

    /// The least weight of the kernel's fragments before a low-pass.
    ///
    /// It is [`LEAST_AT_RIM`], or [`LEAST_WEIGHT`] for a kernel that falls below [`LEAST_AT_RIM`]
    /// well inside the disk and would be flattened there.
    pub fn floor(self) -> f64 {
        let near_rim = match self {
            Self::Gaussian { sigma } => (-0.5 / (sigma * sigma)).exp(),
            Self::Ellipse { a, .. } => (-a).exp(),
            Self::Cone { power } => AT_RIM.powf(power),
            Self::Constant => 1.0,
        };
        if near_rim < LEAST_AT_RIM { LEAST_WEIGHT } else { LEAST_AT_RIM }
    }

    /// The kernel's family.
    pub fn shape(self) -> KernelShape {
        match self {
            Self::Gaussian { .. } => KernelShape::Gaussian,
            Self::Ellipse { .. } => KernelShape::Ellipse,
            Self::Cone { .. } => KernelShape::Cone,
            Self::Constant => KernelShape::Constant,
        }
    }

    /// `psi_E` from the two numbers by which paper 000 specifies a kernel (section 4.2, criteria 4
    /// and 5): `psi(mid) = 1/2` and `psi'(mid) = slope`, so `n = -2 slope mid / ln 2` and
    /// `a = ln 2 mid^-n`.
    fn plateau(mid: f64, slope: f64) -> Self {
        let n = -2.0 * slope * mid / LN_2;
        Self::Ellipse { a: LN_2 * mid.powf(-n), n, smooth: false }
    }

    /// Whether the parameters are within the accepted ranges.
    fn is_usable(self) -> bool {
        match self {
            Self::Gaussian { sigma } => (0.05..=10.0).contains(&sigma),
            Self::Ellipse { a, n, smooth } => {
                (if smooth { 0.01 } else { 0.0 }..=1000.0).contains(&a) && (0.1..=100.0).contains(&n)
            }
            Self::Cone { power } => (0.1..=10.0).contains(&power),
            Self::Constant => true,
        }
    }
}

impl FromStr for Kernel {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let bad = || {
            Error::Usage(format!(
                "a kernel is gaussian[:SIGMA] (0.05 to 10), ellipse:A,N[,smooth] (A from 0 to 1000, N from 0.1 to 100), \
                 plateau:MID,SLOPE (half the weight at MID radii, falling there by -SLOPE a radius: an ellipse, within those limits), \
                 cone:P (P from 0.1 to 10), hat or constant, not {text:?}"
            ))
        };
        let number = |text: &str| text.trim().parse::<f64>().map_err(|_| bad());
        let (name, numbers) =
            text.split_once(':').map_or((text, Vec::new()), |(name, numbers)| (name, numbers.split(',').collect()));
        let kernel = match (name, &numbers[..]) {
            ("gaussian", []) => Self::Gaussian { sigma: 1.0 / 3.0 },
            ("gaussian", [sigma]) => Self::Gaussian { sigma: number(sigma)? },
            ("ellipse", [a, n]) => Self::Ellipse { a: number(a)?, n: number(n)?, smooth: false },
            ("ellipse", [a, n, "smooth"]) => Self::Ellipse { a: number(a)?, n: number(n)?, smooth: true },
            ("plateau", [mid, slope]) => Self::plateau(number(mid)?, number(slope)?),
            ("cone", [power]) => Self::Cone { power: number(power)? },
            ("hat", []) => Self::Cone { power: 1.0 },
            ("constant", []) => Self::Constant,
            _ => return Err(bad()),
        };
        if kernel.is_usable() { Ok(kernel) } else { Err(bad()) }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn kernel(text: &str) -> Kernel {
        text.parse().unwrap()
    }

    #[test]
    fn kernels_are_read_and_refused() {
        assert_eq!(kernel("ellipse:6,3"), Kernel::Ellipse { a: 6.0, n: 3.0, smooth: false });
        assert_eq!(kernel("hat"), kernel("cone:1"));
        for bad in [
            "",
            "ellipse",
            "ellipse:6",
            "ellipse:1001,3",
            "ellipse:6,0",
            "gaussian:0",
            "gaussian:",
            "ellipse:6,3,1",
            "hat:1",
            "cone",
            "cone:0",
            "cone:nan",
            "ellipse:0,3,smooth",
            "plateau:0.5",
            "plateau:0.5,2",
            "plateau:0,-2",
            "plateau:-0.5,2",
            "plateau:0.01,-20000",
        ] {
            assert!(bad.parse::<Kernel>().is_err(), "{bad}");
        }
    }

    #[test]
    fn the_ellipse_kernel_is_the_papers() {
        let kernel = kernel("ellipse:6,3");
        assert_eq!(kernel.weight(0.0), 1.0);
        assert!((kernel.weight(0.25) - (-6.0f64 / 8.0).exp()).abs() < 1e-15);
        assert!((kernel.weight(1.0) - (-6.0f64).exp()).abs() < 1e-15);
    }

    /// The kernels of paper 000's figures 9 and 10 follow their formulas wherever those are at
    /// least 2^-24. The higher floor [`LEAST_AT_RIM`] would have changed five of them.
    #[test]
    fn the_papers_figures_are_drawn_as_they_are() {
        let gaussian = |paper: f64| (format!("gaussian:{}", paper / 1.5), -0.5 / (paper * paper), 2.0);
        let ellipse = |n: f64, a: f64| (format!("ellipse:{a},{n}"), -a / 1.5f64.powf(n), n);
        let figure_9 = [0.2, 0.3, 0.5, 0.6, 0.8, 1.0].map(gaussian);
        let figure_10 =
            [(2.0, 8.0), (2.0, 1.0), (3.0, 20.0), (3.0, 5.0), (5.0, 50.0), (5.0, 4.0)].map(|(n, a)| ellipse(n, a));
        let mut changed = 0;
        for (text, factor, n) in figure_9.into_iter().chain(figure_10) {
            // The paper's own variable, r = 1.5 rho.
            let published = |r: f64| (factor * r.powf(n)).exp();
            let kernel = kernel(&text);
            for step in 0..=1000 {
                let rho = f64::from(step) / 1000.0;
                let expected = published(1.5 * rho).max(LEAST_WEIGHT);
                assert!((kernel.weight(rho * rho) - expected).abs() <= 1e-12 * expected, "{text} at {rho}");
            }
            changed += u32::from(published(1.5) < LEAST_AT_RIM);
        }
        assert_eq!(changed, 5);
    }

    #[test]
    fn a_plateau_has_the_width_and_the_slope_that_are_asked_for() {
        for (mid, slope) in [(0.5, -2.0), (0.7, -3.0), (0.9, -0.5), (0.2, -1.5)] {
            let kernel = kernel(&format!("plateau:{mid},{slope}"));
            let at = |rho: f64| kernel.weight(rho * rho);
            assert!((at(mid) - 0.5).abs() < 1e-12, "{mid}");
            let found = (at(mid + 1e-6) - at(mid - 1e-6)) / 2e-6;
            assert!((found - slope).abs() < 1e-6, "{mid}: {found}");
        }
    }

    #[test]
    fn every_kernel_falls_from_one_and_never_below_its_floor() {
        for (text, floor) in [
            ("gaussian", LEAST_AT_RIM),
            ("gaussian:0.2", LEAST_WEIGHT),
            ("ellipse:6,3", LEAST_AT_RIM),
            ("ellipse:6,3,smooth", LEAST_AT_RIM),
            ("ellipse:7,3", LEAST_WEIGHT),
            ("ellipse:16,0.5", LEAST_WEIGHT),
            ("hat", LEAST_AT_RIM),
            ("cone:1.5", LEAST_AT_RIM),
            ("cone:3", LEAST_WEIGHT),
            ("constant", LEAST_AT_RIM),
        ] {
            let kernel = kernel(text);
            assert_eq!((kernel.weight(0.0), kernel.floor()), (1.0, floor), "{text}");
            let weights: Vec<_> = (0..=200).map(|i| kernel.weight(f64::from(i) / 100.0)).collect();
            assert!(weights.windows(2).all(|w| w[0] >= w[1]) && weights[200] >= floor, "{text}");
        }
        assert_eq!(kernel("ellipse:6,3,smooth").weight(1.0), LEAST_AT_RIM);
        assert_eq!(kernel("hat").weight(0.25), 0.5);
        assert!((kernel("cone:1.5").weight(0.25) - 0.5f64.powf(1.5)).abs() < 1e-15);
        let sigma = 0.4;
        assert!((Kernel::Gaussian { sigma }.weight(sigma * sigma) - (-0.5f64).exp()).abs() < 1e-15);
    }
}
