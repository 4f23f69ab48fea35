//! `transforms.json`: one object, with an object for each picture in `frames`. A frame may have the
//! keys of a camera file instead, and a list of frames may stand alone.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use serde_json::Value;

use super::colmap::Model;
use super::{NamedCamera, name_of};
use crate::io::camera::{CameraFile, Pose, of_value, rigid};
use crate::io::values::shown;
use crate::scene::Lens;

/// Keys of coefficients of distortion.
const DISTORTIONS: [&str; 12] = ["k", "k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "sx1", "sy1", "omega"];

/// The name of a whole sphere's camera model.
const SPHERE: &str = "EQUIRECTANGULAR";

/// Keys of a pose in a camera file.
const POSES: [&str; 4] = ["eye", "target", "camera_to_world", "world_to_camera"];

/// Groups of a camera file's keys that may stand beside `frames` for all of them. A frame that has
/// one key of a group has the group for itself.
const SHARED: [&[&str]; 4] =
    [&["width", "height"], &["model", "fx", "fy", "cx", "cy", "fov", "height_world"], &["up"], &["near"]];

/// Keys of a lens that only frames with a `transform_matrix` use.
const OF_TRANSFORMS: [&str; 8] =
    ["w", "h", "fl_x", "fl_y", "camera_angle_x", "camera_angle_y", "camera_model", "is_fisheye"];

/// Whether a file is of this kind: a list, or an object with a list `frames`.
pub(super) fn is(file: &Value) -> bool {
    frames(file).is_some()
}

fn frames(file: &Value) -> Option<&[Value]> {
    file.as_array().or_else(|| file.get("frames")?.as_array()).map(Vec::as_slice)
}

pub(super) fn read(file: &Value, size: (u32, u32)) -> Result<Vec<NamedCamera>, String> {
    let of_frame = |(index, own): (usize, &Value)| {
        let frame = Frame { own, shared: file };
        frame.camera(index, size).map_err(|what| format!("frame {}{}: {what}", index + 1, frame.shown()))
    };
    frames(file).unwrap_or_default().iter().enumerate().map(of_frame).collect()
}

/// A frame, and the object of the file, whose values apply to all frames.
struct Frame<'a> {
    own: &'a Value,
    shared: &'a Value,
}

impl Frame<'_> {
    fn camera(&self, index: usize, size: (u32, u32)) -> Result<NamedCamera, String> {
        let name = match self.own.get("file_path") {
            None | Some(Value::Null) => format!("{index:04}"),
            Some(path) => path.as_str().and_then(name_of).ok_or("its file_path is not a valid file name")?,
        };
        if let Some(camera) = self.of_camera_file() {
            return Ok(NamedCamera { name, camera: camera?, undrawn: None });
        }
        let given = match (self.pixels("w")?, self.pixels("h")?) {
            (Some(width), Some(height)) => Some((width, height)),
            (None, None) => None,
            _ => return Err("a size is both w and h".into()),
        };
        let (width, height) = given.unwrap_or(size);
        // A frame without a pose is of another kind, so its lens tells nothing.
        let pose = self.pose()?;
        let (lens, undrawn) = self.bent_lens(f64::from(width), f64::from(height), given.is_some())?;
        let camera = CameraFile { size: given, lens, pose, near: None };
        Ok(NamedCamera { name, camera, undrawn })
    }

    /// The lens with its distortion, and the name of its model if that is not drawn.
    fn bent_lens(&self, width: f64, height: f64, sized: bool) -> Result<(Lens, Option<&'static str>), String> {
        let named = self.value("camera_model").map(|value| value.as_str().unwrap_or_default());
        if named == Some(SPHERE) {
            return Ok((Lens::Equirectangular, None));
        }
        let is_fisheye = self.value("is_fisheye").is_some_and(|is| is != &Value::Bool(false));
        let model = match named {
            Some(name) => Some(Model::of_name(name).ok_or_else(|| {
                let name = shown(name.as_bytes());
                format!("the camera_model '{name}' is not drawn; undistort the pictures first")
            })?),
            None => None,
        };
        let intrinsics = self.intrinsics(width, height, sized)?;
        if let Some(model) = model.filter(|model| model.is_undrawn()) {
            return Ok((Lens::Intrinsics(intrinsics), Some(model.name)));
        }
        let mut given = Vec::new();
        for key in DISTORTIONS {
            given.extend(self.number(key)?.filter(|value| *value != 0.0).map(|value| (key, value)));
        }
        let has = |key: &str| given.iter().any(|(name, _)| *name == key);
        // OpenCV's model with eight coefficients has a denominator. Others differ in their form.
        let name = match model {
            Some(model) if model.fisheye || !is_fisheye => model.name,
            _ if is_fisheye => "OPENCV_FISHEYE",
            _ => "OPENCV",
        };
        let name = if name == "OPENCV" && (has("k5") || has("k6")) { "FULL_OPENCV" } else { name };
        let model = Model::of_name(name).ok_or("its lens has no model")?;
        if let Some((key, _)) = given.iter().find(|(key, _)| !model.reads(key)) {
            return Err(format!("its {key} is no coefficient of the camera_model {name}"));
        }
        let of = |key: &str| given.iter().find(|(name, _)| *name == key).map_or(0.0, |(_, value)| *value);
        Ok((model.lens_of(intrinsics, &of), None))
    }

    /// The camera of a frame that has the keys of a camera file; `None` for other frames.
    fn of_camera_file(&self) -> Option<Result<CameraFile, String>> {
        if self.own.get("transform_matrix").is_some() {
            return None;
        }
        let own = self.own.as_object().filter(|own| POSES.iter().any(|key| own.contains_key(*key)))?;
        let mut object = own.clone();
        object.remove("file_path");
        for (key, value) in self.shared.as_object().into_iter().flatten() {
            let Some(group) = SHARED.iter().find(|group| group.contains(&key.as_str())) else {
                if OF_TRANSFORMS.contains(&key.as_str()) || DISTORTIONS.contains(&key.as_str()) {
                    return Some(Err(format!(
                        "'{key}' is for frames with a transform_matrix: a frame with {} takes width, height, fx, fy, \
                         cx, cy or fov",
                        POSES.iter().find(|pose| own.contains_key(**pose)).copied().unwrap_or_default()
                    )));
                }
                continue;
            };
            // A matrix contains up.
            let has_use = key != "up" || own.contains_key("eye");
            if has_use && !group.iter().any(|key| own.contains_key(*key)) {
                object.insert(key.clone(), value.clone());
            }
        }
        Some(of_value(Value::Object(object)))
    }

    /// `[fx, fy, cx, cy]` from focal lengths in pixels, or else from angles. Pixels are square if
    /// only one of fx and fy is known.
    fn intrinsics(&self, width: f64, height: f64, sized: bool) -> Result<[f64; 4], String> {
        // A frame's own angles come before lengths for all frames.
        let has_own = |key: &str| self.own.get(key).is_some_and(|value| !value.is_null());
        let of_own_angles =
            ["camera_angle_x", "camera_angle_y"].into_iter().any(has_own) && !["fl_x", "fl_y"].into_iter().any(has_own);
        let of_angle = |key: &str, side: f64| match self.number(key)?.filter(|_| !of_own_angles || has_own(key)) {
            Some(angle) if !(angle > 0.0 && angle < PI) => {
                Err(format!("its {key} must lie between 0 and pi (radians), but it is {angle:?}"))
            }
            angle => Ok(angle.map(|angle| 0.5 * side / (0.5 * angle).tan())),
        };
        let length = |key: &str| if of_own_angles { Ok(None) } else { self.number(key) };
        let pixels = [length("fl_x")?, length("fl_y")?, self.number("cx")?, self.number("cy")?];
        if !sized && pixels.iter().any(Option::is_some) {
            return Err("intrinsics are in pixels, so the camera needs w and h".into());
        }
        let [fl_x, fl_y, cx, cy] = pixels;
        let fx = if fl_x.is_some() { fl_x } else { of_angle("camera_angle_x", width)? };
        let fy = if fl_y.is_some() { fl_y } else { of_angle("camera_angle_y", height)? };
        let fx = fx.or(fy).ok_or("it gives neither fl_x nor camera_angle_x")?;
        let (cx, cy) = (cx.unwrap_or(0.5 * width), cy.unwrap_or(0.5 * height));
        Ok([fx, fy.unwrap_or(fx), cx, cy])
    }

    fn pose(&self) -> Result<Pose, String> {
        let matrix = self.own.get("transform_matrix").ok_or("it has neither a transform_matrix nor eye and target")?;
        let rows: [[f64; 4]; 4] =
            serde_json::from_value(matrix.clone()).map_err(|_| "its transform_matrix is not 4 rows of 4 numbers")?;
        let (to_world, eye) = rigid(rows)?;
        // From y up and z back to y down and z forward.
        let turned = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        Ok(Pose::Rigid((to_world * turned).transpose(), eye))
    }

    /// The frame's own value, or else the one for all frames.
    fn value(&self, key: &str) -> Option<&Value> {
        let given = |object: &'_ Value| object.get(key).is_some_and(|value| !value.is_null());
        if given(self.own) { self.own.get(key) } else { self.shared.get(key).filter(|value| !value.is_null()) }
    }

    fn number(&self, key: &str) -> Result<Option<f64>, String> {
        let number = |value: &Value| value.as_f64().ok_or_else(|| format!("its {key} is not a number"));
        self.value(key).map(number).transpose()
    }

    /// A number of pixels; programs also write it with a decimal point.
    fn pixels(&self, key: &str) -> Result<Option<u32>, String> {
        let whole = |number: f64| {
            let pixels = number as u32;
            (f64::from(pixels) == number).then_some(pixels).ok_or(format!("its {key} is not a number of pixels"))
        };
        self.number(key)?.map(whole).transpose()
    }

    /// The frame's `file_path` in brackets, for messages; empty if there is none.
    fn shown(&self) -> String {
        let name = self.own.get("file_path").and_then(Value::as_str);
        name.map_or(String::new(), |name| format!(" ({})", shown(name.as_bytes())))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::*;
    use crate::scene::{Form, Optics};

    fn parse(text: &str, size: (u32, u32)) -> Result<Vec<NamedCamera>, String> {
        super::super::parse(text, size)
    }

    const POSE: &str = r#""transform_matrix": [[1,0,0,3],[0,0,-1,4],[0,1,0,5],[0,0,0,1]]"#;

    fn one(shared: &str, own: &str) -> Result<NamedCamera, String> {
        let text = format!(r#"{{{shared} "frames": [{{"file_path": "./train/r_7", {own} {POSE}}}]}}"#);
        parse(&text, (400, 300)).map(|cameras| cameras[0].clone())
    }

    #[test]
    fn poses_are_camera_to_world_with_y_up_and_z_back() {
        let camera = one(r#""camera_angle_x": 1.5707963267948966,"#, "").unwrap();
        assert_eq!((camera.name.as_str(), camera.camera.size, camera.undrawn), ("train/r_7", None, None));
        let Pose::Rigid(rotation, eye) = camera.camera.pose else { panic!() };
        assert_eq!(eye, DVec3::new(3.0, 4.0, 5.0));
        // Up in the picture (the camera's y) is the world's z; the view (its -z) is the world's y.
        assert_eq!((rotation * DVec3::X, rotation * DVec3::Z, rotation * DVec3::Y), (DVec3::X, -DVec3::Y, DVec3::Z));
        let Lens::Intrinsics([fx, fy, cx, cy]) = camera.camera.lens else { panic!() };
        assert!((fx - 200.0).abs() < 1e-12 && fy == fx && (cx, cy) == (200.0, 150.0), "{fx} {fy} {cx} {cy}");
    }

    #[test]
    fn a_frames_own_lens_comes_before_that_of_all() {
        let shared = r#""w": 800.0, "h": 600, "fl_x": 500, "cx": 390.5, "k1": 0, "camera_model": "OPENCV","#;
        let lens = |own: &str| one(shared, own).unwrap().camera;
        assert_eq!(lens("").lens, Lens::Intrinsics([500.0, 500.0, 390.5, 300.0]));
        assert_eq!(lens("").size, Some((800, 600)));
        let own = lens(r#""fl_x": 700, "fl_y": 710, "cy": 310, "w": 640, "cx": null,"#);
        assert_eq!((own.lens, own.size), (Lens::Intrinsics([700.0, 710.0, 390.5, 310.0]), Some((640, 600))));
        // An angle of the frame's own too, before lengths for all.
        for shared in [shared.to_owned(), format!(r#"{shared} "fl_y": 600, "camera_angle_y": 1,"#)] {
            let camera = one(&shared, r#""camera_angle_x": 1.5707963267948966,"#).unwrap().camera;
            let Lens::Intrinsics([fx, fy, ..]) = camera.lens else { panic!() };
            assert!((fx - 400.0).abs() < 1e-9 && fy == fx, "{fx} {fy}");
        }
        let intrinsics = [500.0, 500.0, 390.5, 300.0];
        let bent = |optics: Optics| Lens::Curved(optics, intrinsics);
        let plain = Optics::of(Form::Perspective);
        let tangential = plain.with_tangential([0.0, -0.5]);
        assert_eq!(lens(r#""p2": -0.5,"#).lens, bent(tangential));
        assert_eq!(lens(r#""k1": 0.1, "k4": 0.2,"#).lens, bent(plain.with_radial([0.1, 0.0, 0.0, 0.2])));
        let rational = plain.with_radial([0.1, 0.0, 0.0, 0.0]).with_denominator([0.2, 0.0, 0.0]);
        assert_eq!(lens(r#""k1": 0.1, "k4": 0.2, "camera_model": "FULL_OPENCV","#).lens, bent(rational));
        for own in [r#""camera_model": "OPENCV_FISHEYE", "k1": 0.25,"#, r#""is_fisheye": true, "k1": 0.25,"#] {
            assert_eq!(lens(own).lens, bent(Optics::of(Form::Fisheye).with_radial([0.25, 0.0, 0.0, 0.0])));
        }
        assert_eq!(lens(r#""camera_model": "EQUIRECTANGULAR","#).lens, Lens::Equirectangular);
        // All coefficients of COLMAP's models are read by their own names.
        let radial = bent(plain.with_radial([0.3, 0.0, 0.0, 0.0]));
        assert_eq!(lens(r#""camera_model": "SIMPLE_RADIAL", "k": 0.3, "k1": null,"#).lens, radial);
        assert_eq!(lens(r#""camera_model": "SIMPLE_RADIAL", "k1": 0.3,"#).lens, radial);
        let prism = Optics::of(Form::Fisheye).with_prism([0.01, -0.02]);
        assert_eq!(lens(r#""camera_model": "THIN_PRISM_FISHEYE", "sx1": 0.01, "sy1": -0.02,"#).lens, bent(prism));
        let Lens::Curved(wide, [fx, ..]) = lens(r#""camera_model": "FOV", "omega": 0.5,"#).lens else { panic!() };
        assert_eq!((wide, fx), (Optics::field_of_view(0.5), 1000.0));
        let undrawn = one(shared, r#""camera_model": "RAD_TAN_THIN_PRISM_FISHEYE","#).unwrap();
        assert_eq!(
            (undrawn.camera.lens, undrawn.undrawn),
            (Lens::Intrinsics(intrinsics), Some("RAD_TAN_THIN_PRISM_FISHEYE"))
        );
    }

    #[test]
    fn frames_may_be_cameras_of_a_camera_file() {
        let own = r#"{"eye": [0,-5,2], "target": [0,0,0], "up": [0,0,1], "fov": 40, "width": 64, "height": 48}"#;
        for text in [format!("[{own}, {own}]"), format!(r#"{{"frames": [{own}, {own}]}}"#)] {
            let cameras = parse(&text, (8, 8)).unwrap();
            let CameraFile { size, lens, pose, .. } = &cameras[1].camera;
            assert_eq!((cameras[1].name.as_str(), *size, *lens), ("0001", Some((64, 48)), Lens::Fov(40.0)));
            assert_eq!(*pose, Pose::LookAt(DVec3::new(0.0, -5.0, 2.0), DVec3::ZERO, Some(DVec3::Z)));
        }
    }

    #[test]
    fn cameras_of_a_camera_file_share_what_stands_beside_frames() {
        let frames = r#""frames": [{"eye": [0,-5,2], "target": [0,0,0]},
                                   {"eye": [0,-5,2], "target": [0,0,0], "fx": 9, "cx": 1, "cy": 2, "up": [1,0,0]}]"#;
        let shared = r#""width": 64, "height": 48, "fov": 40, "up": [0,0,1], "near": 0.5"#;
        let cameras = parse(&format!("{{{shared}, {frames}}}"), (8, 8)).unwrap();
        let [first, second] = [0, 1].map(|k| cameras[k].camera.clone());
        assert_eq!((first.size, first.lens, first.near), (Some((64, 48)), Lens::Fov(40.0), Some(0.5)));
        assert!(matches!(first.pose, Pose::LookAt(_, _, Some(DVec3::Z))));
        assert_eq!((second.size, second.lens), (Some((64, 48)), Lens::Intrinsics([9.0, 9.0, 1.0, 2.0])));
        assert!(matches!(second.pose, Pose::LookAt(_, _, Some(DVec3::X))));
        for unused in [r#""fl_x": 5"#, r#""k1": 0.1"#] {
            let message = parse(&format!("{{{unused}, {frames}}}"), (8, 8)).unwrap_err();
            assert!(message.starts_with("frame 1: '") && message.contains("with eye takes"), "{message}");
        }
    }

    #[test]
    fn what_is_no_set_of_cameras_is_said() {
        for (shared, own, said) in [
            ("", "", "neither fl_x nor camera_angle_x"),
            (r#""fl_x": 5,"#, "", "needs w and h"),
            (r#""w": 8, "fl_x": 5,"#, "", "both w and h"),
            (r#""w": 8, "h": 7.5, "fl_x": 5,"#, "", "h is not a number of pixels"),
            (r#""w": -8, "h": 7, "fl_x": 5,"#, "", "w is not a number of pixels"),
            (r#""camera_angle_x": "wide","#, "", "camera_angle_x is not a number"),
            (r#""camera_angle_x": 1, "camera_model": "FISHEYE624","#, "", "'FISHEYE624'"),
            (r#""camera_angle_x": 3.2,"#, "", "camera_angle_x must lie between 0 and pi (radians), but it is 3.2"),
            (r#""camera_angle_x": 0,"#, "", "camera_angle_x must lie between 0 and pi"),
            (r#""camera_angle_x": 1, "camera_angle_y": -1,"#, "", "camera_angle_y must lie between 0 and pi"),
            (r#""camera_angle_x": 1,"#, r#""k2": [],"#, "k2 is not a number"),
            (r#""camera_angle_x": 1,"#, r#""omega": 0.5,"#, "its omega is no coefficient of the camera_model OPENCV"),
            (r#""camera_angle_x": 1, "camera_model": "FOV","#, r#""k1": 0.5,"#, "its k1 is no coefficient of"),
            (r#""camera_angle_x": 1, "is_fisheye": true,"#, r#""k5": 0.5,"#, "its k5 is no coefficient of"),
        ] {
            let message = one(shared, own).unwrap_err();
            assert!(message.starts_with("frame 1 (./train/r_7): ") && message.contains(said), "{message}");
        }
        for (text, said) in [
            ("", "not JSON"),
            ("5", "cameras are a transforms.json, "),
            (r#"[{"eye": [1,2,3]}]"#, "frame 1: the camera needs eye and target"),
            (r#"[{"eye": [1,2,3], "target": [0,0,0], "fl_x": 5}]"#, "unknown field"),
            (r#"{"frames": 5}"#, "(a single camera is given with --camera)"),
            (r#"{"frames": [5]}"#, "frame 1: it has neither a transform_matrix nor eye and target"),
            // A pose of 3 rows, as nerfstudio exports it.
            (r#"[{"file_path": "a.png", "transform": [[1,0,0,0],[0,1,0,0],[0,0,1,0]]}]"#, "neither a transform_matrix"),
            (
                r#"{"camera_angle_x": 1, "frames": [{}]}"#,
                "frame 1: it has neither a transform_matrix nor eye and target",
            ),
            (r#"{"camera_angle_x": 1, "frames": [{"file_path": 7}]}"#, "not a valid file name"),
            (r#"{"camera_angle_x": 1, "frames": [{"transform_matrix": [[1]]}]}"#, "not 4 rows"),
        ] {
            let message = parse(text, (8, 8)).unwrap_err();
            assert!(message.contains(said), "{text}: {message}");
        }
    }
}
