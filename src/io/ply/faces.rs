//! The triangles of a PLY file: polygons of the element `face`, strips of the element `tristrips`.

use super::header::{Element, Kind, Property, Scalar};
use crate::io::fault::Fault;

/// How a list of vertices becomes triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    /// One polygon, fanned from its first corner.
    Polygon,
    /// Each vertex makes a triangle with the two before it, every second one turned round; -1 begins another strip.
    Strip,
}

/// Triangles while they are read, and the list that they are read from.
#[derive(Debug, Default)]
pub(super) struct Faces {
    pub(super) triangles: Vec<[u32; 3]>,
    shape: Option<Shape>,
    /// The last two vertices of a strip, or the first and the last one of a polygon.
    kept: [Option<u32>; 2],
    /// Whether the next triangle of the strip is turned round.
    odd: bool,
}

impl Faces {
    /// Which property of an element lists the vertices of faces, if one does.
    pub(super) fn list(element: &Element) -> Option<(usize, Scalar, Scalar)> {
        Self::shape_of(element)?;
        let list = |(index, property): (usize, &Property)| match property.kind {
            Kind::List { count, item } if ["vertex_indices", "vertex_index"].contains(&property.name.as_str()) => {
                Some((index, count, item))
            }
            _ => None,
        };
        element.properties.iter().enumerate().find_map(list)
    }

    fn shape_of(element: &Element) -> Option<Shape> {
        match element.name.as_str() {
            "face" => Some(Shape::Polygon),
            "tristrips" => Some(Shape::Strip),
            _ => None,
        }
    }

    /// Begins the list of a row.
    pub(super) fn begin(&mut self, element: &Element) {
        self.shape = Self::shape_of(element);
        (self.kept, self.odd) = ([None, None], false);
    }

    /// Takes the next number of the list.
    pub(super) fn take(&mut self, element: &Element, row: u64, number: f64) -> Result<(), Fault> {
        if number == -1.0 && self.shape == Some(Shape::Strip) {
            (self.kept, self.odd) = ([None, None], false);
            return Ok(());
        }
        let vertex = number as u32;
        if f64::from(vertex) != number {
            let (row, name) = (row + 1, &element.name);
            return Err(Fault::Malformed(format!(
                "row {row} of element '{name}' names the vertex {number}, which cannot be"
            )));
        }
        let [first, second] = self.kept;
        match (first, second) {
            (None, _) => self.kept[0] = Some(vertex),
            (_, None) => self.kept[1] = Some(vertex),
            (Some(first), Some(second)) => {
                let turned = self.shape == Some(Shape::Strip) && self.odd;
                let triangle = if turned { [second, first, vertex] } else { [first, second, vertex] };
                // Strips turn corners by triangles without area.
                if first != second && second != vertex && vertex != first {
                    self.triangles.push(triangle);
                }
                let keep = if self.shape == Some(Shape::Strip) { second } else { first };
                self.kept = [Some(keep), Some(vertex)];
                self.odd = !self.odd;
            }
        }
        Ok(())
    }

    /// The triangles of a file with so many vertices.
    pub(super) fn finish(self, vertices: usize) -> Result<Vec<[u32; 3]>, Fault> {
        match self.triangles.as_flattened().iter().find(|vertex| **vertex as usize >= vertices) {
            Some(vertex) => {
                Err(Fault::Malformed(format!("a face names the vertex {vertex}, but there are {vertices}")))
            }
            None => Ok(self.triangles),
        }
    }
}
