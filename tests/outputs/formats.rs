//! Formats of images: each file holds the same values, read back without epsplat's own readers
//! where there are others.

use super::common::command::{DATA, Folder, epsplat, fails, succeeds, text};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::scene::Map;
use std::path::Path;
use std::process::{Command, Stdio};

/// The arguments of a small picture of the bunny, by the reference.
fn picture<'a>(bunny: &'a str, output: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["render", bunny, "--mesh", "surfels", "-o", output, "--backend", "reference", "--size", "40x30"], more].concat()
}

fn bunny() -> String {
    format!("{DATA}/bunny.obj")
}

/// Renders to a new file, and returns its bytes.
fn rendered(folder: &Folder, name: &str, more: &[&str]) -> Vec<u8> {
    let output = folder.path(name);
    succeeds(&picture(&bunny(), text(&output), more));
    std::fs::read(output).unwrap()
}

/// An array of NumPy: the text of its header and its data.
fn npy(bytes: &[u8]) -> (&str, &[u8]) {
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert_eq!((10 + length) % 64, 0);
    assert_eq!(bytes[9 + length], b'\n');
    (std::str::from_utf8(&bytes[10..10 + length]).unwrap().trim_end(), &bytes[10 + length..])
}

/// The files of an archive without compression, by the local headers, which have sizes of 64 bits.
fn zipped(bytes: &[u8]) -> Vec<(String, &[u8])> {
    let (mut files, mut at) = (Vec::new(), 0);
    let number = |at: usize, count: usize| {
        bytes[at..at + count].iter().rev().fold(0usize, |value, byte| value << 8 | usize::from(*byte))
    };
    while number(at, 4) == 0x0403_4b50 {
        let (crc, name, extra) = (number(at + 14, 4), number(at + 26, 2), number(at + 28, 2));
        assert_eq!((number(at + 8, 2), number(at + 30 + name, 2)), (0, 1), "no compression, sizes of 64 bits");
        let (start, size) = (at + 30 + name + extra, number(at + 34 + name, 8));
        let data = &bytes[start..start + size];
        assert_eq!(crc32(data), crc as u32);
        files.push((String::from_utf8(bytes[at + 30..at + 30 + name].to_vec()).unwrap(), data));
        at = start + size;
    }
    // The central directory follows, and has an entry for each file.
    assert_eq!(number(at, 4), 0x0201_4b50);
    assert_eq!(number(bytes.len() - 12, 2), files.len());
    files
}

fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    !bytes.iter().fold(u32::MAX, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
}

/// The bits of f32 or u32 in little-endian order.
fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect()
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn arrays_have_the_bits_of_an_exr() {
    let folder = Folder::new();
    let aov = ["--aov", "depth,normal,height,index"];
    rendered(&folder, "a.exr", &aov);
    let frame = epsplat::io::exr::read(&folder.path("a.exr")).unwrap();
    let color: Vec<f32> = frame.color.iter().flatten().copied().collect();
    assert!(color.iter().any(|value| *value > 0.1));
    let archive = rendered(&folder, "a.npz", &aov);
    let files = zipped(&archive);
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["color.npy", "depth.npy", "normal.npy", "index.npy", "height.npy"]);
    for (name, file) in &files {
        let (header, data) = npy(file);
        let (kind, shape, expected) = match name.as_str() {
            "color.npy" => ("<f4", "(30, 40, 4)", bits(&color)),
            "depth.npy" => ("<f4", "(30, 40)", bits(frame.map(Map::Depth).unwrap())),
            "normal.npy" => ("<f4", "(30, 40, 3)", bits(frame.map(Map::Normal).unwrap())),
            "height.npy" => ("<f4", "(30, 40)", bits(frame.map(Map::Height).unwrap())),
            _ => ("<u4", "(30, 40, 2)", frame.numbers(Map::Index).unwrap().to_vec()),
        };
        assert_eq!(header, format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}"));
        assert!(words(data) == expected, "{name}");
    }
    // An .npy file holds the colour, or the only map.
    let plain = rendered(&folder, "c.npy", &[]);
    assert!(plain == files[0].1);
    let depth = rendered(&folder, "d.npy", &["--aov", "depth"]);
    assert!(depth == files[1].1);
    fails(&picture(&bunny(), "x.npy", &["--aov", "depth,normal"]), 2, &["one array", ".npz"]);
}

#[test]
fn an_exr_has_one_part_with_the_names_that_others_expect() {
    let folder = Folder::new();
    rendered(&folder, "a.exr", &["--aov", "depth,normal,surfaces", "--composite", "layers"]);
    let file = exr::meta::MetaData::read_from_file(folder.path("a.exr"), true).unwrap();
    assert_eq!(file.headers.len(), 1);
    let names: Vec<String> = file.headers[0].channels.list.iter().map(|channel| channel.name.to_string()).collect();
    assert_eq!(names[..8], ["A", "B", "G", "R", "depth.Z", "normal.X", "normal.Y", "normal.Z"]);
    assert!(names.contains(&"surfaces.8.A".to_owned()) && names.len() == 24, "{names:?}");
}

/// Versions before 0.2.0 wrote a part for each map.
#[test]
fn files_with_a_part_for_each_map_are_read() {
    use exr::prelude::*;
    let folder = Folder::new();
    let values = |k: f32| (0..6).map(|i| k + i as f32).collect::<Vec<f32>>();
    let part = |name: &str, channels: &[(&str, FlatSamples)]| {
        let channels = channels.iter().map(|(name, samples)| AnyChannel::new(*name, samples.clone()));
        let attributes = LayerAttributes::named(name);
        Layer::new((3, 2), attributes, Encoding::FAST_LOSSLESS, AnyChannels::sort(channels.collect()))
    };
    let floats = |k: f32| FlatSamples::F32(values(k));
    let layers = vec![
        part("color", &[("R", floats(0.1)), ("G", floats(0.2)), ("B", floats(0.3)), ("A", floats(0.4))]),
        part("depth", &[("Z", floats(7.0))]),
        part("index", &[("input", FlatSamples::U32(vec![0; 6])), ("point", FlatSamples::U32(vec![u32::MAX; 6]))]),
    ];
    let bounds = IntegerBounds::from_dimensions((3, 2));
    let path = folder.path("old.exr");
    Image::from_layers(ImageAttributes::new(bounds), layers).write().to_file(&path).unwrap();
    let read = epsplat::io::exr::read(&path).unwrap();
    assert_eq!(read.color[2], [2.1, 2.2, 2.3, 2.4]);
    assert_eq!(read.map(Map::Depth).unwrap(), values(7.0));
    assert_eq!(read.numbers(Map::Index).unwrap()[..2], [0, u32::MAX]);
    // `compare` finds no difference to the new layout.
    let new = folder.path("new.exr");
    epsplat::io::exr::write(&new, &read).unwrap();
    let said = String::from_utf8(succeeds(&["compare", text(&path), text(&new)]).stdout).unwrap();
    assert!(said.contains("equal images") && said.contains("depth") && !said.contains("only"), "{said}");
}

#[test]
fn raw_frames_and_jpegs_show_the_png() {
    let folder = Folder::new();
    rendered(&folder, "a.png", &[]);
    let png = image::open(folder.path("a.png")).unwrap().into_rgba8();
    assert!(png.as_raw() == &rendered(&folder, "a.raw", &[]));
    // A JPEG shows the picture over white; its errors are those of the compression.
    let bytes = rendered(&folder, "a.jpeg", &["--background", "0.2,0.4,0.1"]);
    assert_eq!(bytes[..2], [0xff, 0xd8]);
    rendered(&folder, "b.png", &["--background", "1,1,1"]);
    let over = |name: &str| image::open(folder.path(name)).unwrap().into_rgb8();
    rendered(&folder, "b.jpg", &[]);
    let (jpeg, white) = (over("b.jpg"), over("b.png"));
    let off = |a: &image::RgbImage, b: &image::RgbImage| {
        a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.as_raw().len() as f64
    };
    assert!(off(&jpeg, &white) < 3.0, "{}", off(&jpeg, &white));
    assert!(off(&over("a.jpeg"), &white) > 20.0, "control: another background");
    fails(&picture(&bunny(), "x.jpg", &["--aov", "depth"]), 2, &["JPEG holds no maps", ".exr"]);
}

#[test]
fn depths_are_integers_of_a_stated_scale() {
    let folder = Folder::new();
    rendered(&folder, "a.exr", &["--aov", "depth"]);
    let frame = epsplat::io::exr::read(&folder.path("a.exr")).unwrap();
    let depths = frame.map(Map::Depth).unwrap();
    rendered(&folder, "a.png", &["--aov", "depth", "--depth-scale", "1000"]);
    let image::DynamicImage::ImageLuma16(image) = image::open(folder.path("a.png")).unwrap() else {
        panic!("16-bit grey");
    };
    let mut seen = 0;
    for (value, depth) in image.as_raw().iter().zip(depths) {
        let expected = if depth.is_finite() { (f64::from(*depth) * 1000.0).round() } else { 0.0 };
        assert_eq!(f64::from(*value), expected);
        seen += usize::from(*value > 0);
    }
    assert!(seen > 100 && seen < depths.len());
    let png = folder.path("x.png");
    let scaled = |scale: &str| picture_of(&png, &["--aov", "depth", "--depth-scale", scale]);
    let output = epsplat(&scaled("1e6").iter().map(String::as_str).collect::<Vec<_>>());
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    let fits = said.split("--depth-scale ").nth(1).unwrap().split(' ').next().unwrap().to_owned();
    assert!(said.contains("exceeds 65535") && !png.exists(), "{said}");
    succeeds(&scaled(&fits).iter().map(String::as_str).collect::<Vec<_>>());
    fails(&picture(&bunny(), "x.png", &["--depth-scale", "9"]), 2, &["--aov depth"]);
    fails(&picture(&bunny(), "x.exr", &["--aov", "depth", "--depth-scale", "9"]), 2, &[".png"]);
    fails(&picture(&bunny(), "x.png", &["--aov", "normal", "--depth-scale", "9"]), 2, &["--aov depth"]);
}

fn picture_of(output: &Path, more: &[&str]) -> Vec<String> {
    picture(&bunny(), text(output), more).into_iter().map(str::to_owned).collect()
}

#[test]
fn standard_output_gets_the_bytes_of_a_file_and_nothing_else() {
    let folder = Folder::new();
    for (format, more) in [("png", &[][..]), ("exr", &["--aov", "depth"]), ("npy", &[]), ("jpg", &[]), ("tif", &[])] {
        let bytes = rendered(&folder, &format!("a.{format}"), more);
        let line = [&["--format", format][..], more].concat();
        assert!(succeeds(&picture(&bunny(), "-", &line)).stdout == bytes, "{format}");
    }
    assert!(succeeds(&picture(&bunny(), "-", &[])).stdout == std::fs::read(folder.path("a.png")).unwrap());
    assert!(!folder.path("-").exists() && !Path::new("-").exists());
    fails(&picture(&bunny(), "-", &["--json", "-"]), 2, &["both go to standard output"]);
    fails(&picture(&bunny(), "a.exr", &["--format", "png"]), 2, &["names another format"]);
    let turn = ["--turntable", "3", "--format", "exr"];
    fails(&picture(&bunny(), "-", &turn), 2, &["cannot be told apart", "raw"]);
}

#[test]
fn a_turntable_streams_the_frames_that_a_folder_gets() {
    let folder = Folder::new();
    let output = folder.path("turn");
    succeeds(&picture(&bunny(), text(&output), &["--turntable", "3"]));
    let raw = succeeds(&picture(&bunny(), "-", &["--turntable", "3", "--format", "raw"])).stdout;
    let frames: Vec<&[u8]> = raw.chunks(40 * 30 * 4).collect();
    assert_eq!((frames.len(), raw.len()), (3, 3 * 40 * 30 * 4));
    for (number, frame) in frames.iter().enumerate() {
        let png = image::open(output.join(format!("{number:04}.png"))).unwrap().into_rgba8();
        assert!(png.as_raw() == frame, "{number}");
    }
    assert!(frames[0] != frames[1] && frames[1] != frames[2], "control: the frames differ");
    // From above, a turn of 180 degrees turns the picture.
    let above = ["--turntable", "2", "--format", "raw", "--from", "above", "--samples", "1", "--shading", "unlit"];
    let raw = succeeds(&picture(&bunny(), "-", &above)).stdout;
    let (a, b) = raw.split_at(raw.len() / 2);
    let covered = |frame: &[u8]| frame.chunks(4).map(|pixel| pixel[3] > 0).collect::<Vec<_>>();
    let turned: Vec<bool> = covered(b).into_iter().rev().collect();
    let differ = covered(a).iter().zip(&turned).filter(|(a, b)| a != b).count();
    assert!(differ * 100 < turned.len(), "{differ}");
    fails(&picture(&bunny(), "x", &["--turntable", "3", "--eye", "0,0,1"]), 2, &["--eye"]);
    fails(&picture(&bunny(), "x", &["--turntable", "0"]), 2, &["--turntable"]);
}

/// A reader that closes a pipe early has what it wants.
#[cfg(unix)]
#[test]
fn a_closed_pipe_ends_the_run_without_a_word() {
    let arguments = picture_of(Path::new("-"), &["--turntable", "400", "--format", "raw"]);
    let mut child = Command::new(env!("CARGO_BIN_EXE_epsplat"))
        .args(&arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut start = [0; 100];
    std::io::Read::read_exact(child.stdout.as_mut().unwrap(), &mut start).unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{said}");
    assert!(!said.contains("panicked") && !said.contains("error"), "{said}");
}

/// Every format says why it cannot be written, and leaves nothing.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_and_a_missing_folder_are_told_for_every_format() {
    let folder = Folder::new();
    for format in epsplat::io::images::ImageFormat::names() {
        let full = picture_of(Path::new("/dev/full"), &["--format", format]);
        fails(&full.iter().map(String::as_str).collect::<Vec<_>>(), 1, &["cannot write /dev/full", "No space left"]);
        let missing = folder.path(&format!("no/a.{format}"));
        let missing = picture_of(&missing, &[]);
        fails(&missing.iter().map(String::as_str).collect::<Vec<_>>(), 1, &["cannot write", "No such file"]);
        let script = "exec \"$0\" \"$@\" > /dev/full";
        let line = picture_of(Path::new("-"), &["--format", format]);
        let mut command = Command::new("sh");
        let output = command.args(["-c", script, env!("CARGO_BIN_EXE_epsplat")]).args(line).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(1) && said.contains("cannot write standard output: No space"), "{said}");
    }
    assert!(folder.names().is_empty());
}

/// A frame of no maps has no others to write.
#[test]
fn formats_are_found_by_their_names() {
    use epsplat::io::images::{Content, Image, ImageFormat};
    for name in ImageFormat::names() {
        let format: ImageFormat = name.parse().unwrap();
        assert!(ImageFormat::of_path(Path::new(&format!("a.{}", name.to_uppercase()))).unwrap() == format);
        let frame = Frame::of_colors(2, 1, vec![[0.5, 0.25, 1.0, 1.0]; 2]);
        let image = Image { frame: &frame, content: Content::Color, place: None };
        assert!(!format.encoded(Path::new("a"), &image).unwrap().is_empty(), "{name}");
    }
    let said = ImageFormat::of_path(Path::new("a.bmp")).unwrap_err().to_string();
    assert!(said.contains(".png, .exr") && said.contains("a.bmp"), "{said}");
}

/// The unit cube of the data folder has y up and its top face at z = 1.
#[test]
fn heights_of_a_map_are_z_whatever_the_file_calls_up() {
    let folder = Folder::new();
    let (cube, output) = (format!("{DATA}/cube.obj"), folder.path("h.npy"));
    let map = ["render", &cube, "-o", text(&output), "--backend", "reference", "--pixel-size", "0.5"];
    succeeds(&[&map[..], &["--up", "z", "--aov", "height"]].concat());
    let file = std::fs::read(&output).unwrap();
    let (_, data) = npy(&file);
    let heights: Vec<f32> = words(data).into_iter().map(f32::from_bits).collect();
    assert!(heights.len() == 16 && heights.iter().all(|height| (height - 1.0).abs() < 1e-6), "{heights:?}");
    fails(&[&map[..], &["--aov", "height"]].concat(), 2, &["y is up", "--up z"]);
}

#[test]
fn marks_and_eye_dome_lighting_are_refused_where_tiles_would_repeat_them() {
    let folder = Folder::new();
    let (scan, output) = (format!("{DATA}/autzen.laz"), folder.path("m.png"));
    let map = ["render", &scan, "-o", text(&output), "--facing", "square", "--bounds", "636550,848950,637050,848960"];
    let refuses = |more: &[&str], words: &[&str]| fails(&[&map[..], more].concat(), 2, words);
    // 5000 columns are two tiles.
    refuses(&["--pixel-size", "0.1", "--edl"], &["--edl", "one tile", "5000x100"]);
    refuses(&["--pixel-size", "0.02", "--scale-bar"], &["--scale-bar", "one band"]);
    assert!(!output.exists());
    succeeds(&[&map[..], &["--pixel-size", "0.1", "--scale-bar", "--backend", "reference", "--samples", "1"]].concat());
}
