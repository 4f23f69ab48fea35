//! Colour maps: the colours of numbers from 0 to 1.

use std::fmt;
use std::str::FromStr;

use colorous::Gradient;

use crate::error::{Error, Result};

/// The number of steps in which colours are computed: more than 8-bit codes can show.
const STEPS: usize = 1024;

/// The names of the maps, and their gradients. `gray` has none: it is linear in sRGB codes.
const MAPS: [(&str, Option<Gradient>); 17] = [
    ("viridis", Some(colorous::VIRIDIS)),
    ("turbo", Some(colorous::TURBO)),
    ("gray", None),
    ("inferno", Some(colorous::INFERNO)),
    ("magma", Some(colorous::MAGMA)),
    ("plasma", Some(colorous::PLASMA)),
    ("cividis", Some(colorous::CIVIDIS)),
    ("cubehelix", Some(colorous::CUBEHELIX)),
    ("warm", Some(colorous::WARM)),
    ("cool", Some(colorous::COOL)),
    ("rainbow", Some(colorous::RAINBOW)),
    ("sinebow", Some(colorous::SINEBOW)),
    ("spectral", Some(colorous::SPECTRAL)),
    ("blues", Some(colorous::BLUES)),
    ("greens", Some(colorous::GREENS)),
    ("reds", Some(colorous::REDS)),
    ("red-blue", Some(colorous::RED_BLUE)),
];

/// The colours of numbers from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ColorMap {
    /// Index in [`MAPS`].
    map: usize,
    /// The map runs from its end to its start.
    reversed: bool,
}

impl ColorMap {
    /// The sRGB codes of a number, which is clamped to [0, 1].
    pub fn code(self, share: f64) -> [u8; 3] {
        let share = share.clamp(0.0, 1.0);
        let share = if self.reversed { 1.0 - share } else { share };
        match MAPS[self.map].1 {
            Some(gradient) => gradient.eval_continuous(share).into_array(),
            None => [(255.0 * share).round() as u8; 3],
        }
    }

    /// The codes of equal steps from 0 to 1, for [`step`].
    pub(crate) fn steps(self) -> Vec<[u8; 3]> {
        (0..STEPS).map(|step| self.code(step as f64 / (STEPS - 1) as f64)).collect()
    }
}

/// The index of a number's code in [`ColorMap::steps`].
pub(crate) fn step(share: f64) -> usize {
    (share.clamp(0.0, 1.0) * (STEPS - 1) as f64).round() as usize
}

/// The colours of categories, by their number.
pub(crate) fn category(number: u32) -> [u8; 3] {
    colorous::TABLEAU10[number as usize % colorous::TABLEAU10.len()].into_array()
}

impl fmt::Display for ColorMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", MAPS[self.map].0, if self.reversed { "-r" } else { "" })
    }
}

impl FromStr for ColorMap {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let name = text.trim().to_ascii_lowercase();
        let (name, reversed) = name.strip_suffix("-r").map_or((name.as_str(), false), |name| (name, true));
        let name = if name == "grey" { "gray" } else { name };
        let map = MAPS.iter().position(|(known, _)| *known == name).ok_or_else(|| {
            let names: Vec<_> = MAPS.iter().map(|(name, _)| *name).collect();
            Error::Usage(format!("{text:?} is no colour map: give one of {}", names.join(", ")))
        })?;
        Ok(Self { map, reversed })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_maps_have_the_colours_of_their_authors() {
        let code = |name: &str, share: f64| name.parse::<ColorMap>().unwrap().code(share);
        // The ends and the middle of matplotlib's tables (bids.github.io/colormap), and white.
        for (name, share, expected) in [
            ("viridis", 0.0, [68, 1, 84]),
            ("viridis", 1.0, [253, 231, 37]),
            ("Viridis", 0.5, [33, 145, 140]),
            ("magma", 0.0, [0, 0, 4]),
            ("magma", 1.0, [252, 253, 191]),
            ("inferno", 1.0, [252, 255, 164]),
            ("plasma", 0.0, [13, 8, 135]),
            ("gray", 0.5, [128; 3]),
            ("grey", 7.0, [255; 3]),
        ] {
            let difference = code(name, share).iter().zip(expected).map(|(a, b)| a.abs_diff(b)).max();
            assert!(difference.unwrap() <= 1, "{name} {share}: {:?}", code(name, share));
        }
        assert_eq!(code("viridis-r", 0.0), code("viridis", 1.0));
        let steps = ColorMap::default().steps();
        assert_eq!((steps[step(-1.0)], steps[step(1.0)]), (code("viridis", 0.0), code("viridis", 1.0)));
        assert!("jet".parse::<ColorMap>().unwrap_err().to_string().contains("viridis, turbo"));
        assert_eq!("cool-r".parse::<ColorMap>().unwrap().to_string(), "cool-r");
    }
}
