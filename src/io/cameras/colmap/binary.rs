//! COLMAP's binary format, little-endian.
//!
//! - `cameras.bin`: the number of cameras (u64); for each its CAMERA_ID (u32), the number of its
//!   model (i32), WIDTH and HEIGHT (u64) and the model's parameters (f64).
//! - `images.bin`: the number of images (u64); for each its IMAGE_ID (u32), QW QX QY QZ TX TY TZ
//!   (f64), CAMERA_ID (u32), its NAME, which ends with a zero, and the number of its points (u64);
//!   each point is 24 bytes.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};

use super::models::Model;
use super::{Lenses, NamedCamera};
use crate::io::fault::Fault;

/// The longest name of an image, bytes: longer than the longest path of a system.
const LONGEST_NAME: u64 = 1 << 15;

/// Bytes of a point of an image: X and Y (f64) and POINT3D_ID (u64).
const POINT: u64 = 24;

pub(super) fn lenses(file: File, name: &'static str) -> Result<Lenses, Fault> {
    let length = file.metadata()?.len();
    cameras_of(&mut Bytes::new(BufReader::new(file), length), name)
}

pub(super) fn images(file: File, lenses: &Lenses) -> Result<Vec<NamedCamera>, Fault> {
    let length = file.metadata()?.len();
    images_of(&mut Bytes::new(BufReader::new(file), length), lenses)
}

fn cameras_of(bytes: &mut Bytes<impl BufRead + Seek>, name: &'static str) -> Result<Lenses, Fault> {
    let count = bytes.count("camera", 24 + 3 * 8)?;
    let mut lenses = Lenses::new(name);
    for _ in 0..count {
        bytes.next();
        let (id, number) = (bytes.u32()?, bytes.u32()? as i32);
        let size = [bytes.u64()?, bytes.u64()?];
        let model = Model::of_number(number)
            .ok_or_else(|| bytes.fault(&format!("there is no camera model with the number {number}")))?;
        let parameters = (0..model.parameters()).map(|_| bytes.f64()).collect::<Result<Vec<_>, _>>()?;
        let camera = || {
            if let Some(value) = parameters.iter().find(|value| !value.is_finite()) {
                return Err(format!("its PARAMS, '{value}', is not a number"));
            }
            let [width, height] = size.map(u32::try_from);
            let (Ok(width), Ok(height)) = (width, height) else {
                return Err(format!("an image of {}x{} pixels is too large", size[0], size[1]));
            };
            model.camera((width, height), &parameters)
        };
        lenses.add(id.into(), camera(), &bytes.place());
    }
    Ok(lenses)
}

fn images_of(bytes: &mut Bytes<impl BufRead + Seek>, lenses: &Lenses) -> Result<Vec<NamedCamera>, Fault> {
    let count = bytes.count("image", 4 + 7 * 8 + 4 + 1 + 8)?;
    let mut images = Vec::new();
    for _ in 0..count {
        bytes.next();
        bytes.u32()?;
        let mut pose = [0.0; 7];
        for value in &mut pose {
            *value = bytes.f64()?;
        }
        let id = bytes.u32()?;
        let name = bytes.name()?;
        if pose.iter().any(|value| !value.is_finite()) {
            return Err(bytes.fault("its pose has a value that is not a number"));
        }
        images.push(lenses.image(&name, pose, id.into()).map_err(|what| bytes.fault(&what))?);
        let points = bytes.u64()?;
        let skipped = points.checked_mul(POINT).filter(|bytes_of_points| *bytes_of_points <= bytes.left);
        let skipped = skipped.ok_or_else(|| bytes.fault(&format!("it has no space for its {points} points")))?;
        bytes.skip(skipped)?;
    }
    Ok(images)
}

/// The bytes of a file, and the record that is being read, for messages.
struct Bytes<R> {
    reader: R,
    /// Bytes that were not read yet.
    left: u64,
    record: &'static str,
    number: u64,
    count: u64,
}

impl<R: BufRead + Seek> Bytes<R> {
    fn new(reader: R, length: u64) -> Self {
        Self { reader, left: length, record: "record", number: 0, count: 0 }
    }

    /// Reads the number of records, which have at least `least` bytes each.
    fn count(&mut self, record: &'static str, least: u64) -> Result<u64, Fault> {
        self.record = record;
        let count = self.u64()?;
        if count > self.left / least {
            let left = self.left;
            return Err(Fault::Malformed(format!("it announces {count} {record}s, but {left} bytes follow")));
        }
        self.count = count;
        Ok(count)
    }

    /// Begins the next record.
    fn next(&mut self) {
        self.number += 1;
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        self.left = self.left.checked_sub(N as u64).ok_or_else(|| self.ended())?;
        let mut bytes = [0; N];
        self.reader.read_exact(&mut bytes).map_err(|error| match error.kind() {
            std::io::ErrorKind::UnexpectedEof => self.ended(),
            _ => Fault::Io(error),
        })?;
        Ok(bytes)
    }

    fn u32(&mut self) -> Result<u32, Fault> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, Fault> {
        self.take().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64, Fault> {
        self.take().map(f64::from_le_bytes)
    }

    /// Reads a text that ends with a zero.
    fn name(&mut self) -> Result<String, Fault> {
        let mut name = Vec::new();
        let read = self.reader.by_ref().take(LONGEST_NAME.min(self.left)).read_until(0, &mut name)?;
        self.left -= read as u64;
        if name.pop() != Some(0) {
            return Err(self.fault("its NAME does not end with a zero"));
        }
        String::from_utf8(name).map_err(|_| self.fault("its NAME is not UTF-8 text"))
    }

    /// Skips bytes, of which there are at least as many left.
    fn skip(&mut self, bytes: u64) -> Result<(), Fault> {
        self.left -= bytes;
        let by = i64::try_from(bytes).map_err(|_| self.ended())?;
        Ok(self.reader.seek_relative(by)?)
    }

    fn ended(&self) -> Fault {
        match self.number {
            0 => Fault::Malformed(format!("it ends before its number of {}s", self.record)),
            _ => self.fault("the file ends in it"),
        }
    }

    /// The current record, for messages.
    fn place(&self) -> String {
        format!("{} {} of {}", self.record, self.number, self.count)
    }

    fn fault(&self, what: &str) -> Fault {
        Fault::Malformed(format!("{}: {what}", self.place()))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::io::Cursor;

    fn said(fault: Fault) -> String {
        match fault {
            Fault::Malformed(what) | Fault::Usage(what) => what,
            Fault::Io(error) => error.to_string(),
        }
    }

    fn bytes(bytes: &[u8]) -> Bytes<Cursor<&[u8]>> {
        Bytes::new(Cursor::new(bytes), bytes.len() as u64)
    }

    /// The bytes of a file with one camera.
    fn camera(model: i32, [width, height]: [u64; 2], parameters: &[f64]) -> Vec<u8> {
        let mut file =
            [1u64.to_le_bytes().to_vec(), 7u32.to_le_bytes().to_vec(), model.to_le_bytes().to_vec()].concat();
        file.extend([width, height].map(u64::to_le_bytes).as_flattened());
        parameters.iter().for_each(|value| file.extend(value.to_le_bytes()));
        file
    }

    /// The bytes of a file with one image of camera 7 without points.
    fn image(pose: [f64; 7], name: &[u8]) -> Vec<u8> {
        let mut file = [&1u64.to_le_bytes()[..], &3u32.to_le_bytes()].concat();
        pose.iter().for_each(|value| file.extend(value.to_le_bytes()));
        [&file[..], &7u32.to_le_bytes(), name, &0u64.to_le_bytes()].concat()
    }

    #[test]
    fn damage_is_said_with_its_place() {
        let pinhole = [50.0, 51.0, 32.0, 24.0];
        let lenses = || cameras_of(&mut bytes(&camera(1, [64, 48], &pinhole)), "cameras.bin").map_err(said).unwrap();
        let pose = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let good = image(pose, b"a b.png\0");
        assert_eq!(images_of(&mut bytes(&good), &lenses()).map_err(said).unwrap()[0].name, "a b");
        // A file that is cut anywhere is refused.
        for end in 0..good.len() {
            assert!(images_of(&mut bytes(&good[..end]), &lenses()).is_err(), "{end}");
        }
        let mut many = image(pose, b"a\0");
        let last = many.len() - 8;
        many[last..].copy_from_slice(&(1u64 << 60).to_le_bytes());
        for (file, what) in [
            (many, "image 1 of 1: it has no space for its 1152921504606846976 points"),
            ((1u64 << 60).to_le_bytes().to_vec(), "it announces 1152921504606846976 images, but 0 bytes follow"),
            (image(pose, &[b'a'; 70_000]), "image 1 of 1: its NAME does not end with a zero"),
            (image(pose, b"\xff\0"), "image 1 of 1: its NAME is not UTF-8 text"),
            (image(pose, b"..\0"), "image 1 of 1: its NAME is not a valid file name"),
            (image([f64::NAN; 7], b"a\0"), "image 1 of 1: its pose has a value that is not a number"),
            (image([0.0; 7], b"a\0"), "image 1 of 1: its quaternion has the length 0, not 1"),
            (vec![1; 5], "it ends before its number of images"),
        ] {
            assert_eq!(said(images_of(&mut bytes(&file), &lenses()).err().unwrap()), what);
        }
    }

    #[test]
    fn cameras_that_cannot_be_used_are_said_with_their_place() {
        let pose = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        for (file, what) in [
            (camera(1, [64, 48], &[f64::INFINITY; 4]), "its PARAMS, 'inf', is not a number"),
            (camera(1, [1 << 40, 48], &[50.0; 4]), "an image of 1099511627776x48 pixels is too large"),
        ] {
            let lenses = cameras_of(&mut bytes(&file), "cameras.bin").map_err(said).unwrap();
            let fault = images_of(&mut bytes(&image(pose, b"a\0")), &lenses).err().unwrap();
            let place = "image 1 of 1: its camera 7 cannot be used, camera 1 of 1 of cameras.bin: ";
            assert_eq!(said(fault), format!("{place}{what}"));
        }
        for (file, what) in [
            (camera(99, [64, 48], &[50.0; 4]), "camera 1 of 1: there is no camera model with the number 99"),
            (camera(-1, [64, 48], &[50.0; 4]), "camera 1 of 1: there is no camera model with the number -1"),
            (camera(4, [64, 48], &[50.0; 7]), "camera 1 of 1: the file ends in it"),
        ] {
            assert_eq!(said(cameras_of(&mut bytes(&file), "cameras.bin").err().unwrap()), what);
        }
    }
}
