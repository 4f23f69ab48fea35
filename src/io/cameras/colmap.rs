//! COLMAP's text format: lenses in `cameras.txt`, poses in `images.txt`.
//!
//! - A line of `cameras.txt` is `CAMERA_ID MODEL WIDTH HEIGHT PARAMS...`, in pixels; the centre of
//!   the first pixel is (0.5, 0.5).
//! - An image in `images.txt` is a line `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME` and a line
//!   of its points `X Y POINT3D_ID ...`, which may be empty.
//!
//! The quaternion and the translation map world coordinates to camera coordinates: x right, y down,
//! z forward.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

use glam::{DMat3, DQuat, DVec3};

use super::{NamedCamera, name_of};
use crate::error::{Error, Result};
use crate::io::camera::{CameraFile, Pose};
use crate::io::fault::Fault;
use crate::io::input::check_regular;
use crate::io::values::{parse_number, shown};
use crate::scene::Lens;

const CAMERAS: &str = "cameras.txt";
pub(super) const IMAGES: &str = "images.txt";

pub(super) fn read(folder: &Path) -> Result<Vec<NamedCamera>> {
    let path = folder.join(CAMERAS);
    let file = opened(&path).map_err(|error| {
        if error.kind() == io::ErrorKind::NotFound && folder.join("cameras.bin").exists() {
            let what = "only COLMAP's text is read: make it with 'colmap model_converter --output_type TXT'";
            return Error::malformed(folder, what);
        }
        Error::read(&path, error)
    })?;
    let lenses = lenses(&mut Lines::of(BufReader::new(file))).map_err(|fault| fault.of(&path))?;
    let path = folder.join(IMAGES);
    let file = opened(&path).map_err(|error| Error::read(&path, error))?;
    images(&mut Lines::of(BufReader::new(file)), &lenses).map_err(|fault| fault.of(&path))
}

/// The cameras by identifier. For a camera that cannot be used, the map has its line and the
/// reason: only images that refer to this camera are errors.
type Lenses = HashMap<u64, Result<Camera, String>>;

fn opened(path: &Path) -> io::Result<File> {
    check_regular(path)?;
    File::open(path)
}

/// A line of `cameras.txt`.
struct Camera {
    size: (u32, u32),
    intrinsics: [f64; 4],
    distortion: Option<(&'static str, f64)>,
}

/// The models that are pinholes where all distortion coefficients are 0: name, whether they have
/// two focal lengths, and the names of the coefficients after the principal point.
const MODELS: [(&str, bool, &[&str]); 6] = [
    ("SIMPLE_PINHOLE", false, &[]),
    ("PINHOLE", true, &[]),
    ("SIMPLE_RADIAL", false, &["k"]),
    ("RADIAL", false, &["k1", "k2"]),
    ("OPENCV", true, &["k1", "k2", "p1", "p2"]),
    ("FULL_OPENCV", true, &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]),
];

fn lenses(lines: &mut Lines<impl BufRead>) -> Result<Lenses, Fault> {
    let mut lenses = Lenses::new();
    while lines.next_record()? {
        let mut words = lines.words();
        let id = whole(words.next(), "CAMERA_ID").map_err(|what| lines.fault(&what))?;
        let line = lines.number;
        let camera = match lenses.contains_key(&id) {
            false => lens(words),
            true => Err(format!("there is another camera {id}")),
        };
        lenses.insert(id, camera.map_err(|what| format!("line {line} of {CAMERAS}: {what}")));
    }
    Ok(lenses)
}

fn lens<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<Camera, String> {
    let name = words.next().ok_or("it ends before its MODEL")?;
    let model = MODELS.iter().find(|(model, ..)| *model == name);
    let (_, two, distortions) = model.ok_or_else(|| {
        format!("the model '{}' is not a pinhole; undistort the pictures first", shown(name.as_bytes()))
    })?;
    let size = (whole(words.next(), "WIDTH")?, whole(words.next(), "HEIGHT")?);
    let parameters = words.map(|word| number(Some(word), "PARAMS")).collect::<Result<Vec<_>, _>>()?;
    let needed = 3 + usize::from(*two) + distortions.len();
    if parameters.len() != needed {
        return Err(format!("a {name} camera has {needed} parameters, not {}", parameters.len()));
    }
    let (lens, rest) = parameters.split_at(needed - distortions.len());
    let intrinsics = match *lens {
        [fx, fy, cx, cy] => [fx, fy, cx, cy],
        [f, cx, cy] => [f, f, cx, cy],
        _ => return Err("its parameters are not a lens's".into()),
    };
    let distortion = distortions.iter().zip(rest).map(|(name, value)| (*name, *value)).find(|(_, value)| *value != 0.0);
    Ok(Camera { size, intrinsics, distortion })
}

fn images(lines: &mut Lines<impl BufRead>, lenses: &Lenses) -> Result<Vec<NamedCamera>, Fault> {
    let mut images = Vec::new();
    while lines.next_record()? {
        images.push(image(&lines.line, lenses).map_err(|what| lines.fault(&what))?);
        // Without this check, every second image would be lost silently in a file without the lines
        // of points.
        if lines.next()? && !lines.are_points() {
            return Err(lines.fault(
                "not points X Y POINT3D_ID of the image in the line before; an image without points is followed by an empty \
                 line",
            ));
        }
    }
    Ok(images)
}

fn image(line: &str, lenses: &Lenses) -> Result<NamedCamera, String> {
    let mut rest = line;
    let mut next = || {
        let (word, after) = match rest.trim_start().split_once(|c: char| c.is_ascii_whitespace()) {
            Some(split) => split,
            None => (rest.trim_start(), ""),
        };
        rest = after;
        (!word.is_empty()).then_some(word)
    };
    whole::<u64>(next(), "IMAGE_ID")?;
    let mut pose = [0.0; 7];
    for (value, name) in pose.iter_mut().zip(["QW", "QX", "QY", "QZ", "TX", "TY", "TZ"]) {
        *value = number(next(), name)?;
    }
    let id = whole(next(), "CAMERA_ID")?;
    // A name may contain spaces.
    let name = name_of(rest.trim()).ok_or("its NAME is not a valid file name")?;
    let lens = lenses.get(&id).ok_or_else(|| format!("there is no camera {id} in {CAMERAS}"))?;
    let lens = lens.as_ref().map_err(|what| format!("its camera {id} cannot be used, {what}"))?;
    let [w, x, y, z, tx, ty, tz] = pose;
    let quaternion = DQuat::from_xyzw(x, y, z, w);
    let length = quaternion.length();
    if !(0.99..=1.01).contains(&length) {
        return Err(format!("its quaternion has the length {length}, not 1"));
    }
    let rotation = DMat3::from_quat(quaternion.normalize());
    let eye = -(rotation.transpose() * DVec3::new(tx, ty, tz));
    let camera = CameraFile {
        size: Some(lens.size),
        lens: Lens::Intrinsics(lens.intrinsics),
        pose: Pose::Rigid(rotation, eye),
        near: None,
    };
    Ok(NamedCamera { name, camera, distortion: lens.distortion })
}

fn number(word: Option<&str>, what: &str) -> Result<f64, String> {
    let word = word.ok_or_else(|| format!("it ends before its {what}"))?;
    let finite = parse_number(word.as_bytes()).filter(|number| number.is_finite());
    finite.ok_or_else(|| format!("its {what}, '{}', is not a number", shown(word.as_bytes())))
}

fn whole<T: std::str::FromStr>(word: Option<&str>, what: &str) -> Result<T, String> {
    let word = word.ok_or_else(|| format!("it ends before its {what}"))?;
    word.parse().map_err(|_| format!("its {what}, '{}', is not a whole number", shown(word.as_bytes())))
}

/// The lines of a text, and the current line's number.
struct Lines<R> {
    reader: R,
    line: String,
    number: u64,
}

impl<R: BufRead> Lines<R> {
    fn of(reader: R) -> Self {
        Self { reader, line: String::new(), number: 0 }
    }

    /// Reads the next line; returns `false` at the end.
    fn next(&mut self) -> Result<bool, Fault> {
        self.line.clear();
        self.number += 1;
        let read = self.reader.read_line(&mut self.line);
        if self.number == 1 && self.line.starts_with('\u{feff}') {
            self.line.drain(..'\u{feff}'.len_utf8());
        }
        read.map(|bytes| bytes > 0).map_err(|error| match error.kind() {
            io::ErrorKind::InvalidData => self.fault("it is not UTF-8 text"),
            _ => Fault::Io(error),
        })
    }

    /// Reads the next line that is neither empty nor a comment; returns `false` at the end.
    fn next_record(&mut self) -> Result<bool, Fault> {
        while self.next()? {
            let line = self.line.trim_start();
            if !line.is_empty() && !line.starts_with('#') {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn words(&self) -> impl Iterator<Item = &str> {
        self.line.split_ascii_whitespace()
    }

    /// Whether the line can be the points of an image.
    fn are_points(&self) -> bool {
        let mut count = 0;
        let numbers = self.words().all(|word| {
            count += 1;
            word.parse::<f64>().is_ok()
        });
        numbers && count % 3 == 0
    }

    fn fault(&self, what: &str) -> Fault {
        Fault::Malformed(format!("line {}: {what}", self.number))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::*;

    const LENSES: &str = "# Camera list\n1 PINHOLE 640 480 500 510 320 240.5\n\n  2 SIMPLE_RADIAL 64 48 50 32 24 0.1\n";

    fn read(cameras: &str, poses: &str) -> Result<Vec<NamedCamera>, String> {
        let said = |fault| match fault {
            Fault::Malformed(what) | Fault::Usage(what) => what,
            Fault::Io(error) => error.to_string(),
        };
        let lenses = lenses(&mut Lines::of(cameras.as_bytes())).map_err(said)?;
        images(&mut Lines::of(poses.as_bytes()), &lenses).map_err(said)
    }

    #[test]
    fn poses_are_world_to_camera() {
        // A third of a turn about (1, 1, 1): the world's x, y and z become the camera's y, z and x.
        let poses = "# Image list\n# two lines each\n\n7 0.5 0.5 0.5 0.5 1 2 3 1 left/a b.jpg\n1.5 2.5 -1 3 4 77\n\
                     # not a comment of the image before\n8 1 0 0 0 0 0 0 2 c.png\n\n9 -1 0 0 0 6e6 0 0 1 d.png";
        let images = read(LENSES, poses).unwrap();
        assert_eq!(images.iter().map(|image| image.name.as_str()).collect::<Vec<_>>(), ["left/a b", "c", "d"]);
        let pose = |image: &NamedCamera| match image.camera.pose {
            Pose::Rigid(rotation, eye) => (rotation, eye),
            Pose::LookAt(..) => panic!(),
        };
        let (rotation, eye) = pose(&images[0]);
        assert_eq!((rotation * DVec3::X, rotation * DVec3::Y, rotation * DVec3::Z), (DVec3::Y, DVec3::Z, DVec3::X));
        assert_eq!(rotation * eye + DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO);
        assert_eq!(pose(&images[2]), (DMat3::IDENTITY, DVec3::new(-6e6, 0.0, 0.0)));
        assert_eq!(images[0].camera.lens, Lens::Intrinsics([500.0, 510.0, 320.0, 240.5]));
        assert_eq!((images[1].camera.size, images[1].distortion), (Some((64, 48)), Some(("k", 0.1))));
        assert_eq!(images[1].camera.lens, Lens::Intrinsics([50.0, 50.0, 32.0, 24.0]));
    }

    #[test]
    fn what_is_not_colmaps_is_said_with_its_line() {
        let of_one = "7 1 0 0 0 0 0 0 1 a.png\n";
        for (cameras, said) in [
            ("1 PINHOLE 640 480 500 510 320", "line 1 of cameras.txt: a PINHOLE camera has 4 parameters, not 3"),
            (
                "\n1 OPENCV_FISHEYE 6 4 5 5 3 2 0 0 0 0",
                "line 2 of cameras.txt: the model 'OPENCV_FISHEYE' is not a pinhole",
            ),
            ("1", "line 1 of cameras.txt: it ends before its MODEL"),
            ("1 PINHOLE 640 -480 1 1 1 1", "line 1 of cameras.txt: its HEIGHT, '-480', is not a whole number"),
            ("1 PINHOLE 640 480 1 1 1 nan", "line 1 of cameras.txt: its PARAMS, 'nan', is not a number"),
            ("1 PINHOLE 6 4 1 1 1 1\n1 PINHOLE 6 4 1 1 1 1", "line 2 of cameras.txt: there is another camera 1"),
        ] {
            let message = read(cameras, of_one).unwrap_err();
            assert!(
                message.starts_with("line 1: its camera 1 cannot be used, ") && message.contains(said),
                "{message}"
            );
            // A camera that no image refers to does not matter.
            let others = format!("{cameras}\n2 PINHOLE 640 480 500 510 320 240\n");
            assert_eq!(read(&others, "7 1 0 0 0 0 0 0 2 a.png\n").unwrap().len(), 1);
        }
        let message = read("one", "").unwrap_err();
        assert!(message.starts_with("line 1: its CAMERA_ID, 'one', is not a whole number"), "{message}");
        let marked = format!("\u{feff}{LENSES}");
        assert_eq!(read(&marked, &format!("\u{feff}# Images\n{of_one}")).unwrap().len(), 1);
        for (poses, said) in [
            ("1 1 0 0 0 0 0 0 1 a.png\n2 1 0 0 0 0 0 0 1 b.png\n", "line 2: not points"),
            ("1 1 0 0 0 0 0 0 3 a.png", "line 1: there is no camera 3 in cameras.txt"),
            ("1 2 0 0 0 0 0 0 1 a.png", "line 1: its quaternion has the length 2"),
            ("1 0 0 0 0 0 0 0 1 a.png", "line 1: its quaternion has the length 0"),
            ("1 1 0 0 0 x 0 0 1 a.png", "line 1: its TX, 'x', is not a number"),
            ("1 1 0 0 0 0 0", "line 1: it ends before its TZ"),
            ("1 1 0 0 0 0 0 0 1 ..", "line 1: its NAME is not a valid file name"),
            ("1 1 0 0 0 0 0 0 1", "line 1: its NAME is not a valid file name"),
        ] {
            let message = read(LENSES, poses).unwrap_err();
            assert!(message.starts_with(said), "{poses}: {message}");
        }
    }
}
