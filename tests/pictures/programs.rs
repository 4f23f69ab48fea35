//! Cameras of other programs: COLMAP's binary model equals its text, lenses that are no pinholes
//! are drawn or ignored, and damaged files end in a sentence.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common::{self, Random};
use common::command::{Folder, epsplat, fails, ply, succeeds, text};
use epsplat::io::camera::Pose;
use epsplat::io::cameras::{self, NamedCamera};
use epsplat::{Camera, Lens};
use glam::{DQuat, DVec2, DVec3, EulerRot};
use std::fmt::Write;
use std::path::Path;

/// COLMAP's models as its documentation lists them: number, name and number of parameters.
const MODELS: [(i32, &str, usize); 11] = [
    (0, "SIMPLE_PINHOLE", 3),
    (1, "PINHOLE", 4),
    (2, "SIMPLE_RADIAL", 4),
    (3, "RADIAL", 5),
    (4, "OPENCV", 8),
    (5, "OPENCV_FISHEYE", 8),
    (6, "FULL_OPENCV", 12),
    (7, "FOV", 5),
    (8, "SIMPLE_RADIAL_FISHEYE", 4),
    (9, "RADIAL_FISHEYE", 5),
    (10, "THIN_PRISM_FISHEYE", 12),
];

/// Models with one focal length.
const OF_ONE: [i32; 5] = [0, 2, 3, 8, 9];

/// A model as COLMAP's files: `[cameras, images]`, binary and text.
struct Model {
    binary: [Vec<u8>; 2],
    text: [String; 2],
}

/// Makes a model with a camera for each of `models` (number, name, parameters) and an image of each
/// camera in a random pose, by the format's specification.
fn model(models: &[(i32, &str, Vec<f64>)], random: &mut Random) -> Model {
    let count = (models.len() as u64).to_le_bytes().to_vec();
    let mut binary = [count.clone(), count];
    let mut text = ["# Camera list\n".to_owned(), "# Image list\n".to_owned()];
    for (id, (number, name, parameters)) in (1u32..).zip(models) {
        let [cameras, images] = &mut binary;
        cameras.extend(id.to_le_bytes());
        cameras.extend(number.to_le_bytes());
        cameras.extend([640u64, 480].map(u64::to_le_bytes).as_flattened());
        parameters.iter().for_each(|value| cameras.extend(value.to_le_bytes()));
        let words: Vec<_> = parameters.iter().map(f64::to_string).collect();
        writeln!(text[0], "{id} {name} 640 480 {}", words.join(" ")).unwrap();

        let mut angle = || random.between(-3.0, 3.0);
        let q = DQuat::from_euler(EulerRot::XYZ, angle(), angle(), angle());
        let pose = [q.w, q.x, q.y, q.z, angle(), angle(), 5e3 + angle()];
        images.extend((100 + id).to_le_bytes());
        pose.iter().for_each(|value| images.extend(value.to_le_bytes()));
        images.extend(id.to_le_bytes());
        images.extend(format!("set/image {id}.jpg\0").bytes());
        // Points of the image: X, Y and the identifier of a point, or -1.
        images.extend(u64::from(id % 3).to_le_bytes());
        for _ in 0..id % 3 {
            images.extend([1.5f64, 2.5].map(f64::to_le_bytes).as_flattened());
            images.extend((-1i64).to_le_bytes());
        }
        let words: Vec<_> = pose.iter().map(f64::to_string).collect();
        let points = "1.5 2.5 -1 ".repeat((id % 3) as usize);
        writeln!(text[1], "{} {} {id} set/image {id}.jpg\n{points}", 100 + id, words.join(" ")).unwrap();
    }
    Model { binary, text }
}

fn folder_of(model: &Model, place: &str, is_binary: bool) -> Folder {
    let folder = Folder::new();
    std::fs::create_dir_all(folder.path(place)).unwrap();
    for (k, name) in ["cameras", "images"].into_iter().enumerate() {
        match is_binary {
            true => folder.file(&format!("{place}/{name}.bin"), &model.binary[k]),
            false => folder.file(&format!("{place}/{name}.txt"), &model.text[k]),
        };
    }
    folder
}

fn camera(named: &NamedCamera) -> Camera {
    let Pose::Rigid(rotation, eye) = named.camera.pose else { panic!("a pose is rigid") };
    Camera::posed(named.camera.size.unwrap(), named.camera.lens, eye, rotation, 0.1).unwrap()
}

/// Where a camera shows a point, pixels.
fn pixel(camera: &Camera, point: DVec3) -> DVec2 {
    camera.image(camera.to_camera(point)).unwrap().0
}

/// Parameters of a model: its focal lengths, the principal point and the `rest`.
fn parameters(number: i32, count: usize, rest: f64) -> Vec<f64> {
    let lens = if OF_ONE.contains(&number) { vec![500.0, 320.5, 239.25] } else { vec![500.0, 510.0, 320.5, 239.25] };
    let rest = vec![rest; count - lens.len()];
    [lens, rest].concat()
}

#[test]
fn a_binary_model_shows_points_where_its_text_does() {
    let mut random = Random(11);
    let models: Vec<_> = MODELS.iter().map(|&(id, name, count)| (id, name, parameters(id, count, 0.0))).collect();
    let model = model(&models, &mut random);
    let of_text = cameras::read(&folder_of(&model, ".", false).path(""), (9, 9)).unwrap();
    for place in [".", "sparse/0", "sparse", "colmap/sparse/0"] {
        let of_binary = cameras::read(&folder_of(&model, place, true).path(""), (9, 9)).unwrap();
        assert_eq!((of_binary.len(), of_text.len()), (MODELS.len(), MODELS.len()), "{place}");
        let cameras: Vec<_> = of_binary.iter().map(camera).collect();
        for ((binary, text), (number, name, _)) in of_binary.iter().zip(&of_text).zip(MODELS) {
            assert_eq!((binary.undrawn, text.undrawn, binary.camera.lens), (None, None, text.camera.lens), "{name}");
            assert_eq!(binary.camera.lens.optics().is_some(), name.contains("FISHEYE"), "{name}");
            assert_eq!(binary.name, format!("set/image {}", number + 1));
            let fy = if OF_ONE.contains(&number) { 500.0 } else { 510.0 };
            let lens = binary.camera.as_pinhole().unwrap_or_else(|| binary.camera.clone()).lens;
            assert_eq!(lens, Lens::Intrinsics([500.0, fy, 320.5, 239.25]), "{name}");
            assert_eq!(binary.name, text.name);
            let [a, b] = [binary, text].map(camera);
            for _ in 0..50 {
                let mut at = || random.between(-1.0, 1.0);
                // A point before the camera.
                let point = a.eye + a.rotation.transpose() * DVec3::new(at(), at(), 3.0);
                let apart = pixel(&a, point).distance(pixel(&b, point));
                assert!(apart < 0.01, "{name}: {apart} pixels");
            }
        }
        // Control: the pose of another image is apart by more.
        let point = cameras[0].eye + cameras[0].rotation.transpose() * DVec3::new(0.2, 0.1, 3.0);
        assert!(pixel(&cameras[0], point).distance(pixel(&cameras[1], point)) > 1.0);
    }
    let none = Folder::new();
    let message = cameras::read(&none.path(""), (9, 9)).unwrap_err().to_string();
    assert!(message.contains("it has no COLMAP model") && message.contains("sparse/0"), "{message}");
}

#[test]
fn lenses_with_distortion_are_drawn_unless_that_is_ignored() {
    let cloud = Folder::new();
    let cloud = (cloud.file("c.ply", ply("x y z nx ny nz radius", 1, "0 0 0 0 0 1 1\n")), cloud);
    let (mut random, views) = (Random(3), cloud.1.path("views"));
    for (number, name, count) in MODELS {
        let model = model(&[(number, name, parameters(number, count, 0.125))], &mut random);
        let is_distorted = count > if OF_ONE.contains(&number) { 3 } else { 4 };
        for is_binary in [true, false] {
            let folder = folder_of(&model, "sparse/0", is_binary);
            let cameras = folder.path("");
            let line = ["render", text(&cloud.0), "-o", text(&views), "--cameras", text(&cameras), "--scale", "0.02"];
            let line = [&line[..], &["--backend", "reference"]].concat();
            succeeds(&line);
            let note = succeeds(&[&line[..], &["--ignore-distortion"]].concat()).stderr;
            let said = String::from_utf8(note).unwrap().contains("the lens distortion of 1 cameras is left out");
            assert_eq!(said, is_distorted, "{name}");
            assert!(views.join("set/image 1.png").is_file(), "{name}");
            std::fs::remove_dir_all(&views).unwrap();
        }
    }
}

#[test]
fn a_damaged_binary_model_ends_in_one_sentence() {
    let mut random = Random(7);
    let model =
        model(&[(1, "PINHOLE", parameters(1, 4, 0.0)), (0, "SIMPLE_PINHOLE", parameters(0, 3, 0.0))], &mut random);
    let folder = folder_of(&model, ".", true);
    let (cameras, images) = (folder.path("cameras.bin"), folder.path("images.bin"));
    let refusal = || {
        let message = cameras::read(&folder.path(""), (9, 9)).unwrap_err().to_string();
        assert!(!message.contains('\n') && message.len() < 300, "{message}");
        message
    };
    for (k, path) in [&cameras, &images].into_iter().enumerate() {
        for end in 0..model.binary[k].len() {
            std::fs::write(path, &model.binary[k][..end]).unwrap();
            assert!(refusal().contains(text(path)), "{end}");
        }
        let mut many = model.binary[k].clone();
        many[..8].copy_from_slice(&(1u64 << 60).to_le_bytes());
        std::fs::write(path, many).unwrap();
        assert!(refusal().contains("it announces 1152921504606846976 "));
        std::fs::write(path, &model.binary[k]).unwrap();
    }
    let mut unknown = model.binary[0].clone();
    unknown[12..16].copy_from_slice(&77i32.to_le_bytes());
    std::fs::write(&cameras, unknown).unwrap();
    assert!(refusal().contains("camera 1 of 2: there is no camera model with the number 77"));
    std::fs::write(&cameras, &model.binary[0]).unwrap();
    // The zero after the first name becomes a letter, and so do all others.
    let endless = model.binary[1].iter().map(|byte| if *byte == 0 { b'a' } else { *byte }).collect::<Vec<_>>();
    let endless = [&model.binary[1][..72], &endless[72..]].concat();
    std::fs::write(&images, endless).unwrap();
    assert!(refusal().contains("image 1 of 2: its NAME does not end with a zero"));
    std::fs::write(&images, &model.binary[1]).unwrap();
    assert_eq!(cameras::read(&folder.path(""), (9, 9)).unwrap().len(), 2);
    // On the command line too.
    std::fs::write(&images, &model.binary[1][..99]).unwrap();
    let cloud = folder.file("c.ply", ply("x y z nx ny nz radius", 1, "0 0 0 0 0 1 1\n"));
    let (views, project) = (folder.path("views"), folder.path(""));
    let line = ["render", text(&cloud), "-o", text(&views), "--cameras", text(&project)];
    fails(&line, 1, &["images.bin", "it announces 2 images, but 91 bytes follow"]);
}

/// The same camera in the files of four programs.
#[test]
fn one_camera_is_the_same_in_all_kinds_of_files() {
    let folder = Folder::new();
    // The camera at (3, 4, 5) looks along +x, with +z at the top of its image: right is -y and down
    // is -z. With OpenGL's axes, up is +z and back is -x.
    let splats = r#"[{"id": 0, "img_name": "a", "width": 64, "height": 48, "position": [3, 4, 5],
        "rotation": [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], "fx": 80, "fy": 80}]"#;
    let fov = 2.0 * (24.0f64 / 80.0).atan().to_degrees();
    let path = format!(
        r#"{{"camera_type": "perspective", "render_width": 64, "render_height": 48, "keyframes": [],
            "camera_path": [{{"camera_to_world": [0,0,-1,3, -1,0,0,4, 0,1,0,5, 0,0,0,1], "fov": {fov:?}, "aspect": 1.33}}]}}"#
    );
    let nerf = r#"{"w": 9, "h": 9, "fl_x": 1, "frames": [{"w": 64, "h": 48, "fl_x": 80, "fl_y": 80, "cx": 32, "cy": 24,
        "transform_matrix": [[0,0,-1,3], [-1,0,0,4], [0,1,0,5], [0,0,0,1]]}]}"#;
    let list = r#"[{"eye": [3, 4, 5], "target": [13, 4, 5], "up": [0, 0, 1], "width": 64, "height": 48,
        "fx": 80, "fy": 80, "cx": 32, "cy": 24}]"#;
    for (name, content) in [("s.json", splats), ("p.json", &path), ("t.json", nerf), ("l.json", list)] {
        let named = cameras::read(&folder.file(name, content), (9, 9)).unwrap();
        let file = &named[0].camera;
        let camera = match file.pose {
            Pose::Rigid(..) => camera(&named[0]),
            Pose::LookAt(eye, target, up) => {
                Camera::look_at(file.size.unwrap(), file.lens, eye, target, up, epsplat::Up::Z, 0.1).unwrap()
            }
        };
        // By hand: 10 units ahead, 2 to the right (-y) and 1 up (+z).
        let shown = pixel(&camera, DVec3::new(13.0, 2.0, 6.0));
        assert!(shown.distance(DVec2::new(32.0 + 16.0, 24.0 - 8.0)) < 1e-9, "{name}: {shown}");
        assert_eq!((named.len(), file.size), (1, Some((64, 48))), "{name}");
    }
}

#[test]
fn a_file_of_no_known_kind_is_refused_with_what_is_read() {
    let folder = Folder::new();
    let cloud = folder.file("c.ply", ply("x y z nx ny nz radius", 1, "0 0 0 0 0 1 1\n"));
    let image = folder.file("a.png", std::fs::read(Path::new(common::command::DATA).join("cube.png")).unwrap());
    let files = [image, folder.file("x.json", r#"{"views": []}"#), folder.file("x.txt", "1 2 3")];
    let views = folder.path("views");
    for file in &files {
        let line = ["render", text(&cloud), "-o", text(&views), "--cameras", text(file)];
        fails(&line, 1, &["transforms.json", "camera_path.json", "COLMAP", "--camera"]);
        let stderr = String::from_utf8(epsplat(&line).stderr).unwrap();
        assert_eq!(stderr.lines().count(), 1, "{stderr}");
    }
}
