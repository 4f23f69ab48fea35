//! ASCII PLY: words separated by white space; line ends have no meaning.

use super::contents::{Contents, ends_early, negative_list};
use super::faces::{Faces, Role, needed};
use super::header::{Element, Header, Kind};
use super::vertex::{Layout, Vertices, is_tree};
use crate::Progress;
use crate::io::dimensions::Collector;
use crate::io::fault::Fault;
use crate::io::values::{parse_number, shown};
use crate::io::{Points, Tree, TreeRow};
use std::io::{self, BufRead};

/// Longest prefix of a word that is kept, bytes; any number that is written as text is shorter.
const TOKEN_LIMIT: usize = 1 << 10;

/// Reads the needed elements; `reader` must stand just after the header.
pub(super) fn read(
    reader: impl BufRead,
    header: &Header,
    length: u64,
    faces: Faces,
    progress: &dyn Progress,
) -> Result<Contents, Fault> {
    let mut tokens = Tokens { reader, line: header.lines + 1, line_end: header.line_end, token: Vec::new() };
    let mut contents = Contents { faces, ..Contents::default() };
    for element in needed(&header.elements) {
        if element.name == "vertex" {
            (contents.points, _, contents.collector) = vertices(&mut tokens, element, length, progress)?;
        } else if is_tree(element) {
            let (nodes, rows, _) = vertices(&mut tokens, element, length, &())?;
            contents.tree = Some(Tree { nodes: Box::new(nodes), rows });
        } else {
            others(&mut tokens, element, &mut contents.faces)?;
        }
    }
    Ok(contents)
}

/// Reads the rows of an element of faces, and skips those of any other element.
fn others(tokens: &mut Tokens<impl BufRead>, element: &Element, faces: &mut Faces) -> Result<(), Fault> {
    let roles = faces.roles(element);
    for row in 0..if element.properties.is_empty() { 0 } else { element.count } {
        faces.begin(element);
        for (property, &role) in element.properties.iter().zip(&roles) {
            let whole = match (role, property.kind) {
                (Role::Unused, kind) => tokens.skip(element, row, kind)?,
                (_, Kind::List { .. }) => tokens.list(element, row, |number| faces.take(element, row, role, number))?,
                (_, Kind::Scalar(_)) => match tokens.number()? {
                    Some(number) => faces.take(element, row, role, number).map(|()| true)?,
                    None => false,
                },
            };
            if !whole {
                return Err(ends_early(element, row));
            }
        }
        faces.end();
    }
    Ok(())
}

fn vertices(
    tokens: &mut Tokens<impl BufRead>,
    vertex: &Element,
    length: u64,
    progress: &dyn Progress,
) -> Result<(Points, Vec<TreeRow>, Option<Collector>), Fault> {
    let layout = Layout::of(vertex)?;
    // In text each number takes at least one digit and one separator.
    let possible = length / (2 * layout.scalars.len().max(1)) as u64;
    let mut vertices = Vertices::with_capacity(&layout, vertex.count.min(possible))?;
    let mut used = vec![None; layout.scalars.len()];
    for (index, column) in layout.columns.iter().enumerate() {
        used[column.slot] = Some(index);
    }
    let mut values = vec![0.0; layout.columns.len()];
    let mut unreported = 0;
    for row in 0..vertex.count {
        let mut slots = used.iter();
        for property in &vertex.properties {
            let column = match property.kind {
                Kind::Scalar(_) => slots.next().copied().flatten(),
                Kind::List { .. } => None,
            };
            let whole = match column {
                // Words that only options ask for are no fault of the file.
                Some(column) if column >= layout.plain => tokens.word()?.map(|word| values[column] = word).is_some(),
                Some(column) => tokens.number()?.map(|number| values[column] = number).is_some(),
                None => tokens.skip(vertex, row, property.kind)?,
            };
            if !whole {
                return Err(ends_early(vertex, row));
            }
        }
        vertices.extend(1, |column, _| values[column]);
        unreported += 1;
        if unreported == 1 << 16 {
            progress.advance(unreported);
            unreported = 0;
        }
    }
    progress.advance(unreported);
    Ok(vertices.into_points())
}

/// The words of a text, and the number of the current line.
struct Tokens<R> {
    reader: R,
    line: u64,
    line_end: u8,
    token: Vec<u8>,
}

impl<R: BufRead> Tokens<R> {
    /// Reads the next word into `token`; returns `false` at the end of the file.
    fn advance(&mut self) -> Result<bool, Fault> {
        self.token.clear();
        loop {
            let buffer = match self.reader.fill_buf() {
                Ok(buffer) => buffer,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error.into()),
            };
            if buffer.is_empty() {
                return Ok(!self.token.is_empty());
            }
            let mut start = 0;
            if self.token.is_empty() {
                start = buffer.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap_or(buffer.len());
                self.line += buffer[..start].iter().filter(|&&byte| byte == self.line_end).count() as u64;
            }
            let word = &buffer[start..];
            let length = word.iter().position(u8::is_ascii_whitespace);
            let end = start + length.unwrap_or(word.len());
            let room = TOKEN_LIMIT.saturating_sub(self.token.len());
            self.token.extend(buffer[start..end].iter().take(room));
            self.reader.consume(end);
            if length.is_some() && !self.token.is_empty() {
                return Ok(true);
            }
        }
    }

    /// Reads the next number; returns `None` at the end of the file.
    fn number(&mut self) -> Result<Option<f64>, Fault> {
        if !self.advance()? {
            return Ok(None);
        }
        match parse_number(&self.token) {
            Some(number) => Ok(Some(number)),
            None => Err(Fault::Malformed(format!("line {}: '{}' is not a number", self.line, shown(&self.token)))),
        }
    }

    /// Reads the next word as a number, or NaN if it is none; returns `None` at the end of the
    /// file.
    fn word(&mut self) -> Result<Option<f64>, Fault> {
        Ok(self.advance()?.then(|| parse_number(&self.token).unwrap_or(f64::NAN)))
    }

    /// Skips one property; returns `false` if the file ends inside it.
    fn skip(&mut self, element: &Element, row: u64, kind: Kind) -> Result<bool, Fault> {
        if matches!(kind, Kind::Scalar(_)) {
            return self.advance();
        }
        self.length(element, row)?.map_or(Ok(false), |items| {
            for _ in 0..items {
                if !self.advance()? {
                    return Ok(false);
                }
            }
            Ok(true)
        })
    }

    /// Passes each number of a list to `take`; returns `false` if the file ends inside the list.
    fn list(
        &mut self,
        element: &Element,
        row: u64,
        mut take: impl FnMut(f64) -> Result<(), Fault>,
    ) -> Result<bool, Fault> {
        let Some(items) = self.length(element, row)? else { return Ok(false) };
        for _ in 0..items {
            let Some(number) = self.number()? else { return Ok(false) };
            take(number)?;
        }
        Ok(true)
    }

    /// Reads the length of a list; returns `None` at the end of the file.
    fn length(&mut self, element: &Element, row: u64) -> Result<Option<u64>, Fault> {
        let Some(items) = self.number()? else { return Ok(None) };
        if items < 0.0 {
            return Err(negative_list(element, row));
        }
        if items.fract() != 0.0 {
            let token = shown(&self.token);
            return Err(Fault::Malformed(format!("line {}: '{token}' is not the length of a list", self.line)));
        }
        Ok(Some(items as u64))
    }
}
