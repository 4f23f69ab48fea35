//! Value ranges of colours and intensities: one rule for all formats, applied to all inputs
//! together.

use super::las::{file as las_file, point};
use super::{Folder, data};
use epsplat::io::{self, Points, ReadOptions, settle_colors};
use epsplat::low_level::scene::Colors;
use epsplat::low_level::scene::color::srgb_to_linear;
use las::{Color, Point};
use std::fmt::Write;

/// Two colours that alternate.
const ORANGE: [f64; 3] = [230.0, 120.0, 30.0];
const BLUE: [f64; 3] = [30.0, 90.0, 220.0];

fn turns(i: usize) -> [f64; 3] {
    if i.is_multiple_of(2) { ORANGE } else { BLUE }
}

/// Position of point `i` in a grid of 40 by 50.
fn place(i: usize) -> [f64; 3] {
    [(i % 40) as f64 * 0.1, (i / 40) as f64 * 0.1, 0.0]
}

/// A PLY text file of points with additional properties (type, name) and their values.
fn ply(properties: &[(&str, &str)], count: usize, values: impl Fn(usize) -> Vec<f64>) -> Vec<u8> {
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {count}\n");
    for (kind, name) in [("double", "x"), ("double", "y"), ("double", "z")].iter().chain(properties) {
        writeln!(text, "property {kind} {name}").unwrap();
    }
    text.push_str("end_header\n");
    rows(&mut text, count, values);
    text.into_bytes()
}

fn rows(text: &mut String, count: usize, values: impl Fn(usize) -> Vec<f64>) {
    for i in 0..count {
        let row: Vec<String> = place(i).into_iter().chain(values(i)).map(|value| value.to_string()).collect();
        writeln!(text, "{}", row.join(" ")).unwrap();
    }
}

/// A PCD text file of points with additional fields (name, size, type, count) and their values.
#[cfg(feature = "pcd")]
fn pcd(fields: &[(&str, usize, char, usize)], count: usize, values: impl Fn(usize) -> Vec<f64>) -> Vec<u8> {
    let all = || [("x", 8, 'F', 1), ("y", 8, 'F', 1), ("z", 8, 'F', 1)].into_iter().chain(fields.iter().copied());
    let line = |of: fn((&str, usize, char, usize)) -> String| all().map(of).collect::<Vec<_>>().join(" ");
    let mut text = format!(
        "VERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\nWIDTH {count}\nHEIGHT 1\nPOINTS {count}\nDATA ascii\n",
        line(|field| field.0.into()),
        line(|field| field.1.to_string()),
        line(|field| field.2.into()),
        line(|field| field.3.to_string())
    );
    rows(&mut text, count, values);
    text.into_bytes()
}

fn obj(count: usize, color: impl Fn(usize) -> [f64; 3]) -> Vec<u8> {
    let mut text = String::new();
    for i in 0..count {
        let ([x, y, z], [r, g, b]) = (place(i), color(i));
        writeln!(text, "v {x} {y} {z} {r} {g} {b}").unwrap();
    }
    text.into_bytes()
}

/// A LAS file with this point format, and colours and intensities from `of`.
fn las(format: u8, count: usize, of: impl Fn(usize) -> ([f64; 3], u16)) -> Vec<u8> {
    let point = |i: usize| {
        let (color, intensity) = of(i);
        let [x, y, z] = place(i);
        let [red, green, blue] = color.map(|value| value as u16);
        let color = Some(Color { red, green, blue });
        Point { x: x + 5e5, y: y + 5.6e6, z, color, intensity, ..point(0, None) }
    };
    las_file(4, format, false, (0..count).map(point))
}

/// An E57 file of one scan, with colours of this type and limits, and intensities.
#[cfg(feature = "e57")]
fn e57(
    colors: &e57::RecordDataType,
    limits: Option<[f64; 2]>,
    count: usize,
    of: impl Fn(usize) -> (Option<[f64; 3]>, f64),
) -> Vec<u8> {
    use e57::{ColorLimits, E57Writer, Record, RecordDataType, RecordName, RecordValue};
    let number = |value: f64| match colors {
        RecordDataType::Single { .. } => RecordValue::Single(value as f32),
        RecordDataType::Double { .. } => RecordValue::Double(value),
        _ => RecordValue::Integer(value as i64),
    };
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").unwrap();
    let names = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
    let mut prototype: Vec<Record> =
        names.into_iter().map(|name| Record { name, data_type: RecordDataType::F64 }).collect();
    prototype.push(Record { name: RecordName::Intensity, data_type: RecordDataType::F64 });
    let has_color = of(0).0.is_some();
    if has_color {
        let names = [RecordName::ColorRed, RecordName::ColorGreen, RecordName::ColorBlue];
        prototype.extend(names.into_iter().map(|name| Record { name, data_type: colors.clone() }));
    }
    let mut scan = writer.add_pointcloud("scan", prototype).unwrap();
    if let Some([low, high]) = limits {
        let [low, high] = [low, high].map(|limit| Some(number(limit)));
        scan.set_color_limits(Some(ColorLimits {
            red_min: low.clone(),
            red_max: high.clone(),
            green_min: low.clone(),
            green_max: high.clone(),
            blue_min: low,
            blue_max: high,
        }));
    }
    for i in 0..count {
        let (color, intensity) = of(i);
        let place = place(i).into_iter().chain([intensity]).map(RecordValue::Double);
        scan.add_point(place.chain(color.into_iter().flatten().map(number)).collect()).unwrap();
    }
    scan.finalize().unwrap();
    writer.finalize().unwrap();
    drop(writer);
    bytes.into_inner()
}

const COUNT: usize = 2000;

fn codes(points: &Points) -> Vec<[u8; 4]> {
    match &points.colors {
        Some(Colors::Srgb8(codes)) => codes.clone(),
        other => panic!("{:?}", other.as_ref().map(|colors| colors.linear(0))),
    }
}

fn assert_turns(points: &Points, what: &str) {
    for (i, code) in codes(points).into_iter().enumerate() {
        let [r, g, b] = turns(i).map(|value| value as u8);
        assert_eq!(code, [r, g, b, 255], "{what}, point {i}");
    }
    assert_eq!(points.notes, Vec::<String>::new(), "{what}");
}

fn times(factor: f64) -> impl Fn(usize) -> Vec<f64> {
    move |i| turns(i).map(|value| value * factor).to_vec()
}

#[test]
fn eight_bit_values_in_wider_types_are_eight_bit_colours() {
    let folder = Folder::new();
    for kind in ["char", "uchar", "short", "ushort", "int", "uint", "float", "double"] {
        // Some programs write unsigned bytes as signed ones.
        let signed = |value: f64| if kind == "char" && value > 127.0 { value - 256.0 } else { value };
        let properties = ["red", "green", "blue"].map(|name| (kind, name));
        let values = |i: usize| turns(i).map(signed).to_vec();
        assert_turns(&folder.read("a.ply", &ply(&properties, COUNT, values)).unwrap(), kind);
        let mixed = [(kind, "red"), ("uchar", "green"), (kind, "blue")];
        let values =
            |i: usize| turns(i).iter().enumerate().map(|(k, v)| if k == 1 { *v } else { signed(*v) }).collect();
        assert_turns(&folder.read("a.ply", &ply(&mixed, COUNT, values)).unwrap(), kind);
    }
    for factor in [256.0, 257.0] {
        let properties = ["red", "green", "blue"].map(|name| ("ushort", name));
        assert_turns(&folder.read("a.ply", &ply(&properties, COUNT, times(factor))).unwrap(), "ushort");
        assert_turns(&folder.read("a.las", &las(7, COUNT, |i| (turns(i).map(|v| v * factor), 9))).unwrap(), "LAS");
    }
    for format in [2, 3, 7, 8] {
        assert_turns(&folder.read("a.las", &las(format, COUNT, |i| (turns(i), 9))).unwrap(), "LAS");
    }
    assert_turns(&folder.read("a.obj", &obj(COUNT, turns)).unwrap(), "OBJ");
}

#[cfg(feature = "pcd")]
#[test]
fn pcd_colours_are_channels_or_vectors_of_any_type() {
    let folder = Folder::new();
    for (size, kind, factor) in [
        (1, 'U', 1.0),
        (2, 'U', 1.0),
        (2, 'U', 256.0),
        (2, 'U', 257.0),
        (4, 'U', 1.0),
        (4, 'I', 1.0),
        (4, 'F', 1.0),
        (8, 'F', 1.0),
    ] {
        for names in [
            ["red", "green", "blue"],
            ["r", "g", "b"],
            ["Red", "Green", "Blue"],
            ["diffuse_red", "diffuse_green", "diffuse_blue"],
        ] {
            let fields = names.map(|name| (name, size, kind, 1));
            assert_turns(&folder.read("a.pcd", &pcd(&fields, COUNT, times(factor))).unwrap(), names[0]);
        }
        for name in ["rgb", "Cd", "color"] {
            let fields = [(name, size, kind, 3)];
            assert_turns(&folder.read("a.pcd", &pcd(&fields, COUNT, times(factor))).unwrap(), name);
        }
    }
    let sixteen =
        pcd(&["r", "g", "b"].map(|name| (name, 2, 'U', 1)), COUNT, |i| vec![300.0 + i as f64, 40_001.0, 65_535.0]);
    let colors = folder.read("a.pcd", &sixteen).unwrap().colors.unwrap();
    let light = |code: f64| srgb_to_linear(code / 65535.0) as f32;
    assert_eq!(colors.linear(5), [light(305.0), light(40_001.0), 1.0, 1.0]);
}

/// A packed colour in a float field may be stored as an integer: as digits in text, or as the
/// float's value.
#[cfg(feature = "pcd")]
#[test]
fn a_float_field_may_hold_an_integer() {
    let folder = Folder::new();
    let packed = |i: usize| turns(i).iter().fold(0, |all, value| all << 8 | *value as u32);
    for alpha in [0u32, 0xff00_0000] {
        let text = pcd(&[("rgb", 4, 'F', 1)], COUNT, |i| vec![f64::from(packed(i) | alpha)]);
        assert_turns(&folder.read("a.pcd", &text).unwrap(), "digits");
        let signed = pcd(&[("rgb", 4, 'F', 1)], COUNT, |i| vec![f64::from((packed(i) | alpha).cast_signed())]);
        assert_turns(&folder.read("a.pcd", &signed).unwrap(), "signed digits");
    }
    let text = String::from_utf8(pcd(&[("rgb", 4, 'F', 1)], 0, |_| Vec::new())).unwrap();
    let binary = |of: &dyn Fn(usize) -> f32| {
        let header = text.replace("WIDTH 0", "WIDTH 500").replace("POINTS 0", "POINTS 500").replace("ascii", "binary");
        let mut bytes = header.into_bytes();
        for i in 0..500 {
            bytes.extend(place(i).iter().flat_map(|c| c.to_le_bytes()).chain(of(i).to_le_bytes()));
        }
        bytes
    };
    assert_turns(&folder.read("a.pcd", &binary(&|i| packed(i) as f32)).unwrap(), "the value of a float");
    assert_turns(&folder.read("a.pcd", &binary(&|i| f32::from_bits(packed(i)))).unwrap(), "the bits of a float");
    // PCL's own sample: one colour, and a fourth byte that was never set.
    let sample = folder.read("a.pcd", &binary(&|_| 4.2108e6)).unwrap().colors.unwrap();
    let light = |code: f64| srgb_to_linear(code / 255.0) as f32;
    assert_eq!(sample.linear(7), [light(128.0), light(128.0), light(224.0), 1.0]);
}

#[cfg(feature = "e57")]
#[test]
fn e57_colours_follow_their_limits_unless_the_values_contradict_them() {
    use e57::RecordDataType;
    let folder = Folder::new();
    let single = RecordDataType::Single { min: None, max: None };
    let integer = |max| RecordDataType::Integer { min: 0, max };
    let read = |kind: &RecordDataType, limits, factor: f64| {
        let color = |i: usize| (Some(turns(i).map(|value| value * factor)), 0.5);
        folder.read("a.e57", &e57(kind, limits, COUNT, color)).unwrap()
    };
    for (kind, limits, factor) in [
        (&single, None, 1.0),
        (&RecordDataType::F64, None, 1.0),
        (&single, Some([0.0, 255.0]), 1.0),
        (&single, Some([0.0, 65535.0]), 1.0),
        (&integer(255), None, 1.0),
        (&integer(65535), None, 1.0),
        (&integer(65535), None, 257.0),
        (&integer(65535), Some([0.0, 255.0]), 1.0),
        (&integer(65535), Some([0.0, 65535.0]), 1.0),
    ] {
        assert_turns(&read(kind, limits, factor), &format!("{kind:?} {limits:?}"));
    }
    let share = read(&single, None, 1.0 / 255.0).colors.unwrap();
    let [r, g, b, _] = share.linear(0);
    for (light, code) in [r, g, b].into_iter().zip(ORANGE) {
        assert!((f64::from(light) - srgb_to_linear(code / 255.0)).abs() < 1e-6);
    }
    // Limits that most values exceed are ignored with a note.
    let wrong = read(&integer(65535), Some([0.0, 255.0]), 257.0);
    assert_eq!(codes(&wrong)[0], [230, 120, 30, 255]);
    assert!(wrong.notes[0].contains("range from 0 to 255, but 6000 of 6000 numbers lie outside"), "{:?}", wrong.notes);
    // Limits that contain all values are applied.
    let stretched = read(&integer(255), Some([0.0, 240.0]), 1.0).colors.unwrap();
    assert_eq!(stretched.linear(0)[0], srgb_to_linear(230.0 / 240.0) as f32);
}

/// If at most 1 % of the nonzero numbers exceed 255, they are outliers; with more, all numbers are
/// 16-bit.
#[test]
fn few_outliers_do_not_make_sixteen_bits() {
    let folder = Folder::new();
    for (outliers, largest, is_byte) in
        [(1, 256.0, true), (20, 256.0, true), (20, 65535.0, true), (61, 256.0, false), (2000, 60_000.0, false)]
    {
        let color = |i: usize| if i < outliers { [largest, 120.0, 30.0] } else { turns(i) };
        let values = |i: usize| color(i).to_vec();
        let ushort = ["red", "green", "blue"].map(|name| ("ushort", name));
        let read = [
            folder.read("a.las", &las(2, COUNT, |i| (color(i), 9))).unwrap(),
            folder.read("a.ply", &ply(&ushort, COUNT, values)).unwrap(),
        ];
        for points in read {
            let found = matches!(points.colors, Some(Colors::Srgb8(_)));
            assert_eq!(found, is_byte, "{outliers} of {largest}");
            if is_byte {
                assert_eq!((codes(&points)[0], codes(&points)[99]), ([255, 120, 30, 255], [30, 90, 220, 255]));
                assert_eq!(points.notes, Vec::<String>::new());
            }
        }
    }
    // Black points do not count: the few others decide.
    let color = |i: usize| if i < 10 { [300.0 * i as f64, 50_000.0, 40_000.0] } else { [0.0; 3] };
    let read = folder.read("a.las", &las(2, COUNT, |i| (color(i), 9))).unwrap();
    assert!(matches!(read.colors, Some(Colors::Linear(_))));
}

#[test]
fn floats_are_light_in_ply_and_srgb_elsewhere() {
    let folder = Folder::new();
    let float = ["red", "green", "blue"].map(|name| ("float", name));
    let shares = |i: usize| turns(i).map(|value| value / 255.0);
    let share = (ORANGE[0] / 255.0) as f32;
    let ply_colors = folder.read("a.ply", &ply(&float, COUNT, |i| shares(i).to_vec())).unwrap().colors.unwrap();
    assert_eq!(ply_colors.linear(0)[0], share);
    let of_obj = folder.read("a.obj", &obj(COUNT, shares)).unwrap().colors.unwrap();
    assert_eq!(of_obj.linear(0)[0], srgb_to_linear(share.into()) as f32);
    // Values above 1 are kept as brighter than white, and their share is reported.
    let bright = |i: usize| shares(i).map(|share| if i.is_multiple_of(10) { share * 6.0 } else { share }).to_vec();
    let points = folder.read("a.ply", &ply(&float, COUNT, bright)).unwrap();
    assert!((points.colors.unwrap().linear(0)[0] - 6.0 * share).abs() < 1e-6);
    assert!(
        points.notes[0].starts_with("warning: a.ply: ") && points.notes[0].contains("above 1"),
        "{:?}",
        points.notes
    );
    // Non-integer values up to 255 keep their fractions.
    let halves = |i: usize| turns(i).map(|value| value + 0.5).to_vec();
    let points = folder.read("a.ply", &ply(&float, COUNT, halves)).unwrap();
    assert_eq!(points.colors.unwrap().linear(1)[2], srgb_to_linear(220.5 / 255.0) as f32);
}

/// Whatever range is chosen, colours that are nearly black are reported.
#[test]
fn dark_pictures_are_told() {
    let folder = Folder::new();
    let dark = |i: usize| turns(i).map(|value| (value / 40.0).floor());
    let ushort = ["red", "green", "blue"].map(|name| ("ushort", name));
    let float = ["red", "green", "blue"].map(|name| ("float", name));
    let uchar = ["red", "green", "blue"].map(|name| ("uchar", name));
    let twelve_bits = |i: usize| turns(i).map(|value| value * 16.0 + 1.0);
    for (name, bytes) in [
        ("a.las", las(2, COUNT, |i| (dark(i), 9))),
        ("b.las", las(2, COUNT, |i| (twelve_bits(i), 9))),
        ("a.ply", ply(&ushort, COUNT, |i| dark(i).to_vec())),
        ("b.ply", ply(&uchar, COUNT, |i| turns(i).map(|value| (value / 255.0).round()).to_vec())),
        ("c.ply", ply(&float, COUNT, |i| turns(i).map(|value| value / 65535.0).to_vec())),
        ("a.obj", obj(COUNT, |i| turns(i).map(|value| value / 65535.0))),
    ] {
        let notes = folder.read(name, &bytes).unwrap().notes;
        let told = notes.len() == 1 && notes[0].starts_with(&format!("warning: {name}: its colours are nearly black"));
        assert!(told, "{name}: {notes:?}");
        let (_, preparation) =
            epsplat::low_level::surfels::build(vec![folder.read(name, &bytes).unwrap()], &()).unwrap();
        assert!(preparation.notes().contains(&notes[0]));
    }
}

/// Reads files as one scene.
fn together(folder: &Folder, files: &[(&str, Vec<u8>)]) -> Vec<Points> {
    let read = |(name, bytes): &(&str, Vec<u8>)| {
        std::fs::write(folder.path(name), bytes).unwrap();
        io::read_raw(&folder.path(name), ReadOptions::default(), &()).unwrap()
    };
    let mut inputs: Vec<Points> = files.iter().map(read).collect();
    settle_colors(&mut inputs);
    inputs
}

/// Two tiles of one scan share their white level: equal intensities give equal greys.
#[test]
fn tiles_of_intensities_have_no_seam() {
    let folder = Folder::new();
    let dark = |i: usize| 100.0 + (i % 50) as f64;
    let light = |i: usize| 100.0 + (i % 50) as f64 * 20.0;
    let ply_of = |kind: &str, name: &str, of: &dyn Fn(usize) -> f64| ply(&[(kind, name)], COUNT, |i| vec![of(i)]);
    let las_of = |format: u8, of: &dyn Fn(usize) -> f64| las(format, COUNT, |i| ([0.0; 3], of(i) as u16));
    #[cfg_attr(not(any(feature = "pcd", feature = "e57")), allow(unused_mut))]
    let mut pairs = vec![
        [("a.las", las_of(0, &dark)), ("b.las", las_of(0, &light))],
        [("a.las", las_of(2, &dark)), ("b.las", las_of(1, &light))],
        [("a.las", las_of(6, &dark)), ("b.las", las_of(7, &light))],
        [("a.ply", ply_of("float", "intensity", &dark)), ("b.ply", ply_of("double", "scalar_Intensity", &light))],
        [("a.ply", ply_of("ushort", "intensity", &dark)), ("b.las", las_of(1, &light))],
    ];
    #[cfg(feature = "pcd")]
    {
        let pcd_of = |of: &dyn Fn(usize) -> f64| pcd(&[("intensity", 4, 'F', 1)], COUNT, |i| vec![of(i)]);
        pairs.push([("a.pcd", pcd_of(&dark)), ("b.pcd", pcd_of(&light))]);
        pairs.push([("a.pcd", pcd_of(&dark)), ("b.ply", ply_of("float", "intensity", &light))]);
    }
    #[cfg(feature = "e57")]
    {
        let e57_of = |of: &dyn Fn(usize) -> f64| e57(&e57::RecordDataType::U8, None, COUNT, |i| (None, of(i)));
        pairs.push([("a.e57", e57_of(&dark)), ("b.e57", e57_of(&light))]);
    }
    for pair in pairs {
        let what = format!("{} and {}", pair[0].0, pair[1].0);
        let alone: Vec<Points> = pair.iter().map(|(name, bytes)| folder.read(name, bytes).unwrap()).collect();
        let tiles = together(&folder, &pair);
        let white = 100.0 + 49.0 * 20.0;
        for (tile, of) in tiles.iter().zip([&dark as &dyn Fn(usize) -> f64, &light]) {
            for (i, code) in codes(tile).into_iter().enumerate() {
                let grey = (of(i) / white * 255.0).round() as u8;
                assert_eq!(code, [grey, grey, grey, 255], "{what}, point {i}");
            }
        }
        // Control: each tile alone has its own white level.
        assert_eq!((codes(&alone[0])[49], codes(&alone[1])[49]), ([255; 4], [255; 4]), "{what}");
    }
}

/// A dark tile of a 16-bit scan is not taken for 8-bit: one rule applies to the scene, and a nearly
/// black tile is reported.
#[test]
fn tiles_of_colours_have_one_rule() {
    let folder = Folder::new();
    let wide = |i: usize| turns(i).map(|value| value * 250.0 + 7.0);
    let narrow = |i: usize| turns(i);
    let tiles =
        together(&folder, &[("a.las", las(2, COUNT, |i| (narrow(i), 9))), ("b.las", las(2, COUNT, |i| (wide(i), 9)))]);
    let light = |value: f64| srgb_to_linear(value / 65535.0) as f32;
    assert_eq!(tiles[0].colors.as_ref().unwrap().linear(0)[0], light(230.0));
    assert_eq!(tiles[1].colors.as_ref().unwrap().linear(0)[0], light(57507.0));
    assert!(tiles[0].notes[0].starts_with("warning: a.las: its colours are nearly black"), "{:?}", tiles[0].notes);
    assert!(tiles[1].notes.is_empty());
    // Tiles of one kind are judged together: the first one alone would have too many outliers.
    let few = |i: usize| if i < 100 { [256.0, 120.0, 30.0] } else { turns(i) };
    let tiles = together(
        &folder,
        &[
            ("a.las", las(2, COUNT, |i| (few(i), 9))),
            ("b.las", las(2, COUNT, |i| (narrow(i), 9))),
            ("c.ply", ply(&["red", "green", "blue"].map(|name| ("ushort", name)), COUNT, |i| narrow(i).to_vec())),
        ],
    );
    assert!(tiles.iter().all(|tile| matches!(tile.colors, Some(Colors::Srgb8(_)))));
}

#[test]
fn intensities_show_where_colours_are_missing_or_zero() {
    let folder = Folder::new();
    let intensity = |i: usize| (i % 101) as f64 * 10.0;
    let grey = |i: usize| {
        let code = (intensity(i) / 1000.0 * 255.0).round() as u8;
        [code, code, code, 255]
    };
    let mut files = vec![];
    for format in [0, 1, 2, 3, 6, 7, 8] {
        files.push(("a.las", las(format, COUNT, |i| ([0.0; 3], intensity(i) as u16))));
    }
    for (kind, name) in [
        ("float", "intensity"),
        ("double", "scalar_Intensity"),
        ("ushort", "Intensity"),
        ("float", "scalar_intensity"),
        ("int", "reflectance"),
    ] {
        files.push(("a.ply", ply(&[(kind, name)], COUNT, |i| vec![intensity(i)])));
        for color in ["uchar", "ushort", "float"] {
            let properties = [(color, "red"), (color, "green"), (color, "blue"), (kind, name)];
            files.push(("a.ply", ply(&properties, COUNT, |i| vec![0.0, 0.0, 0.0, intensity(i)])));
        }
    }
    #[cfg(feature = "pcd")]
    {
        files.push(("a.pcd", pcd(&[("intensity", 4, 'F', 1)], COUNT, |i| vec![intensity(i)])));
        let fields = [("rgb", 4, 'U', 1), ("Intensity", 2, 'U', 1)];
        files.push(("a.pcd", pcd(&fields, COUNT, |i| vec![0.0, intensity(i)])));
    }
    #[cfg(feature = "e57")]
    {
        let black = |i: usize| (Some([0.0; 3]), intensity(i));
        files.push(("a.e57", e57(&e57::RecordDataType::U8, None, COUNT, black)));
        files.push(("a.e57", e57(&e57::RecordDataType::U8, None, COUNT, |i| (None, intensity(i)))));
    }
    for (name, bytes) in files {
        let points = folder.read(name, &bytes).unwrap();
        let expected: Vec<_> = (0..COUNT).map(grey).collect();
        assert_eq!(codes(&points), expected, "{name}");
        assert_eq!(points.notes, Vec::<String>::new());
    }
    // Negative intensities, such as decibels, have their own black level.
    let decibels = ply(&[("float", "intensity")], COUNT, |i| vec![-20.0 + (i % 101) as f64 * 0.2]);
    let codes = codes(&folder.read("a.ply", &decibels).unwrap());
    assert_eq!((codes[0], codes[50], codes[100]), ([0, 0, 0, 255], [128, 128, 128, 255], [255; 4]));
    // Constant intensities are ignored.
    let same = ply(&[("float", "intensity")], COUNT, |_| vec![7.0]);
    assert_eq!(folder.read("a.ply", &same).unwrap().colors, None);
}

#[test]
fn attributes_have_the_names_that_programs_write() {
    let folder = Folder::new();
    for names in [
        ["nx", "ny", "nz"],
        ["nxx", "ny", "nz"],
        ["nxx", "nyy", "nzz"],
        ["normalx", "normaly", "normalz"],
        ["NormalX", "NormalY", "NormalZ"],
        ["normal_x", "normal_y", "normal_z"],
        ["scalar_Nx", "scalar_Ny", "scalar_Nz"],
    ] {
        let up = |_: usize| vec![0.0, 0.5, 1.0];
        let points = folder.read("a.ply", &ply(&names.map(|name| ("float", name)), 9, up)).unwrap();
        assert_eq!(points.normals, Some(vec![[0.0, 0.5, 1.0]; 9]), "{names:?}");
        #[cfg(feature = "pcd")]
        {
            let points = folder.read("a.pcd", &pcd(&names.map(|name| (name, 4, 'F', 1)), 9, up)).unwrap();
            assert_eq!(points.normals, Some(vec![[0.0, 0.5, 1.0]; 9]), "{names:?}");
        }
    }
    for names in [
        ["red", "green", "blue"],
        ["r", "g", "b"],
        ["R", "G", "B"],
        ["diffuse_red", "diffuse_green", "diffuse_blue"],
        ["Cd_r", "Cd_g", "Cd_b"],
        ["Cd[0]", "Cd[1]", "Cd[2]"],
        ["scalar_R", "scalar_G", "scalar_B"],
    ] {
        let points = folder.read("a.ply", &ply(&names.map(|name| ("uchar", name)), COUNT, times(1.0))).unwrap();
        assert_turns(&points, names[0]);
    }
}

#[test]
fn what_a_file_has_is_listed() {
    let folder = Folder::new();
    let about = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.path(name), bytes).unwrap();
        let options = ReadOptions { describe: true, ..ReadOptions::default() };
        *io::read_with(&folder.path(name), options, &()).unwrap().about.unwrap()
    };
    let listed = |about: &io::About| -> Vec<(String, bool)> {
        about.attributes.iter().map(|attribute| (attribute.name.clone(), attribute.used)).collect()
    };
    let own = |all: &[(&str, bool)]| all.iter().map(|(name, used)| ((*name).to_owned(), *used)).collect::<Vec<_>>();
    let properties =
        [("uchar", "red"), ("uchar", "green"), ("uchar", "blue"), ("float", "intensity"), ("int", "label")];
    let bytes = ply(&properties, COUNT, |i| turns(i).into_iter().chain([i as f64, 3.0]).collect());
    let found = about("a.ply", &bytes);
    assert_eq!(found.format, "PLY, text");
    let mut expected = own(&[("x", true), ("y", true), ("z", true), ("red", true), ("green", true), ("blue", true)]);
    expected.extend(own(&[("intensity", false), ("label", false)]));
    assert_eq!((listed(&found), found.intensities), (expected, None));
    let found = about("a.ply", &ply(&properties, COUNT, |i| vec![0.0, 0.0, 0.0, i as f64, 3.0]));
    assert_eq!(found.intensities, Some([0.0, 1997.0]));
    assert!(listed(&found).contains(&("red".into(), false)) && listed(&found).contains(&("intensity".into(), true)));
    let found = about("a.las", &las(7, COUNT, |i| (turns(i), 9)));
    assert_eq!(
        (found.format.as_str(), found.colors.as_deref()),
        ("LAS 1.4, point format 7", Some("8-bit sRGB in wider integers"))
    );
    assert!(listed(&found).contains(&("intensity".into(), false)), "{found:?}");
    std::fs::copy(data("autzen.laz"), folder.path("b.laz")).unwrap();
    let options = ReadOptions { describe: true, ..ReadOptions::default() };
    let found = io::read_with(&folder.path("b.laz"), options, &()).unwrap().about.unwrap();
    assert!(found.format.starts_with("LAZ 1."), "{found:?}");
}

/// Alpha values that are classes are reported, and can be ignored.
#[test]
fn alphas_that_are_no_opacities_are_told() {
    let folder = Folder::new();
    let with_alpha = |kind: &str, alpha: &dyn Fn(usize) -> f64| {
        let properties = [("uchar", "red"), ("uchar", "green"), ("uchar", "blue"), (kind, "alpha")];
        ply(&properties, COUNT, |i| turns(i).into_iter().chain([alpha(i)]).collect())
    };
    for kind in ["uchar", "ushort", "int", "float"] {
        let bytes = with_alpha(kind, &|i| (i % 7) as f64);
        let points = folder.read("a.ply", &bytes).unwrap();
        assert_eq!(codes(&points)[6], [230, 120, 30, 6], "{kind}");
        assert!(points.notes[0].contains("at most 6 of 255") && points.notes[0].contains("--ignore-alpha"));
        let options = ReadOptions { ignore_alpha: true, ..ReadOptions::default() };
        assert_turns(&io::read_with(&folder.path("a.ply"), options, &()).unwrap(), kind);
    }
    // Real opacities, scaled by the range of their type or values.
    for (kind, full) in [("uchar", 255.0), ("ushort", 65535.0), ("ushort", 255.0), ("float", 1.0), ("double", 255.0)] {
        let points = folder.read("a.ply", &with_alpha(kind, &|i| full * (i % 6) as f64 / 5.0)).unwrap();
        let alpha = points.colors.as_ref().unwrap().linear(3)[3];
        assert!((alpha - 0.6).abs() < 1e-6, "{kind}: {alpha}");
        assert_eq!(points.notes, Vec::<String>::new(), "{kind}");
    }
}

/// Rows read in pieces have the same colours as in a read of all rows.
#[test]
fn pieces_have_the_colours_of_all_rows() {
    let folder = Folder::new();
    const ROWS: usize = 80_000;
    let file = |shades: bool, color: &dyn Fn(usize) -> [u16; 3]| {
        let mut text = format!("ply\nformat binary_little_endian 1.0\nelement vertex {ROWS}\n");
        ["x", "y", "z", "nx", "ny", "nz", "radius"].iter().for_each(|name| text += &format!("property float {name}\n"));
        ["red", "green", "blue"].iter().for_each(|name| text += &format!("property ushort {name}\n"));
        text += if shades { "property float intensity\nend_header\n" } else { "end_header\n" };
        let mut bytes = text.into_bytes();
        for i in 0..ROWS {
            let [x, y, z] = place(i).map(|c| c as f32);
            bytes.extend([x, y, z, 0.0, 0.0, 1.0, 0.1].iter().flat_map(|c: &f32| c.to_le_bytes()));
            bytes.extend(color(i).iter().flat_map(|c| c.to_le_bytes()));
            bytes.extend((i as f32).to_le_bytes().iter().filter(|_| shades));
        }
        bytes
    };
    let late = |i: usize| if i < 70_000 { [200, 100, 50] } else { [60_000, 40_001, 300] };
    for (name, bytes) in
        [("a.ply", file(false, &late)), ("b.ply", file(true, &late)), ("c.ply", file(true, &|_| [0; 3]))]
    {
        let whole = folder.read(name, &bytes).unwrap();
        let input = io::Input::open(&folder.path(name), None).unwrap();
        let mut files = vec![io::ply::Rows::open(input, false).unwrap().unwrap()];
        io::ply::Rows::settle_colors(&mut files).unwrap();
        for range in [0..10, 69_990..70_010] {
            let piece = files[0].points(&files[0].bytes(range.clone()).unwrap()).unwrap();
            let (piece, whole) = (piece.colors.unwrap(), whole.colors.as_ref().unwrap());
            for (k, i) in range.enumerate() {
                assert_eq!(piece.linear(k), whole.linear(i as usize), "{name} {i}");
            }
        }
    }
}
