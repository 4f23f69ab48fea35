//! COLMAP's text format: lenses in `cameras.txt`, poses in `images.txt`.
//!
//! - A line of `cameras.txt` is `CAMERA_ID MODEL WIDTH HEIGHT PARAMS...`, in pixels; the centre of
//!   the first pixel is (0.5, 0.5).
//! - An image in `images.txt` is a line `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME` and a line
//!   of its points `X Y POINT3D_ID ...`, which may be empty.

use std::fs::File;
use std::io::{self, BufRead, BufReader};

use super::models::{Camera, Model};
use super::{Lenses, NamedCamera};
use crate::io::fault::Fault;
use crate::io::values::{parse_number, shown};

pub(super) fn lenses(file: File, name: &'static str) -> Result<Lenses, Fault> {
    cameras_of(&mut Lines::of(BufReader::new(file)), name)
}

pub(super) fn images(file: File, lenses: &Lenses) -> Result<Vec<NamedCamera>, Fault> {
    images_of(&mut Lines::of(BufReader::new(file)), lenses)
}

fn cameras_of(lines: &mut Lines<impl BufRead>, name: &'static str) -> Result<Lenses, Fault> {
    let mut lenses = Lenses::new(name);
    while lines.next_record()? {
        let mut words = lines.words();
        let id = whole(words.next(), "CAMERA_ID").map_err(|what| lines.fault(&what))?;
        lenses.add(id, lens(words), &format!("line {}", lines.number));
    }
    Ok(lenses)
}

fn lens<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<Camera, String> {
    let name = words.next().ok_or("it ends before its MODEL")?;
    let model = Model::of_name(name)
        .ok_or_else(|| format!("the model '{}' is not known: undistort the pictures first", shown(name.as_bytes())))?;
    let size = (whole(words.next(), "WIDTH")?, whole(words.next(), "HEIGHT")?);
    let parameters = words.map(|word| number(Some(word), "PARAMS")).collect::<Result<Vec<_>, _>>()?;
    model.camera(size, &parameters)
}

fn images_of(lines: &mut Lines<impl BufRead>, lenses: &Lenses) -> Result<Vec<NamedCamera>, Fault> {
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
    lenses.image(rest.trim(), pose, id)
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
    use crate::io::camera::Pose;
    use crate::scene::{Form, Lens, Optics};
    use glam::{DMat3, DVec3};

    const LENSES: &str = "# Camera list\n1 PINHOLE 640 480 500 510 320 240.5\n\n  2 SIMPLE_RADIAL 64 48 50 32 24 0.1\n";

    fn read(cameras: &str, poses: &str) -> Result<Vec<NamedCamera>, String> {
        let said = |fault| match fault {
            Fault::Malformed(what) | Fault::Usage(what) => what,
            Fault::Io(error) => error.to_string(),
        };
        let lenses = cameras_of(&mut Lines::of(cameras.as_bytes()), "cameras.txt").map_err(said)?;
        images_of(&mut Lines::of(poses.as_bytes()), &lenses).map_err(said)
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
        let optics = Optics::of(Form::Perspective).with_radial([0.1, 0.0, 0.0, 0.0]);
        assert_eq!(images[1].camera.size, Some((64, 48)));
        assert_eq!(images[1].camera.lens, Lens::Curved(optics, [50.0, 50.0, 32.0, 24.0]));
    }

    #[test]
    fn what_is_not_colmaps_is_said_with_its_line() {
        let of_one = "7 1 0 0 0 0 0 0 1 a.png\n";
        for (cameras, said) in [
            ("1 PINHOLE 640 480 500 510 320", "line 1 of cameras.txt: a PINHOLE camera has 4 parameters, not 3"),
            (
                "\n1 EQUIRECTANGULAR 6 4 5 5 3 2 0 0 0 0",
                "line 2 of cameras.txt: the model 'EQUIRECTANGULAR' is not known",
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
