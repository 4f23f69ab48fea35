//! The lines of an OBJ file.

use crate::Progress;
use crate::io::fault::Fault;
use crate::io::values::{BYTE_ORDER_MARK, finite, line_end, parse_number, shown};
use crate::scene::Colors;
use crate::scene::color::{DEFAULT_COLOR, srgb_to_linear};
use std::io::{BufRead, Read};

use super::faces::{Faces, Named, Triangle};

/// No line is longer, with those that continue it; a polygon of a million corners is shorter.
const LINE_LIMIT: usize = 1 << 24;

/// What the lines of a file say.
#[derive(Debug, Default)]
pub(super) struct Lines {
    pub(super) positions: Vec<[f64; 3]>,
    /// One colour and alpha for each position, or none at all, as the file has them; none of its own is not a number.
    colors: Vec<[f64; 4]>,
    pub(super) normals: Vec<[f64; 3]>,
    /// Only if a surface is wanted, and so for all that follows.
    pub(super) texture: Vec<[f32; 2]>,
    /// What `mtllib` names.
    pub(super) libraries: Vec<String>,
    /// What `usemtl` names, each once.
    pub(super) materials: Vec<String>,
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
    /// Reads all of them; of texture coordinates, materials and their libraries only if a `surface` is wanted.
    ///
    /// # Errors
    /// A number that is none, or a face that names what does not exist.
    pub(super) fn read(reader: impl BufRead, surface: bool, progress: &dyn Progress) -> Result<Self, Fault> {
        let line_end = b'\n';
        let mut rest = Reader { reader, progress, unreported: 0, count: 0, line: Vec::new(), line_end };
        let (mut lines, mut material) = (Self::default(), None);
        while rest.next_line()? {
            lines.count = rest.count;
            lines.take(&rest.line, surface, &mut material)?;
        }
        progress.advance(rest.unreported);
        lines.faces.check(lines.counts())?;
        Ok(lines)
    }

    /// What the lines `mtllib` name, as far as lines can be read.
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

    /// Takes a line; `material` is the number of the current one.
    fn take(&mut self, line: &[u8], surface: bool, material: &mut Option<usize>) -> Result<(), Fault> {
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
            Some(b"vt") if surface => {
                let (u, v) = (self.number(words.next())? as f32, words.next());
                let v = if v.is_some() { self.number(v)? as f32 } else { 0.0 };
                self.texture.push([u, v]);
            }
            Some(b"mtllib") if surface => self.libraries.push(rest_of(line, b"mtllib")),
            Some(b"usemtl") if surface => {
                let name = rest_of(line, b"usemtl");
                let known = self.materials.iter().position(|material| *material == name);
                *material = Some(known.unwrap_or(self.materials.len()));
                if known.is_none() {
                    self.materials.push(name);
                }
            }
            Some(b"f") => {
                let (counts, line) = (self.counts(), self.count);
                self.faces.add(words, counts, (surface, *material, line))?;
            }
            _ => {}
        }
        Ok(())
    }
}

/// What follows the keyword on a line, which may hold spaces.
fn rest_of(line: &[u8], keyword: &[u8]) -> String {
    let rest = line.trim_ascii().strip_prefix(keyword).unwrap_or_default();
    String::from_utf8_lossy(rest.trim_ascii()).into_owned()
}

impl Lines {
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

    /// One colour for each position, in linear light, if any has one.
    ///
    /// No standard says what colours range over: most programs write shares of 1, some codes of 0 to 255. A channel that comes to
    /// 2 or more in the file is taken for codes; colour and alpha each for itself.
    pub(super) fn colors(&self) -> Option<Colors> {
        let unit = |of: fn(&[f64; 4]) -> f64| {
            let largest = self.colors.iter().map(of).fold(0.0, f64::max);
            if largest >= 2.0 { 255.0 } else { 1.0 }
        };
        let (full, opaque) = (unit(|[r, g, b, _]| r.max(*g).max(*b)), unit(|[.., a]| *a));
        let linear = |&[r, g, b, a]: &[f64; 4]| {
            if r.is_nan() {
                return DEFAULT_COLOR;
            }
            let [r, g, b] = [r, g, b].map(|share| finite(srgb_to_linear(share / full)));
            [r, g, b, finite(a / opaque)]
        };
        (!self.colors.is_empty()).then(|| Colors::Linear(self.colors.iter().map(linear).collect()))
    }
}
