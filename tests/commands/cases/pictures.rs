//! Colours, and pictures that must be equal however they are drawn.

use std::collections::BTreeSet;

use super::{case, covered, drawn};
use crate::common::command::{DATA, Folder, succeeds, text};

/// The mean of the codes, by channel.
fn mean(codes: &[[u8; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|k| codes.iter().map(|code| f64::from(code[k])).sum::<f64>() / codes.len() as f64)
}

#[test]
fn numbers_of_colours_mean_what_their_program_meant() {
    let folder = Folder::new();
    for name in [
        "ply_pdal_uint16_normalx.ply",
        "ply_float_0_255.ply",
        #[cfg(feature = "e57")]
        "e57_colour_float255_no_limits.e57",
        #[cfg(feature = "pcd")]
        "pcd_pdal_red_green_blue.pcd",
    ] {
        let codes = covered(&drawn(&folder, &[&case(name), "--size", "64x64"]).0);
        // Blending makes most pixels neither colour.
        for own in [[230, 120, 30], [30, 90, 220]] {
            let is_own = |code: &&[u8; 3]| code.iter().zip(own).all(|(a, b): (&u8, u8)| a.abs_diff(b) <= 2);
            let count = codes.iter().filter(is_own).count();
            assert!(20 * count > codes.len() && count > 20, "{name}: {own:?} {count} of {}", codes.len());
        }
    }
    // A single value of 256 among 8-bit values does not make the file 16-bit.
    let codes = covered(&drawn(&folder, &[&case("las_8bit_one_256.las"), "--size", "64x64"]).0);
    assert!(codes.len() > 300 && mean(&codes).iter().sum::<f64>() > 150.0, "{:?}", mean(&codes));
}

#[test]
fn intensity_shows_where_no_colour_does() {
    let folder = Folder::new();
    for name in ["las_rgb_zero_intensity.las", "ply_intensity_only.ply"] {
        let codes = covered(&drawn(&folder, &[&case(name), "--size", "64x64"]).0);
        let levels: BTreeSet<u8> = codes.iter().map(|code| code[0]).collect();
        assert!(codes.iter().all(|[r, g, b]| r == g && g == b), "{name}");
        assert!(levels.len() > 20 && *levels.last().unwrap() > 120, "{name}: {levels:?}");
    }
    // Two tiles share one white level, that of the brighter one.
    let [a, b] = ["las_tileA_intensity.las", "las_tileB_intensity.las"].map(case);
    let view = ["--eye", "10,5,40", "--target", "10,5,0", "--up", "0,1,0", "--ortho", "10", "--size", "96x48"];
    let picture = |inputs: &[&str]| drawn(&folder, &[inputs, &view].concat()).0;
    let both = picture(&[&a, &b]);
    let half = |x: u32| mean(&covered(&image::imageops::crop_imm(&both, x, 0, 44, 48).to_image()))[0];
    let alone = mean(&covered(&picture(&[&b])))[0];
    assert!(
        (half(0) - half(52)).abs() < 20.0 && alone > 2.0 * half(0).max(half(52)),
        "{} {} {alone}",
        half(0),
        half(52)
    );
}

#[test]
fn faces_have_their_colours() {
    let folder = Folder::new();
    let file = case("ply_face_colours_cube.ply");
    let mut seen = BTreeSet::new();
    for eye in ["4,0,0", "-4,0,0", "0,4,0", "0,-4,0", "0,0,4", "0,0,-4"] {
        let up = if eye.starts_with("0,0") { "0,1,0" } else { "0,0,1" };
        for how in [&[file.as_str()][..], &["--triangles", &file]] {
            let view = ["--eye", eye, "--target", "0,0,0", "--up", up, "--ortho", "1", "--size", "32x32"];
            let codes = covered(&drawn(&folder, &[how, &view].concat()).0);
            let of_face: BTreeSet<[u8; 3]> = codes.iter().copied().collect();
            assert_eq!((codes.len(), of_face.len()), (32 * 32, 1), "{eye} {how:?}: {of_face:?}");
            seen.extend(of_face);
        }
    }
    assert_eq!(seen.len(), 6, "{seen:?}");
}

#[test]
fn materials_paint_as_they_say() {
    let folder = Folder::new();
    let view = ["--eye", "0,0,4", "--target", "0,0,0", "--up", "0,1,0", "--ortho", "2", "--size", "64x64"];
    // Returns the code at a point of the image plane; both coordinates are in -1 to 1, right and
    // up.
    let at = |file: &str, how: &[&str]| {
        let (image, told) = drawn(&folder, &[how, &[&case(file)], &view].concat());
        let code = move |(x, y): (f64, f64)| {
            let pixel = image.get_pixel((32.0 + 32.0 * x) as u32, (32.0 - 32.0 * y) as u32).0;
            [pixel[0], pixel[1], pixel[2]]
        };
        (code, told)
    };
    // The texture as it should appear: red and green above blue and yellow.
    let quarters = [[255, 0, 0], [0, 200, 0], [0, 0, 255], [255, 230, 0]];
    let places = |middle: f64, half: f64| {
        [(-half, half), (half, half), (-half, -half), (half, -half)].map(|(x, y)| (x + middle, y + middle))
    };
    for how in [&[][..], &["--triangles"]] {
        let (code, _) = at("obj/t_map_kd_lower.obj", how);
        assert_eq!(places(0.0, 0.5).map(code), quarters, "{how:?}");
        // The texture repeats two by two times.
        let (code, _) = at("obj/t_scale_2.obj", how);
        for middle in [-0.5, 0.5] {
            assert_eq!(places(middle, 0.25).map(&code), quarters, "{how:?} {middle}");
        }
    }
    let (code, told) = at("obj/t_kd_zero.obj", &["--triangles"]);
    assert_eq!(places(0.0, 0.5).map(code), [[0; 3]; 4]);
    assert!(told.contains("Kd") && told.contains("black"), "{told}");
}

/// Compares two pictures: the largest difference, and the share of pixels that only one of them
/// covers.
fn apart(folder: &Folder, arguments: [&[&str]; 2]) -> serde_json::Value {
    let paths = ["one.exr", "other.exr"].map(|name| folder.path(name));
    for (arguments, path) in arguments.iter().zip(&paths) {
        succeeds(&[&["render"], *arguments, &["-o", text(path)]].concat());
    }
    let output = succeeds(&["compare", text(&paths[0]), text(&paths[1]), "--json", "-"]);
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn filtered_caps_are_the_same_in_every_organisation_and_the_reference() {
    if crate::common::gpu().is_none() {
        return;
    }
    let folder = Folder::new();
    let caps = case("caps_lowpass_max.ply");
    let own = [&caps, "--lowpass", "max", "--samples", "1", "--size", "240x180"];
    let found = apart(&folder, [&own, &[&own[..], &["--backend", "reference"]].concat()]);
    assert_eq!(found["coverage_mismatch"], 0.0, "{found}");
    let caps = case("bunnycap.ply");
    let own = [&caps, "--lowpass", "max", "--samples", "1", "--size", "64x48", "--up", "1,2,3", "--organisation"];
    let found = apart(&folder, [&[&own[..], &["tile"]].concat(), &[&own[..], &["scatter"]].concat()]);
    assert_eq!((&found["max_abs"], &found["coverage_mismatch"]), (&0.0.into(), &0.0.into()), "{found}");
}

#[test]
fn depths_of_textures_are_infinite_where_nothing_is() {
    let folder = Folder::new();
    let [torus, cube, image] = ["texz/tortex.ply", "texz/cube.ply", "texz/t0.png"].map(case);
    let of_data = format!("{DATA}/cube.png");
    let own = [&torus, &cube, "--texture", &image, "--texture", &of_data, "--size", "256x256", "--aov", "texz"];
    let found = apart(&folder, [&own, &[&own[..], &["--backend", "reference"]].concat()]);
    let map = found["maps"].as_array().unwrap().iter().find(|map| map["map"] == "texz").unwrap();
    assert_eq!(map["coverage_mismatch"].as_f64().unwrap_or(0.0), 0.0, "{map}");
    assert!(map["max_abs"].as_f64().is_some_and(f64::is_finite), "{map}");
}
