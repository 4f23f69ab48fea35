//! OFF, the format of Geomview: vertices, polygons, and colours of either.

use std::io::BufReader;

use glam::DVec3;

use crate::io::about::About;
use crate::io::fault::{self, Fault};
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
/// `ST` texture coordinates, as in `CNOFF`. Three or four numbers after the corners of a polygon
/// are its colour, which counts where vertices have none. Colours are sRGB codes of 255 if all are
/// whole, else shares of 1. Polygons are cut into triangles. Comments start with `#`.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) if the system cannot read,
/// [`Error::Malformed`](crate::Error::Malformed) if a line does not fit its place, a polygon names
/// a vertex that does not exist, or the file ends before what it promises.
pub fn read(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let Input { file, length, path, .. } = input;
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
        let mut header = Self::default();
        let Some(mut marks) = word.strip_suffix(b"OFF") else {
            return match word.is_empty() && rest.first().is_some_and(u8::is_ascii_digit) && !line.contains(&b'O') {
                true => Ok((header, line)),
                false => Err(Fault::Malformed(format!("it is no OFF file of three dimensions: '{}'", shown(line)))),
            };
        };
        for (mark, has) in [(&b"ST"[..], &mut header.texture), (b"C", &mut header.color), (b"N", &mut header.normal)] {
            if let Some(rest) = marks.strip_prefix(mark) {
                (*has, marks) = (true, rest);
            }
        }
        let is_binary = rest.trim_ascii().starts_with(b"BINARY");
        match (marks.is_empty(), is_binary) {
            (true, false) => Ok((header, rest)),
            (_, true) => Err(Fault::Malformed("binary OFF is not read: write it as text, or as PLY".into())),
            _ => Err(Fault::Malformed(format!(
                "vertices of '{}' are not read: OFF, COFF, NOFF and STOFF are",
                shown(word)
            ))),
        }
    }

    /// The names of the numbers of a vertex that has `width` of them.
    fn names(self, width: usize) -> Result<Vec<String>, Fault> {
        let mut names = vec!["x", "y", "z"];
        names.extend(["nx", "ny", "nz"].into_iter().filter(|_| self.normal));
        let texture: &[&str] = if self.texture { &["texture_u", "texture_v"] } else { &[] };
        let left = width.saturating_sub(names.len() + texture.len());
        if self.color {
            names.extend(["red", "green", "blue", "alpha"].into_iter().take(left.min(4)));
        }
        names.extend(texture);
        if names.len() > width || self.color && left < 3 {
            return Err(Fault::Malformed(format!("a vertex of this file has more than {width} numbers")));
        }
        Ok(names.into_iter().map(str::to_owned).collect())
    }
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
        let names = if read == 0 { Header::default().names(3)? } else { self.names };
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
