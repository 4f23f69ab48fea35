//! Leica's PTX: scans one after the other, each with a pose and a grid of points.

use super::rows::Parsed;
use crate::io::fault::Fault;

/// The lines in front of the points of a scan: its numbers of columns and rows, the scanner's
/// position and three axes, and the four lines of a matrix.
const HEADER: usize = 10;

/// The line of the header from which on the matrix follows.
const MATRIX: usize = 6;

/// Finds the points of the scans among the rows of a file.
#[derive(Debug, Default)]
pub(super) struct Scans {
    /// The most numbers of a point so far.
    widest: usize,
    /// The lines of the current scan's header so far.
    header: Vec<Vec<f64>>,
    /// The points that the current scan still has.
    left: u64,
    /// The number of scans.
    pub(super) count: u64,
    /// The index of the next point in the file.
    next: u64,
    /// The indices of points without a return.
    pub(super) missing: Vec<u64>,
}

/// The names of the numbers of a point.
pub(super) const NAMES: [&str; 7] = ["x", "y", "z", "intensity", "red", "green", "blue"];

impl Scans {
    /// The number of [`NAMES`] that points have: three, four with an intensity, or seven with a
    /// colour too.
    pub(super) fn width(&self) -> usize {
        match self.widest {
            7.. => 7,
            4.. => 4,
            _ => 3,
        }
    }

    /// The points that the last scan lacks.
    pub(super) fn lacks(&self) -> u64 {
        self.left
    }

    /// Returns the numbers of the points in the rows of a block, in the coordinates of the file:
    /// one for each of [`NAMES`], NaN where a point has none.
    ///
    /// # Errors
    ///
    /// The line in the block and the fault of a row that does not fit its place.
    pub(super) fn take(&mut self, parsed: &Parsed) -> Result<Vec<f64>, (u64, Fault)> {
        let mut points = Vec::with_capacity(parsed.values.len());
        let mut start = 0;
        for (end, line) in &parsed.ends {
            let row = &parsed.values[start..*end];
            start = *end;
            let taken = if self.left > 0 { self.point(row, &mut points) } else { self.header(row) };
            taken.map_err(|what| (*line, Fault::Malformed(what)))?;
        }
        Ok(points)
    }

    fn header(&mut self, row: &[f64]) -> Result<(), String> {
        if self.header.len() == HEADER {
            self.header.clear();
        }
        let place = self.header.len();
        let (wanted, what) = match place {
            0 => (1, "the number of columns of a scan"),
            1 => (1, "the number of rows of a scan"),
            2..MATRIX => (3, "the position or an axis of a scanner"),
            _ => (4, "a line of the matrix of a scan"),
        };
        if row.len() != wanted || row.iter().any(|number| !number.is_finite()) {
            let [needs, has] = [wanted, row.len()]
                .map(|count| if count == 1 { "1 number".into() } else { format!("{count} numbers") });
            return Err(format!("a row of {needs} is needed here, {what}; it has {has}"));
        }
        if place < 2 && (row[0] < 0.0 || row[0].fract() != 0.0) {
            return Err(format!("a whole number is needed here, {what}, not {}", row[0]));
        }
        self.header.push(row.to_vec());
        if self.header.len() == HEADER {
            self.count += 1;
            // The cast saturates.
            self.left = (self.header[0][0] as u64).saturating_mul(self.header[1][0] as u64);
        }
        Ok(())
    }

    fn point(&mut self, row: &[f64], points: &mut Vec<f64>) -> Result<(), String> {
        if row.len() < 3 {
            let has = if row.len() == 1 { "1 number".into() } else { format!("{} numbers", row.len()) };
            return Err(format!("its scan still lacks {} points, but it has {has}", self.left));
        }
        self.left -= 1;
        self.next += 1;
        let [x, y, z] = [row[0], row[1], row[2]];
        if [x, y, z] == [0.0; 3] {
            self.missing.push(self.next - 1);
            return Ok(());
        }
        let line = |k: usize, axis: usize| self.header.get(MATRIX + k).map_or(0.0, |line| line[axis]);
        let place = |axis: usize| x * line(0, axis) + y * line(1, axis) + z * line(2, axis) + line(3, axis);
        points.extend([0, 1, 2].map(place));
        self.widest = self.widest.max(row.len());
        // A colour is whole or none.
        let own = if row.len() < NAMES.len() { &row[..row.len().min(4)] } else { row };
        points.extend((3..NAMES.len()).map(|k| own.get(k).copied().unwrap_or(f64::NAN)));
        Ok(())
    }
}

/// Converts indices among the points that have returns to indices in the file, and merges them with
/// those of the `missing` points.
pub(super) fn in_file(left_out: &[u64], missing: Vec<u64>, kept: u64) -> Vec<u64> {
    if missing.is_empty() {
        return left_out.to_vec();
    }
    let count = kept + left_out.len() as u64 + missing.len() as u64;
    let (mut absent, mut dropped) = (missing.into_iter().peekable(), left_out.iter().peekable());
    let mut own = 0;
    let is_left_out = |index: &u64| {
        if absent.next_if_eq(index).is_some() {
            return true;
        }
        own += 1;
        dropped.next_if(|dropped| **dropped == own - 1).is_some()
    };
    (0..count).filter(is_left_out).collect()
}
