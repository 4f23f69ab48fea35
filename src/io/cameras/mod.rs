//! Sets of cameras, as reconstruction and radiance-field programs write them. Each camera gives one
//! picture.

mod colmap;
mod transforms;

use std::collections::HashMap;
use std::path::Path;

use super::camera::CameraFile;
use super::fault::Fault;
use super::values::shown;
use crate::error::Result;

/// A camera of a set.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// The name of its picture: a relative path without an image's extension, with `/` between
    /// ordinary names, so that it cannot leave its folder. It is unique within the set.
    pub name: String,
    /// Lens and pose.
    pub camera: CameraFile,
    /// The first coefficient of lens distortion that is not 0, and its value.
    /// [`camera`](Self::camera) ignores distortion.
    pub distortion: Option<(&'static str, f64)>,
}

/// Reads a set of cameras, in the order of the file:
///
/// - A file is a `transforms.json` as NeRF, instant-ngp and nerfstudio write it. `transform_matrix`
///   is camera-to-world with the axes of OpenGL (x right, y up, z back). The lens is
///   `fl_x fl_y cx cy` in pixels of a picture of `w` x `h`, or `camera_angle_x` (the horizontal
///   field of view, radians); a frame's own values take precedence over those for all frames.
///   `file_path` is the name.
/// - A folder contains COLMAP's `cameras.txt` and `images.txt`, whose poses are world-to-camera
///   with x right, y down, z forward.
///
/// Coordinates are those of the file. A camera without a picture size gets `size`, pixels.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) if the system cannot read,
/// [`Error::Malformed`](crate::Error::Malformed) if a file violates its format, a lens is not a
/// pinhole even without its distortion, there is no camera, or two have the same name.
pub fn read(path: &Path, size: (u32, u32)) -> Result<Vec<NamedCamera>> {
    let (path, cameras) = if path.is_dir() {
        (path.join(colmap::IMAGES), colmap::read(path)?)
    } else {
        (path.to_owned(), transforms::read(path, size)?)
    };
    check_names(&cameras).map_err(|fault| fault.of(&path))?;
    Ok(cameras)
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
