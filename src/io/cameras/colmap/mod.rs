//! COLMAP's models: a folder with lenses in `cameras.bin` or `cameras.txt` and poses in
//! `images.bin` or `images.txt`.
//!
//! Sizes and parameters are in pixels; the centre of the first pixel is (0.5, 0.5). The quaternion
//! and the translation of an image map world coordinates to camera coordinates: x right, y down, z
//! forward.

mod binary;
mod models;
mod text;

use std::collections::HashMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};

use self::models::Camera;
pub(super) use self::models::Model;
use super::{NamedCamera, name_of};
use crate::error::{Error, Result};
use crate::io::camera::{CameraFile, Pose};
use crate::io::fault::Fault;
use crate::io::input::check_regular;

/// Folders of a project in which programs store its model. The first one with a model is read.
const PLACES: [&str; 4] = ["", "sparse/0", "sparse", "colmap/sparse/0"];

/// The files of a model: lenses and poses. Binary files are read if there are both kinds, as COLMAP
/// does.
const FORMS: [Form; 2] = [
    Form { cameras: "cameras.bin", images: "images.bin", lenses: binary::lenses, poses: binary::images },
    Form { cameras: "cameras.txt", images: "images.txt", lenses: text::lenses, poses: text::images },
];

/// A form of COLMAP's files, with its readers.
struct Form {
    cameras: &'static str,
    images: &'static str,
    lenses: fn(File, &'static str) -> Result<Lenses, Fault>,
    poses: fn(File, &Lenses) -> Result<Vec<NamedCamera>, Fault>,
}

/// A model that was found: its form and its folder.
struct Found(&'static Form, PathBuf);

impl Found {
    /// Finds the first whole model, or else the first file of lenses, whose poses are missing.
    fn of(folder: &Path) -> Option<Self> {
        let all = || PLACES.iter().flat_map(|place| FORMS.iter().map(move |form| Self(form, folder.join(place))));
        let is_whole = |found: &Self| found.files().iter().all(|file| file.exists());
        all().find(is_whole).or_else(|| all().find(|found| found.files()[0].exists()))
    }

    fn files(&self) -> [PathBuf; 2] {
        [self.0.cameras, self.0.images].map(|name| self.1.join(name))
    }
}

/// The files of the model in `folder` or in its project: lenses and poses.
pub(super) fn files(folder: &Path) -> Option<[PathBuf; 2]> {
    Found::of(folder).map(|found| found.files())
}

/// Reads the model in `folder` or in its project. Returns the file of the poses, and the cameras.
pub(super) fn read(folder: &Path) -> Result<(PathBuf, Vec<NamedCamera>)> {
    let found = Found::of(folder).ok_or_else(|| {
        let what = "it has no COLMAP model: cameras.bin and images.bin, or cameras.txt and images.txt, in the folder \
                    itself, in sparse/0, in sparse or in colmap/sparse/0";
        Error::malformed(folder, what)
    })?;
    let (form, [cameras, images]) = (found.0, found.files());
    let lenses = opened(&cameras).and_then(|file| (form.lenses)(file, form.cameras));
    let lenses = lenses.map_err(|fault| fault.of(&cameras))?;
    let poses = opened(&images).and_then(|file| (form.poses)(file, &lenses));
    Ok((images.clone(), poses.map_err(|fault| fault.of(&images))?))
}

fn opened(path: &Path) -> Result<File, Fault> {
    let open = || -> io::Result<File> {
        check_regular(path)?;
        File::open(path)
    };
    Ok(open()?)
}

/// The cameras by identifier, and the name of their file.
struct Lenses {
    file: &'static str,
    /// For a camera that cannot be used, the map has its place in the file and the reason: only
    /// images that refer to this camera are errors.
    cameras: HashMap<u64, Result<Camera, String>>,
}

impl Lenses {
    fn new(file: &'static str) -> Self {
        Self { file, cameras: HashMap::new() }
    }

    /// Adds the camera `id`, which stands at `place` in the file.
    fn add(&mut self, id: u64, camera: Result<Camera, String>, place: &str) {
        let camera = if self.cameras.contains_key(&id) { Err(format!("there is another camera {id}")) } else { camera };
        self.cameras.insert(id, camera.map_err(|what| format!("{place} of {}: {what}", self.file)));
    }

    /// The camera of an image with a pose of QW, QX, QY, QZ, TX, TY, TZ; the error is one clause.
    fn image(&self, name: &str, pose: [f64; 7], id: u64) -> Result<NamedCamera, String> {
        let name = name_of(name).ok_or("its NAME is not a valid file name")?;
        let lens = self.cameras.get(&id).ok_or_else(|| format!("there is no camera {id} in {}", self.file))?;
        let lens = lens.as_ref().map_err(|what| format!("its camera {id} cannot be used, {what}"))?;
        let [w, x, y, z, tx, ty, tz] = pose;
        let quaternion = DQuat::from_xyzw(x, y, z, w);
        let length = quaternion.length();
        if !(0.99..=1.01).contains(&length) {
            return Err(format!("its quaternion has the length {length}, not 1"));
        }
        let rotation = DMat3::from_quat(quaternion.normalize());
        let eye = -(rotation.transpose() * DVec3::new(tx, ty, tz));
        let camera =
            CameraFile { size: Some(lens.size), lens: lens.lens, pose: Pose::Rigid(rotation, eye), near: None };
        Ok(NamedCamera { name, camera, undrawn: lens.undrawn })
    }
}
