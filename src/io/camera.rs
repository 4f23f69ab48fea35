//! Camera files: one JSON object.
//!
//! ```json
//! { "width": 1920, "height": 1080, "fx": 1400, "fy": 1400, "cx": 960, "cy": 540,
//!   "camera_to_world": [[1,0,0,0], [0,-1,0,0], [0,0,-1,5], [0,0,0,1]] }
//! ```
//!
//! Camera space is x right, y down, z forward. The pose is `camera_to_world` or `world_to_camera`
//! (4x4, rows), or `eye`, `target` and optionally `up`. The lens is `fx fy cx cy` in pixels, or
//! `fov` (vertical, degrees). With `"model": "orthographic"` the lens is `fx fy cx cy` in pixels
//! per world unit, or `height_world`. With `"model": "fisheye"` it is `fx fy cx cy` in pixels per
//! radian, or `fov` across the width; with `"model": "equirectangular"` it is the whole sphere.

use std::path::Path;

use glam::{DMat3, DVec3};
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::io::input::text;
use crate::io::values::one_line;
use crate::scene::lens::{DEFAULT_FISHEYE, DEFAULT_FOV};
use crate::scene::{Form, Lens, Optics};

/// The content of a camera file.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraFile {
    /// Width and height in pixels, if given.
    pub size: Option<(u32, u32)>,
    /// The lens: intrinsics, field of view or height of view.
    pub lens: Lens,
    /// Position and orientation.
    pub pose: Pose,
    /// Near depth, if given.
    pub near: Option<f64>,
}

/// Position and orientation of a camera.
#[derive(Clone, Debug, PartialEq)]
pub enum Pose {
    /// World-to-camera rotation, and the eye in world coordinates.
    Rigid(DMat3, DVec3),
    /// Eye, target and up, in world coordinates.
    LookAt(DVec3, DVec3, Option<DVec3>),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    #[serde(default)]
    model: Model,
    width: Option<u32>,
    height: Option<u32>,
    fx: Option<f64>,
    fy: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    fov: Option<f64>,
    height_world: Option<f64>,
    eye: Option<[f64; 3]>,
    target: Option<[f64; 3]>,
    up: Option<[f64; 3]>,
    camera_to_world: Option<[[f64; 4]; 4]>,
    world_to_camera: Option<[[f64; 4]; 4]>,
    near: Option<f64>,
}

#[derive(Clone, Copy, Default, Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Model {
    #[default]
    Pinhole,
    Orthographic,
    Fisheye,
    Equirectangular,
}

/// Reads a camera file.
pub fn read(path: &Path) -> Result<CameraFile> {
    let text = text(path)?;
    parse(&text).map_err(|what| Error::malformed(path, what))
}

impl CameraFile {
    /// Scales width and height of the image by `scale`, and rounds them; the field of view stays
    /// the same. A camera without a size is unchanged.
    pub fn scaled(self, scale: f64) -> Self {
        let Some((width, height)) = self.size else { return self };
        // Rounds to at least one pixel, unless the size is 0. Sizes that are too large saturate;
        // these sizes and 0 are refused where sizes are checked.
        let scaled = |side: u32| if side == 0 { 0 } else { (f64::from(side) * scale).round().max(1.0) as u32 };
        let size = (scaled(width), scaled(height));
        let (x, y) = (f64::from(size.0) / f64::from(width), f64::from(size.1) / f64::from(height));
        let pixels = |[fx, fy, cx, cy]: [f64; 4]| [fx * x, fy * y, cx * x, cy * y];
        let lens = match self.lens {
            Lens::Intrinsics(values) => Lens::Intrinsics(pixels(values)),
            Lens::OrthographicScale(values) => Lens::OrthographicScale(pixels(values)),
            Lens::Curved(optics, values) => Lens::Curved(optics, pixels(values)),
            lens @ (Lens::Fov(_) | Lens::OrthographicHeight(_) | Lens::Fisheye(_) | Lens::Equirectangular) => lens,
        };
        Self { size: Some(size), lens, ..self }
    }

    /// This camera as a pinhole with the focal lengths of its model and the same principal point,
    /// if its lens has such; `None` for other cameras.
    pub fn as_pinhole(&self) -> Option<Self> {
        match self.lens {
            Lens::Curved(optics, [fx, fy, cx, cy]) => {
                let per = optics.per_focal();
                Some(Self { lens: Lens::Intrinsics([fx * per, fy * per, cx, cy]), ..self.clone() })
            }
            _ => None,
        }
    }
}

fn parse(text: &str) -> std::result::Result<CameraFile, String> {
    let raw: Raw = serde_json::from_str(text).map_err(|e| format!("not a camera: {}", one_line(&e.to_string())))?;
    of_raw(raw)
}

/// The camera that a JSON object describes.
pub(super) fn of_value(value: serde_json::Value) -> std::result::Result<CameraFile, String> {
    let raw: Raw = serde_json::from_value(value).map_err(|e| format!("not a camera: {}", one_line(&e.to_string())))?;
    of_raw(raw)
}

fn of_raw(raw: Raw) -> std::result::Result<CameraFile, String> {
    let size = match (raw.width, raw.height) {
        (Some(width), Some(height)) => Some((width, height)),
        (None, None) => None,
        _ => return Err("a camera gives both width and height, or neither".into()),
    };
    let intrinsics = match (raw.fx, raw.fy, raw.cx, raw.cy) {
        (None, None, None, None) => None,
        (Some(fx), fy, Some(cx), Some(cy)) => Some([fx, fy.unwrap_or(fx), cx, cy]),
        _ => return Err("intrinsics need fx, cx and cy (and fy, if it differs)".into()),
    };
    let lens = match (raw.model, intrinsics, raw.fov, raw.height_world) {
        (Model::Pinhole, Some(values), None, None) => Lens::Intrinsics(values),
        (Model::Pinhole, None, fov, None) => Lens::Fov(fov.unwrap_or(DEFAULT_FOV)),
        (Model::Orthographic, Some(values), None, None) => Lens::OrthographicScale(values),
        (Model::Orthographic, None, None, Some(height)) => Lens::OrthographicHeight(height),
        (Model::Fisheye, Some(values), None, None) => Lens::Curved(Optics::of(Form::Fisheye), values),
        (Model::Fisheye, None, fov, None) => Lens::Fisheye(fov.unwrap_or(DEFAULT_FISHEYE)),
        (Model::Equirectangular, None, None, None) => Lens::Equirectangular,
        (Model::Equirectangular, ..) => {
            return Err(
                "an equirectangular camera shows the whole sphere: leave fx, fy, cx, cy, fov and height_world out"
                    .into(),
            );
        }
        (Model::Orthographic, None, None, None) => {
            return Err("an orthographic camera needs height_world, or fx, cx and cy".into());
        }
        _ => return Err("the camera gives its lens twice: take one of fx..cy, fov and height_world".into()),
    };
    if intrinsics.is_some() && size.is_none() {
        return Err("intrinsics are in pixels, so the camera needs width and height".into());
    }
    let pose = match (raw.camera_to_world, raw.world_to_camera, raw.eye, raw.target) {
        (Some(matrix), None, None, None) => {
            let (rotation, eye) = rigid(matrix)?;
            Pose::Rigid(rotation.transpose(), eye)
        }
        (None, Some(matrix), None, None) => {
            let (rotation, shift) = rigid(matrix)?;
            Pose::Rigid(rotation, -(rotation.transpose() * shift))
        }
        (None, None, Some(eye), Some(target)) => Pose::LookAt(eye.into(), target.into(), raw.up.map(Into::into)),
        (None, None, ..) => return Err("the camera needs eye and target, camera_to_world or world_to_camera".into()),
        _ => return Err("the camera gives its pose twice".into()),
    };
    if raw.up.is_some() && matches!(pose, Pose::Rigid(..)) {
        return Err("a pose matrix contains the up direction: leave `up` out".into());
    }
    Ok(CameraFile { size, lens, pose, near: raw.near })
}

/// The rotation and translation of a 4x4 matrix, given by rows; the last row must be 0 0 0 1.
pub(super) fn rigid(rows: [[f64; 4]; 4]) -> std::result::Result<(DMat3, DVec3), String> {
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err("the last row of a pose matrix must be 0 0 0 1".into());
    }
    let column = |k: usize| DVec3::new(rows[0][k], rows[1][k], rows[2][k]);
    Ok((DMat3::from_cols(column(0), column(1), column(2)), column(3)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_two_matrices_are_inverse_to_each_other() {
        let inner = r#""width": 8, "height": 8, "fx": 5, "cx": 4, "cy": 4"#;
        let a =
            parse(&format!(r#"{{{inner}, "camera_to_world": [[0,0,1,3],[1,0,0,4],[0,1,0,5],[0,0,0,1]]}}"#)).unwrap();
        let b =
            parse(&format!(r#"{{{inner}, "world_to_camera": [[0,1,0,-4],[0,0,1,-5],[1,0,0,-3],[0,0,0,1]]}}"#)).unwrap();
        assert_eq!(a, b);
        assert_eq!(a.lens, Lens::Intrinsics([5.0, 5.0, 4.0, 4.0]));
        let Pose::Rigid(rotation, eye) = a.pose else { unreachable!() };
        assert_eq!(eye, DVec3::new(3.0, 4.0, 5.0));
        assert_eq!(rotation * DVec3::X, DVec3::Z);
    }

    #[test]
    fn what_a_file_says_cannot_break_the_message() {
        for name in ["a\\nb", "\u{85}", "\\u001b[2J", &"long".repeat(10_000)] {
            let message = parse(&format!(r#"{{"{name}":1}}"#)).unwrap_err();
            assert!(!message.chars().any(char::is_control) && message.len() < 400, "{message}");
            assert!(
                message.starts_with("not a camera: unknown field `") && message.contains(" at line 1 "),
                "{message}"
            );
        }
    }

    #[test]
    fn contradictions_are_refused() {
        for bad in [
            "",
            "[]",
            "{}",
            r#"{"eye":[0,0,1]}"#,
            r#"{"eye":[0,0,1],"target":[0,0,0],"fov":40,"height_world":3}"#,
            r#"{"eye":[0,0,1],"target":[0,0,0],"fx":40,"cx":3,"cy":3}"#,
            r#"{"eye":[0,0,1],"target":[0,0,0],"typo":1}"#,
            r#"{"eye":[0,0,1],"target":[0,0,0],"model":"orthographic"}"#,
            r#"{"eye":[0,0,1],"target":[0,0,0],"world_to_camera":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}"#,
            r#"{"world_to_camera":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]]}"#,
            r#"{"eye":[0,0,1],"target":[0,0,0],"width":5}"#,
        ] {
            assert!(parse(bad).is_err(), "{bad}");
        }
        assert!(parse(r#"{"eye":[0,0,1],"target":[0,0,0]}"#).is_ok());
    }
}
