//! From surfels to PLY bytes.

use crate::Result;
use crate::io::atomic::write_whole;
use crate::scene::color::{DEFAULT_COLOR, linear_to_srgb};
use std::io::{self, Write};
use std::path::Path;

/// One surfel as a PLY vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// World coordinates.
    pub position: [f64; 3],
    /// The normal, as it shall stand in the file.
    pub normal: [f32; 3],
    /// The disk's radius, world units.
    pub radius: f32,
    /// 8-bit sRGB; where colours are written, a surfel without one gets [`DEFAULT_COLOR`].
    pub color: Option<[u8; 3]>,
}

/// Which types and properties a written file has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Properties {
    /// Coordinates are `double`, not `float`: for coordinates whose last digits an f32 would lose.
    pub double_coordinates: bool,
    /// `uchar red green blue` are written.
    pub colors: bool,
}

/// Writes `count` vertices as binary little-endian PLY: `x y z nx ny nz radius` and, where asked for, `red green blue`.
///
/// The vertices are written as they come, so that they never lie in memory together; the file appears whole or not at
/// all.
///
/// # Errors
///
/// [`Error::Write`](crate::Error::Write) where the system cannot write, or `vertices` are not `count` many.
pub fn write(
    path: &Path,
    properties: Properties,
    count: u64,
    vertices: impl IntoIterator<Item = Vertex>,
) -> Result<()> {
    write_whole(path, |out| {
        let real = if properties.double_coordinates { "double" } else { "float" };
        write!(out, "ply\nformat binary_little_endian 1.0\ncomment epsplat {}\n", env!("CARGO_PKG_VERSION"))?;
        write!(out, "element vertex {count}\nproperty {real} x\nproperty {real} y\nproperty {real} z\n")?;
        out.write_all(b"property float nx\nproperty float ny\nproperty float nz\nproperty float radius\n")?;
        if properties.colors {
            out.write_all(b"property uchar red\nproperty uchar green\nproperty uchar blue\n")?;
        }
        out.write_all(b"end_header\n")?;
        let [r, g, b, _] = DEFAULT_COLOR.map(|linear| (linear_to_srgb(f64::from(linear)) * 255.0).round() as u8);
        let mut written = 0;
        let mut row = Vec::with_capacity(64);
        for vertex in vertices {
            row.clear();
            for coordinate in vertex.position {
                if properties.double_coordinates {
                    row.extend(coordinate.to_le_bytes());
                } else {
                    row.extend((coordinate as f32).to_le_bytes());
                }
            }
            for value in vertex.normal.into_iter().chain([vertex.radius]) {
                row.extend(value.to_le_bytes());
            }
            if properties.colors {
                row.extend(vertex.color.unwrap_or([r, g, b]));
            }
            out.write_all(&row)?;
            written += 1;
        }
        if written == count {
            Ok(())
        } else {
            Err(io::Error::other(format!("{count} vertices were announced, but {written} came")))
        }
    })
}
