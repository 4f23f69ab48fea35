//! The camera of a picture, from options, camera files and, by default, the scene.

use std::fmt::Display;
use std::path::Path;

use glam::DVec3;
use serde::Serialize;

use super::extent::Extent;
use crate::error::{Error, Result};
use crate::io::camera::{self, CameraFile, Pose};
use crate::options::CameraOptions;
use crate::options::parse::{up_argument, vector_argument};
use crate::options::values::Ortho;
use crate::progress::Progress;
use crate::scene::camera::check_near;
use crate::scene::framing::{Others, fitted_height};
use crate::scene::lens::DEFAULT_FOV;
use crate::scene::{Camera, Lens, Scene, Side, Up};

/// A view, complete except for values from the scene, such as the scene's centre.
///
/// `View::default()` shows the whole scene.
#[derive(Clone, Debug)]
pub struct View(Kind);

#[derive(Clone, Debug)]
enum Kind {
    Given(Given),
    Camera(Camera),
}

/// A view as options or a camera file give it.
#[derive(Clone, Debug)]
struct Given {
    size: (u32, u32),
    lens: Lens,
    place: Place,
    near: Option<f64>,
    source: Source,
}

/// Where a lens is given.
#[derive(Clone, Copy, Debug)]
enum Source {
    Options,
    /// The file of `--camera`.
    File,
    /// A file of many cameras.
    Set,
}

#[derive(Clone, Debug)]
enum Place {
    /// Framed to show the whole scene.
    Framed {
        /// The side, if it is given.
        side: Option<Side>,
        /// The direction of up, if it is given.
        up: Option<DVec3>,
        /// The view is orthographic, and as high as the scene needs.
        fits: bool,
    },
    /// At this eye, looking at the scene's centre, with this direction of up if it is given.
    Eye(DVec3, Option<DVec3>),
    /// A given pose.
    Pose(Pose),
}

impl Default for View {
    fn default() -> Self {
        let (size, lens) = (Self::DEFAULT_SIZE, Lens::Fov(DEFAULT_FOV));
        let place = Place::Framed { side: None, up: None, fits: false };
        Self(Kind::Given(Given { size, lens, place, near: None, source: Source::Options }))
    }
}

impl From<Camera> for View {
    fn from(camera: Camera) -> Self {
        Self(Kind::Camera(camera))
    }
}

impl View {
    /// The default size of a picture, pixels.
    pub const DEFAULT_SIZE: (u32, u32) = (1024, 1024);

    /// The default size of a picture of the whole sphere, pixels.
    pub const SPHERE_SIZE: (u32, u32) = (2048, 1024);

    /// Returns the view that the options describe.
    ///
    /// # Errors
    /// [`Error::Usage`] for options that give no camera, or an error of reading a camera file.
    pub fn new(options: &CameraOptions) -> Result<Self> {
        if let Some(path) = &options.file {
            return Self::of_file(options, camera::read(path)?, path, None);
        }
        if options.pixel_size.is_some() {
            return Err(Error::Usage("a view has no pixel size: render a map by it (Renderer::grid and map)".into()));
        }
        let (lens, option) = options.lens();
        let default = if lens == Lens::Equirectangular { Self::SPHERE_SIZE } else { Self::DEFAULT_SIZE };
        let size = options.size.unwrap_or(default);
        if lens == Lens::Equirectangular && (options.fov.is_some() || options.intrinsics.is_some()) {
            return Err(Error::Usage(
                "--projection equirectangular shows the whole sphere: leave --fov and --intrinsics out".into(),
            ));
        }
        if lens.optics().is_some() && options.eye.is_none() {
            return Err(Error::Usage("--projection sees all around a point: give it by --eye".into()));
        }
        lens.intrinsics(size.0, size.1).map_err(|error| said_by(option, error))?;
        check_near_option(options)?;
        let fits = options.ortho == Some(Ortho::Fit);
        if fits && options.eye.is_some() {
            return Err(Error::Usage("--ortho needs its HEIGHT with --eye: without --eye the scene decides it".into()));
        }
        let place = match (options.eye, options.target) {
            (None, _) => Place::Framed { side: options.side()?, up: options.up, fits },
            (Some(eye), None) => Place::Eye(eye, options.up),
            (Some(eye), Some(target)) => Place::Pose(Pose::LookAt(eye, target, options.up)),
        };
        Given { size, lens, place, near: options.near, source: Source::Options }.checked()
    }

    /// Returns the view of `file`, a camera that was read from `path`. The options may supply size
    /// and near depth. The size in the file is multiplied by `scale`.
    ///
    /// # Errors
    /// [`Error::Usage`] if file and options contradict each other or give no camera.
    pub fn of_file(options: &CameraOptions, file: CameraFile, path: &Path, scale: Option<f64>) -> Result<Self> {
        if let (Some(size), Some(own)) = (options.size, file.size)
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
        if scale.is_some() && file.size.is_none() {
            let path = path.display();
            return Err(Error::Usage(format!(
                "--scale needs pictures of known size, which {path} does not give: take --size"
            )));
        }
        check_near_option(options)?;
        let file = file.scaled(scale.unwrap_or(1.0));
        let default = if file.lens == Lens::Equirectangular { Self::SPHERE_SIZE } else { Self::DEFAULT_SIZE };
        let size = file.size.or(options.size).unwrap_or(default);
        let near = options.near.or(file.near);
        let source = if options.file.is_some() { Source::File } else { Source::Set };
        let view = Given { size, lens: file.lens, place: Place::Pose(file.pose), near, source };
        view.checked().map_err(|error| said_by(path.display(), error))
    }

    /// Returns the camera of the view and the point that it looks at. `others` hold the other
    /// shares of the scene.
    pub(super) fn camera(&self, scene: &Scene, extent: &Extent, others: &dyn Others) -> Result<(Camera, Seen)> {
        match &self.0 {
            Kind::Given(given) => given.camera(scene, extent, others),
            Kind::Camera(camera) => Ok((camera.clone(), Seen::of_pose(camera, extent.middle(scene)))),
        }
    }

    /// How users get a pinhole in place of the view's lens; empty if there is no such way, or the
    /// view is one.
    pub(super) fn as_pinhole(&self) -> &'static str {
        match &self.0 {
            Kind::Given(Given { lens, .. }) if lens.optics().is_none() => "",
            Kind::Given(Given { source: Source::Options, .. }) => "leave --projection out",
            Kind::Given(Given { source: Source::File, .. }) => "take a camera file without a model",
            Kind::Given(Given { source: Source::Set, lens: Lens::Curved(..), .. }) => "take --ignore-distortion",
            Kind::Given(_) | Kind::Camera(_) => "",
        }
    }

    /// Whether the view is placed so that the whole scene shows.
    pub(super) fn is_framed(&self) -> bool {
        matches!(&self.0, Kind::Given(Given { place: Place::Framed { .. }, .. }))
    }

    /// Returns the number of pixels of the picture.
    pub fn pixels(&self) -> u64 {
        let (width, height) = match &self.0 {
            Kind::Given(given) => given.size,
            Kind::Camera(camera) => (camera.width, camera.height),
        };
        u64::from(width) * u64::from(height)
    }
}

impl Given {
    /// Checks the view with stand-ins for values from the scene, such as the scene's centre.
    ///
    /// Errors thus come before the inputs are read, which may take minutes.
    fn checked(self) -> Result<View> {
        let stand_in = match &self.place {
            Place::Pose(pose) => pose.clone(),
            Place::Framed { side, up, .. } => {
                if let (Some(side), Some(_)) = (side, up) {
                    side.view(*up, Up::Z)?;
                }
                let across = up.filter(|up| *up != DVec3::ZERO).map_or(DVec3::X, |up| up.any_orthogonal_vector());
                Pose::LookAt(DVec3::ZERO, across, *up)
            }
            Place::Eye(..) => Pose::LookAt(DVec3::ZERO, DVec3::X, None),
        };
        self.posed(&stand_in, Up::Z, self.near.unwrap_or(1.0))?;
        Ok(View(Kind::Given(self)))
    }

    fn posed(&self, pose: &Pose, up: Up, near: f64) -> Result<Camera> {
        match *pose {
            Pose::Rigid(rotation, eye) => Camera::posed(self.size, self.lens, eye, rotation, near),
            Pose::LookAt(eye, target, own_up) => Camera::look_at(self.size, self.lens, eye, target, own_up, up, near),
        }
    }

    /// Returns the camera of the view and the point that it looks at.
    fn camera(&self, scene: &Scene, extent: &Extent, others: &dyn Others) -> Result<(Camera, Seen)> {
        let near = self.near.unwrap_or_else(|| extent.near(scene));
        let (pose, up, by) = match &self.place {
            Place::Framed { side, up, fits } => {
                let lens = match fits {
                    true => Lens::OrthographicHeight(fitted_height(self.size, (scene, others), (*side, *up))?),
                    false => self.lens,
                };
                let (camera, target) = Camera::framing_among(self.size, lens, (scene, others), near, (*side, *up))?;
                // Near the vertical, the printed view would else have another roll.
                let up = match side {
                    Some(side) if side.is_steep() => Some(side.view(*up, scene.up)?.1),
                    _ => *up,
                };
                return Ok((camera, Seen { target, up, by: By::Choice }));
            }
            Place::Eye(eye, up) => (&Pose::LookAt(*eye, extent.middle(scene), *up), *up, By::Choice),
            Place::Pose(pose @ Pose::LookAt(.., up)) => (pose, *up, By::Arguments),
            Place::Pose(pose @ Pose::Rigid(..)) => (pose, None, By::Pose),
        };
        let camera = self.posed(pose, scene.up, near)?;
        Ok(match *pose {
            Pose::LookAt(_, target, _) => (camera, Seen { target, up, by }),
            Pose::Rigid(..) => {
                let seen = Seen::of_pose(&camera, extent.middle(scene));
                (camera, seen)
            }
        })
    }
}

/// The point that a camera looks at, and its direction of up.
#[derive(Clone, Copy)]
pub(super) struct Seen {
    /// The point, world coordinates. For a pose of a file it is at the depth of the scene's centre.
    target: DVec3,
    /// Direction of up from the options or the pose; None for the scene's.
    up: Option<DVec3>,
    by: By,
}

impl Seen {
    /// Returns the point that a camera with known rotation and eye looks at.
    fn of_pose(camera: &Camera, middle: DVec3) -> Self {
        let distance = camera.to_camera(middle).z.max(camera.near);
        let target = camera.eye + camera.rotation.row(2) * distance;
        Self { target, up: Some(-camera.rotation.row(1)), by: By::Pose }
    }
}

/// Source of a view's pose.
#[derive(Clone, Copy, PartialEq)]
enum By {
    /// The scene decides; only the eye or up may be given.
    Choice,
    /// Eye and target of the options or of a file.
    Arguments,
    /// A rotation and an eye.
    Pose,
}

/// Angle between the line of sight and up, degrees, below which up barely fixes the picture's roll.
const NEARLY_UP: f64 = 5.0;

/// Roll of a picture, degrees, up to which no warning is printed.
const TURNED: f64 = 1.0;

/// A view as the options that reproduce it, world coordinates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewReport {
    /// Position of the camera.
    pub eye: [f64; 3],
    /// Point that the camera looks at.
    pub target: [f64; 3],
    /// Direction of up.
    pub up: [f64; 3],
    /// Source of the direction of up.
    because: &'static str,
    /// Warning about the picture's roll, if the line of sight is nearly along up.
    #[serde(skip_serializing_if = "Option::is_none")]
    turned: Option<String>,
}

impl ViewReport {
    /// Describes `camera`, which looks at `seen`. `guessed` is true if the scene's up is a guess.
    pub(super) fn new(camera: &Camera, seen: &Seen, scene: &Scene, guessed: bool) -> Self {
        let because = match (seen.up, guessed, scene.up) {
            (Some(_), ..) if seen.by == By::Pose => "as the camera says",
            (Some(_), ..) => "as asked for",
            (None, false, _) => "as the file or its format says",
            (None, true, Up::Z) => "a guess, as the points lie flat",
            (None, true, Up::Y) => "a guess",
        };
        let given = seen.up.unwrap_or(scene.up.axis());
        let forward = camera.rotation.row(2);
        // A camera that looks along the scene's up uses the other axis as up.
        let is_along = seen.up.is_none() && forward.cross(given).length() <= 1e-3;
        let up = if is_along { scene.up.other() } else { given };
        let turned = if is_along || seen.by == By::Pose { None } else { turned(camera, up, scene.up) };
        Self { eye: camera.eye.into(), target: seen.target.into(), up: up.into(), because, turned }
    }

    /// Notes the view, and its warning.
    pub(super) fn tell(&self, progress: &dyn Progress) {
        progress.note(&self.sentence());
        self.warning().iter().for_each(|warning| progress.note(warning));
    }

    /// Returns the options in one line, with the source of up.
    pub fn sentence(&self) -> String {
        let [eye, target] = [self.eye, self.target].map(|v| vector_argument(v.into()));
        format!("view: --eye {eye} --target {target} --up {} ({})", up_argument(self.up.into()), self.because)
    }

    /// Returns the warning about the picture's roll, if there is one.
    pub fn warning(&self) -> Option<String> {
        self.turned.as_ref().map(|turned| format!("warning: {turned}"))
    }
}

/// Returns a warning if a view is nearly along `up` and its picture is rolled.
///
/// Such a picture's roll is fixed by the small component of up across the line of sight.
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
            "the view is only {off:.1} degrees off the direction of up, which thus barely fixes the picture's roll: {name} is \
             {angle:.0} degrees from its top; {option} turns it to the top"
        )
    })
}

/// Returns an error of a value, prefixed with the option or file that it came from.
fn said_by(who: impl Display, error: Error) -> Error {
    Error::Usage(format!("{who}: {error}"))
}

fn check_near_option(options: &CameraOptions) -> Result<()> {
    options.near.map_or(Ok(()), check_near).map_err(|error| said_by("--near", error))
}
