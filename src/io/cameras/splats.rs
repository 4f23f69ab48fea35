//! `cameras.json` of 3D Gaussian Splatting: a list of objects with `id`, `img_name`, `width`,
//! `height`, `position`, `rotation`, `fx` and `fy`.
//!
//! `rotation` has the rows of the camera-to-world rotation, with x right, y down, z forward. The
//! principal point is the centre of the image.

use glam::{DMat3, DVec3};
use serde::Deserialize;
use serde_json::Value;

use super::{NamedCamera, name_of};
use crate::io::camera::{CameraFile, Pose};
use crate::io::values::one_line;
use crate::scene::Lens;

#[derive(Deserialize)]
struct Raw {
    img_name: Option<String>,
    width: u32,
    height: u32,
    position: [f64; 3],
    rotation: [[f64; 3]; 3],
    fx: f64,
    fy: f64,
}

/// Whether a file is of this kind: a list whose first entry has a position and a rotation.
pub(super) fn is(file: &Value) -> bool {
    file.get(0).is_some_and(|first| first.get("position").is_some() && first.get("rotation").is_some())
}

pub(super) fn read(file: &Value, _: (u32, u32)) -> Result<Vec<NamedCamera>, String> {
    let all = file.as_array().map(Vec::as_slice).unwrap_or_default();
    let of_entry = |(index, entry): (usize, &Value)| {
        camera(index, entry).map_err(|what| format!("camera {} of the list: {what}", index + 1))
    };
    all.iter().enumerate().map(of_entry).collect()
}

fn camera(index: usize, entry: &Value) -> Result<NamedCamera, String> {
    let raw = Raw::deserialize(entry).map_err(|error| one_line(&error.to_string()))?;
    let name = match &raw.img_name {
        None => format!("{index:04}"),
        Some(name) => name_of(name).ok_or("its img_name is not a valid file name")?,
    };
    let [width, height] = [raw.width, raw.height].map(f64::from);
    let to_camera = DMat3::from_cols_array_2d(&raw.rotation);
    let camera = CameraFile {
        size: Some((raw.width, raw.height)),
        lens: Lens::Intrinsics([raw.fx, raw.fy, 0.5 * width, 0.5 * height]),
        pose: Pose::Rigid(to_camera, DVec3::from_array(raw.position)),
        near: None,
    };
    Ok(NamedCamera { name, camera, undrawn: None })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::*;

    fn one(own: &str) -> Result<NamedCamera, String> {
        let text = format!(
            r#"[{{"id": 0, {own} "width": 640, "height": 480, "position": [3, 4, 5],
                "rotation": [[0, 0, 1], [1, 0, 0], [0, 1, 0]], "fx": 500, "fy": 510}}]"#
        );
        let file = serde_json::from_str(&text).unwrap();
        assert!(is(&file));
        read(&file, (8, 8)).map(|cameras| cameras[0].clone())
    }

    #[test]
    fn poses_are_camera_to_world_with_y_down_and_z_forward() {
        let camera = one(r#""img_name": "left/a.jpg","#).unwrap();
        assert_eq!((camera.name.as_str(), camera.camera.size), ("left/a", Some((640, 480))));
        assert_eq!(camera.camera.lens, Lens::Intrinsics([500.0, 510.0, 320.0, 240.0]));
        let Pose::Rigid(rotation, eye) = camera.camera.pose else { panic!() };
        assert_eq!(eye, DVec3::new(3.0, 4.0, 5.0));
        // The columns of `rotation` are the camera's axes: right is the world's y, down its z,
        // forward its x.
        assert_eq!((rotation * DVec3::Y, rotation * DVec3::Z, rotation * DVec3::X), (DVec3::X, DVec3::Y, DVec3::Z));
        assert_eq!(one("").unwrap().name, "0000");
    }

    #[test]
    fn what_is_missing_is_said() {
        let message = one(r#""img_name": "..","#).unwrap_err();
        assert_eq!(message, "camera 1 of the list: its img_name is not a valid file name");
        let file = serde_json::from_str(r#"[{"position": [0, 0, 0], "rotation": 5}]"#).unwrap();
        assert!(is(&file));
        let message = read(&file, (8, 8)).unwrap_err();
        assert!(message.starts_with("camera 1 of the list: invalid type"), "{message}");
    }
}
