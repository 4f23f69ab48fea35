//! Rows of numbers under names, as text files have them, which become points as PLY vertices do.

use super::gaussian;
use super::header::{Element, Kind, Property, Scalar, Tints};
use super::vertex::{Layout, Vertices};
use crate::io::about::Attribute;
use crate::io::color_range::{Number, Shades};
use crate::io::fault::Fault;
use crate::io::{Points, ReadOptions};

/// The columns of a table, and which of them are needed.
pub(in crate::io) struct Table {
    element: Element,
    layout: Layout,
    /// [`ReadOptions::flatten`] and [`ReadOptions::solid`].
    thick: [bool; 2],
    /// The indices of the columns that are needed, in order.
    needed: Vec<usize>,
    /// The index in `needed` of each column of the layout.
    places: Vec<usize>,
}

impl Table {
    /// Finds the attributes among the `names` of the columns: those of PLY vertices.
    ///
    /// # Errors
    ///
    /// [`Fault::Malformed`] if x, y or z is missing, [`Fault::Usage`] if a wanted attribute is.
    pub fn of(names: Vec<String>, options: &ReadOptions) -> Result<Self, Fault> {
        let property = |name| Property { name, kind: Kind::Scalar(Scalar::F64) };
        let element = Element {
            name: "vertex".into(),
            count: 0,
            properties: names.into_iter().map(property).collect(),
            tints: Tints { own: false, ignore_alpha: options.ignore_alpha },
            wanted: options.wanted.clone(),
        };
        let layout = Layout::of(&element)?;
        let mut needed: Vec<usize> = layout.columns.iter().map(|column| column.slot).collect();
        needed.sort_unstable();
        needed.dedup();
        let place = |slot: usize| needed.iter().position(|own| *own == slot).unwrap_or_default();
        let places = layout.columns.iter().map(|column| place(column.slot)).collect();
        Ok(Self { element, layout, thick: [options.flatten, options.solid], needed, places })
    }

    /// The indices of the columns whose numbers a row has, in order.
    pub fn needed(&self) -> &[usize] {
        &self.needed
    }

    /// The attributes of a row, and which of them are used.
    pub fn attributes(&self) -> Vec<Attribute> {
        self.layout.attributes(&self.element)
    }

    /// Returns an empty table with memory for `rows` rows; the caller limits this number by the
    /// length of the file.
    pub fn with_capacity(&self, rows: u64) -> Result<Rows<'_>, Fault> {
        let vertices = Vertices::with_capacity(&self.layout, rows)?;
        Ok(Rows { table: self, vertices, whole: vec![true; self.needed.len()] })
    }
}

/// The rows of a table while it is being read.
pub(in crate::io) struct Rows<'a> {
    table: &'a Table,
    vertices: Vertices<'a>,
    /// For each needed column, whether all its numbers are whole; missing ones do not count.
    whole: Vec<bool>,
}

impl Rows<'_> {
    /// The number of rows.
    pub fn len(&self) -> u64 {
        self.vertices.len()
    }

    /// Appends rows: the numbers of the needed columns, row by row.
    pub fn extend(&mut self, values: &[f64]) {
        let stride = self.whole.len().max(1);
        for (column, whole) in self.whole.iter_mut().enumerate() {
            let is_whole = |value: &f64| value.is_nan() || value.fract() == 0.0;
            *whole = *whole && values.iter().skip(column).step_by(stride).all(is_whole);
        }
        let places = &self.table.places;
        self.vertices.extend(values.len() / stride, |column, row| values[row * stride + places[column]]);
    }

    /// Appends rows with the numbers of all columns.
    pub fn extend_all(&mut self, values: &[f64]) {
        let (width, needed) = (self.table.element.properties.len(), &self.table.needed);
        if needed.len() == width {
            return self.extend(values);
        }
        let rows = values.chunks_exact(width.max(1));
        self.extend(&rows.flat_map(|row| needed.iter().map(|column| row[*column])).collect::<Vec<_>>());
    }

    /// Returns the points, which may be the vertices of a mesh. Text has no types: numbers of
    /// intensities are integers if all of the file are whole, and those of colours may be.
    pub fn finish(self, is_mesh: bool) -> Result<Points, Fault> {
        let Table { layout, thick, places, .. } = self.table;
        let is_whole = |column: usize| self.whole[places[column]];
        let (mut points, _, collector) = self.vertices.into_points();
        for run in points.raw.iter_mut().flat_map(|raw| &mut raw.runs) {
            if let Some(colors) = &mut run.colors {
                colors.kind.light = false;
                if layout.color.is_some_and(|color| color.into_iter().all(is_whole)) {
                    colors.kind.number = Number::Whole;
                }
            }
            if let Some(Shades::Floats { integer, .. }) = &mut run.shades {
                *integer = layout.intensity.is_some_and(is_whole);
            }
        }
        gaussian::settle(&mut points, *thick)?;
        collector.map_or(Ok(()), |collector| collector.finish(&mut points, is_mesh))?;
        Ok(points)
    }
}
