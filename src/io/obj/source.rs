//! The lines of an OBJ file, as the face parser is given them.

use crate::Progress;
use crate::io::fault::Fault;
use crate::io::values::{BYTE_ORDER_MARK, finite, line_end, parse_number, shown};
use crate::scene::Colors;
use crate::scene::color::{DEFAULT_COLOR, srgb_to_linear};
use std::io::{self, BufRead, Read};

/// No line is longer, with those that continue it; a polygon of a million corners is shorter.
const LINE_LIMIT: usize = 1 << 24;

/// What the vertex lines of a file say.
#[derive(Debug, Default)]
pub(super) struct Lines {
    pub(super) positions: Vec<[f64; 3]>,
    /// One colour and alpha for each position, or none at all, as the file has them; none of its own is not a number.
    colors: Vec<[f64; 4]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) every_corner_has_a_normal: bool,
    /// Only if they are wanted, and so for all that follows.
    pub(super) every_corner_has_texture: bool,
    /// What `mtllib` names.
    pub(super) libraries: Vec<String>,
    /// What `usemtl` names, each once.
    pub(super) materials: Vec<String>,
    /// Lines read.
    pub(super) count: u64,
}

/// Reads vertices, and passes the parser the faces.
///
/// The parser renumbers vertices by first use, drops those of no face, repeats those of several groups or materials,
/// and stops at text that is not UTF-8. So vertices are kept here; the parser gets each one's number in place of its
/// coordinates, and sees no comments. Of a mesh it is given texture coordinates too, and each material as a group whose name
/// is the material's number; of points neither.
pub(super) struct Source<'a, R> {
    reader: R,
    /// Whether texture coordinates and materials are wanted.
    surface: bool,
    progress: &'a dyn Progress,
    unreported: u64,
    lines: Lines,
    line: Vec<u8>,
    /// What lines end with.
    line_end: u8,
    /// What the parser is given of the current line, and how much of it has been taken.
    passed: Vec<u8>,
    taken: usize,
    fault: Option<Fault>,
}

impl<'a, R: BufRead> Source<'a, R> {
    pub(super) fn new(reader: R, surface: bool, progress: &'a dyn Progress) -> Self {
        let lines = Lines { every_corner_has_a_normal: true, every_corner_has_texture: surface, ..Lines::default() };
        let (line, passed) = (Vec::new(), Vec::new());
        Self { reader, surface, progress, unreported: 0, lines, line, line_end: b'\n', passed, taken: 0, fault: None }
    }

    /// What was read, unless reading is why the parser stopped.
    pub(super) fn finish(self) -> Result<Lines, Fault> {
        self.progress.advance(self.unreported);
        match self.fault {
            Some(fault) => Err(fault),
            None => Ok(self.lines),
        }
    }

    /// Takes the next line, with those that continue it; `false` at the end of the file.
    fn next_line(&mut self) -> Result<bool, Fault> {
        self.line.clear();
        if self.lines.count == 0 {
            self.line_end = line_end(&mut self.reader)?;
        }
        loop {
            let room = LINE_LIMIT.saturating_sub(self.line.len());
            let bytes = self.reader.by_ref().take(room as u64).read_until(self.line_end, &mut self.line)?;
            if room == 0 {
                let line = self.lines.count;
                return Err(Fault::Malformed(format!("line {line} is longer than {LINE_LIMIT} bytes")));
            }
            if bytes == 0 {
                return Ok(!self.line.is_empty());
            }
            self.lines.count += 1;
            if self.lines.count == 1 && self.line.starts_with(BYTE_ORDER_MARK) {
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

    fn take_line(&mut self) -> Result<(), Fault> {
        let Self { lines, line, passed, surface, .. } = self;
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next() {
            Some(b"v") => {
                lines.vertex(words)?;
                passed.extend(format!("v {} 0 0\n", lines.positions.len() - 1).bytes());
            }
            Some(b"vn") => {
                let mut normal = [0.0; 3];
                for component in &mut normal {
                    *component = lines.number(words.next())? as f32;
                }
                lines.normals.push(normal);
                let [x, y, z] = normal;
                passed.extend(format!("vn {x} {y} {z}\n").bytes());
            }
            Some(b"vt") if *surface => {
                let (u, v) = (lines.number(words.next())? as f32, words.next());
                let v = if v.is_some() { lines.number(v)? as f32 } else { 0.0 };
                passed.extend(format!("vt {u} {v}\n").bytes());
            }
            Some(b"mtllib") if *surface => {
                lines.libraries.push(rest_of(line, b"mtllib"));
            }
            Some(b"usemtl") if *surface => {
                let name = rest_of(line, b"usemtl");
                let known = lines.materials.iter().position(|material| *material == name);
                let number = known.unwrap_or(lines.materials.len());
                if known.is_none() {
                    lines.materials.push(name);
                }
                passed.extend(format!("g {number}\n").bytes());
            }
            // A face of one or two corners has no area, and one of none is refused by the parser.
            Some(b"f") if words.clone().count() > 2 => {
                passed.push(b'f');
                for word in words.take_while(|word| !word.starts_with(b"#")) {
                    let mut indices = word.split(|&byte| byte == b'/');
                    let (vertex, texture, normal) = (indices.next(), indices.next(), indices.next());
                    let [texture, normal] = [texture, normal].map(|index| index.filter(|index| !index.is_empty()));
                    lines.every_corner_has_a_normal &= normal.is_some();
                    lines.every_corner_has_texture &= texture.is_some();
                    passed.push(b' ');
                    passed.extend(vertex.unwrap_or_default());
                    let texture = texture.filter(|_| *surface);
                    if texture.is_some() || normal.is_some() {
                        passed.push(b'/');
                        passed.extend(texture.unwrap_or_default());
                    }
                    if let Some(normal) = normal {
                        passed.push(b'/');
                        passed.extend(normal);
                    }
                }
                passed.push(b'\n');
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

impl<R: BufRead> Read for Source<'_, R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.taken == self.passed.len() {
            self.passed.clear();
            self.taken = 0;
            let taken = match self.next_line() {
                Ok(false) => return Ok(0),
                Ok(true) => self.take_line(),
                Err(fault) => Err(fault),
            };
            if let Err(fault) = taken {
                self.fault = Some(fault);
                return Err(io::ErrorKind::InvalidData.into());
            }
        }
        let rest = &self.passed[self.taken..];
        let count = rest.len().min(out.len());
        out[..count].copy_from_slice(&rest[..count]);
        self.taken += count;
        Ok(count)
    }
}
