//! Maps of `--pixel-size`: where their pixels lie, what their files say about it, and heights.

use super::common::command::{DATA, Folder, fails, ply, succeeds, text};
use std::fs::File;
use std::path::{Path, PathBuf};
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;

/// A level square of 20x20 units at map coordinates, z = 5, with a block of z = 9 over x 6 to 8 and
/// y 14 to 16, relative to (1000, 2000).
fn cloud(folder: &Folder) -> PathBuf {
    let inside = |x: f64, y: f64| (6.0..=8.0).contains(&x) && (14.0..=16.0).contains(&y);
    let rows: String = (0..41 * 41)
        .map(|i| (f64::from(i % 41) * 0.5, f64::from(i / 41) * 0.5))
        .map(|(x, y)| format!("{} {} {} 0 0 1 0.4\n", 1000.0 + x, 2000.0 + y, if inside(x, y) { 9 } else { 5 }))
        .collect();
    let text = ply("x y z nx ny nz radius", 41 * 41, &rows);
    folder.file("c.ply", text.replace("format ascii 1.0\n", "format ascii 1.0\ncomment epsplat\ncomment up z\n"))
}

fn rendered(input: &str, output: &Path, more: &[&str]) {
    let line = ["render", input, "-o", text(output), "--backend", "reference", "--samples", "1"];
    succeeds(&[&line[..], more].concat());
}

/// The size of a TIFF and its pixels.
fn pixels(path: &Path) -> ((u32, u32), DecodingResult) {
    let mut decoder = Decoder::new(File::open(path).unwrap()).unwrap();
    (decoder.dimensions().unwrap(), decoder.read_image().unwrap())
}

fn floats(path: &Path) -> ((u32, u32), Vec<f32>) {
    match pixels(path) {
        (size, DecodingResult::F32(values)) => (size, values),
        _ => panic!("f32"),
    }
}

/// The scale of pixels and the tie point.
fn place(path: &Path) -> (Vec<f64>, Vec<f64>) {
    let mut decoder = Decoder::new(File::open(path).unwrap()).unwrap();
    let mut numbers = |tag| decoder.get_tag_f64_vec(tag).unwrap();
    (numbers(Tag::ModelPixelScaleTag), numbers(Tag::ModelTiepointTag))
}

#[test]
fn a_point_lies_where_the_grid_says() {
    let folder = Folder::new();
    let (cloud, tif) = (cloud(&folder), folder.path("h.tif"));
    rendered(text(&cloud), &tif, &["--pixel-size", "0.25", "--aov", "height"]);
    let ((width, height), values) = floats(&tif);
    // The data span 1000 to 1020 and 2000 to 2020, all multiples of the pixel.
    assert_eq!((width, height), (80, 80));
    assert_eq!(place(&tif), (vec![0.25, 0.25, 0.0], vec![0.0, 0.0, 0.0, 1000.0, 2020.0, 0.0]));
    let at = |x: f64, y: f64| values[((2020.0 - y) / 0.25) as usize * 80 + ((x - 1000.0) / 0.25) as usize];
    assert_eq!((at(1007.1, 2015.1), at(1006.1, 2014.1)), (9.0, 9.0));
    // Controls: the ground around the block, where x and y change places, and where y is upside
    // down.
    assert_eq!((at(1005.1, 2015.1), at(1015.1, 2007.1), at(1007.1, 2005.1)), (5.0, 5.0, 5.0));
    let mut decoder = Decoder::new(File::open(&tif).unwrap()).unwrap();
    assert_eq!(decoder.get_tag_ascii_string(Tag::GdalNodata).unwrap(), "nan");
    let outside = folder.path("o.tif");
    rendered(text(&cloud), &outside, &["--pixel-size", "1", "--aov", "height", "--bounds", "1018,2018,1024,2021.5"]);
    let ((width, height), values) = floats(&outside);
    assert_eq!((width, height, place(&outside).1[4]), (6, 4, 2022.0));
    assert!(values[0].is_nan() && values[6 * 3] == 5.0);
}

#[test]
fn heights_are_the_depths_below_the_camera() {
    let folder = Folder::new();
    let scan = format!("{DATA}/autzen.laz");
    let part = ["--pixel-size", "2", "--bounds", "636500,849100,636700,849200"];
    let [heights, depths, json] = ["h.tif", "d.tif", "d.json"].map(|name| folder.path(name));
    rendered(&scan, &heights, &[&part[..], &["--aov", "height"]].concat());
    rendered(&scan, &depths, &[&part[..], &["--aov", "depth", "--json", text(&json)]].concat());
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    let eye = report["grid"]["eye"].as_f64().unwrap();
    let ((size, heights), (same, depths)) = (floats(&heights), floats(&depths));
    assert_eq!((size, same), ((100, 50), (100, 50)));
    let mut seen = 0;
    for (height, depth) in heights.iter().zip(&depths) {
        assert_eq!(height.is_nan(), depth.is_nan());
        if !depth.is_nan() {
            let expected = eye - f64::from(*depth);
            assert!((f64::from(*height) - expected).abs() <= 1e-6 * expected, "{height} {expected}");
            // `epsplat info` says that the scan lies between these heights, feet.
            assert!((390.0..620.0).contains(height), "{height}");
            seen += 1;
        }
    }
    assert!(seen > 3000, "{seen}");
}

/// The keys of the LAS file are copied one by one, with the meaning of a pixel added.
#[test]
fn the_coordinate_system_is_that_of_the_las_file() {
    let folder = Folder::new();
    let (scan, tif) = (format!("{DATA}/autzen.laz"), folder.path("a.tif"));
    let part = ["--pixel-size", "4", "--bounds", "636500,849100,636700,849200"];
    rendered(&scan, &tif, &part);
    let bytes = std::fs::read(scan).unwrap();
    // The first record of this file is its key directory.
    let words: Vec<u32> =
        bytes[227 + 54..][..184].chunks(2).map(|b| u32::from(u16::from_le_bytes([b[0], b[1]]))).collect();
    let count = words[3] as usize;
    let mut expected: Vec<&[u32]> = words[4..][..4 * count].chunks(4).collect();
    let area = [1025, 0, 1, 1];
    expected.retain(|key| key[0] != 1025);
    expected.push(&area);
    expected.sort();
    let mut decoder = Decoder::new(File::open(&tif).unwrap()).unwrap();
    let keys = decoder.get_tag_u32_vec(Tag::GeoKeyDirectoryTag).unwrap();
    assert_eq!(keys[..4], [1, 1, 0, expected.len() as u32]);
    assert_eq!(keys[4..].chunks(4).collect::<Vec<_>>(), expected);
    let doubles = decoder.get_tag_f64_vec(Tag::GeoDoubleParamsTag).unwrap();
    assert_eq!((doubles[0], doubles.len()), (41.75, 9));
    let texts = decoder.get_tag_ascii_string(Tag::GeoAsciiParamsTag).unwrap();
    assert!(texts.starts_with("NAD_1983_HARN_Lambert_Conformal_Conic|"), "{texts}");
    // A file whose system is text with a code.
    let copc = folder.path("c.tif");
    rendered(&format!("{DATA}/simple.copc.laz"), &copc, &["--pixel-size", "100"]);
    let mut decoder = Decoder::new(File::open(&copc).unwrap()).unwrap();
    let keys = decoder.get_tag_u32_vec(Tag::GeoKeyDirectoryTag).unwrap();
    assert!(keys.chunks(4).any(|key| key == [3072, 0, 1, 2991]), "{keys:?}");
}

#[test]
fn colours_are_those_of_a_png_and_world_files_have_the_grid() {
    let folder = Folder::new();
    let cloud = cloud(&folder);
    let [tif, png, jpg] = ["a.tif", "a.png", "b.jpg"].map(|name| folder.path(name));
    for path in [&tif, &png, &jpg] {
        rendered(text(&cloud), path, &["--pixel-size", "0.5", "--bounds", "995,1995,1010,2012.25"]);
    }
    let ((width, height), DecodingResult::U8(bytes)) = pixels(&tif) else { panic!("8 bits") };
    assert_eq!((width, height), (30, 35));
    let image = image::open(&png).unwrap().into_rgba8();
    assert!(image.as_raw() == &bytes);
    // Nothing lies in the west and the south, and the square in the north-east.
    let alpha = |column: u32, row: u32| image.get_pixel(column, row).0[3];
    assert_eq!((alpha(1, 1), alpha(1, 33), alpha(28, 33), alpha(28, 2)), (0, 0, 0, 255));
    for world in ["a.pgw", "b.jgw"] {
        let text = std::fs::read_to_string(folder.path(world)).unwrap();
        assert_eq!(text, "0.5\n0\n0\n-0.5\n995.25\n2012.25\n");
    }
    assert!(!folder.path("a.tfw").exists());
    // Nothing is written where a world file would overwrite an input.
    let own = folder.path("c.pgw");
    std::fs::copy(&cloud, &own).unwrap();
    let out = folder.path("c.png");
    let line = ["render", text(&own), "--input-format", "ply", "-o", text(&out), "--pixel-size", "1"];
    fails(&line, 2, &["would overwrite the input"]);
    assert!(!out.exists());
}

/// A wide map is rendered in tiles. Pixels on both sides of a seam are those of a map of that part
/// alone.
#[test]
fn tiles_meet_without_a_seam() {
    let folder = Folder::new();
    let (cloud, wide, part) = (cloud(&folder), folder.path("w.tif"), folder.path("p.tif"));
    let json = folder.path("w.json");
    // 5000 pixels of 1/256 from 1000 on; the seam is at 4096 pixels, x = 1016.
    let pixel = ["--pixel-size", "0.00390625", "--aov", "height", "--bounds"];
    let line = [&pixel[..], &["1000,2015,1019.53125,2015.25", "--json", text(&json)]].concat();
    rendered(text(&cloud), &wide, &line);
    rendered(text(&cloud), &part, &[&pixel[..], &["1015.75,2015,1016.25,2015.25"]].concat());
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    assert_eq!(report["tiles"], 2);
    let (((width, height), all), ((across, _), one)) = (floats(&wide), floats(&part));
    assert_eq!((width, height, across), (5000, 64, 128));
    let mut most: f32 = 0.0;
    for row in 0..64 {
        for column in 0..128 {
            let (a, b) = (all[row * 5000 + 4096 - 64 + column], one[row * 128 + column]);
            assert_eq!(a.is_nan(), b.is_nan());
            most = most.max((a - b).abs());
        }
    }
    assert!(most < 1e-5, "{most}");
}

#[test]
fn maps_that_cannot_be_made_are_refused() {
    let folder = Folder::new();
    let (cloud, bunny, out) = (cloud(&folder), format!("{DATA}/bunny.obj"), folder.path("x.tif"));
    let refuses = |input: &str, output: &Path, more: &[&str], words: &[&str]| {
        let line = ["render", input, "-o", text(output), "--backend", "reference"];
        fails(&[&line[..], more].concat(), 2, words);
    };
    refuses(&bunny, &out, &["--pixel-size", "0.1"], &["y is up", "--up z"]);
    refuses(text(&cloud), &out, &["--pixel-size", "0.1", "--up", "x"], &["--up z"]);
    refuses(text(&cloud), &out, &["--pixel-size", "0"], &["positive"]);
    refuses(text(&cloud), &out, &["--pixel-size", "1e-9"], &["larger --pixel-size", "--bounds"]);
    refuses(text(&cloud), &folder.path("x.png"), &["--pixel-size", "0.001"], &["only a .tif"]);
    refuses(text(&cloud), &out, &["--bounds", "0,0,1,1"], &["--pixel-size"]);
    refuses(text(&cloud), &out, &["--pixel-size", "1", "--bounds", "1,0,0,1"], &["XMIN,YMIN,XMAX,YMAX"]);
    refuses(text(&cloud), &out, &["--pixel-size", "1", "--size", "9x9"], &["--size"]);
    refuses(text(&cloud), &out, &["--aov", "depth,height"], &["one map"]);
    refuses(text(&cloud), &out, &["--aov", "index"], &["one or three numbers"]);
    assert_eq!(folder.names(), ["c.ply"]);
}
