//! The camera of a picture, as far as arguments and camera files decide it.

use std::fmt::Display;
use std::path::Path;

use epsplat::io::camera::{self, CameraFile, Pose};
use epsplat::scene::camera::{DEFAULT_FOV, check_near};
use epsplat::scene::{Camera, Lens, Scene, Up};
use epsplat::{Error, Result};
use glam::DVec3;
use serde::Serialize;

use super::super::parse::{up_argument, vector_argument};
use super::Arguments;

pub(super) const DEFAULT_SIZE: (u32, u32) = (1024, 1024);

/// A view, which lacks at most what the scene decides.
pub(super) struct View {
    size: (u32, u32),
    lens: Lens,
    place: Place,
    near: Option<f64>,
}

enum Place {
    /// Chosen to show the scene, with this up if there is one.
    Framed(Option<DVec3>),
    /// At the eye; looks at the scene's centre.
    Eye(DVec3, Option<DVec3>),
    /// As given.
    Pose(Pose),
}

impl View {
    /// What the arguments say, `--cameras` apart.
    pub(super) fn of(arguments: &Arguments) -> Result<Self> {
        if let Some(path) = &arguments.camera {
            return Self::of_file(arguments, camera::read(path)?, path);
        }
        let (lens, option) = match (arguments.intrinsics, arguments.ortho) {
            (Some(values), _) => (Lens::Intrinsics(values), "--intrinsics"),
            (None, Some(height)) => (Lens::OrthographicHeight(height), "--ortho"),
            (None, None) => (Lens::Fov(arguments.fov.unwrap_or(DEFAULT_FOV)), "--fov"),
        };
        let size = arguments.size.unwrap_or(DEFAULT_SIZE);
        lens.intrinsics(size.0, size.1).map_err(|error| said_by(option, error))?;
        check_near_argument(arguments)?;
        let place = match (arguments.eye, arguments.target) {
            (None, _) => Place::Framed(arguments.up),
            (Some(eye), None) => Place::Eye(eye, arguments.up),
            (Some(eye), Some(target)) => Place::Pose(Pose::LookAt(eye, target, arguments.up)),
        };
        Self { size, lens, place, near: arguments.near }.checked()
    }

    /// What a camera of the file at `path` says, and the arguments that add to it.
    pub(super) fn of_file(arguments: &Arguments, file: CameraFile, path: &Path) -> Result<Self> {
        if let (Some(size), Some(own)) = (arguments.size, file.size)
            && size != own
        {
            return Err(Error::Usage(format!(
                "--size {}x{} contradicts {}, which says {}x{}",
                size.0,
                size.1,
                path.display(),
                own.0,
                own.1
            )));
        }
        if arguments.scale.is_some() && file.size.is_none() {
            let path = path.display();
            return Err(Error::Usage(format!(
                "--scale needs pictures of known size, which {path} does not give: take --size"
            )));
        }
        check_near_argument(arguments)?;
        let file = file.scaled(arguments.scale.unwrap_or(1.0));
        let size = file.size.or(arguments.size).unwrap_or(DEFAULT_SIZE);
        let near = arguments.near.or(file.near);
        let view = Self { size, lens: file.lens, place: Place::Pose(file.pose), near };
        view.checked().map_err(|error| said_by(path.display(), error))
    }

    /// What the arguments decide is refused before minutes of reading: only the scene's centre is not known yet.
    fn checked(self) -> Result<Self> {
        let stand_in = match &self.place {
            Place::Pose(pose) => pose.clone(),
            Place::Framed(up) => {
                let across = up.filter(|up| *up != DVec3::ZERO).map_or(DVec3::X, |up| up.any_orthogonal_vector());
                Pose::LookAt(DVec3::ZERO, across, *up)
            }
            Place::Eye(..) => Pose::LookAt(DVec3::ZERO, DVec3::X, None),
        };
        self.posed(&stand_in, Up::Z, self.near.unwrap_or(1.0))?;
        Ok(self)
    }

    fn posed(&self, pose: &Pose, up: Up, near: f64) -> Result<Camera> {
        match *pose {
            Pose::Rigid(rotation, eye) => Camera::posed(self.size, self.lens, eye, rotation, near),
            Pose::LookAt(eye, target, own_up) => Camera::look_at(self.size, self.lens, eye, target, own_up, up, near),
        }
    }

    /// The camera of the view, and what it looks at, world coordinates, where nobody said so; `default_near` is
    /// [`Camera::default_near`] of the scene.
    pub(super) fn camera(&self, scene: &Scene, default_near: f64) -> Result<(Camera, Option<[DVec3; 2]>)> {
        let near = self.near.unwrap_or(default_near);
        let camera = match &self.place {
            Place::Framed(up) => {
                let (camera, target) = Camera::framing_up(self.size, self.lens, scene, near, *up)?;
                let eye = camera.eye;
                return Ok((camera, Some([eye, target])));
            }
            Place::Eye(eye, up) => {
                let center = scene.origin + scene.framed().0.center();
                self.posed(&Pose::LookAt(*eye, center, *up), scene.up, near)
            }
            Place::Pose(pose) => self.posed(pose, scene.up, near),
        };
        Ok((camera?, None))
    }

    /// Pixels of the picture.
    pub(super) fn pixels(&self) -> u64 {
        u64::from(self.size.0) * u64::from(self.size.1)
    }
}

/// A view that was chosen to show the scene, in the words of the options that give it again.
#[derive(Serialize)]
pub(super) struct ChosenView {
    eye: [f64; 3],
    target: [f64; 3],
    up: [f64; 3],
    /// Why up is what it is.
    because: &'static str,
}

impl ChosenView {
    /// From `eye` to `target`; up is `given` or the scene's, which may have been `guessed`.
    pub(super) fn new([eye, target]: [DVec3; 2], scene: &Scene, given: Option<DVec3>, guessed: bool) -> Self {
        let because = match (given, guessed, scene.up) {
            (Some(_), ..) => "as asked for",
            (None, false, _) => "as the file or its format says",
            (None, true, Up::Z) => "a guess, as the points lie flat",
            (None, true, Up::Y) => "a guess",
        };
        let up = given.unwrap_or(scene.up.axis());
        Self { eye: eye.into(), target: target.into(), up: up.into(), because }
    }

    /// The options, and why.
    pub(super) fn sentence(&self) -> String {
        let [eye, target] = [self.eye, self.target].map(|v| vector_argument(v.into()));
        format!("view: --eye {eye} --target {target} --up {} ({})", up_argument(self.up.into()), self.because)
    }
}

/// An error of a value, with the option or the file that gave it.
fn said_by(who: impl Display, error: Error) -> Error {
    Error::Usage(format!("{who}: {error}"))
}

fn check_near_argument(arguments: &Arguments) -> Result<()> {
    arguments.near.map_or(Ok(()), check_near).map_err(|error| said_by("--near", error))
}
