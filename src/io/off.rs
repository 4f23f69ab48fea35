//! OFF, the format of Geomview: vertices, polygons, and colours of either.

use std::fmt;
use std::io::BufReader;

use glam::DVec3;

use crate::io::about::About;
use crate::io::fault::{self, Fault};
use crate::io::input::Local;
use crate::io::ply::Table;
use crate::io::text::{Blocks, Separator, content, in_line, no_number, number};
use crate::io::triangles::give_faces;
use crate::io::values::shown;
use crate::io::{Input, Paint, Points, ReadOptions, encoding, polygon};
use crate::scene::color::{DEFAULT_COLOR, srgb_to_linear};
use crate::{Progress, Result};

/// Reads the vertices and polygons of an OFF file in text.
///
/// The first word says what vertices have beside their coordinates: `N` normals, `C` colours and
/// `ST` texture coordinates, as in `CNOFF`, in any order. Normals precede colours, but MeshLab's
/// library writes `NCOFF` with colours first; the order that leaves normals of unit length is
/// taken. Three or four numbers after the corners of a polygon are its colour, which counts where
/// vertices have none. Colours are sRGB codes of 255 if all are whole and one is above 1, else
/// shares of 1. Polygons are cut into triangles. Comments start with `#`.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) if the system cannot read,
/// [`Error::Malformed`](crate::Error::Malformed) if a line does not fit its place, a polygon names
/// a vertex that does not exist, or the file ends before what it promises.
pub fn read(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let Local { file, length, path } = input.local()?;
    let in_file = |fault: Fault| fault.of(&path);
    let decoded = encoding::decoded(BufReader::with_capacity(1 << 18, file), length);
    let (reader, length) = decoded.map_err(Fault::Io).map_err(in_file)?;
    progress.begin(&format!("reading {}", fault::name(&path)), length);
    let read = Blocks::new(reader).and_then(|blocks| {
        progress.advance(blocks.mark);
        points(blocks, options, progress)
    });
    progress.end();
    let mut points = read.map_err(in_file)?;
    points.raw.iter_mut().for_each(|raw| raw.name = fault::name(&path));
    Ok(points)
}

/// The content of a file while it is being read.
#[derive(Debug, Default)]
struct Contents {
    header: Option<Header>,
    /// The numbers of vertices and of polygons that the file promises.
    promised: Option<[u64; 2]>,
    /// The names of the numbers of a vertex, from the first one.
    names: Vec<String>,
    /// The numbers of all vertices.
    vertices: Vec<f64>,
    triangles: Vec<[u32; 3]>,
    polygons: u64,
    /// For each triangle its polygon's colour as in the file; NaN without one.
    colors: Vec<[f64; 4]>,
}

/// The first word of a file.
#[derive(Clone, Copy, Debug, Default)]
struct Header {
    texture: bool,
    color: bool,
    normal: bool,
    /// Colours precede normals.
    color_first: bool,
}

/// Reads all lines.
fn points(mut blocks: Blocks, options: &ReadOptions, progress: &dyn Progress) -> Result<Points, Fault> {
    let (mut contents, mut line) = (Contents::default(), 0);
    while let Some(block) = blocks.next()? {
        for own in block.split_inclusive(|byte| *byte == blocks.line_end) {
            line += 1;
            let end = own.iter().position(|byte| *byte == b'#').unwrap_or(own.len());
            content(&own[..end]).map_or(Ok(()), |own| contents.take(own)).map_err(in_line(line))?;
        }
        progress.advance(block.len() as u64);
    }
    contents.finish(options)
}

impl Header {
    /// Splits the first line into the first word and the rest. The word may be missing.
    fn of(line: &[u8]) -> Result<(Self, &[u8]), Fault> {
        let end = line.iter().position(|byte| !byte.is_ascii_alphabetic()).unwrap_or(line.len());
        let (word, rest) = line.split_at(end);
        let Some(marks) = word.strip_suffix(b"OFF") else {
            return match word.is_empty() && rest.first().is_some_and(u8::is_ascii_digit) && !line.contains(&b'O') {
                true => Ok((Self::default(), line)),
                false => Err(Fault::Malformed(format!("it is no OFF file of three dimensions: '{}'", shown(line)))),
            };
        };
        if rest.trim_ascii().starts_with(b"BINARY") {
            return Err(Fault::Malformed("binary OFF is not read: write it as text, or as PLY".into()));
        }
        match Self::of_marks(marks) {
            Some(header) => Ok((header, rest)),
            None => Err(Fault::Malformed(format!(
                "vertices of '{}' are not read: the marks in front of OFF may be ST, C and N, as in COFF",
                shown(word)
            ))),
        }
    }

    /// The meaning of the marks in front of `OFF`; None if one is not known, or occurs twice.
    fn of_marks(mut marks: &[u8]) -> Option<Self> {
        let place = |mark: u8| marks.iter().position(|own| *own == mark);
        let color_first = place(b'N').zip(place(b'C')).is_some_and(|(normal, color)| normal < color);
        let mut header = Self { color_first, ..Self::default() };
        while !marks.is_empty() {
            let of_mark = [(&b"ST"[..], &mut header.texture), (b"C", &mut header.color), (b"N", &mut header.normal)];
            let found = of_mark.into_iter().find_map(|(mark, has)| Some((marks.strip_prefix(mark)?, has)));
            let (rest, has) = found.filter(|(_, has)| !**has)?;
            (*has, marks) = (true, rest);
        }
        Some(header)
    }

    /// The names of the numbers of a vertex that has `width` of them.
    fn names(self, width: usize) -> Result<Vec<String>, Fault> {
        let normal: &[&str] = if self.normal { &["nx", "ny", "nz"] } else { &[] };
        let texture: &[&str] = if self.texture { &["texture_u", "texture_v"] } else { &[] };
        let fixed = 3 + normal.len() + texture.len();
        let least = fixed + if self.color { 3 } else { 0 };
        if width < least {
            return Err(Fault::Malformed(format!(
                "a vertex of {self} needs {least} numbers or more, but this line has {width}"
            )));
        }
        let color = &["red", "green", "blue", "alpha"][..if self.color { (width - fixed).min(4) } else { 0 }];
        let [first, second] = if self.color_first { [color, normal] } else { [normal, color] };
        let names = [&["x", "y", "z"][..], first, second, texture].concat();
        Ok(names.into_iter().map(str::to_owned).collect())
    }

    /// The same header with colours and normals in the order that leaves normals of unit length, or
    /// zeros, in `vertices` of `width` numbers.
    fn fitted(self, vertices: &[f64], width: usize) -> Self {
        let has_normals = |header: &Self| {
            let names = header.names(width).unwrap_or_default();
            let Some(at) = names.iter().position(|name| name == "nx") else { return true };
            let length = |row: &[f64]| DVec3::from_slice(&row[at..]).length();
            vertices.chunks_exact(names.len()).map(length).all(|length| length == 0.0 || (length - 1.0).abs() < 0.01)
        };
        let other = Self { color_first: !self.color_first, ..self };
        if self.color && self.normal && !has_normals(&self) && has_normals(&other) { other } else { self }
    }
}

impl fmt::Display for Header {
    /// The kind of file, with marks in the order of Geomview.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let marks = [(self.texture, "ST"), (self.color, "C"), (self.normal, "N")];
        let marks: String = marks.into_iter().filter(|(has, _)| *has).map(|(_, mark)| mark).collect();
        let article = if marks.starts_with('C') { "a" } else { "an" };
        write!(formatter, "{article} {marks}OFF file")
    }
}

/// Whether a word is the first one of an OFF file in text.
pub(super) fn is_first_word(word: &[u8]) -> bool {
    word.strip_suffix(b"OFF").is_some_and(|marks| Header::of_marks(marks).is_some())
}

impl Contents {
    /// The number of vertices so far.
    fn count(&self) -> u64 {
        (self.vertices.len() / self.names.len().max(1)) as u64
    }

    /// Takes a line.
    fn take(&mut self, line: &[u8]) -> Result<(), Fault> {
        let line = if self.header.is_none() {
            let (header, rest) = Header::of(line.trim_ascii())?;
            self.header = Some(header);
            rest
        } else {
            line
        };
        let mut cells = Separator::Space.cells(line).map(|cell| number(cell).ok_or_else(|| no_number(cell)));
        let Some([vertices, polygons]) = self.promised else {
            let counts: Vec<f64> = cells.collect::<Result<_, _>>()?;
            let is_count = |count: &f64| *count >= 0.0 && count.fract() == 0.0;
            if let [vertices, polygons, ..] = counts[..]
                && counts.iter().all(is_count)
            {
                self.promised = Some([vertices as u64, polygons as u64]);
            } else if !counts.is_empty() {
                return Err(Fault::Malformed("the numbers of vertices, faces and edges are needed".into()));
            }
            return Ok(());
        };
        if self.count() < vertices {
            return self.vertex(&cells.collect::<Result<Vec<_>, _>>()?);
        }
        // More lines than promised have no meaning.
        if self.polygons < polygons {
            let count = cells.next().transpose()?.unwrap_or_default();
            return self.polygon(count, &cells.collect::<Result<Vec<_>, _>>()?);
        }
        Ok(())
    }

    fn vertex(&mut self, numbers: &[f64]) -> Result<(), Fault> {
        if self.names.is_empty() {
            self.names = self.header.unwrap_or_default().names(numbers.len())?;
        }
        let width = self.names.len();
        let own = numbers.get(..width);
        let missing = || Fault::Malformed(format!("{width} numbers are needed for a vertex, not {}", numbers.len()));
        self.vertices.extend(own.ok_or_else(missing)?);
        Ok(())
    }

    fn polygon(&mut self, count: f64, numbers: &[f64]) -> Result<(), Fault> {
        let vertices = self.count();
        let corners = numbers.get(..count as usize).filter(|_| count >= 0.0 && count.fract() == 0.0);
        let corners = corners.ok_or_else(|| {
            Fault::Malformed(format!("a face of {count} corners is promised, but {} numbers follow", numbers.len()))
        })?;
        let is_there = |corner: &f64| corner.fract() == 0.0 && (0.0..vertices as f64).contains(corner);
        if let Some(other) = corners.iter().find(|corner| !is_there(corner)) {
            return Err(Fault::Malformed(format!("a face names the vertex {other} of {vertices}, counted from 0")));
        }
        let place = |corner: &f64| {
            let first = *corner as usize * self.names.len();
            DVec3::new(self.vertices[first], self.vertices[first + 1], self.vertices[first + 2])
        };
        let cut = polygon::triangles(&corners.iter().map(place).collect::<Vec<_>>());
        let color = match numbers[corners.len()..] {
            [r, g, b] => [r, g, b, f64::NAN],
            [r, g, b, a] => [r, g, b, a],
            _ => [f64::NAN; 4],
        };
        self.colors.extend(cut.iter().map(|_| color));
        self.triangles.extend(cut.into_iter().map(|three| three.map(|k| corners[k] as u32)));
        self.polygons += 1;
        Ok(())
    }

    fn finish(self, options: &ReadOptions) -> Result<Points, Fault> {
        let [vertices, polygons] = self
            .promised
            .ok_or_else(|| Fault::Malformed("the file ends before its numbers of vertices and faces".into()))?;
        let read = self.count();
        if read < vertices {
            return Err(Fault::Malformed(format!("it promises {vertices} vertices, and ends after {read}")));
        }
        if self.polygons < polygons {
            let read = self.polygons;
            return Err(Fault::Malformed(format!("it promises {polygons} faces, and ends after {read}")));
        }
        let header = self.header.unwrap_or_default();
        let width = self.names.len();
        let names =
            if read == 0 { Header::default().names(3)? } else { header.fitted(&self.vertices, width).names(width)? };
        let table = Table::of(names, options)?;
        let mut rows = table.with_capacity(read)?;
        rows.extend_all(&self.vertices);
        let is_mesh = !self.triangles.is_empty();
        let mut points = rows.finish(is_mesh)?;
        if is_mesh {
            let colors = face_colors(&self.colors);
            let paint = (!colors.is_empty()).then(|| Box::new(Paint { colors, ..Paint::default() }));
            give_faces(&mut points, self.triangles, paint);
        }
        let about = About { format: "OFF".into(), attributes: table.attributes(), ..About::default() };
        points.about = options.describe.then(|| Box::new(about));
        Ok(points)
    }
}

/// Linear colours of triangles; empty if none has a colour in the file.
fn face_colors(given: &[[f64; 4]]) -> Vec<[f32; 4]> {
    let is_given = |color: &&[f64; 4]| color[..3].iter().all(|channel| channel.is_finite());
    let numbers = || given.iter().filter(is_given).flatten().filter(|channel| channel.is_finite());
    let white = if numbers().all(|channel| channel.fract() == 0.0) && numbers().any(|channel| *channel > 1.0) {
        255.0
    } else {
        1.0
    };
    let share = |number: f64| (number / white).clamp(0.0, 1.0);
    let color = |color: &[f64; 4]| match is_given(&color) {
        true => {
            let [r, g, b] = [color[0], color[1], color[2]].map(|channel| srgb_to_linear(share(channel)) as f32);
            [r, g, b, if color[3].is_finite() { share(color[3]) as f32 } else { 1.0 }]
        }
        false => DEFAULT_COLOR,
    };
    if given.iter().any(|color| is_given(&color)) { given.iter().map(color).collect() } else { Vec::new() }
}
