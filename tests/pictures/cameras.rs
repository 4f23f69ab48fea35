//! Files of many cameras: pictures equal single renders in every format, and bad files give a
//! one-sentence error.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::Random;
use common::command::{DATA, Folder, epsplat, fails, ply, succeeds, text};
use epsplat::io::camera::Pose;
use epsplat::io::cameras;
use glam::{DMat3, DQuat, DVec3, EulerRot};
use std::path::{Path, PathBuf};

/// Intrinsics of a camera of 64x48 pixels whose principal point is off-centre, as JSON.
const LENS: &str = r#""w": 64, "h": 48, "fl_x": 70, "fl_y": 75, "cx": 30, "cy": 26"#;

/// One frame of a transforms.json.
fn frame(path: &str, to_world: DMat3, eye: DVec3) -> String {
    let rows: Vec<_> = (0..3)
        .map(|k| [to_world.row(k).x, to_world.row(k).y, to_world.row(k).z, eye[k]])
        .chain([[0.0, 0.0, 0.0, 1.0]])
        .collect();
    format!(r#"{{"file_path": "{path}", "transform_matrix": {rows:?}}}"#)
}

fn transforms(lens: &str, frames: &[String]) -> String {
    format!(r#"{{{lens}, "frames": [{}]}}"#, frames.join(", "))
}

/// Renders a scene with all `cameras` into a new folder, and returns the folder.
fn views(folder: &Folder, scene: &str, cameras: &Path, more: &[&str]) -> PathBuf {
    let output = folder.path("views");
    let _ = std::fs::remove_dir_all(&output);
    succeeds(&[&["render", scene, "--cameras", text(cameras), "-o", text(&output)], more].concat());
    output
}

fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The bunny at its original position and at map coordinates, where f32 has steps of half a unit.
fn scenes(folder: &Folder) -> [(PathBuf, DVec3); 2] {
    let bunny = Path::new(DATA).join("bunny.obj");
    let far = DVec3::new(445_000.0, 5_411_000.0, 300.0);
    let moved = std::fs::read_to_string(&bunny).unwrap();
    let moved: String = moved
        .lines()
        .map(|line| match line.strip_prefix("v ") {
            Some(vertex) => {
                let at: Vec<f64> = vertex.split(' ').map(|word| word.parse().unwrap()).collect();
                format!("v {} {} {}\n", at[0] + far.x, at[1] + far.y, at[2] + far.z)
            }
            None => format!("{line}\n"),
        })
        .collect();
    [(bunny, DVec3::ZERO), (folder.file("far.obj", moved), far)]
}

#[test]
fn both_formats_show_what_eye_and_target_show() {
    let folder = Folder::new();
    let colmap = folder.path("colmap");
    std::fs::create_dir(&colmap).unwrap();
    std::fs::write(colmap.join("cameras.txt"), "# lenses\n3 PINHOLE 64 48 70 75 30 26\n").unwrap();
    for (scene, origin) in scenes(&folder) {
        // The camera looks along -z with y up: OpenGL's axes are the world's, and COLMAP's are
        // turned by half a turn around x.
        let eye = origin + DVec3::new(0.5, 5.0, 16.0);
        let single = folder.path("single.png");
        let [eye_text, target] = [eye, eye - 16.0 * DVec3::Z].map(|v| format!("{},{},{}", v.x, v.y, v.z));
        let place = ["--eye", &eye_text, "--target", &target, "--up", "0,1,0"];
        let lens = ["--size", "64x48", "--intrinsics", "70,75,30,26"];
        succeeds(&[&["render", text(&scene), "-o", text(&single)], &place[..], &lens].concat());
        let expected = bytes(&single);

        let right = frame("right.jpg", DMat3::IDENTITY, eye);
        // Controls: the axes of the other convention, and the eye half a pixel to the side.
        let turned = frame("turned.jpg", DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)), eye);
        let aside = frame("aside.jpg", DMat3::IDENTITY, eye + DVec3::X * (0.5 * 16.0 / 70.0));
        let file = folder.file("transforms.json", transforms(LENS, &[right, turned, aside]));
        let output = views(&folder, text(&scene), &file, &[]);
        assert_eq!(bytes(&output.join("right.png")), expected);
        for control in ["turned.png", "aside.png"] {
            assert_ne!(bytes(&output.join(control)), expected, "{control}");
        }

        let (tx, ty, tz) = (-eye.x, eye.y, eye.z);
        let images = format!("1 0 1 0 0 {tx} {ty} {tz} 3 right.jpg\n\n2 1 0 0 0 {tx} {ty} {tz} 3 turned.jpg\n1 2 3\n");
        std::fs::write(colmap.join("images.txt"), images).unwrap();
        let output = views(&folder, text(&scene), &colmap, &[]);
        assert_eq!(bytes(&output.join("right.png")), expected);
        assert_ne!(bytes(&output.join("turned.png")), expected);
    }
}

#[test]
fn one_pose_is_the_same_in_both_formats() {
    let folder = Folder::new();
    let mut random = Random(5);
    let (mut frames, mut images) = (Vec::new(), String::new());
    for number in 0..20 {
        let mut angle = || random.between(-3.0, 3.0);
        let rotation = DQuat::from_euler(EulerRot::XYZ, angle(), angle(), angle());
        let eye = DVec3::new(random.between(-5.0, 5.0), random.between(-5.0, 5.0), 5e6);
        let (q, t) = (rotation, -(rotation * eye));
        images += &format!("{number} {} {} {} {} {} {} {} 1 {number}.png\n\n", q.w, q.x, q.y, q.z, t.x, t.y, t.z);
        let to_world = DMat3::from_quat(rotation).transpose() * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        frames.push(frame(&format!("{number}.png"), to_world, eye));
    }
    std::fs::write(folder.path("cameras.txt"), "1 PINHOLE 64 48 70 75 30 26").unwrap();
    std::fs::write(folder.path("images.txt"), images).unwrap();
    let of_colmap = cameras::read(&folder.path(""), (9, 9)).unwrap();
    let of_nerf = cameras::read(&folder.file("t.json", transforms(LENS, &frames)), (9, 9)).unwrap();
    assert_eq!((of_colmap.len(), of_nerf.len()), (20, 20));
    for (a, b) in of_colmap.iter().zip(&of_nerf) {
        assert_eq!((&a.name, a.camera.size, a.camera.lens), (&b.name, b.camera.size, b.camera.lens));
        let (Pose::Rigid(a, eye_a), Pose::Rigid(b, eye_b)) = (&a.camera.pose, &b.camera.pose) else { panic!() };
        let apart = (*a - *b).to_cols_array().into_iter().fold(0.0, |most: f64, e| most.max(e.abs()));
        // A matrix entry is 2 (ab + cd) of the components of a unit quaternion: 16 roundings in
        // all, of numbers up to 1. The eye is rounded at 5e6, its largest coordinate.
        assert!(apart < 8.0 * f64::EPSILON && eye_a.distance(*eye_b) < 1e-8, "{apart:e} {:e}", eye_a.distance(*eye_b));
    }
}

#[test]
fn pictures_are_those_of_single_renders_to_the_bit() {
    let folder = Folder::new();
    let bunny = format!("{DATA}/bunny.obj");
    let cameras = Path::new(DATA).join("cameras/transforms.json");
    let report = folder.path("report.json");
    let maps = ["--aov", "depth,normal,weight,count", "--json", text(&report), "--scale", "0.25"];
    let output = views(&folder, &bunny, &cameras, &maps);
    let report: serde_json::Value = serde_json::from_slice(&bytes(&report)).unwrap();
    let of_views = report["views"].as_array().unwrap();
    assert_eq!(of_views.len(), 12);
    assert!(report["total_ms"].as_f64().unwrap() > 0.0 && report["writers"].as_u64().unwrap() > 0);
    let mut different = std::collections::HashSet::new();
    for (camera, view) in cameras::read(&cameras, (9, 9)).unwrap().into_iter().zip(of_views) {
        let Pose::Rigid(rotation, eye) = camera.camera.pose else { panic!() };
        let to_world: Vec<_> =
            (0..3).map(|k| [rotation.col(k).x, rotation.col(k).y, rotation.col(k).z, eye[k]]).collect();
        let single = format!(
            r#"{{"width": 100, "height": 100, "fx": 120, "cx": 50, "cy": 50,
                 "camera_to_world": [{:?}, {:?}, {:?}, [0, 0, 0, 1]]}}"#,
            to_world[0], to_world[1], to_world[2]
        );
        let (single, image) = (folder.file("single.json", single), folder.path("single.exr"));
        succeeds(&[&["render", &bunny, "-o", text(&image), "--camera", text(&single)], &maps[..2]].concat());
        let path = output.join(&camera.name).with_extension("exr");
        assert_eq!(view["file"], text(&path));
        assert_eq!((&view["width"], &view["surfels"]), (&100.into(), &of_views[0]["surfels"]));
        assert!(view["write_ms"].is_number() && view["passes"].is_object());
        assert!(bytes(&path) == bytes(&image), "{}", camera.name);
        different.insert(bytes(&path));
    }
    assert_eq!(different.len(), 12);
}

#[test]
fn a_set_without_sizes_takes_the_size_that_is_asked_for() {
    let folder = Folder::new();
    let cloud = folder.file("c.ply", ply("x y z nx ny nz radius", 1, "0 0 0 0 0 1 1\n"));
    let angle = 60f64.to_radians();
    let frames = [frame("./train/r_0", DMat3::IDENTITY, 3.0 * DVec3::Z)];
    let file = folder.file("transforms.json", transforms(&format!(r#""camera_angle_x": {angle:?}"#), &frames));
    let more = ["--size", "40x40", "--backend", "reference", "--format", "exr"];
    let output = views(&folder, text(&cloud), &file, &more);
    let image = folder.path("single.exr");
    let place = ["--eye", "0,0,3", "--target", "0,0,0", "--fov", "60"];
    succeeds(&[&["render", text(&cloud), "-o", text(&image)], &place[..], &more[..4]].concat());
    assert_eq!(bytes(&output.join("train/r_0.exr")), bytes(&image));
    fails(&["render", text(&cloud), "-o", text(&output), "--cameras", text(&file), "--scale", "2"], 2, &["--size"]);
}

#[test]
fn sets_that_cannot_be_rendered_end_in_a_sentence() {
    let folder = Folder::new();
    let cloud = folder.file("c.ply", ply("x y z nx ny nz radius", 1, "0 0 0 0 0 1 1\n"));
    let output = folder.path("views");
    let render = |cameras: &Path, more: &[&str], code: i32, words: &[&str]| {
        let base = ["render", text(&cloud), "-o", text(&output), "--backend", "reference", "--cameras", text(cameras)];
        fails(&[&base, more].concat(), code, words);
    };
    let eye = 3.0 * DVec3::Z;
    let good = |name: &str| frame(name, DMat3::IDENTITY, eye);
    let set = |lens: &str, frames: &[String]| folder.file("set.json", transforms(lens, frames));
    render(&folder.path("none.json"), &[], 1, &["none.json"]);
    render(&folder.file("set.json", "{"), &[], 1, &["set.json", "not JSON"]);
    render(&set(LENS, &[]), &[], 1, &["set.json", "no camera"]);
    render(&set(LENS, &[good("a.png"), good("./a.jpg")]), &[], 1, &["cameras 1 and 2", "'a'"]);
    render(&set(LENS, &[good("..")]), &[], 1, &["frame 1", "file_path"]);
    let large = frame("b", 2.0 * DMat3::IDENTITY, eye);
    render(&set(LENS, &[good("a"), large]), &[], 2, &["views/b.png", "set.json: ", "rigid"]);
    let distorted = transforms(&format!(r#"{LENS}, "k1": 0.01"#), &[good("a")]);
    let distorted = folder.file("distorted.json", distorted);
    let wide = folder.file("wide.json", transforms(r#""camera_angle_x": 3.5"#, &[good("a")]));
    render(&wide, &[], 1, &["wide.json", "frame 1", "camera_angle_x must lie between 0 and pi"]);
    let nested = folder.file("nested.json", transforms(LENS, &[good("x"), good("b"), good("x.png/y")]));
    render(&nested, &[], 2, &["views/x.png/y.png would lie in", "views/x.png, which is a file"]);
    let unknown = transforms(&format!(r#"{LENS}, "camera_model": "RAD_TAN_THIN_PRISM_FISHEYE""#), &[good("a")]);
    let unknown = folder.file("unknown.json", unknown);
    render(&unknown, &[], 1, &["unknown.json", "RAD_TAN_THIN_PRISM_FISHEYE, is not rendered", "--ignore-distortion"]);
    let set = set(LENS, &[good("a")]);
    render(&set, &["--size", "9x9"], 2, &["contradicts", "64x48"]);
    render(&set, &["--scale", "0"], 2, &["positive"]);
    render(&set, &["--scale", "1000"], 2, &["32768"]);
    render(&set, &["--eye", "0,0,1"], 2, &["--eye"]);
    render(&set, &["--format", "png", "--aov", "depth"], 2, &["PNG holds no maps"]);
    render(&set, &["--json", text(&set)], 2, &["overwrite"]);
    render(&set, &["--json", text(&output.join("a.png"))], 2, &["overwrite"]);
    fails(&["render", text(&cloud), "-o", "a.png", "--scale", "2"], 2, &["--cameras"]);
    fails(&["render", text(&cloud), "-o", text(&folder.path("")), "--cameras", text(&set)], 2, &["another folder"]);
    let taken = ["render", text(&cloud), "-o", text(&cloud), "--backend", "reference", "--cameras", text(&set)];
    fails(&taken, 1, &["c.ply"]);
    let deep = folder.path("no/such");
    fails(&["render", text(&cloud), "-o", text(&deep), "--cameras", text(&set)], 1, &["no/such"]);
    let empty = folder.path("empty");
    std::fs::create_dir(&empty).unwrap();
    render(&empty, &[], 1, &["cameras.txt"]);
    std::fs::write(empty.join("cameras.bin"), "").unwrap();
    render(&empty, &[], 1, &["cameras.bin", "it ends before"]);
    assert!(!output.exists());

    // `--ignore-distortion` leaves distortion out, and a note says so.
    let base = ["render", text(&cloud), "-o", text(&output), "--backend", "reference", "--cameras", text(&distorted)];
    let stderr = epsplat(&[&base[..], &["--ignore-distortion"]].concat()).stderr;
    assert!(String::from_utf8(stderr).unwrap().contains("distortion of 1 cameras is left out"));
    assert!(output.join("a.png").exists());
}

#[test]
fn a_picture_that_cannot_be_written_is_named_and_others_stay() {
    let folder = Folder::new();
    let cloud = folder.file("c.ply", ply("x y z nx ny nz radius", 1, "0 0 0 0 0 1 1\n"));
    let frames: Vec<_> =
        (0..40).map(|k| frame(&format!("../out/{k:02}.png"), DMat3::IDENTITY, 3.0 * DVec3::Z)).collect();
    let set = folder.file("set.json", transforms(LENS, &frames));
    let output = folder.path("views");
    std::fs::create_dir_all(output.join("out/05.png")).unwrap();
    fails(
        &["render", text(&cloud), "-o", text(&output), "--backend", "reference", "--cameras", text(&set)],
        1,
        &["cannot write", "out/05.png"],
    );
    assert_eq!(bytes(&output.join("out/04.png")), bytes(&output.join("out/00.png")));
    assert!(!output.join("out/39.png").exists());
    assert!(!folder.names().contains(&"out".to_owned()));
}

/// Symbolic links in the output folder cannot lead a picture out of it.
#[cfg(unix)]
#[test]
fn links_in_the_folder_lead_nowhere_out_of_it() {
    use std::os::unix::fs::symlink;
    let folder = Folder::new();
    let cloud = folder.file("c.ply", ply("x y z nx ny nz radius", 1, "0 0 0 0 0 1 1\n"));
    let place = |name: &str| frame(name, DMat3::IDENTITY, 3.0 * DVec3::Z);
    let set = folder.file("set.json", transforms(LENS, &[place("first"), place("train/a"), place("../b")]));
    let (output, outside) = (folder.path("views"), folder.path("outside"));
    let line = ["render", text(&cloud), "-o", text(&output), "--backend", "reference", "--cameras", text(&set)];
    std::fs::create_dir(&outside).unwrap();
    std::fs::create_dir(&output).unwrap();
    std::fs::write(outside.join("b.png"), "precious").unwrap();
    for (link, target) in [("train", "../outside"), ("b.png", "../outside/b.png"), ("b.png", "../outside/new.png")] {
        symlink(target, output.join(link)).unwrap();
        fails(&line, 1, &[&format!("views/{link}"), "a symbolic link leads out of"]);
        assert_eq!((std::fs::read_dir(&output).unwrap().count(), std::fs::read_dir(&outside).unwrap().count()), (1, 1));
        assert_eq!(bytes(&outside.join("b.png")), b"precious");
        std::fs::remove_file(output.join(link)).unwrap();
    }
    // Controls: a link to a folder inside the output folder is followed, and so is a link to the
    // output folder itself.
    std::fs::create_dir(output.join("other")).unwrap();
    symlink("other", output.join("train")).unwrap();
    let linked = folder.path("linked");
    symlink("views", &linked).unwrap();
    succeeds(&[&line[..3], &[text(&linked)], &line[4..]].concat());
    assert_eq!(bytes(&output.join("other/a.png")), bytes(&output.join("first.png")));
    assert!(output.join("b.png").is_file() && output.join("train").is_symlink());
}

#[test]
fn an_error_of_a_camera_names_the_option_or_the_file_that_gave_it() {
    let folder = Folder::new();
    let cloud = folder.file("c.ply", ply("x y z", 3, "0 0 0\n1 0 0\n0 1 0\n"));
    let image = folder.path("c.png");
    let line = ["render", text(&cloud), "-o", text(&image), "--backend", "reference", "--size", "8x8"];
    let option = |more: &[&str], words: &[&str]| fails(&[&line[..], more].concat(), 2, words);
    for height in ["0", "-3", "nan", "inf", "1e308", "1e-308"] {
        option(&["--ortho", height], &["--ortho: the height of an orthographic view must be positive", "is not"]);
    }
    for angle in ["0", "-3", "nan", "180", "1e308"] {
        option(&["--fov", angle], &["--fov: a field of view lies between 0 and 180 degrees"]);
    }
    option(&["--intrinsics", "0,1,2,3"], &["--intrinsics: ", "fx = 0"]);
    option(&["--near", "-1"], &["--near: the near depth must be positive"]);
    let place = r#""eye": [0,0,5], "target": [0,0,0]"#;
    for (given, said) in [
        (r#""model": "orthographic", "height_world": 1e308"#, "the height of an orthographic view"),
        (r#""fov": 200"#, "a field of view"),
        (r#""near": -1"#, "the near depth"),
        (r#""width": 0, "height": 8"#, "an image is 1 to"),
        (r#""up": [0, 0, 1]"#, "the camera's up"),
    ] {
        let camera = folder.file("camera.json", format!("{{{place}, {given}}}"));
        fails(&[&line[..6], &["--camera", text(&camera)]].concat(), 2, &["camera.json: ", said]);
    }
    // The option is at fault, not the file.
    let camera = folder.file("camera.json", format!("{{{place}}}"));
    let near = ["--camera", text(&camera), "--near", "0"];
    fails(&[&line[..6], &near].concat(), 2, &["error: --near: the near depth"]);
    assert!(!image.exists());
    succeeds(&[&line[..], &["--ortho", "3"]].concat());
}

/// Camera files may begin with a byte order mark or be UTF-16, as on Windows.
#[test]
fn camera_files_may_begin_with_a_byte_order_mark() {
    let folder = Folder::new();
    let one = r#"{"width": 8, "height": 8, "fov": 40, "eye": [0, 0, 3], "target": [0, 0, 0]}"#;
    let many = transforms(LENS, &[frame("a.png", DMat3::IDENTITY, DVec3::Z)]);
    let forms = |text: &str| {
        let codes: Vec<u16> = format!("\u{feff}{text}").encode_utf16().collect();
        let [little, big] = [u16::to_le_bytes, u16::to_be_bytes]
            .map(|bytes| codes.iter().flat_map(|&code| bytes(code)).collect::<Vec<u8>>());
        [format!("\u{feff}{text}").into_bytes(), little, big]
    };
    let plain = |text: &str| folder.file("plain.json", text);
    let expected = epsplat::io::camera::read(&plain(one)).unwrap();
    for bytes in forms(one) {
        assert_eq!(epsplat::io::camera::read(&folder.file("one.json", bytes)).unwrap(), expected);
    }
    let expected = cameras::read(&plain(&many), (8, 8)).unwrap();
    for bytes in forms(&many) {
        assert_eq!(cameras::read(&folder.file("many.json", bytes), (8, 8)).unwrap(), expected);
    }
}
