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

/// No line is longer, with those that continue it; a polygon of a million corners is shorter.
const LINE_LIMIT: usize = 1 << 24;

/// What the lines of a file say.
#[derive(Debug, Default)]
pub(super) struct Lines {
    pub(super) positions: Vec<[f64; 3]>,
    /// One colour and alpha for each position, or none at all, as the file has them; none of its own is not a number.
    colors: Vec<[f64; 4]>,
    /// Codes of `#MRGB` lines, one vertex after the other.
    polypaint: Vec<[u8; 4]>,
    pub(super) normals: Vec<[f64; 3]>,
    pub(super) texture: Vec<[f32; 2]>,
    /// What `mtllib` names.
    pub(super) libraries: Vec<String>,
    /// Names after `usemtl`, each once, and their numbers.
    pub(super) materials: Vec<String>,
    numbers: HashMap<String, u32>,
    /// The number of the current one.
    material: Option<u32>,
    pub(super) faces: Faces,
    /// Lines read.
    count: u64,
}

/// The lines that are not read yet.
struct Reader<'a, R> {
    reader: R,
    progress: &'a dyn Progress,
    unreported: u64,
    /// Lines so far, those of the current one too.
    count: u64,
    line: Vec<u8>,
    /// What lines end with.
    line_end: u8,
}

impl<R: BufRead> Reader<'_, R> {
    /// Takes the next line, with those that continue it; `false` at the end of the file.
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
    /// Reads all of them. Texture coordinates that are none are an error only if `strict`: for
    /// points it matters little where in a texture they are.
    ///
    /// # Errors
    /// A number that is none, or a face that names what does not exist.
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

    /// Names after `mtllib`, as far as lines can be read.
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

    /// Vertices, texture coordinates and normals so far.
    fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.texture.len(), self.normals.len()]
    }

    /// Takes a line.
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

/// The codes of a line `#MRGB` of ZBrush: of each vertex a mask, red, green and blue, two digits of
/// base 16 each.
fn polypaint(digits: &[u8]) -> impl Iterator<Item = [u8; 4]> {
    let of_vertex = |digits: &[u8; 8]| {
        let code = u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
        let [_, r, g, b] = code.to_be_bytes();
        Some([r, g, b, 255])
    };
    digits.as_chunks::<8>().0.iter().map_while(of_vertex)
}

/// What follows the keyword on a line, which may hold spaces.
fn rest_of(line: &[u8], keyword: &[u8]) -> String {
    let rest = line.trim_ascii().strip_prefix(keyword).unwrap_or_default();
    String::from_utf8_lossy(rest.trim_ascii()).into_owned()
}

impl Lines {
    /// `u` or `u v`.
    fn place<'w>(&self, mut words: impl Iterator<Item = &'w [u8]>) -> Result<[f32; 2], Fault> {
        let (u, v) = (self.number(words.next())? as f32, words.next());
        Ok([u, if v.is_some() { self.number(v)? as f32 } else { 0.0 }])
    }

    /// The number of the material of this name.
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

    /// `x y z`, then nothing, or a weight `w`, or `r g b`, or `r g b a`.
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
                // Vertices before the first coloured one.
                self.colors.resize(self.positions.len(), [f64::NAN; 4]);
                self.colors.push([r, g, b, a].map(|share| if share.is_nan() { 0.0 } else { share }));
            }
            None if !self.colors.is_empty() => self.colors.push([f64::NAN; 4]),
            None => {}
        }
        self.positions.push(position);
        Ok(())
    }

    /// One colour for each position as the file has it, if any has one.
    ///
    /// No standard says what colours range over: most programs write shares of 1, some codes of 0
    /// to 255. Where no vertex has one, those of lines `#MRGB`, in the vertices' order, count.
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
