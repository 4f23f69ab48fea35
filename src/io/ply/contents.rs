//! The content of a PLY file, and the errors that text and binary files share.

use super::faces::Faces;
use super::header::Element;
use crate::io::dimensions::Collector;
use crate::io::fault::Fault;
use crate::io::values::shown;
use crate::io::{Points, Tree};
use crate::scene::Whole;

/// Everything that is read after the header.
#[derive(Default)]
pub(super) struct Contents {
    pub(super) points: Points,
    pub(super) faces: Faces,
    pub(super) tree: Option<Tree>,
    pub(super) whole: Option<Whole>,
    /// The attributes of vertices that options ask for.
    pub(super) collector: Option<Collector>,
}

/// The error of a file that ends inside `element`, after `rows` whole rows.
pub(super) fn ends_early(element: &Element, rows: u64) -> Fault {
    let rows_of = match element.name.as_str() {
        "vertex" => "vertices".to_owned(),
        name => format!("rows of element '{}'", shown(name.as_bytes())),
    };
    Fault::Malformed(format!("the header promises {} {rows_of}, the file ends after {rows}", element.count))
}

pub(super) fn negative_list(element: &Element, row: u64) -> Fault {
    let name = shown(element.name.as_bytes());
    Fault::Malformed(format!("row {} of element '{name}' has a list of negative length", row + 1))
}
