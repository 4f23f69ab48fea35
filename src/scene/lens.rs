//! The intrinsics of a camera before its pose and image size are known.

use std::f64::consts::{PI, TAU};

use super::camera::{LARGEST, Projection};
use super::optics::{Form, Optics};
use crate::error::{Error, Result};

/// The default vertical field of view, degrees.
pub const DEFAULT_FOV: f64 = 45.0;

/// The default field of view of a fisheye across the width of its image, degrees.
pub const DEFAULT_FISHEYE: f64 = 180.0;

/// The intrinsics of a camera before its pose and image size are known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// Vertical field of view in degrees, principal point in the centre.
    Fov(f64),
    /// `[fx, fy, cx, cy]` in pixels.
    Intrinsics([f64; 4]),
    /// Orthographic: the height of the image in world units.
    OrthographicHeight(f64),
    /// Orthographic `[fx, fy, cx, cy]`: pixels per world unit, and pixels.
    OrthographicScale([f64; 4]),
    /// A lens that is no pinhole, with `[fx, fy, cx, cy]` in pixels.
    Curved(Optics, [f64; 4]),
    /// An equidistant fisheye: the field of view across the image's width in degrees, principal
    /// point in the centre.
    Fisheye(f64),
    /// The whole sphere: longitude across the image's width, latitude down its height.
    Equirectangular,
}

impl Lens {
    /// The projection and `[fx, fy, cx, cy]` for images of `width` x `height`.
    ///
    /// Focal lengths are in pixels (pinhole) or pixels per world unit (orthographic), the principal
    /// point in pixels.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] for a field of view outside 0 to 180 degrees, or numbers beyond the
    /// device's range.
    pub fn intrinsics(self, width: u32, height: u32) -> Result<(Projection, [f64; 4])> {
        let (w, h) = (f64::from(width), f64::from(height));
        let (projection, values) = match self {
            Self::Fov(degrees) => {
                if !(degrees > 0.0 && degrees < 180.0) {
                    return Err(Error::Usage(format!(
                        "a field of view lies between 0 and 180 degrees, {degrees:?} does not"
                    )));
                }
                let f = 0.5 * h / (0.5 * degrees.to_radians()).tan();
                (Projection::Pinhole, [f, f, 0.5 * w, 0.5 * h])
            }
            Self::Intrinsics(values) => (Projection::Pinhole, values),
            Self::OrthographicHeight(world) => {
                let f = h / world;
                if !(1.0 / LARGEST..=LARGEST).contains(&f) {
                    return Err(Error::Usage(format!(
                        "the height of an orthographic view must be positive and within reason, {world:?} is not"
                    )));
                }
                (Projection::Orthographic, [f, f, 0.5 * w, 0.5 * h])
            }
            Self::OrthographicScale(values) => (Projection::Orthographic, values),
            Self::Curved(optics, values) if optics.is_usable() => (Projection::Pinhole, values),
            Self::Curved(..) => {
                return Err(Error::Usage(
                    "the lens shows nothing: its distortion folds the image at its centre".into(),
                ));
            }
            Self::Fisheye(degrees) => {
                if !(degrees > 0.0 && degrees <= 360.0) {
                    return Err(Error::Usage(format!(
                        "the field of view of a fisheye lies between 0 and 360 degrees, {degrees:?} does not"
                    )));
                }
                let f = w / degrees.to_radians();
                (Projection::Pinhole, [f, f, 0.5 * w, 0.5 * h])
            }
            Self::Equirectangular => (Projection::Pinhole, [w / TAU, h / PI, 0.5 * w, 0.5 * h]),
        };
        let [fx, fy, cx, cy] = values;
        let scale = 1.0 / LARGEST..=LARGEST;
        if !(scale.contains(&fx) && scale.contains(&fy) && cx.abs() <= 1e9 && cy.abs() <= 1e9) {
            return Err(Error::Usage(format!(
                "the camera's scale must be positive and its numbers within reason: fx = {fx}, fy = {fy}, cx = {cx}, \
                 cy = {cy}"
            )));
        }
        Ok((projection, values))
    }

    /// The lens beyond its intrinsics; `None` for a pinhole or an orthographic view.
    pub fn optics(self) -> Option<Optics> {
        match self {
            Self::Curved(optics, _) => Some(optics),
            Self::Fisheye(_) => Some(Optics::of(Form::Fisheye)),
            Self::Equirectangular => Some(Optics::of(Form::Equirectangular)),
            Self::Fov(_) | Self::Intrinsics(_) | Self::OrthographicHeight(_) | Self::OrthographicScale(_) => None,
        }
    }
}
