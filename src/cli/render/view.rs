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
        if let Some(path) = &arguments.camera.file {
            return Self::of_file(arguments, camera::read(path)?, path);
        }
        let (lens, option) = match (arguments.camera.intrinsics, arguments.camera.ortho) {
            (Some(values), _) => (Lens::Intrinsics(values), "--intrinsics"),
            (None, Some(height)) => (Lens::OrthographicHeight(height), "--ortho"),
            (None, None) => (Lens::Fov(arguments.camera.fov.unwrap_or(DEFAULT_FOV)), "--fov"),
        };
        let size = arguments.camera.size.unwrap_or(DEFAULT_SIZE);
        lens.intrinsics(size.0, size.1).map_err(|error| said_by(option, error))?;
        check_near_argument(arguments)?;
        let place = match (arguments.camera.eye, arguments.camera.target) {
            (None, _) => Place::Framed(arguments.camera.up),
            (Some(eye), None) => Place::Eye(eye, arguments.camera.up),
            (Some(eye), Some(target)) => Place::Pose(Pose::LookAt(eye, target, arguments.camera.up)),
        };
        Self { size, lens, place, near: arguments.camera.near }.checked()
    }

    /// What a camera of the file at `path` says, and the arguments that add to it.
    pub(super) fn of_file(arguments: &Arguments, file: CameraFile, path: &Path) -> Result<Self> {
        if let (Some(size), Some(own)) = (arguments.camera.size, file.size)
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
        if arguments.camera.scale.is_some() && file.size.is_none() {
            let path = path.display();
            return Err(Error::Usage(format!(
                "--scale needs pictures of known size, which {path} does not give: take --size"
            )));
        }
        check_near_argument(arguments)?;
        let file = file.scaled(arguments.camera.scale.unwrap_or(1.0));
        let size = file.size.or(arguments.camera.size).unwrap_or(DEFAULT_SIZE);
        let near = arguments.camera.near.or(file.near);
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

    /// The camera of the view, and what it looks at; `default_near` is [`Camera::default_near`] of
    /// the scene.
    pub(super) fn camera(&self, scene: &Scene, default_near: f64) -> Result<(Camera, Seen)> {
        let near = self.near.unwrap_or(default_near);
        let (pose, up, by) = match &self.place {
            Place::Framed(up) => {
                let (camera, target) = Camera::framing_up(self.size, self.lens, scene, near, *up)?;
                return Ok((camera, Seen { target, up: *up, by: By::Choice }));
            }
            Place::Eye(eye, up) => {
                let center = scene.origin + scene.framed().0.center();
                (&Pose::LookAt(*eye, center, *up), *up, By::Choice)
            }
            Place::Pose(pose @ Pose::LookAt(.., up)) => (pose, *up, By::Arguments),
            Place::Pose(pose @ Pose::Rigid(..)) => (pose, None, By::File),
        };
        let camera = self.posed(pose, scene.up, near)?;
        Ok(match *pose {
            Pose::LookAt(_, target, _) => (camera, Seen { target, up, by }),
            Pose::Rigid(rotation, eye) => {
                let distance = camera.to_camera(scene.origin + scene.framed().0.center()).z.max(near);
                let target = eye + camera.rotation.row(2) * distance;
                (camera, Seen { target, up: Some(-rotation.row(1)), by })
            }
        })
    }

    /// Pixels of the picture.
    pub(super) fn pixels(&self) -> u64 {
        u64::from(self.size.0) * u64::from(self.size.1)
    }
}

/// The point that a camera looks at, and its up.
#[derive(Clone, Copy)]
pub(super) struct Seen {
    /// World coordinates.
    pub target: DVec3,
    /// Up as it was given, or as it follows from a pose.
    up: Option<DVec3>,
    by: By,
}

/// The source of a view.
#[derive(Clone, Copy, PartialEq)]
enum By {
    /// It was chosen to show the scene, up apart.
    Choice,
    /// The options or a file.
    Arguments,
    /// A file, as a pose.
    File,
}

/// Degrees: where the line of sight is nearer to up than this, up says little of how the picture is
/// turned.
const NEARLY_UP: f64 = 5.0;

/// Degrees by which a picture may be turned without a word.
const TURNED: f64 = 1.0;

/// A view in the words of the options that give it again.
#[derive(Serialize)]
pub(super) struct ToldView {
    eye: [f64; 3],
    target: [f64; 3],
    up: [f64; 3],
    /// Why up is what it is.
    because: &'static str,
    /// How the picture is turned, where up says little of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    turned: Option<String>,
}

impl ToldView {
    /// The words for `camera`, which looks at `seen`; the scene's up may have been `guessed`.
    pub(super) fn new(camera: &Camera, seen: &Seen, scene: &Scene, guessed: bool) -> Self {
        let because = match (seen.up, guessed, scene.up) {
            (Some(_), ..) if seen.by == By::File => "as the file of the camera says",
            (Some(_), ..) => "as asked for",
            (None, false, _) => "as the file or its format says",
            (None, true, Up::Z) => "a guess, as the points lie flat",
            (None, true, Up::Y) => "a guess",
        };
        let given = seen.up.unwrap_or(scene.up.axis());
        let forward = camera.rotation.row(2);
        // Along up itself the camera takes the other axis.
        let is_along = seen.up.is_none() && forward.cross(given).length() <= 1e-3;
        let up = if is_along { scene.up.other() } else { given };
        let turned = if is_along || seen.by == By::File { None } else { turned(camera, up, scene.up) };
        Self { eye: camera.eye.into(), target: seen.target.into(), up: up.into(), because, turned }
    }

    /// The options, and why.
    pub(super) fn sentence(&self) -> String {
        let [eye, target] = [self.eye, self.target].map(|v| vector_argument(v.into()));
        format!("view: --eye {eye} --target {target} --up {} ({})", up_argument(self.up.into()), self.because)
    }

    /// How the picture is turned, where that may surprise.
    pub(super) fn warning(&self) -> Option<String> {
        self.turned.as_ref().map(|turned| format!("warning: {turned}"))
    }
}

/// How the picture of a view nearly along `up` is turned: what lies across up decides that, however
/// little it is.
fn turned(camera: &Camera, up: DVec3, scene_up: Up) -> Option<String> {
    let up = up.normalize();
    let (forward, top) = (camera.rotation.row(2), -camera.rotation.row(1));
    let off = forward.dot(up).abs().min(1.0).acos().to_degrees();
    let (axis, name, option) = match scene_up {
        Up::Z => (DVec3::Y, "north (+y)", "--up y"),
        Up::Y => (-DVec3::Z, "-z", "--up=-z"),
    };
    let shown = axis.reject_from_normalized(forward);
    if off > NEARLY_UP || shown.length() < 0.5 {
        return None;
    }
    let angle = shown.angle_between(top).to_degrees();
    (angle > TURNED).then(|| {
        format!(
            "the view is {off:.1} degrees off the direction of up, which so says little of how the picture is turned: {name} lies \
             {angle:.0} degrees from its top; {option} puts it there"
        )
    })
}

/// An error of a value, with the option or the file that gave it.
fn said_by(who: impl Display, error: Error) -> Error {
    Error::Usage(format!("{who}: {error}"))
}

fn check_near_argument(arguments: &Arguments) -> Result<()> {
    arguments.camera.near.map_or(Ok(()), check_near).map_err(|error| said_by("--near", error))
}
