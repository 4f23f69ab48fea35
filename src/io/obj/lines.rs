//! The lines of an OBJ file.

use crate::Progress;
use crate::io::RawColors;
use crate::io::color_range::{Kind, Number, Numbers, Values};
use crate::io::fault::Fault;
use crate::io::values::{BYTE_ORDER_MARK, finite, line_end, parse_number, shown};
use crate::scene::color::{DEFAULT_COLOR, srgb8};
use std::collections::HashMap;
use std::io::{BufRead, Read};

use super::faces::{Faces, Named, Numbering, Triangle};

/// Longest line with its continuation lines, bytes. A polygon of a million corners is shorter.
const LINE_LIMIT: usize = 1 << 24;

/// The content of a file.
#[derive(Debug, Default)]
pub(super) struct Lines {
    pub(super) positions: Vec<[f64; 3]>,
    /// The colour and alpha of each position, as they are in the file. NaN for a vertex without a
    /// colour; empty if no vertex has a colour.
    colors: Vec<[f64; 4]>,
    /// The codes of `#MRGB` lines, vertex by vertex.
    polypaint: Vec<[u8; 4]>,
    pub(super) normals: Vec<[f64; 3]>,
    pub(super) texture: Vec<[f32; 2]>,
    /// The text after each `mtllib`.
    pub(super) libraries: Vec<String>,
    /// The distinct names after `usemtl`; their indices are in `numbers`.
    pub(super) materials: Vec<String>,
    numbers: HashMap<String, u32>,
    /// The index of the current material.
    material: Option<u32>,
    pub(super) faces: Faces,
    /// The number of the current line.
    count: u64,
}

/// Reads a file line by line.
struct Reader<'a, R> {
    reader: R,
    progress: &'a dyn Progress,
    unreported: u64,
    /// The number of lines read so far, including the current one.
    count: u64,
    line: Vec<u8>,
    /// The byte that ends a line.
    line_end: u8,
}

impl<R: BufRead> Reader<'_, R> {
    /// Reads the next line with its continuation lines; returns `false` at the end of the file.
    fn next_line(&mut self) -> Result<bool, Fault> {
        self.line.clear();
        if self.count == 0 {
            self.line_end = line_end(&mut self.reader)?;
        }
        loop {
            let room = LINE_LIMIT.saturating_sub(self.line.len());
            let bytes = self.reader.by_ref().take(room as u64).read_until(self.line_end, &mut self.line)?;
            if room == 0 {
                let line = self.count;
                return Err(Fault::Malformed(format!("line {line} is longer than {LINE_LIMIT} bytes")));
            }
            if bytes == 0 {
                return Ok(!self.line.is_empty());
            }
            self.count += 1;
            if self.count == 1 && self.line.starts_with(BYTE_ORDER_MARK) {
                self.line.drain(..BYTE_ORDER_MARK.len());
            }
            self.unreported += bytes as u64;
            if self.unreported >= 1 << 20 {
                self.progress.advance(std::mem::take(&mut self.unreported));
            }
            match self.line.trim_ascii_end().strip_suffix(b"\\") {
                Some(continued) => {
                    let length = continued.len();
                    self.line.truncate(length);
                    self.line.push(b' ');
                }
                None if self.line.len() < LINE_LIMIT || self.line.last() == Some(&self.line_end) => return Ok(true),
                None => {}
            }
        }
    }
}

impl Lines {
    /// Reads all lines. Invalid texture coordinates are an error only if `strict`: for points they
    /// matter little.
    ///
    /// # Errors
    /// A word that is not a number, or a face that refers to an attribute that does not exist.
    pub(super) fn read(reader: impl BufRead, strict: bool, progress: &dyn Progress) -> Result<Self, Fault> {
        let line_end = b'\n';
        let mut rest = Reader { reader, progress, unreported: 0, count: 0, line: Vec::new(), line_end };
        let mut lines = Self::default();
        while rest.next_line()? {
            lines.count = rest.count;
            lines.take(&rest.line, strict)?;
        }
        progress.advance(rest.unreported);
        lines.faces.check(lines.counts(), strict)?;
        Ok(lines)
    }

    /// The text after each `mtllib`, up to the first line that cannot be read.
    pub(super) fn libraries(reader: impl BufRead) -> Vec<String> {
        let mut rest = Reader { reader, progress: &(), unreported: 0, count: 0, line: Vec::new(), line_end: b'\n' };
        let mut libraries = Vec::new();
        while rest.next_line().unwrap_or(false) {
            let line = rest.line.trim_ascii_start();
            if line.strip_prefix(b"mtllib").is_some_and(|rest| rest.first().is_none_or(u8::is_ascii_whitespace)) {
                libraries.push(rest_of(line, b"mtllib"));
            }
        }
        libraries
    }

    /// The triangles of all faces.
    pub(super) fn triangles(&self) -> impl Iterator<Item = Triangle> + '_ {
        let named = Named { positions: &self.positions, texture: &self.texture, normals: &self.normals };
        self.faces.triangles(named)
    }

    /// The number of vertices, texture coordinates and normals so far.
    fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.texture.len(), self.normals.len()]
    }

    /// Parses a line.
    fn take(&mut self, line: &[u8], strict: bool) -> Result<(), Fault> {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next() {
            Some(b"v") => self.vertex(words)?,
            Some(b"vn") => {
                let mut normal = [0.0; 3];
                for component in &mut normal {
                    *component = self.number(words.next())?;
                }
                self.normals.push(normal);
            }
            Some(b"vt") => {
                let place = self.place(words);
                self.texture.push(if strict { place? } else { place.unwrap_or([f32::NAN; 2]) });
            }
            Some(b"mtllib") => self.libraries.push(rest_of(line, b"mtllib")),
            Some(b"usemtl") => self.material = Some(self.number_of(rest_of(line, b"usemtl"))),
            Some(b"f") => {
                let numbering = Numbering { counts: self.counts(), line: self.count, strict };
                self.faces.add(words, numbering, self.material)?;
            }
            Some(b"#MRGB") => self.polypaint.extend(words.next().into_iter().flat_map(polypaint)),
            _ => {}
        }
        Ok(())
    }
}

/// The colours of a line `#MRGB`, which ZBrush writes: for each vertex a mask, red, green and blue,
/// of two hexadecimal digits each.
fn polypaint(digits: &[u8]) -> impl Iterator<Item = [u8; 4]> {
    let of_vertex = |digits: &[u8; 8]| {
        let code = u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
        let [_, r, g, b] = code.to_be_bytes();
        Some([r, g, b, 255])
    };
    digits.as_chunks::<8>().0.iter().map_while(of_vertex)
}

/// The text after the keyword of a line; it may contain spaces.
fn rest_of(line: &[u8], keyword: &[u8]) -> String {
    let rest = line.trim_ascii().strip_prefix(keyword).unwrap_or_default();
    String::from_utf8_lossy(rest.trim_ascii()).into_owned()
}

impl Lines {
    /// Parses `u` or `u v`.
    fn place<'w>(&self, mut words: impl Iterator<Item = &'w [u8]>) -> Result<[f32; 2], Fault> {
        let (u, v) = (self.number(words.next())? as f32, words.next());
        Ok([u, if v.is_some() { self.number(v)? as f32 } else { 0.0 }])
    }

    /// The index of the material with this name, which is added if it is new.
    fn number_of(&mut self, name: String) -> u32 {
        let next = self.materials.len() as u32;
        let number = *self.numbers.entry(name.clone()).or_insert(next);
        if number == next {
            self.materials.push(name);
        }
        number
    }

    fn number(&self, word: Option<&[u8]>) -> Result<f64, Fault> {
        let line = self.count;
        let word = word.ok_or_else(|| Fault::Malformed(format!("line {line}: too few numbers")))?;
        parse_number(word).ok_or_else(|| Fault::Malformed(format!("line {line}: '{}' is not a number", shown(word))))
    }

    /// Parses `x y z`, then nothing, or a weight `w`, or `r g b`, or `r g b a`.
    fn vertex<'w>(&mut self, words: impl Iterator<Item = &'w [u8]>) -> Result<(), Fault> {
        let mut numbers = [0.0; 7];
        let mut count = 0;
        for word in words.take_while(|word| !word.starts_with(b"#")) {
            let number = self.number(Some(word))?;
            if let Some(place) = numbers.get_mut(count) {
                *place = number;
            }
            count += 1;
        }
        let [x, y, z, rest @ ..] = numbers;
        let mut position = [x, y, z];
        let mut color = None;
        match (count, rest) {
            (3, _) => {}
            (4, [w, ..]) if w != 0.0 => position = position.map(|coordinate| coordinate / w),
            (6, [r, g, b, _]) => color = Some([r, g, b, 1.0]),
            (7, color_and_alpha) => color = Some(color_and_alpha),
            _ => {
                let line = self.count;
                return Err(Fault::Malformed(format!(
                    "line {line}: a vertex has three numbers, then a weight that is not zero, or a colour of three or four"
                )));
            }
        }
        match color {
            Some([r, g, b, a]) => {
                // Vertices before this one have no colour.
                self.colors.resize(self.positions.len(), [f64::NAN; 4]);
                self.colors.push([r, g, b, a].map(|share| if share.is_nan() { 0.0 } else { share }));
            }
            None if !self.colors.is_empty() => self.colors.push([f64::NAN; 4]),
            None => {}
        }
        self.positions.push(position);
        Ok(())
    }

    /// The colour of each position as it is in the file; None if no position has one.
    ///
    /// There is no standard for the range of colours: most programs write 0 to 1, some codes of 0
    /// to 255. If no vertex has a colour, those of `#MRGB` lines are used, in the order of
    /// vertices.
    pub(super) fn colors(&self, ignore_alpha: bool) -> Option<RawColors> {
        let of = |values, number, alpha| {
            let numbers = Numbers { values, kind: Kind::of(number), alpha };
            Some(RawColors::of_run(self.positions.len(), Some(numbers), None))
        };
        if self.colors.is_empty() {
            let mut codes = self.polypaint.clone();
            codes.resize(self.positions.len(), srgb8(DEFAULT_COLOR));
            return if self.polypaint.is_empty() { None } else { of(Values::Bytes(codes), Number::Byte, None) };
        }
        let has_alpha = !ignore_alpha && self.colors.iter().any(|[.., alpha]| !alpha.is_nan() && *alpha != 1.0);
        let number = |color: &[f64; 4]| color.map(|value| if value.is_nan() { f32::NAN } else { finite(value) });
        let values = Values::Floats(self.colors.iter().map(number).collect());
        of(values, Number::Float, has_alpha.then_some(Number::Float))
    }
}
