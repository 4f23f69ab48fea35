//! Colours by attribute, filters, legends, and what `info` lists, as users meet them.

#![allow(clippy::unwrap_used, clippy::panic)]

use crate::common;

use common::command::{DATA, Folder, epsplat, fails, ply, succeeds, text};
use epsplat::io;
use epsplat::low_level::scene::KeyColors;
use epsplat::low_level::scene::color::srgb8;
use epsplat::{CameraOptions, DeviceOptions, Picture, RenderOptions, Renderer, Scene, SceneOptions, View};
use std::path::Path;

/// Four wide disks in a row at x = 0, 10, 20, 30, each with a class, an intensity and a height.
fn row(folder: &Folder) -> std::path::PathBuf {
    let rows = "0 0 -1 2 0 0 0 2 0 2 0\n10 0 0 2 0 0 0 2 0 6 50\n20 0 1 2 0 0 0 2 0 9 100\n30 0 0 2 0 0 0 2 0 77 20\n";
    folder.file("row.ply", ply("x y z sx sy sz tx ty tz scalar_Classification intensity", 4, rows))
}

/// The sRGB codes at the centres of the disks, in a picture from above with 4 pixels per unit.
fn centres(path: &Path) -> Vec<[u8; 4]> {
    let frame = io::png::read(path).unwrap();
    (0..4).map(|k| srgb8(frame.color[20 * 160 + 20 + 40 * k])).collect()
}

fn render(folder: &Folder, more: &[&str]) -> Vec<[u8; 4]> {
    let (input, image) = (row(folder), folder.path("row.png"));
    let view = ["--eye", "15,0,50", "--target", "15,0,0", "--up", "y", "--ortho", "10", "--size", "160x40"];
    let all =
        [&["render", text(&input), "-o", text(&image), "--backend", "reference", "--samples", "1"], &view[..], more];
    succeeds(&all.concat());
    centres(&image)
}

/// Whether codes are within one step of those expected.
fn near(codes: &[[u8; 4]], expected: &[[u8; 3]]) {
    assert_eq!(codes.len(), expected.len());
    for (code, [r, g, b]) in codes.iter().zip(expected) {
        assert!(code.iter().zip([r, g, b, &255]).all(|(a, b)| a.abs_diff(*b) <= 1), "{codes:?} {expected:?}");
    }
}

#[test]
fn pictures_have_the_colours_of_the_map() {
    let folder = Folder::new();
    // Viridis at 0, 1/2, 1 and 1/5, from matplotlib's table of 256 colours.
    let viridis = [[68, 1, 84], [33, 145, 140], [253, 231, 37], [65, 68, 135]];
    near(&render(&folder, &["--color-by", "intensity", "--range", "0,100"]), &viridis);
    near(&render(&folder, &["--color-by", "scalar_intensity", "--range", "0%,100%"]), &viridis);
    let grey = |codes: [u8; 4]| codes.map(|code| [code; 3]);
    near(&render(&folder, &["--color-by", "z", "--color-map", "gray", "--range", "-1,1"]), &grey([0, 128, 255, 128]));
    near(&render(&folder, &["--color-by", "z", "--color-map", "gray-r", "--range=-1,1"]), &grey([255, 127, 0, 127]));
    // Values beyond the ends are clamped.
    near(
        &render(&folder, &["--color-by", "intensity", "--color-map", "gray", "--range", "20,50"]),
        &grey([0, 255, 255, 0]),
    );
    // Ground, building and water have their own colours; class 77 has one too.
    let classes = render(&folder, &["--color-by", "class"]);
    near(&classes[..3], &[[166, 118, 68], [226, 92, 44], [54, 128, 220]]);
    assert!(classes[3] != classes[0] && classes[3][3] == 255);
    // All disks face the eye: their normals are +z.
    near(&render(&folder, &["--color-by", "normal"]), &[[128, 128, 255]; 4]);
    // Control: without the option, the picture is lit and has the intensities of the file.
    assert_ne!(render(&folder, &[]), render(&folder, &["--color-by", "intensity", "--range", "0,100"]));
    assert_eq!(render(&folder, &[]), render(&folder, &["--color-by", "rgb"]));
}

#[test]
fn filters_leave_points_out_of_pictures_and_files() {
    let folder = Folder::new();
    let shows = |more: &[&str]| render(&folder, more).iter().map(|code| code[3] > 0).collect::<Vec<_>>();
    assert_eq!(shows(&[]), [true; 4]);
    assert_eq!(shows(&["--where", "class[2:6]"]), [true, true, false, false]);
    assert_eq!(shows(&["--where", "Z[0:],Intensity!(50:100]"]), [false, true, false, true]);
    assert_eq!(shows(&["--classes", "ground,water"]), [true, false, true, false]);
    assert_eq!(shows(&["--classes", "others", "--where", "X[20:]"]), [false, false, false, true]);
    let (input, output) = (row(&folder), folder.path("out.ply"));
    let scan = format!("{DATA}/autzen.laz");
    // 26,107 points are ground, as laspy counts them.
    for (command, output) in [("surfels", &output), ("lod", &output)] {
        succeeds(&[command, &scan, "-o", text(output), "--classes", "2"]);
        let header = std::fs::read(output).unwrap();
        let header = String::from_utf8_lossy(&header[..400]).into_owned();
        assert!(header.contains("element vertex 26107"), "{command}: {header}");
    }
    let told = epsplat(&["info", &scan, "--where", "Classification[2:2]"]);
    let told = String::from_utf8(told.stdout).unwrap();
    assert!(
        told.contains("points    26107") && told.contains("83893 points were left out by --where or --classes"),
        "{told}"
    );
    let image = folder.path("a.png");
    let render = ["render", text(&input), "-o", text(&image)];
    fails(&[&render[..], &["--where", "z[100:]"]].concat(), 1, &["none of the 4 points", "--where"]);
    fails(&[&render[..], &["--where", "height[1:2]"]].concat(), 2, &["'height'", "X, Y, Z, sx"]);
    fails(&[&render[..], &["--where", "z[2:1]"]].concat(), 2, &["above the upper one"]);
    fails(&[&render[..], &["--classes", "grass"]].concat(), 2, &["is no class", "ground"]);
    let bunny = format!("{DATA}/bunny.obj");
    fails(&["render", &bunny, "-o", text(&image), "--where", "z[0:]"], 2, &["it is a mesh"]);
}

#[test]
fn bad_choices_of_colours_are_refused() {
    let folder = Folder::new();
    let (input, image) = (row(&folder), folder.path("a.png"));
    let render = ["render", text(&input), "-o", text(&image)];
    let refused = |more: &[&str], words: &[&str]| fails(&[&render[..], more].concat(), 2, words);
    refused(&["--color-by", "gps-time"], &["no attribute 'gps-time'", "scalar_Classification, intensity"]);
    refused(&["--color-by", "z", "--color-map", "jet"], &["no colour map", "viridis, turbo"]);
    refused(&["--color-by", "z", "--range", "2,1"], &["the lesser first"]);
    refused(&["--color-by", "z", "--range", "1"], &["two numbers or percentages"]);
    refused(&["--range", "1,2"], &["--color-by"]);
    refused(&["--legend"], &["--legend", "--color-by"]);
    refused(&["--scale-bar"], &["--scale-bar", "--ortho"]);
    refused(&["--north", "--ortho", "10"], &["--north", "along -z"]);
    refused(&["--color-by", "normal", "--facing", "square"], &["--facing", "normal"]);
    assert_eq!(folder.names(), ["row.ply"]);
}

#[test]
fn a_legend_is_drawn_into_the_colour_alone() {
    let folder = Folder::new();
    let (input, plain, marked) = (row(&folder), folder.path("plain.exr"), folder.path("marked.exr"));
    let view = ["--eye", "15,0,50", "--target", "15,0,0", "--up", "y", "--ortho", "40", "--size", "200x160"];
    let render = |output: &Path, more: &[&str]| {
        let by = ["--color-by", "intensity", "--aov", "depth", "--backend", "reference", "--samples", "1"];
        succeeds(&[&["render", text(&input), "-o", text(output)], &view[..], &by[..], more].concat());
        io::exr::read(output).unwrap()
    };
    let without = render(&plain, &[]);
    let with = render(&marked, &["--legend", "--scale-bar", "--north"]);
    assert_eq!(without.map(epsplat::Map::Depth), with.map(epsplat::Map::Depth));
    let changed = (0..with.color.len()).filter(|index| with.color[*index] != without.color[*index]).count();
    assert!(changed > 2000 && changed < with.color.len() / 2, "{changed}");
    // The middle of the picture is free of marks.
    assert!((60..100).all(|y| (60..120).all(|x| with.color[y * 200 + x] == without.color[y * 200 + x])));
}

#[test]
fn parts_of_an_octree_share_the_range_of_the_overview() {
    let mut scene = SceneOptions::default();
    scene.colors.color_by = Some("z".parse().unwrap());
    let scene = Scene::open([format!("{DATA}/simple.copc.laz")], &scene).unwrap();
    let mut options = RenderOptions::default();
    let device = DeviceOptions { backend: "reference".parse().unwrap(), ..DeviceOptions::default() };
    let ends = |picture: Picture| match picture.key.unwrap().colors {
        KeyColors::Ramp { ends, .. } => (ends, picture.read.map(|read| read.points[0])),
        other => panic!("{other:?}"),
    };
    let view = |side: u32| View::new(&CameraOptions { size: Some((side, side)), ..CameraOptions::default() }).unwrap();
    let whole = ends(Renderer::new(&scene, &options, &device, &()).unwrap().frame(&view(32), &()).unwrap());
    // 2 % and 98 % of all heights, as numpy sorts them.
    assert!((whole.0[0] - 411.19).abs() < 1e-4 && (whole.0[1] - 520.6).abs() < 1e-4, "{whole:?}");
    options.levels.lod = Some("8px".parse().unwrap());
    let mut renderer = Renderer::new(&scene, &options, &device, &()).unwrap();
    let [far, near] = [16, 256].map(|side| ends(renderer.frame(&view(side), &()).unwrap()));
    assert_eq!(far.0, near.0);
    assert!(far.1.unwrap() < near.1.unwrap(), "{far:?} {near:?}");
}

#[test]
fn info_lists_attributes_with_their_ranges() {
    let folder = Folder::new();
    let input = row(&folder);
    let output = succeeds(&["info", text(&input), "--json", "-"]);
    let info: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let attributes = info["attributes"].as_array().unwrap();
    let range = |name: &str| &attributes.iter().find(|attribute| attribute["name"] == name).unwrap()["range"];
    assert_eq!(range("X"), &serde_json::json!([0.0, 30.0]));
    assert_eq!(range("Z"), &serde_json::json!([-1.0, 1.0]));
    assert_eq!(range("scalar_Classification"), &serde_json::json!([2.0, 77.0]));
    let told = String::from_utf8(succeeds(&["info", &format!("{DATA}/autzen.laz")]).stdout).unwrap();
    for line in ["Intensity          0 to 254", "ReturnNumber       1 to 4", "PointSourceId      7326\n"] {
        assert!(told.contains(line), "{told}");
    }
}
