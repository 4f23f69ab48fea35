//! Attributes of points that are read only if an option asks for them, to colour points by one of
//! them or to select points. PDAL calls them dimensions.
//!
//! A reader lists the attributes that its file has and passes the numbers of each point to a
//! `Collector`, which stores one attribute, tests the conditions, and finds ranges. A file that
//! is read without such options has no collector.

mod class_list;
mod collect;
mod columns;
mod filter;
mod names;

pub use class_list::ClassList;
pub(super) use collect::{Collector, of_positions};
pub use collect::{Column, Span};
pub(super) use columns::Columns;
pub use filter::{Filter, Range};
pub(super) use names::ANGLE_STEP;
pub use names::Group;

use std::fmt;
use std::str::FromStr;

use crate::error::Error;

/// The quantity that points are coloured by.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum ColorBy {
    /// The colours of the file, or its intensities where it has none.
    #[default]
    Rgb,
    /// The direction of the normal, from the file or from neighbours.
    Normal,
    /// The number of points per area.
    Density,
    /// An attribute by its name.
    Attribute(String),
}

impl FromStr for ColorBy {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        Ok(match text.trim() {
            "" => return Err(Error::Usage("it is the name of an attribute, such as z or intensity".into())),
            name if name.eq_ignore_ascii_case("rgb") => Self::Rgb,
            name if name.eq_ignore_ascii_case("normal") => Self::Normal,
            name if name.eq_ignore_ascii_case("density") => Self::Density,
            name => Self::Attribute(name.to_owned()),
        })
    }
}

impl fmt::Display for ColorBy {
    /// Writes the syntax that `from_str` reads.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rgb => "rgb",
            Self::Normal => "normal",
            Self::Density => "density",
            Self::Attribute(name) => name,
        })
    }
}

/// The attributes to read beside those that every picture needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wanted {
    /// The name of the attribute to store for each point ([`Points::column`](super::Points)).
    pub column: Option<String>,
    /// The points to keep; all if the filter is empty.
    pub filter: Filter,
    /// Find the range of every attribute.
    pub spans: bool,
}

impl Wanted {
    /// Whether no attribute is wanted.
    pub fn is_empty(&self) -> bool {
        self.column.is_none() && self.filter.is_empty() && !self.spans
    }
}
