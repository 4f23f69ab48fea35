//! Files: one module per format. Every reader returns [`Points`]; an output file appears whole or
//! not at all.

pub mod about;
pub mod atomic;
mod attributes;
mod beside;
pub mod camera;
pub mod cameras;
mod classes;
pub(crate) mod closed;
mod color_range;
mod companions;
mod degrees;
pub mod dimensions;
#[cfg(feature = "e57")]
pub mod e57;
mod encoding;
#[cfg(feature = "exr")]
pub mod exr;
mod fault;
mod format;
#[cfg(feature = "gltf")]
pub mod gltf;
pub mod image;
pub mod images;
pub(crate) mod input;
pub mod las;
pub mod mesh;
pub mod obj;
pub mod off;
pub mod paint;
#[cfg(feature = "parts")]
pub mod part;
#[cfg(feature = "pcd")]
pub mod pcd;
pub mod place;
pub mod ply;
pub mod png;
pub mod points;
mod polygon;
#[cfg(feature = "http")]
pub mod remote;
pub mod source;
pub mod stl;
pub mod text;
pub mod texture;
pub(crate) mod textures;
mod tree;
pub(crate) mod triangles;
mod values;
pub mod vpc;
pub mod write_behind;

pub use crate::address::shown;
pub use about::About;
pub use classes::{ClassOpacities, class_color, class_name};
pub use color_range::{ColorRules, RawColors, settle_colors};
pub use companions::companions;
pub use dimensions::{ColorBy, Column, Filter, Span, Wanted};
pub use format::Format;
pub use input::{Input, MOST_COPIED};
pub use mesh::{Material, Mesh};
pub use paint::Paint;
pub use points::{Points, Up};
pub use texture::Texture;
pub use tree::{Tree, TreeRow};

use crate::{Error, Progress, Result};
use std::path::Path;

/// Options for reading files.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// The format. If None, it is detected from the file's extension, or else its first bytes.
    pub format: Option<Format>,
    /// Keep points that a LAS file marks as withheld, which means deleted.
    pub keep_withheld: bool,
    /// Drop the shortest axis of ellipsoidal Gaussians, however thick they are, so that they become
    /// surfels. If false, a file is an error if many of its Gaussians are thicker than a tenth of
    /// their width.
    pub flatten: bool,
    /// Keep the shortest axes of such a file's Gaussians instead ([`Points::thirds`]), so that it
    /// is no error. [`flatten`](Self::flatten) has precedence.
    pub solid: bool,
    /// Opacities by class, for the points of laser scans (LAS files).
    pub classes: ClassOpacities,
    /// Ignore the alphas of colours, but not the opacities of Gaussians.
    pub ignore_alpha: bool,
    /// Store the file's description of itself in [`Points::about`].
    pub describe: bool,
    /// Fail if a part of a file cannot be read: a scan of an E57 file, a chunk of a LAZ file, or a
    /// node of a COPC file. If false, that part is left out and named in [`Points::unread`].
    pub strict: bool,
    /// Attributes to read beside those that every picture needs, and the points to keep.
    pub wanted: Wanted,
}

/// Reads a file of any supported format; see [`Input::open`].
///
/// The formats are those of [`Format::READ`]. E57, glTF and PCD need the features `e57`,
/// `gltf` and `pcd`. Points
/// keep the file's order and coordinates. A file without points is not an error here.
///
/// # Errors
///
/// [`Error::Read`] for a missing file or a directory, [`Error::Malformed`] for a file of another
/// format, or one that violates its format.
pub fn read(path: &Path, progress: &dyn Progress) -> Result<Points> {
    read_with(path, ReadOptions::default(), progress)
}

/// Reads the points of a file with options.
///
/// # Errors
///
/// As [`read`].
pub fn read_with(path: &Path, options: ReadOptions, progress: &dyn Progress) -> Result<Points> {
    read_settled(Input::open(path, options.format)?, &options, progress)
}

/// Reads an opened file, and decides what its colours mean.
fn read_settled(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let mut points = read_opened(input, options, progress)?;
    settle_colors(std::slice::from_mut(&mut points));
    Ok(points)
}

/// Reads the points of a file and keeps its colours as they are in the file ([`Points::raw`]).
///
/// [`settle_colors`] then decides what they mean, for all inputs of a scene together.
///
/// # Errors
///
/// As [`read`].
pub fn read_raw(path: &Path, options: ReadOptions, progress: &dyn Progress) -> Result<Points> {
    read_opened(Input::open(path, options.format)?, &options, progress)
}

/// Reads an opened file, and keeps its colours as they are in the file.
fn read_opened(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let (format, path, name) = (input.format, input.path.clone(), fault::name(&input.path));
    let mut points = match format {
        Format::Ply => ply::read(input, options, progress),
        Format::Las => las::read(input, options, progress),
        Format::Obj => obj::read(input, options, progress),
        Format::E57 => read_e57(input, options, progress),
        Format::Pcd => read_pcd(input, options, progress),
        Format::Xyz => text::read(input, options, progress),
        Format::Pts => text::read_pts(input, options, progress),
        Format::Ptx => text::read_ptx(input, options, progress),
        Format::Stl => stl::read(input, options, progress),
        Format::Off => off::read(input, options, progress),
        Format::Gltf => read_gltf(input, options, progress),
    }?;
    if format == Format::Obj {
        dimensions::of_positions(&mut points, &options.wanted).map_err(|fault| fault.of(&path))?;
    }
    if format != Format::Las && points.faces.is_none() {
        points.notes.extend(degrees::hint_of(&name, &points.positions, None));
    }
    Ok(points)
}

#[cfg(feature = "e57")]
use e57::read as read_e57;
#[cfg(feature = "gltf")]
use gltf::read as read_gltf;
#[cfg(feature = "pcd")]
use pcd::read as read_pcd;

#[cfg(not(feature = "e57"))]
fn read_e57(input: Input, _: &ReadOptions, _: &dyn Progress) -> Result<Points> {
    Err(without(&input.path, "e57"))
}

#[cfg(not(feature = "gltf"))]
fn read_gltf(input: Input, _: &ReadOptions, _: &dyn Progress) -> Result<Points> {
    Err(without(&input.path, "gltf"))
}

#[cfg(not(feature = "pcd"))]
fn read_pcd(input: Input, _: &ReadOptions, _: &dyn Progress) -> Result<Points> {
    Err(without(&input.path, "pcd"))
}

/// The error for a format whose reader is not compiled in.
#[cfg(not(all(feature = "e57", feature = "gltf", feature = "pcd")))]
fn without(path: &Path, feature: &str) -> Error {
    let format = feature.to_ascii_uppercase();
    Error::malformed(path, format!("this build does not read {format} files: build with '--features {feature}'"))
}

/// Reads the triangles of a file of [`Format::MESHES`]; see [`Input::open`].
///
/// # Errors
///
/// As [`read`].
pub fn read_mesh(path: &Path, progress: &dyn Progress) -> Result<Mesh> {
    read_mesh_with(path, ReadOptions::default(), progress)
}

/// Reads the triangles of a mesh file with options.
///
/// # Errors
///
/// As [`read`].
pub fn read_mesh_with(path: &Path, options: ReadOptions, progress: &dyn Progress) -> Result<Mesh> {
    let input = Input::open(path, options.format)?;
    match input.format {
        Format::Obj => obj::read_mesh(input, &options, progress),
        Format::Ply => ply::read_mesh(input, &options, progress),
        format if Format::MESHES.contains(&format) => Ok(Mesh::of_points(read_settled(input, &options, progress)?)),
        _ => {
            let what = format!("only {} files are read as meshes; convert it to one", Format::meshes_sentence());
            Err(Error::malformed(&input.path, what))
        }
    }
}
