//! `camera_path.json` of nerfstudio: one object, with an object for each picture in `camera_path`.
//!
//! `camera_to_world` has the 16 numbers of a matrix, row by row, with the axes of OpenGL: x right,
//! y up, z back. `fov` is the vertical field of view in degrees. Pixels are square, as nerfstudio
//! draws them: the size is `render_width` x `render_height`, and `aspect` is not used.

use glam::{DMat3, DVec3};
use serde::Deserialize;
use serde_json::Value;

use super::NamedCamera;
use crate::io::camera::{CameraFile, Pose, rigid};
use crate::io::values::{one_line, shown};
use crate::scene::{Form, Lens, Optics};

#[derive(Deserialize)]
struct Raw {
    camera_type: Option<String>,
    render_width: Option<f64>,
    render_height: Option<f64>,
    camera_path: Vec<Value>,
}

#[derive(Deserialize)]
struct Entry {
    camera_to_world: [f64; 16],
    fov: f64,
}

/// Whether a file is of this kind: an object with a list `camera_path`.
pub(super) fn is(file: &Value) -> bool {
    file.get("camera_path").is_some_and(Value::is_array)
}

pub(super) fn read(file: &Value, _: (u32, u32)) -> Result<Vec<NamedCamera>, String> {
    let raw = Raw::deserialize(file).map_err(|error| one_line(&error.to_string()))?;
    let form = match raw.camera_type.as_deref() {
        None => Form::Perspective,
        Some(kind) => kind.parse().map_err(|_| {
            let kind = shown(kind.as_bytes());
            format!("the camera_type '{kind}' is not drawn: perspective, fisheye and equirectangular cameras are")
        })?,
    };
    let pixels = |key: &str, number: f64| {
        let pixels = number as u32;
        (f64::from(pixels) == number).then_some(pixels).ok_or(format!("its {key} is not a number of pixels"))
    };
    let size = match (raw.render_width, raw.render_height) {
        (Some(width), Some(height)) => Some((pixels("render_width", width)?, pixels("render_height", height)?)),
        (None, None) => None,
        _ => return Err("a size is both render_width and render_height".into()),
    };
    let of_entry = |(index, entry): (usize, &Value)| {
        let camera =
            camera(entry, size, form).map_err(|what| format!("camera {} of camera_path: {what}", index + 1))?;
        Ok(NamedCamera { name: format!("{index:04}"), camera, undrawn: None })
    };
    raw.camera_path.iter().enumerate().map(of_entry).collect()
}

fn camera(entry: &Value, size: Option<(u32, u32)>, form: Form) -> Result<CameraFile, String> {
    let Entry { camera_to_world: m, fov } = Entry::deserialize(entry).map_err(|error| one_line(&error.to_string()))?;
    let row = |k: usize| [m[4 * k], m[4 * k + 1], m[4 * k + 2], m[4 * k + 3]];
    let (to_world, eye) = rigid([row(0), row(1), row(2), row(3)])?;
    let turned = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let pose = Pose::Rigid((to_world * turned).transpose(), eye);
    let lens = match (form, size) {
        (Form::Perspective, _) => Lens::Fov(fov),
        (Form::Equirectangular, _) => Lens::Equirectangular,
        (Form::Fisheye, None) => return Err("a fisheye needs render_width and render_height".into()),
        // nerfstudio takes the focal length of a pinhole with this field of view.
        (Form::Fisheye, Some((width, height))) => {
            let [width, height] = [width, height].map(f64::from);
            let f = 0.5 * height / (0.5 * fov.to_radians()).tan();
            Lens::Curved(Optics::of(Form::Fisheye), [f, f, 0.5 * width, 0.5 * height])
        }
    };
    Ok(CameraFile { size, lens, pose, near: None })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::*;

    fn parse(head: &str, entry: &str) -> Result<Vec<NamedCamera>, String> {
        let file = serde_json::from_str(&format!(r#"{{{head} "camera_path": [{entry}]}}"#)).unwrap();
        assert!(is(&file));
        read(&file, (8, 8))
    }

    const ENTRY: &str = r#"{"camera_to_world": [1,0,0,3, 0,0,-1,4, 0,1,0,5, 0,0,0,1], "fov": 50, "aspect": 1.5}"#;

    #[test]
    fn poses_are_camera_to_world_with_y_up_and_z_back() {
        let cameras = parse(r#""camera_type": "perspective", "render_width": 96, "render_height": 64.0,"#, ENTRY);
        let NamedCamera { name, camera, .. } = &cameras.unwrap()[0];
        assert_eq!((name.as_str(), camera.size, camera.lens), ("0000", Some((96, 64)), Lens::Fov(50.0)));
        let Pose::Rigid(rotation, eye) = camera.pose else { panic!() };
        assert_eq!(eye, DVec3::new(3.0, 4.0, 5.0));
        // Up in the picture (the camera's y) is the world's z; the view (its -z) is the world's y.
        assert_eq!((rotation * DVec3::X, rotation * DVec3::Z, rotation * DVec3::Y), (DVec3::X, -DVec3::Y, DVec3::Z));
        assert_eq!(parse("", ENTRY).unwrap()[0].camera.size, None);
        let sized = r#""camera_type": "fisheye", "render_width": 96, "render_height": 64,"#;
        let Lens::Curved(optics, [fx, fy, cx, cy]) = parse(sized, ENTRY).unwrap()[0].camera.lens else { panic!() };
        assert_eq!((optics, cx, cy), (Optics::of(Form::Fisheye), 48.0, 32.0));
        assert!((fx - 32.0 / 25f64.to_radians().tan()).abs() < 1e-9 && fx == fy, "{fx} {fy}");
        let sphere = parse(r#""camera_type": "equirectangular","#, ENTRY).unwrap();
        assert_eq!(sphere[0].camera.lens, Lens::Equirectangular);
    }

    #[test]
    fn what_is_wrong_is_said() {
        for (head, entry, said) in [
            (r#""camera_type": "vr180","#, ENTRY, "the camera_type 'vr180' is not drawn"),
            (r#""camera_type": "fisheye","#, ENTRY, "camera 1 of camera_path: a fisheye needs render_width"),
            (r#""render_width": 96,"#, ENTRY, "a size is both render_width and render_height"),
            (r#""render_width": 96.5, "render_height": 64,"#, ENTRY, "its render_width is not a number of pixels"),
            ("", r#"{"camera_to_world": [1, 2], "fov": 50}"#, "camera 1 of camera_path: invalid length 2"),
            ("", "5", "camera 1 of camera_path: invalid type"),
            (
                "",
                r#"{"camera_to_world": [1,0,0,3, 0,0,-1,4, 0,1,0,5, 0,0,0,2], "fov": 50}"#,
                "camera 1 of camera_path: the last row of a pose matrix must be 0 0 0 1",
            ),
        ] {
            let message = parse(head, entry).unwrap_err();
            assert!(message.starts_with(said), "{message}");
        }
    }
}
