//! Properties beside those that every reader of points knows.

use std::io::{self, Write};

/// A whole number for each point, in a property of its own.
#[derive(Clone, Copy, Debug)]
pub struct Column<'a> {
    /// The name of the property, in which there is no space.
    pub name: &'a str,
    /// A value for each point; missing ones are written as 0.
    pub values: &'a [u32],
}

impl Column<'_> {
    /// Writes the header lines of `columns`.
    pub(super) fn write_properties(columns: &[Self], out: &mut impl Write) -> io::Result<()> {
        columns.iter().try_for_each(|column| writeln!(out, "property uint {}", column.name))
    }

    pub(super) fn bytes(&self, index: usize) -> [u8; 4] {
        self.values.get(index).copied().unwrap_or_default().to_le_bytes()
    }
}
