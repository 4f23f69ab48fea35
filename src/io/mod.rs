//! Files: one format each; every reader ends in [`Points`], every writer appears whole or not at all.

pub mod atomic;
pub mod camera;
pub mod cameras;
mod companions;
#[cfg(feature = "e57")]
pub mod e57;
pub mod exr;
mod fault;
pub mod image;
mod intensity;
pub mod las;
pub mod mesh;
pub mod obj;
#[cfg(feature = "pcd")]
pub mod pcd;
pub mod ply;
pub mod png;
pub mod points;
mod polygon;
pub mod texture;
mod triangles;
mod values;
pub mod write_behind;

pub use companions::companions;
pub use mesh::{Material, Mesh};
pub use points::{Points, Up};
pub use texture::Texture;

use crate::{Error, Progress, Result};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Reads any supported file: PLY, LAS, LAZ (COPC too), OBJ, and with the features of those names E57 and PCD, by its extension in
/// either case, or else by its first bytes.
///
/// Points come in the file's own order and coordinates. A file with no points is no error here.
///
/// # Errors
///
/// [`Error::Read`] for a missing file or a directory, [`Error::Malformed`] for a file that is none of these formats or
/// is not what its format says.
pub fn read(path: &Path, progress: &dyn Progress) -> Result<Points> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("ply") => ply::read(path, progress),
        Some("las" | "laz") => las::read(path, progress),
        Some("obj") => obj::read(path, progress),
        Some("e57") => read_e57(path, progress),
        Some("pcd") => read_pcd(path, progress),
        _ => match &magic(path).map_err(|error| Error::read(path, error))? {
            b"ply\n" | b"ply\r" => ply::read(path, progress),
            b"LASF" => las::read(path, progress),
            b"ASTM" => read_e57(path, progress),
            b"# .P" => read_pcd(path, progress),
            _ => Err(Error::malformed(path, "its format is not known; PLY, LAS, LAZ, OBJ, E57 and PCD files are read")),
        },
    }
}

#[cfg(feature = "e57")]
use e57::read as read_e57;
#[cfg(feature = "pcd")]
use pcd::read as read_pcd;

#[cfg(not(feature = "e57"))]
fn read_e57(path: &Path, _: &dyn Progress) -> Result<Points> {
    Err(without(path, "e57"))
}

#[cfg(not(feature = "pcd"))]
fn read_pcd(path: &Path, _: &dyn Progress) -> Result<Points> {
    Err(without(path, "pcd"))
}

/// A file of a format whose reader was left out.
#[cfg(not(all(feature = "e57", feature = "pcd")))]
fn without(path: &Path, feature: &str) -> Error {
    let format = feature.to_ascii_uppercase();
    Error::malformed(path, format!("this build does not read {format} files: build with '--features {feature}'"))
}

/// Reads the triangles of a mesh: OBJ or PLY, by its extension in either case.
///
/// # Errors
///
/// As [`read`].
pub fn read_mesh(path: &Path, progress: &dyn Progress) -> Result<Mesh> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("obj") => obj::read_mesh(path, progress),
        Some("ply") => ply::read_mesh(path, progress),
        _ => Err(Error::malformed(path, "only OBJ and PLY files are read as meshes; convert it to one")),
    }
}

/// The first four bytes, zeros where the file is shorter.
fn magic(path: &Path) -> std::io::Result<[u8; 4]> {
    let mut bytes = Vec::with_capacity(4);
    File::open(path)?.take(4).read_to_end(&mut bytes)?;
    bytes.resize(4, 0);
    Ok(bytes.first_chunk().copied().unwrap_or_default())
}
