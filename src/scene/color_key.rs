//! The relation between the values of an attribute and their colours, as a legend shows it.

use super::ColorMap;

/// The relation between the values of an attribute and their colours.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorKey {
    /// The attribute.
    pub name: String,
    /// The unit of its values, if it is known.
    pub unit: Option<&'static str>,
    /// The colours.
    pub colors: KeyColors,
}

/// The colours of values.
#[derive(Clone, Debug, PartialEq)]
pub enum KeyColors {
    /// A colour map between two values.
    Ramp {
        /// The colour map.
        map: ColorMap,
        /// The values of its ends.
        ends: [f64; 2],
    },
    /// A colour for each number that occurs: its name and sRGB codes.
    Categories(Vec<(String, [u8; 3])>),
    /// Red, green and blue for x, y and z of unit vectors: the sRGB codes of 0.5 + 0.5 n.
    Vectors,
}
