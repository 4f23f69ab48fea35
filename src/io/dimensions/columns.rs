//! Wanted attributes of formats whose readers give the numbers of a row by the index of a column.

use super::{Collector, Wanted};
use crate::io::fault::Fault;

/// The wanted attributes of a file, and the columns that they are in.
#[derive(Clone, Debug)]
pub(in crate::io) struct Columns {
    /// The names of all attributes of the file.
    names: Vec<String>,
    wanted: Wanted,
    /// The columns of the attributes that a collector needs, in its order.
    columns: Vec<usize>,
}

impl Columns {
    /// Finds the wanted attributes among `names`; `column` gives the column of an attribute by its
    /// index. Returns None if nothing is wanted.
    ///
    /// # Errors
    ///
    /// As [`Collector::of`].
    pub fn of(names: Vec<String>, wanted: &Wanted, column: impl FnMut(usize) -> usize) -> Result<Option<Self>, Fault> {
        let Some(collector) = Collector::of(&names, wanted)? else { return Ok(None) };
        let columns = collector.fields.iter().copied().map(column).collect();
        Ok(Some(Self { names, wanted: wanted.clone(), columns }))
    }

    /// Returns a collector for the rows of the file.
    ///
    /// # Errors
    ///
    /// As [`Collector::of`].
    pub fn collector(&self) -> Result<Option<Collector>, Fault> {
        Collector::of(&self.names, &self.wanted)
    }

    /// Passes `rows` rows to a collector; `value(column, row)` gives their numbers, and `position`
    /// are the columns of their coordinates.
    pub fn mark(
        &self,
        collector: &mut Collector,
        (rows, position): (usize, [usize; 3]),
        value: impl Fn(usize, usize) -> f64,
    ) {
        for row in 0..rows {
            let place = position.map(|column| value(column, row));
            collector.mark(&place, |field| value(self.columns[field], row));
        }
    }
}
