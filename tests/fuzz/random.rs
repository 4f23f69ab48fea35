//! Where generated points lie.

pub use crate::numbers::Random;

/// The distribution of a generated file's points.
#[derive(Clone, Copy)]
pub enum Place {
    /// In the unit cube.
    Unit,
    /// On a coarse grid, so positions repeat.
    Grid,
    /// Far from the origin, as in surveys.
    Survey,
    /// All at one position.
    One,
    /// Values of all magnitudes, including NaN and infinities.
    Wild,
}

/// Coordinates at the limits of the types and of what a scene may hold.
const WILD: [f64; 12] =
    [0.0, -0.0, 1e-320, 1e-40, 1e18, -1.1e18, 3.5e38, 1e300, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 2147483648.0];

impl Place {
    /// A random distribution, favouring the unit cube.
    pub fn any(random: &mut Random) -> Self {
        [Self::Unit, Self::Unit, Self::Grid, Self::Survey, Self::One, Self::Wild][random.below(6)]
    }

    /// A random point of this distribution.
    pub fn point(self, random: &mut Random) -> [f64; 3] {
        [0, 1, 2].map(|axis| match self {
            Self::Unit => random.between(-1.0, 1.0),
            Self::Grid => random.below(3) as f64,
            Self::Survey => [5e5, 6e6, 0.0][axis] + (random.between(0.0, 1e5)).round() / 1000.0,
            Self::One => 7.5,
            Self::Wild if random.one_in(2) => WILD[random.below(WILD.len())],
            Self::Wild => random.between(-1.0, 1.0) * 10f64.powf(random.between(-30.0, 30.0)),
        })
    }
}
