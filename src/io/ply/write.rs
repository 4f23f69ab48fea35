//! Writes surfels and points as PLY.

use super::column::Column;
use super::vertex::{CAP_NAMES, CLIP_NAMES, NUMBER_NAME, SLOPE_NAMES};
use super::write_gaussians;
use crate::io::atomic::write_whole;
use crate::io::{Points, Up};
use crate::scene::color::{DEFAULT_COLOR, SRGB8_TO_LINEAR, srgb8};
use crate::scene::{Cap, Clip, Colors};
use crate::{Error, Progress, Result};
use rayon::prelude::*;
use std::io::{self, Write};
use std::path::Path;

/// One surfel as a PLY vertex. Fields that the [`Properties`] of the file lack are not written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vertex {
    /// World coordinates.
    pub position: [f64; 3],
    /// The normal, written as it is.
    pub normal: [f32; 3],
    /// The disk's radius, or the longer half-axis of an ellipse, world units.
    pub radius: f32,
    /// Half-axes s and t, world units.
    pub axes: [[f32; 3]; 2],
    /// The lines that cut the ellipse.
    pub clip: Clip,
    /// The curvature of the ellipse.
    pub cap: Cap,
    /// The colour; None is written as [`DEFAULT_COLOR`] if the file has colours.
    pub color: Option<Color>,
    /// Texture coordinates (u, v), origin bottom left.
    pub texture: [f32; 2],
    /// Index of the texture; negative means none.
    pub texture_number: i32,
    /// Gradients of u and v along x, y and z, per world unit.
    pub texture_slopes: [[f32; 3]; 2],
}

/// The colour of a vertex. Alpha is straight: 1 is opaque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Color {
    /// 8-bit sRGB and linear alpha.
    Srgb8([u8; 4]),
    /// Linear light.
    Linear([f32; 4]),
}

impl Color {
    /// The colour as 8-bit sRGB; linear light is clamped to [0, 1].
    fn srgb8(self) -> [u8; 4] {
        match self {
            Self::Srgb8(codes) => codes,
            Self::Linear(color) => srgb8(color),
        }
    }

    fn linear(self) -> [f32; 4] {
        match self {
            Self::Srgb8([r, g, b, a]) => {
                let [r, g, b] = [r, g, b].map(|code| SRGB8_TO_LINEAR[usize::from(code)]);
                [r, g, b, f32::from(a) / 255.0]
            }
            Self::Linear(color) => color,
        }
    }
}

/// The encoding of a file's colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorProperties {
    /// No colours.
    #[default]
    Absent,
    /// `uchar red green blue`: 8-bit sRGB.
    Srgb8,
    /// `uchar red green blue alpha`: 8-bit sRGB and linear alpha.
    Srgb8Alpha,
    /// `float red green blue alpha`: linear light, unclamped.
    Linear,
}

/// The properties of a file and their types, in the order in which they are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Properties {
    /// Coordinates are `double` instead of `float`: some need more digits than an f32 has.
    pub double_coordinates: bool,
    /// `float nx ny nz` are written.
    pub normals: bool,
    /// `float radius` is written.
    pub radii: bool,
    /// `float sx sy sz tx ty tz` are written.
    pub axes: bool,
    /// `float clip1_u clip1_v clip1_w clip2_u clip2_v clip2_w` are written.
    pub clips: bool,
    /// `float cap_uu cap_uv cap_vv` are written.
    pub caps: bool,
    /// How `red green blue` and `alpha` are written.
    pub colors: ColorProperties,
    /// `float texture_u texture_v` are written.
    pub texture: bool,
    /// `int texnumber` is written.
    pub texture_number: bool,
    /// `float texture_u_x` to `texture_v_z` are written.
    pub texture_slopes: bool,
    /// `comment up y` or `comment up z` names the axis that points up.
    pub up: Option<Up>,
    /// `comment unsided` says that normals do not tell the two sides of a surface apart.
    pub unsided: bool,
    /// `comment closed` says that the surfels cover a closed surface and face outward.
    pub closed: bool,
}

impl Properties {
    /// The properties with which `points` are written without loss: `double` if a coordinate is not
    /// an f32, and `alpha` beside 8-bit colours only if some alpha is not 1. With half-axes,
    /// normals and radii are written too, for programs that know only those.
    pub fn of(points: &Points) -> Self {
        Self {
            double_coordinates: points.positions.iter().flatten().any(|c| f64::from(*c as f32) != *c && !c.is_nan()),
            normals: points.normals.is_some() || points.axes.is_some(),
            radii: points.radii.is_some() || points.axes.is_some(),
            axes: points.axes.is_some(),
            clips: points.axes.is_some() && points.clips.iter().flatten().any(|clip| !clip.is_none()),
            caps: points.axes.is_some() && points.caps.iter().flatten().any(|cap| !cap.is_flat()),
            colors: match &points.colors {
                None => ColorProperties::Absent,
                Some(Colors::Srgb8(codes)) if codes.iter().all(|code| code[3] == 255) => ColorProperties::Srgb8,
                Some(Colors::Srgb8(_)) => ColorProperties::Srgb8Alpha,
                Some(_) => ColorProperties::Linear,
            },
            texture: points.texture.is_some(),
            texture_number: points.texture.is_some() && points.texture_numbers.is_some(),
            texture_slopes: points.texture.is_some() && points.texture_slopes.is_some(),
            up: points.up,
            unsided: points.unsided,
            closed: points.closed,
        }
    }

    pub(super) fn write_header(self, out: &mut impl Write, count: u64, comments: &[String]) -> io::Result<()> {
        write!(out, "ply\nformat binary_little_endian 1.0\ncomment epsplat {}\n", env!("CARGO_PKG_VERSION"))?;
        if let Some(up) = self.up {
            writeln!(out, "comment up {}", up.name())?;
        }
        if self.closed {
            writeln!(out, "comment closed")?;
        }
        if self.unsided {
            writeln!(out, "comment unsided")?;
        }
        comments.iter().try_for_each(|comment| writeln!(out, "comment {comment}"))?;
        writeln!(out, "element vertex {count}")?;
        self.write_properties(out)
    }

    /// Writes the header lines of an element's properties.
    pub(super) fn write_properties(self, out: &mut impl Write) -> io::Result<()> {
        let mut scalars =
            |kind: &str, names: &[&str]| names.iter().try_for_each(|name| writeln!(out, "property {kind} {name}"));
        scalars(if self.double_coordinates { "double" } else { "float" }, &["x", "y", "z"])?;
        let groups: [(bool, &[&str]); 5] = [
            (self.normals, &["nx", "ny", "nz"]),
            (self.radii, &["radius"]),
            (self.axes, &["sx", "sy", "sz", "tx", "ty", "tz"]),
            (self.clips, &CLIP_NAMES),
            (self.caps, &CAP_NAMES),
        ];
        for (_, names) in groups.into_iter().filter(|(written, _)| *written) {
            scalars("float", names)?;
        }
        const CHANNELS: [&str; 4] = ["red", "green", "blue", "alpha"];
        match self.colors {
            ColorProperties::Absent => {}
            ColorProperties::Srgb8 => scalars("uchar", &CHANNELS[..3])?,
            ColorProperties::Srgb8Alpha => scalars("uchar", &CHANNELS)?,
            ColorProperties::Linear => scalars("float", &CHANNELS)?,
        }
        if self.texture {
            scalars("float", &["texture_u", "texture_v"])?;
        }
        if self.texture_number {
            scalars("int", &[NUMBER_NAME])?;
        }
        if self.texture_slopes {
            scalars("float", SLOPE_NAMES.as_flattened())?;
        }
        Ok(())
    }

    /// Appends the bytes of `vertex` to `row`.
    pub(super) fn encode(self, vertex: &Vertex, row: &mut Vec<u8>) {
        for coordinate in vertex.position {
            if self.double_coordinates {
                row.extend(coordinate.to_le_bytes());
            } else {
                row.extend((coordinate as f32).to_le_bytes());
            }
        }
        let mut floats = |values: &[f32]| values.iter().for_each(|value| row.extend(value.to_le_bytes()));
        if self.normals {
            floats(&vertex.normal);
        }
        if self.radii {
            floats(&[vertex.radius]);
        }
        if self.axes {
            floats(vertex.axes.as_flattened());
        }
        if self.clips {
            floats(vertex.clip.0.as_flattened());
        }
        if self.caps {
            floats(&vertex.cap.0);
        }
        let color = vertex.color.unwrap_or(Color::Linear(DEFAULT_COLOR));
        match self.colors {
            ColorProperties::Absent => {}
            ColorProperties::Srgb8 => row.extend(&color.srgb8()[..3]),
            ColorProperties::Srgb8Alpha => row.extend(color.srgb8()),
            ColorProperties::Linear => floats(&color.linear()),
        }
        if self.texture {
            vertex.texture.iter().for_each(|value| row.extend(value.to_le_bytes()));
        }
        if self.texture_number {
            row.extend(vertex.texture_number.to_le_bytes());
        }
        if self.texture_slopes {
            vertex.texture_slopes.as_flattened().iter().for_each(|value| row.extend(value.to_le_bytes()));
        }
    }
}

/// Writes `count` vertices as binary little-endian PLY, in the format of [this module](super).
///
/// Vertices are written one by one and never held in memory together. The file appears whole or not
/// at all.
///
/// # Errors
///
/// [`Error::Write`](crate::Error::Write) if the system cannot write, or if `vertices` does not
/// yield `count` vertices.
pub fn write(
    path: &Path,
    properties: Properties,
    count: u64,
    vertices: impl IntoIterator<Item = Vertex>,
) -> Result<()> {
    write_whole(path, |out| {
        properties.write_header(out, count, &[])?;
        out.write_all(b"end_header\n")?;
        let mut written = 0;
        let mut row = Vec::with_capacity(96);
        for vertex in vertices {
            row.clear();
            properties.encode(&vertex, &mut row);
            out.write_all(&row)?;
            written += 1;
        }
        if written != count {
            return Err(io::Error::other(format!("{count} vertices were announced, but {written} came")));
        }
        Ok(())
    })
}

/// Writes `points`, without levels of detail, so that [`read`](super::read) returns them unchanged.
/// Gaussians are written as 2D Gaussian splatting does, in f32.
///
/// If there are half-axes, a missing normal is written as s x t normalised, and a missing radius as
/// the longer half-axis.
///
/// # Errors
///
/// [`Error::Write`](crate::Error::Write) if the system cannot write.
pub fn write_points(path: &Path, points: &Points, progress: &dyn Progress) -> Result<()> {
    write_points_with(path, points, &[], progress)
}

/// Writes `points` as [`write_points`] does, with further `columns` after their properties.
///
/// # Errors
///
/// [`Error::Write`](crate::Error::Write) if the system cannot write.
pub fn write_points_with(path: &Path, points: &Points, columns: &[Column<'_>], progress: &dyn Progress) -> Result<()> {
    if points.encoded {
        return write_gaussians::write(path, points, columns, progress);
    }
    let (properties, count) = (Properties::of(points), points.positions.len());
    let comments: Vec<String> = points.beside.iter().map(|mesh| format!("triangles {}", mesh.display())).collect();
    progress.begin("writing points", count as u64);
    let written = write_whole(path, |out| {
        properties.write_header(out, count as u64, &comments)?;
        Column::write_properties(columns, out)?;
        out.write_all(b"end_header\n")?;
        let of_point = |index: usize, rows: &mut Vec<u8>| {
            properties.encode(&vertex(points, index), rows);
            columns.iter().for_each(|column| rows.extend(column.bytes(index)));
        };
        write_rows(out, count, of_point, progress)
    });
    progress.end();
    written
}

/// Writes `count` rows; `encode` appends the bytes of one row. All threads encode the next blocks
/// while the previous blocks are written.
pub(super) fn write_rows(
    out: &mut (impl Write + Send),
    count: usize,
    encode: impl Fn(usize, &mut Vec<u8>) + Sync,
    progress: &dyn Progress,
) -> io::Result<()> {
    const BLOCK: usize = 1 << 14;
    let starts: Vec<usize> = (0..count).step_by(BLOCK).collect();
    let mut blocks: Vec<Vec<u8>> = Vec::new();
    for starts in starts.chunks(2 * rayon::current_num_threads()) {
        let block = |start: &usize| {
            let mut rows = Vec::new();
            (*start..count.min(start + BLOCK)).for_each(|index| encode(index, &mut rows));
            rows
        };
        let encode = || starts.par_iter().map(block).collect::<Vec<Vec<u8>>>();
        let write = || blocks.iter().try_for_each(|rows| out.write_all(rows));
        let (written, encoded) = rayon::join(write, encode);
        written?;
        blocks = encoded;
        let end = starts.last().map_or(0, |start| count.min(start + BLOCK));
        progress.advance((end - starts[0]) as u64);
    }
    blocks.iter().try_for_each(|rows| out.write_all(rows))
}

/// The vertex to write for a point.
fn vertex(points: &Points, index: usize) -> Vertex {
    let axes = of(&points.axes, index);
    Vertex {
        position: points.positions[index],
        clip: of(&points.clips, index).unwrap_or_default(),
        cap: of(&points.caps, index).unwrap_or_default(),
        normal: of(&points.normals, index).unwrap_or_else(|| axes.map_or([0.0; 3], normal)),
        radius: of(&points.radii, index).unwrap_or_else(|| axes.map_or(0.0, longer)),
        axes: axes.unwrap_or_default(),
        color: match &points.colors {
            Some(Colors::Srgb8(codes)) => codes.get(index).map(|code| Color::Srgb8(*code)),
            Some(Colors::Linear(colors)) => colors.get(index).map(|color| Color::Linear(*color)),
            Some(Colors::Constant(color)) => Some(Color::Linear(*color)),
            Some(Colors::Textured(textured)) => textured.colors().get(index).map(|color| Color::Linear(*color)),
            Some(colors @ Colors::Harmonics(_)) => Some(Color::Linear(colors.linear(index))),
            None => None,
        },
        texture: of(&points.texture, index).unwrap_or_default(),
        texture_number: of(&points.texture_numbers, index).map_or(-1, |number| i32::try_from(number).unwrap_or(-1)),
        texture_slopes: of(&points.texture_slopes, index).unwrap_or_default(),
    }
}

/// Checks that the extension of `path` is that of a PLY file.
///
/// # Errors
///
/// [`Error::Usage`](Error::Usage) if it is not.
pub fn check_extension(path: &Path) -> Result<()> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ply")) {
        Ok(())
    } else {
        Err(Error::Usage(format!("the output must end in .ply, {} does not", path.display())))
    }
}

fn of<T: Copy>(all: &Option<Vec<T>>, index: usize) -> Option<T> {
    all.as_ref()?.get(index).copied()
}

/// The unit normal of a disk with these half-axes; zero if they span no plane.
pub(super) fn normal([s, t]: [[f32; 3]; 2]) -> [f32; 3] {
    // In f64, products of f32 numbers neither overflow nor underflow.
    let [s, t] = [s, t].map(|axis| glam::DVec3::from_array(axis.map(f64::from)));
    s.cross(t).normalize_or_zero().as_vec3().to_array()
}

/// The length of the longer half-axis.
pub(super) fn longer(axes: [[f32; 3]; 2]) -> f32 {
    let [s, t] = axes.map(|axis| glam::DVec3::from_array(axis.map(f64::from)).length());
    s.max(t) as f32
}
