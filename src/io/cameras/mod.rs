//! Sets of cameras, as reconstruction and radiance-field programs write them. Each camera gives one
//! picture.

mod camera_path;
mod colmap;
mod splats;
mod transforms;

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::camera::CameraFile;
use super::fault::Fault;
use super::input::text;
use super::values::{one_line, shown};
use crate::error::{Error, Result};

/// A camera of a set.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// The name of its picture: a relative path without an image's extension, with `/` between
    /// ordinary names, so that it cannot leave its folder. It is unique within the set.
    pub name: String,
    /// Lens and pose.
    pub camera: CameraFile,
    /// The name of a model whose lens is not drawn: [`camera`](Self::camera) is then a pinhole with
    /// its focal lengths.
    pub undrawn: Option<&'static str>,
}

/// Reads the cameras of a JSON file, given the default size of pictures.
type ReadJson = fn(&Value, (u32, u32)) -> Result<Vec<NamedCamera>, String>;

/// A kind of JSON file: a test of its content, and its reader, which gets the default size.
struct Kind {
    is: fn(&Value) -> bool,
    read: ReadJson,
}

/// All kinds of JSON files. The first one that fits is taken.
const KINDS: [Kind; 3] = [
    Kind { is: camera_path::is, read: camera_path::read },
    Kind { is: splats::is, read: splats::read },
    Kind { is: transforms::is, read: transforms::read },
];

/// The sentence for files of no known kind.
const READ: &str = "its kind is not known; cameras are a transforms.json, a list of cameras, a cameras.json of 3D \
                    Gaussian Splatting, a camera_path.json of nerfstudio, or a folder with COLMAP's cameras and \
                    images, .bin or .txt (a single camera is given with --camera)";

/// Reads a set of cameras, in the order of the file:
///
/// - `transforms.json`, as NeRF, instant-ngp and nerfstudio write it. `transform_matrix` is
///   camera-to-world with the axes of OpenGL (x right, y up, z back). The lens is `fl_x fl_y cx cy`
///   in pixels of a picture of `w` x `h`, or `camera_angle_x` (the horizontal field of view,
///   radians), with the distortion `k1 k2 k3 k4 p1 p2` of a `camera_model`; a frame's own values
///   take precedence over those for all frames. `file_path` is the name. A list of camera files may
///   stand in place of the frames.
/// - `cameras.json` of 3D Gaussian Splatting: a list of objects with `img_name`, `width`, `height`,
///   `position`, `rotation` (camera-to-world with x right, y down, z forward), `fx` and `fy`.
/// - `camera_path.json` of nerfstudio: `camera_to_world` with the axes of OpenGL, `fov` (vertical,
///   degrees), `render_width` and `render_height`.
/// - A folder with COLMAP's `cameras.bin` and `images.bin`, or the same as `.txt`, in the folder
///   itself or in its `sparse/0`, `sparse` or `colmap/sparse/0`. Poses are world-to-camera with x
///   right, y down, z forward.
///
/// Coordinates are those of the file. A camera without a picture size gets `size`, pixels.
///
/// # Errors
///
/// [`Error::Read`] if the system cannot read,
/// [`Error::Malformed`] if a file violates its format, a lens is of no known model, there is no
/// camera, or two have the same name.
pub fn read(path: &Path, size: (u32, u32)) -> Result<Vec<NamedCamera>> {
    let (path, cameras) = if path.is_dir() { colmap::read(path)? } else { (path.to_owned(), of_file(path, size)?) };
    check_names(&cameras).map_err(|fault| fault.of(&path))?;
    Ok(cameras)
}

/// Returns the files that [`read`] reads.
pub fn files(path: &Path) -> Vec<PathBuf> {
    match path.is_dir() {
        true => colmap::files(path).map(Vec::from).unwrap_or_default(),
        false => vec![path.to_owned()],
    }
}

fn of_file(path: &Path, size: (u32, u32)) -> Result<Vec<NamedCamera>> {
    let text = text(path).map_err(|error| match error {
        Error::Read { source, .. } if source.kind() == io::ErrorKind::InvalidData => Error::malformed(path, READ),
        error => error,
    })?;
    parse(&text, size).map_err(|what| Error::malformed(path, what))
}

fn parse(text: &str, size: (u32, u32)) -> Result<Vec<NamedCamera>, String> {
    let file: Value =
        serde_json::from_str(text).map_err(|error| format!("not JSON, {}: {READ}", one_line(&error.to_string())))?;
    let kind = KINDS.iter().find(|kind| (kind.is)(&file)).ok_or(READ)?;
    (kind.read)(&file, size)
}

fn check_names(cameras: &[NamedCamera]) -> Result<(), Fault> {
    if cameras.is_empty() {
        return Err(Fault::Malformed("it holds no camera".into()));
    }
    let mut known = HashMap::new();
    for (number, camera) in (1..).zip(cameras) {
        if let Some(other) = known.insert(camera.name.as_str(), number) {
            let name = shown(camera.name.as_bytes());
            return Err(Fault::Malformed(format!("cameras {other} and {number} both make the picture '{name}'")));
        }
    }
    Ok(())
}

/// Extensions of image files; anything else after a dot belongs to the name.
const IMAGES: [&str; 12] = ["png", "jpg", "jpeg", "exr", "hdr", "tif", "tiff", "webp", "bmp", "ppm", "pgm", "dng"];

/// Converts the `path` of a picture in a camera file to its name. Parts that would leave a folder
/// are dropped: roots, drives and `..`. None if nothing remains, or the name has control
/// characters.
fn name_of(path: &str) -> Option<String> {
    if path.chars().any(char::is_control) {
        return None;
    }
    let stem = match path.rsplit_once('.') {
        Some((stem, ending)) if IMAGES.iter().any(|image| ending.eq_ignore_ascii_case(image)) => stem,
        _ => path,
    };
    let inside = |part: &&str| !matches!(*part, "" | "." | "..") && !part.ends_with(':');
    let parts: Vec<&str> = stem.split(['/', '\\']).filter(inside).collect();
    // If the extension is all there is, there is no name.
    (!parts.is_empty() && !stem.ends_with(['/', '\\'])).then(|| parts.join("/"))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn names_stay_in_their_folder() {
        for (path, name) in [
            ("./train/r_0", "train/r_0"),
            ("images/frame.001.JPG", "images/frame.001"),
            ("r_0.5", "r_0.5"),
            ("../../images/a.png", "images/a"),
            ("/etc/passwd", "etc/passwd"),
            ("C:\\photos\\a b.jpeg", "photos/a b"),
            ("a/./b//c.exr", "a/b/c"),
            (".hidden", ".hidden"),
        ] {
            assert_eq!(name_of(path).unwrap(), name, "{path}");
        }
        for path in ["", ".", "..", "/", "../..", ".png", "a/.jpg", "a\nb", "a\0"] {
            assert_eq!(name_of(path), None, "{path:?}");
        }
    }
}
