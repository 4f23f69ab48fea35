//! STL, binary and text. Triangles without vertices in common become a mesh.

use std::io::{BufRead, BufReader, Read};

use crate::io::about::{About, Attribute, Role};
use crate::io::closed::distinct;
use crate::io::fault::{self, Fault, reserve};
use crate::io::input::Local;
use crate::io::triangles::give_faces;
use crate::io::values::{line_end, parse_number, shown};
use crate::io::{Input, Paint, Points, ReadOptions, dimensions};
use crate::scene::color::{DEFAULT_COLOR, srgb_to_linear};
use crate::{Progress, Result};

/// Bytes in front of the triangles of a binary file, and bytes of a triangle.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;

/// The first bytes of a text, in which none is zero. Headers and coordinates have such bytes.
const SURELY_TEXT: usize = 1 << 9;

/// Triangles that are decoded at once.
const TOGETHER: u64 = 1 << 14;

/// The longest word of a text, bytes.
const LONGEST_WORD: usize = 1 << 10;

/// Reads the triangles of an STL file. Corners at the same position become one vertex.
///
/// The normals of facets are ignored, as the order of the corners says the same. Colours of 15 bits
/// in binary files are read as VisCAM and SolidView write them, or as Magics or MeshLab if the
/// header has their `COLOR=`. A file is binary if its length is that of the triangles that it
/// promises, if it does not start with `solid`, or if there is a zero byte near its start.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) if the system cannot read,
/// [`Error::Malformed`](crate::Error::Malformed) if the file ends early, or if a word of a text is
/// not the one that is needed.
pub fn read(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let Local { file, length, path } = input.local()?;
    let mut reader = BufReader::with_capacity(1 << 18, file);
    progress.begin(&format!("reading {}", fault::name(&path)), length);
    let read = soup(&mut reader, length, progress).and_then(|(soup, is_text)| {
        let format = if is_text { "STL, text" } else { "STL, binary" };
        let mut points = soup.into_points();
        let attributes = ["x", "y", "z"].map(|name| Attribute::new(name, true, Role::Other)).to_vec();
        let about = About { format: format.into(), attributes, ..About::default() };
        points.about = options.describe.then(|| Box::new(about));
        dimensions::of_positions(&mut points, &options.wanted)?;
        Ok(points)
    });
    progress.end();
    read.map_err(|fault| fault.of(&path))
}

/// Triangles with corners of their own.
#[derive(Debug, Default)]
struct Soup {
    /// Three corners for each triangle.
    corners: Vec<[f64; 3]>,
    /// A linear colour for each triangle; empty if none has one.
    colors: Vec<[f32; 4]>,
}

/// Reads a file of either form; also returns whether it is text.
fn soup(reader: &mut BufReader<std::fs::File>, length: u64, progress: &dyn Progress) -> Result<(Soup, bool), Fault> {
    let start = reader.fill_buf()?;
    let promised = start.get(HEADER - 4..HEADER).and_then(|bytes| bytes.first_chunk().copied());
    let promised = promised.map(|bytes| u64::from(u32::from_le_bytes(bytes)));
    let fits = promised.is_some_and(|count| HEADER as u64 + count * TRIANGLE as u64 == length);
    let is_solid = start.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    // Binary headers may say `solid` too, and bytes may follow the triangles.
    let is_text = !fits && is_solid && !start.iter().take(SURELY_TEXT).any(|byte| *byte == 0);
    match (is_text, promised) {
        (true, _) => Ok((text(reader, progress)?, true)),
        (false, Some(count)) => Ok((binary(reader, (count, length), progress)?, false)),
        (false, None) => {
            Err(Fault::Malformed("it is no STL file: it neither starts with 'solid' nor has a header".into()))
        }
    }
}

/// Reads `count` triangles of a binary file of this length.
fn binary(reader: &mut impl Read, (count, length): (u64, u64), progress: &dyn Progress) -> Result<Soup, Fault> {
    let held = length.saturating_sub(HEADER as u64) / TRIANGLE as u64;
    if held < count {
        return Err(Fault::Malformed(format!("its header promises {count} triangles, the file ends after {held}")));
    }
    let mut header = [0; HEADER];
    reader.read_exact(&mut header)?;
    let mut soup = Soup::default();
    reserve(&mut soup.corners, 3 * count)?;
    let mut codes: Vec<u16> = Vec::new();
    reserve(&mut codes, count)?;
    let mut block = vec![0; TRIANGLE * count.min(TOGETHER) as usize];
    let mut left = count;
    progress.advance(HEADER as u64);
    while left > 0 {
        let block = &mut block[..TRIANGLE * left.min(TOGETHER) as usize];
        reader.read_exact(block)?;
        for triangle in block.as_chunks::<TRIANGLE>().0 {
            let (words, _) = triangle.as_chunks::<4>();
            let number = |at: usize| f64::from(f32::from_le_bytes(words[at]));
            soup.corners.extend([3, 6, 9].map(|at| [number(at), number(at + 1), number(at + 2)]));
            codes.push(u16::from_le_bytes([triangle[48], triangle[49]]));
        }
        progress.advance(block.len() as u64);
        left -= left.min(TOGETHER);
    }
    progress.advance(length - HEADER as u64 - count * TRIANGLE as u64);
    soup.colors = colors(&codes, &header);
    Ok(soup)
}

/// The colours of triangles from their attribute words; empty if none has one.
///
/// VisCAM marks triangles that have a colour, Magics those that have none of their own. MeshLab
/// writes the order and the header of Magics with the mark of VisCAM, and zeros without colours.
fn colors(codes: &[u16], header: &[u8]) -> Vec<[f32; 4]> {
    let default = magics_color(header);
    let mut others = codes.iter().filter(|code| **code != 0);
    let first = others.clone().next();
    let all_marked = others.clone().all(|code| code & 0x8000 != 0);
    let vary = others.any(|code| Some(code) != first);
    let is_magics = default.is_some();
    let marks_own = !is_magics || all_marked && (vary || first.is_none() || is_of_meshlab(header));
    let is_colored = |code: &u16| (code & 0x8000 != 0) == marks_own;
    if !is_magics && !codes.iter().any(is_colored) {
        return Vec::new();
    }
    let other = default.unwrap_or(DEFAULT_COLOR);
    codes.iter().map(|code| if is_colored(code) { color(*code, is_magics) } else { other }).collect()
}

/// The place of a header's colour, behind `COLOR=`.
fn place_of_color(header: &[u8]) -> Option<usize> {
    Some(header.windows(6).position(|window| window == b"COLOR=")? + 6)
}

/// Whether MeshLab wrote a header with a colour: a space takes the place of its alpha.
fn is_of_meshlab(header: &[u8]) -> bool {
    place_of_color(header).is_some_and(|at| header[at..].get(3..13).is_some_and(|rest| rest == b" MATERIAL="))
}

/// The colour of all triangles in a header that Magics wrote; None if only padding follows.
fn magics_color(header: &[u8]) -> Option<[f32; 4]> {
    let at = place_of_color(header)?;
    let given: [u8; 4] = *header.get(at..at + 4)?.first_chunk()?;
    if given == [0; 4] || given == [b' '; 4] {
        return None;
    }
    let [r, g, b, a] = given;
    let a = if is_of_meshlab(header) { 255 } else { a };
    let [r, g, b] = [r, g, b].map(|code| srgb_to_linear(f64::from(code) / 255.0) as f32);
    Some([r, g, b, f32::from(a) / 255.0])
}

/// The colour of a triangle: five bits for each channel. Blue is the lowest in VisCAM's order, red
/// in that of Magics.
fn color(code: u16, is_magics: bool) -> [f32; 4] {
    let channel = |shift: u32| srgb_to_linear(f64::from(code >> shift & 31) / 31.0) as f32;
    let [low, green, high] = [0, 5, 10].map(channel);
    if is_magics { [low, green, high, 1.0] } else { [high, green, low, 1.0] }
}

/// Reads the facets of a text; names of solids may have any words.
fn text(reader: &mut impl BufRead, progress: &dyn Progress) -> Result<Soup, Fault> {
    let line_end = line_end(reader)?;
    let mut words = Words { reader, line: 1, line_end, word: Vec::new(), passed: 0 };
    let mut soup = Soup::default();
    let (mut inside, mut reported) = (false, 0);
    while words.next()? {
        match words.lower().as_slice() {
            b"solid" | b"endsolid" if !inside => words.skip_line()?,
            b"facet" if !inside => inside = true,
            b"endfacet" if inside => {
                inside = false;
                if !soup.corners.len().is_multiple_of(3) {
                    return Err(words.fault("a facet has three corners"));
                }
            }
            b"normal" if inside => (0..3).try_for_each(|_| words.number().map(drop))?,
            b"vertex" if inside => soup.corners.push([words.number()?, words.number()?, words.number()?]),
            b"outer" | b"loop" | b"endloop" if inside => {}
            _ => return Err(words.fault("a word of an STL file is needed here")),
        }
        if words.passed - reported > 1 << 18 {
            progress.advance(words.passed - std::mem::replace(&mut reported, words.passed));
        }
    }
    progress.advance(words.passed - reported);
    if inside {
        return Err(Fault::Malformed(format!("the file ends inside a facet, at line {}", words.line)));
    }
    Ok(soup)
}

/// The words of a text, and the number of the current line.
struct Words<'a, R> {
    reader: &'a mut R,
    line: u64,
    /// The byte that ends a line: `\n` or `\r`.
    line_end: u8,
    word: Vec<u8>,
    /// Bytes so far.
    passed: u64,
}

impl<R: BufRead> Words<'_, R> {
    /// Reads the next word; returns false at the end of the text.
    fn next(&mut self) -> Result<bool, Fault> {
        self.word.clear();
        loop {
            let buffer = self.reader.fill_buf()?;
            if buffer.is_empty() {
                return Ok(!self.word.is_empty());
            }
            let is_within = !self.word.is_empty();
            let start = if is_within { 0 } else { buffer.iter().take_while(|byte| byte.is_ascii_whitespace()).count() };
            self.line += buffer[..start].iter().filter(|byte| **byte == self.line_end).count() as u64;
            let length = buffer[start..].iter().position(u8::is_ascii_whitespace);
            let end = length.map_or(buffer.len(), |length| start + length);
            let left = LONGEST_WORD.saturating_sub(self.word.len());
            self.word.extend(buffer[start..end].iter().take(left));
            self.reader.consume(end);
            self.passed += end as u64;
            if length.is_some() && !self.word.is_empty() {
                return Ok(true);
            }
        }
    }

    fn lower(&self) -> Vec<u8> {
        self.word.to_ascii_lowercase()
    }

    /// Skips the rest of the line.
    fn skip_line(&mut self) -> Result<(), Fault> {
        loop {
            let buffer = self.reader.fill_buf()?;
            let end = buffer.iter().position(|byte| *byte == self.line_end);
            let length = end.unwrap_or(buffer.len());
            let is_over = end.is_some() || buffer.is_empty();
            self.reader.consume(length);
            self.passed += length as u64;
            if is_over {
                return Ok(());
            }
        }
    }

    fn number(&mut self) -> Result<f64, Fault> {
        if !self.next()? {
            return Err(Fault::Malformed(format!("the file ends inside a facet, at line {}", self.line)));
        }
        parse_number(&self.word).ok_or_else(|| self.fault("a number is needed"))
    }

    fn fault(&self, what: &str) -> Fault {
        Fault::Malformed(format!("line {}: {what}, not '{}'", self.line, shown(&self.word)))
    }
}

impl Soup {
    /// Joins corners at the same position.
    fn into_points(self) -> Points {
        let first = distinct(&self.corners);
        let mut numbers = vec![0; self.corners.len()];
        let mut positions = Vec::new();
        for (corner, first) in first.iter().enumerate() {
            let first = *first as usize;
            if first == corner {
                numbers[corner] = positions.len() as u32;
                positions.push(self.corners[corner]);
            } else {
                numbers[corner] = numbers[first];
            }
        }
        let paint = Paint { colors: self.colors, ..Paint::default() };
        let paint = (!paint.colors.is_empty()).then(|| Box::new(paint));
        let mut points = Points { positions, ..Points::default() };
        give_faces(&mut points, numbers.as_chunks::<3>().0.to_vec(), paint);
        points
    }
}
