//! Valid PLY files, and what `write_points` writes.

use super::Folder;
use epsplat::io::Points;
use epsplat::io::ply::{Color, ColorProperties, Properties, Vertex, write, write_points};
use epsplat::low_level::scene::Colors;
use epsplat::low_level::scene::color::srgb_to_linear;

/// Encodes a number of a PLY file as text or as bytes of its type.
fn encode(value: f64, kind: &str, encoding: &str) -> Vec<u8> {
    macro_rules! bytes {
        ($type:ty) => {
            match encoding {
                "binary_little_endian" => (value as $type).to_le_bytes().to_vec(),
                "binary_big_endian" => (value as $type).to_be_bytes().to_vec(),
                _ => format!("{} ", value as $type).into_bytes(),
            }
        };
    }
    match kind {
        "char" | "int8" => bytes!(i8),
        "uchar" | "uint8" => bytes!(u8),
        "short" | "int16" => bytes!(i16),
        "ushort" | "uint16" => bytes!(u16),
        "int" | "int32" => bytes!(i32),
        "uint" | "uint32" => bytes!(u32),
        "float" | "float32" => bytes!(f32),
        "double" | "float64" => bytes!(f64),
        _ => panic!("{kind}"),
    }
}

pub const ENCODINGS: [&str; 3] = ["ascii", "binary_little_endian", "binary_big_endian"];
const KINDS: [&str; 16] = [
    "char", "int8", "uchar", "uint8", "short", "int16", "ushort", "uint16", "int", "int32", "uint", "uint32", "float",
    "float32", "double", "float64",
];

/// An element: name, properties (type, name; a list's type is `list COUNT ITEM`), and rows of
/// numbers.
pub type Element<'a> = (&'a str, &'a [(&'a str, &'a str)], &'a [&'a [f64]]);

pub fn file(encoding: &str, elements: &[Element]) -> Vec<u8> {
    let mut bytes = format!("ply\nformat {encoding} 1.0\ncomment made for a test\nobj_info none\n").into_bytes();
    for (name, properties, rows) in elements {
        bytes.extend(format!("element {name} {}\n", rows.len()).bytes());
        for (kind, property) in *properties {
            bytes.extend(format!("property {kind} {property}\n").bytes());
        }
    }
    bytes.extend(b"end_header\n");
    for (_, properties, rows) in elements {
        for row in *rows {
            let mut values = row.iter().copied();
            for (kind, _) in *properties {
                let mut words = kind.split(' ').skip_while(|&word| word == "list");
                let value = values.next().unwrap();
                bytes.extend(encode(value, words.next().unwrap(), encoding));
                if let Some(item) = words.next() {
                    (0..value as usize).for_each(|_| bytes.extend(encode(values.next().unwrap(), item, encoding)));
                }
            }
            if encoding == "ascii" {
                bytes.push(b'\n');
            }
        }
    }
    bytes
}

/// Any line ending is accepted. The first data byte of the binary file is a line feed, which must
/// not be skipped.
#[test]
fn lines_may_end_in_carriage_returns() {
    let folder = Folder::new();
    let properties = [("uchar", "x"), ("uchar", "y"), ("float", "z")];
    let rows: [&[f64]; 2] = [&[10.0, 13.0, 3.0], &[13.0, 10.0, 0.0]];
    for encoding in ENCODINGS {
        let bytes = file(encoding, &[("vertex", &properties, &rows)]);
        let header = bytes.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
        for end in [&b"\r"[..], b"\r\n"] {
            let lines = if encoding == "ascii" { bytes.len() } else { header };
            let mut other: Vec<u8> = bytes[..lines]
                .iter()
                .flat_map(|byte| if *byte == b'\n' { end } else { std::slice::from_ref(byte) })
                .copied()
                .collect();
            other.extend(&bytes[lines..]);
            for name in ["a.ply", "a"] {
                let points = folder.read(name, &other).unwrap();
                assert_eq!(points.positions, [[10.0, 13.0, 3.0], [13.0, 10.0, 0.0]], "{encoding} {end:?}");
            }
        }
    }
    let text =
        "ply\rformat ascii 1.0\relement vertex 1\rproperty float x\rproperty float y\rproperty float z\rend_header\r";
    let said = folder.refusal("a.ply", format!("{text}1\r2\rthree\r").as_bytes());
    assert_eq!(said, "line 10: 'three' is not a number");
}

#[test]
fn coordinates_of_every_type_in_every_encoding() {
    let folder = Folder::new();
    for encoding in ENCODINGS {
        for kind in KINDS {
            let properties = [("uchar", "other"), (kind, "x"), (kind, "y"), ("float", "f"), (kind, "z")];
            let rows: [&[f64]; 2] = [&[9.0, 1.0, 2.0, 0.5, 3.0], &[8.0, 100.0, 0.0, 0.25, 127.0]];
            let points = folder.read("a.ply", &file(encoding, &[("vertex", &properties, &rows)])).unwrap();
            assert_eq!(points.positions, [[1.0, 2.0, 3.0], [100.0, 0.0, 127.0]], "{encoding} {kind}");
            assert_eq!((points.normals, points.radii, points.colors, points.up), (None, None, None, None));
        }
    }
}

#[test]
fn a_byte_order_mark_may_come_before_a_text() {
    let folder = Folder::new();
    let properties = [("float", "x"), ("float", "y"), ("float", "z")];
    let bytes = file("ascii", &[("vertex", &properties, &[&[1.0, 2.0, 3.0]])]);
    let marked = folder.read("a.ply", &[b"\xef\xbb\xbf", &bytes[..]].concat()).unwrap();
    assert_eq!(marked.positions, [[1.0, 2.0, 3.0]]);
    assert!(folder.refusal("a.ply", &[b"\xef\xbb", &bytes[..]].concat()).contains("its first line is not 'ply'"));
}

#[test]
fn the_whole_range_of_every_type_survives() {
    let folder = Folder::new();
    for encoding in ENCODINGS {
        let extremes: [(&str, [f64; 3]); 8] = [
            ("char", [-128.0, 127.0, -1.0]),
            ("uchar", [255.0, 128.0, 0.0]),
            ("short", [-32768.0, 32767.0, -2.0]),
            ("ushort", [65535.0, 32768.0, 1.0]),
            ("int", [-2147483648.0, 2147483647.0, -3.0]),
            ("uint", [4294967295.0, 2147483648.0, 4.0]),
            ("float", [f64::from(f32::MAX), f64::from(f32::MIN_POSITIVE), -0.1f32 as f64]),
            ("double", [6_123_456.000_1, f64::MAX, 5e-324]),
        ];
        for (kind, row) in extremes {
            let properties = [(kind, "x"), (kind, "y"), (kind, "z")];
            let points = folder.read("a.ply", &file(encoding, &[("vertex", &properties, &[&row])])).unwrap();
            if encoding == "ascii" && kind == "float" {
                assert_eq!(points.positions[0].map(|v| v as f32), row.map(|v| v as f32));
            } else {
                assert_eq!(points.positions, [row], "{encoding} {kind}");
            }
        }
    }
}

#[test]
fn normals_and_radii_are_found_by_name() {
    let folder = Folder::new();
    for encoding in ENCODINGS {
        let properties = [
            ("float", "nz"),
            ("float", "scale"),
            ("double", "x"),
            ("float", "y"),
            ("float", "z"),
            ("double", "nx"),
            ("float", "ny"),
            ("float", "radius"),
        ];
        let rows: [&[f64]; 1] = [&[3.0, 9.0, 1.0, 2.0, 3.0, 1.0, 2.0, 0.5]];
        let points = folder.read("a.ply", &file(encoding, &[("vertex", &properties, &rows)])).unwrap();
        assert_eq!(points.normals.unwrap(), [[1.0, 2.0, 3.0]]);
        assert_eq!(points.radii.unwrap(), [0.5]);
        // Without a radius the scale is used; without all components there are no normals.
        let points = folder
            .read("a.ply", &file(encoding, &[("vertex", &properties[1..7], &[&[9.0, 1.0, 2.0, 3.0, 1.0, 2.0]])]))
            .unwrap();
        assert_eq!((points.normals, points.radii.unwrap()), (None, vec![9.0]));
    }
}

#[test]
fn colours_keep_what_their_type_says() {
    let folder = Folder::new();
    let light = |code: f64| srgb_to_linear(code) as f32;
    for encoding in ENCODINGS {
        let read = |kind: &str, names: [&str; 4], values: [f64; 4], count: usize| {
            let mut properties = vec![("float", "x"), ("float", "y"), ("float", "z")];
            properties.extend(names[..count].iter().map(|name| (kind, *name)));
            let row: Vec<f64> = [0.0; 3].into_iter().chain(values[..count].iter().copied()).collect();
            folder.read("a.ply", &file(encoding, &[("vertex", &properties, &[&row])])).unwrap().colors
        };
        let names = ["red", "green", "blue", "alpha"];
        assert_eq!(read("uchar", names, [1.0, 2.0, 255.0, 7.0], 4), Some(Colors::Srgb8(vec![[1, 2, 255, 7]])));
        assert_eq!(read("uint8", names, [1.0, 2.0, 255.0, 7.0], 3), Some(Colors::Srgb8(vec![[1, 2, 255, 255]])));
        assert_eq!(read("int", names, [1.0, 200.0, -5.0, 7.0], 3), Some(Colors::Srgb8(vec![[1, 200, 0, 255]])));
        assert_eq!(read("char", names, [1.0, -56.0, -1.0, 7.0], 3), Some(Colors::Srgb8(vec![[1, 200, 255, 255]])));
        assert_eq!(read("uchar", names, [1.0, 2.0, 3.0, 4.0], 2), None);
        for names in [["r", "g", "b", "a"], ["diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"]] {
            assert_eq!(read("uchar", names, [1.0, 2.0, 3.0, 4.0], 4), Some(Colors::Srgb8(vec![[1, 2, 3, 4]])));
        }
        let wide = [0.0, 32768.0, 65535.0, 13107.0];
        let expected = [0.0, light(32768.0 / 65535.0), 1.0, 0.2];
        assert_eq!(read("ushort", names, wide, 4), Some(Colors::Linear(vec![expected])));
        let linear = [0.25, -0.5, 4.0, 0.5];
        for kind in ["float", "double"] {
            assert_eq!(read(kind, names, linear, 4), Some(Colors::Linear(vec![[0.25, -0.5, 4.0, 0.5]])));
            assert_eq!(read(kind, names, linear, 3), Some(Colors::Linear(vec![[0.25, -0.5, 4.0, 1.0]])));
            let wild = [0.5, f64::INFINITY, -f64::INFINITY, 1.0];
            assert_eq!(read(kind, names, wild, 3), Some(Colors::Linear(vec![[0.5, f32::MAX, f32::MIN, 1.0]])));
            // A colour that is no number is missing, so the default takes its place.
            let missing = [f64::NAN, 0.5, 0.5, 1.0];
            assert_eq!(read(kind, names, missing, 3), Some(Colors::Linear(vec![[0.7, 0.7, 0.7, 1.0]])));
        }
    }
}

#[test]
fn other_elements_and_lists_are_passed_over() {
    let folder = Folder::new();
    let xyz = [("float", "x"), ("list uchar int", "neighbours"), ("float", "y"), ("float", "z")];
    let vertices: [&[f64]; 3] = [&[1.0, 2.0, 7.0, 7.0, 2.0, 3.0], &[4.0, 0.0, 5.0, 6.0], &[7.0, 1.0, -1.0, 8.0, 9.0]];
    let strips: [&[f64]; 1] = [&[5.0, 0.0, 1.0, 2.0, -1.0, 1.0]];
    for encoding in ENCODINGS {
        for face_list in ["list uchar int", "list int uint", "list ushort double", "list char short"] {
            let face = [("double", "quality"), (face_list, "vertex_indices")];
            let faces: [&[f64]; 2] = [&[0.5, 3.0, 0.0, 1.0, 2.0], &[0.25, 4.0, 0.0, 1.0, 2.0, 0.0]];
            let camera: [&[f64]; 1] = [&[1.0, 2.0]];
            let elements: [Element; 6] = [
                ("camera", &[("float", "view_px"), ("double", "view_py")], &camera),
                ("nothing", &[], &[]),
                ("face", &face, &faces),
                ("tristrips", &[("list int int", "vertex_indices")], &strips),
                ("vertex", &xyz, &vertices),
                ("edge", &[("int", "vertex1")], &camera[..0]),
            ];
            let points = folder.read("a.ply", &file(encoding, &elements)).unwrap();
            assert_eq!(points.positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]], "{encoding} {face_list}");
        }
    }
}

#[test]
fn what_follows_the_vertices_does_not_matter() {
    let folder = Folder::new();
    for encoding in ENCODINGS {
        let xyz = [("float", "x"), ("float", "y"), ("float", "z")];
        let mut bytes = file(encoding, &[("vertex", &xyz, &[&[1.0, 2.0, 3.0]]), ("face", &[("int", "a")], &[&[1.0]])]);
        bytes.extend(b"\nrubbish\xff\n");
        assert_eq!(folder.read("a.ply", &bytes).unwrap().positions, [[1.0, 2.0, 3.0]]);
    }
}

#[test]
fn line_ends_and_comments_of_other_writers() {
    let folder = Folder::new();
    let text = "ply\nformat ascii 1.0\ncomment caf\u{e9}\n\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\nnan -inf\n1e3";
    for text in [text.to_owned(), text.replace('\n', "\r\n"), text.replace('\n', " \n")] {
        // The comment is in Latin-1.
        let bytes: Vec<u8> = text.chars().map(|c| c as u8).collect();
        let points = folder.read("a.ply", &bytes).unwrap();
        assert_eq!(points.positions[0], [1.0, 2.0, 3.0]);
        let [x, y, z] = points.positions[1];
        assert!(x.is_nan() && y == f64::NEG_INFINITY && z == 1000.0);
    }
    let binary = file(
        "binary_little_endian",
        &[("vertex", &[("uchar", "x"), ("uchar", "y"), ("uchar", "z")], &[&[10.0, 13.0, 10.0]])],
    );
    let header = binary.len() - 3;
    let mut crlf = String::from_utf8(binary[..header].to_vec()).unwrap().replace('\n', "\r\n").into_bytes();
    crlf.extend(&binary[header..]);
    assert_eq!(folder.read("a.ply", &crlf).unwrap().positions, [[10.0, 13.0, 10.0]]);
}

#[test]
fn many_blocks_of_rows_join_without_a_seam() {
    let folder = Folder::new();
    let count = 200_000i32;
    let mut bytes = format!("ply\nformat binary_big_endian 1.0\nelement vertex {count}\nproperty double x\nproperty float y\nproperty uchar tag\nproperty int z\nend_header\n").into_bytes();
    for i in 0..count {
        bytes.extend(f64::from(i).to_be_bytes());
        bytes.extend((i as f32 * 0.5).to_be_bytes());
        bytes.push(i as u8);
        bytes.extend((-i).to_be_bytes());
    }
    let points = folder.read("a.ply", &bytes).unwrap();
    assert_eq!(points.positions.len(), count as usize);
    for (i, position) in points.positions.iter().enumerate() {
        assert_eq!(*position, [i as f64, i as f64 * 0.5, -(i as f64)]);
    }
}

#[test]
fn half_axes_and_texture_coordinates_are_found_by_name() {
    let folder = Folder::new();
    let axes = ["sx", "sy", "sz", "tx", "ty", "tz"];
    for encoding in ENCODINGS {
        for names in [["texture_u", "texture_v"], ["texcoord_u", "texcoord_v"], ["s", "t"], ["u", "v"]] {
            let mut properties = vec![("double", "x"), ("float", names[1]), ("float", "y"), ("float", "z")];
            properties.extend(axes.iter().map(|name| ("float", *name)));
            properties.push(("double", names[0]));
            let row: &[f64] = &[1.0, 0.75, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 0.25];
            let points = folder.read("a.ply", &file(encoding, &[("vertex", &properties, &[row])])).unwrap();
            assert_eq!(points.axes.unwrap(), [[[4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]], "{encoding}");
            assert_eq!(points.texture.unwrap(), [[0.25, 0.75]], "{encoding} {names:?}");
            // Half-axes and texture coordinates need all their properties.
            let points = folder.read("a.ply", &file(encoding, &[("vertex", &properties[..9], &[&row[..9]])])).unwrap();
            assert_eq!((points.axes, points.texture), (None, None));
        }
    }
}

/// Vertices as MeshLab, CloudCompare, Open3D and the Point Cloud Library write them, with their
/// other properties.
#[test]
fn files_of_other_programs_are_read() {
    let folder = Folder::new();
    let position = [("float", "x"), ("float", "y"), ("float", "z")];
    let normal = [("float", "nx"), ("float", "ny"), ("float", "nz")];
    let color = [("uchar", "red"), ("uchar", "green"), ("uchar", "blue"), ("uchar", "alpha")];
    let meshlab = [("float", "quality"), ("float", "radius"), ("float", "texture_u"), ("float", "texture_v")];
    let cloudcompare = [("float", "scalar_Intensity"), ("float", "scalar_Original cloud index"), ("float", "scalar_u")];
    let pcl = [("float", "intensity"), ("float", "curvature"), ("int", "label")];
    let face = [("list uchar int", "vertex_indices"), ("list uchar float", "texcoord"), ("int", "texnumber")];
    let faces: [&[f64]; 1] = [&[3.0, 0.0, 0.0, 0.0, 6.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]];
    let camera = [("float", "view_px"), ("int", "viewportx"), ("float", "k2")];
    let row = |values: &[&[f64]]| values.concat();
    let (at, up, rgba) = (&[1.0, 2.0, 3.0][..], &[0.0, 0.0, 1.0][..], &[9.0, 8.0, 7.0, 255.0][..]);
    for encoding in ENCODINGS {
        let flags = [("int", "flags")];
        let properties = [&position[..], &normal, &flags, &color, &meshlab].concat();
        let vertex = row(&[at, up, &[0.0], rgba, &[0.5, 0.25, 0.125, 0.75]]);
        let vertices: [&[f64]; 1] = [&vertex];
        let elements = [("camera", &camera[..], &[&[1.0, 2.0, 3.0][..]][..]), ("vertex", &properties, &vertices)];
        let points =
            folder.read("a.ply", &file(encoding, &[elements[0], elements[1], ("face", &face, &faces)])).unwrap();
        assert_eq!((points.normals, points.radii), (Some(vec![[0.0, 0.0, 1.0]]), Some(vec![0.25])), "{encoding}");
        assert_eq!(
            (points.colors, points.texture),
            (Some(Colors::Srgb8(vec![[9, 8, 7, 255]])), Some(vec![[0.125, 0.75]]))
        );

        for fields in [&cloudcompare, &pcl] {
            let properties = [&position[..], &color[..3], &normal, fields].concat();
            let vertex = row(&[at, &rgba[..3], up, &[1.0, 2.0, 3.0]]);
            let points = folder.read("a.ply", &file(encoding, &[("vertex", &properties, &[&vertex])])).unwrap();
            assert_eq!((points.positions, points.texture, points.radii), (vec![[1.0, 2.0, 3.0]], None, None));
            assert_eq!(
                (points.normals, points.colors),
                (Some(vec![[0.0, 0.0, 1.0]]), Some(Colors::Srgb8(vec![[9, 8, 7, 255]])))
            );
        }

        let open3d = [&position[..], &normal].concat().into_iter().map(|(_, name)| ("double", name));
        let properties = open3d.chain(color[..3].iter().copied()).collect::<Vec<_>>();
        let vertex = row(&[at, up, &rgba[..3]]);
        let points = folder.read("a.ply", &file(encoding, &[("vertex", &properties, &[&vertex])])).unwrap();
        assert_eq!((points.normals, points.axes), (Some(vec![[0.0, 0.0, 1.0]]), None));
    }
}

/// Points with the attributes whose bits are set in `attributes`.
fn points_with(attributes: u32) -> Points {
    let count = 300;
    let all = 0..count;
    let on = |bit: u32| attributes & 1 << bit != 0;
    let real = |i: usize, k: usize| (i * 7 + k) as f32 * 0.1 - 3.0;
    let wide = |i: usize| 6_123_456.001 + i as f64 * 1e-3;
    Points {
        positions: all.clone().map(|i| [if on(0) { wide(i) } else { i as f64 * 0.5 }, -0.25, 2.0]).collect(),
        normals: on(1).then(|| all.clone().map(|i| [real(i, 0), real(i, 1), f32::NAN]).collect()),
        radii: on(2).then(|| all.clone().map(|i| real(i, 2)).collect()),
        axes: on(3).then(|| all.clone().map(|i| [[real(i, 3), 0.5, 0.0], [0.0, -0.0, real(i, 4)]]).collect()),
        colors: match attributes >> 4 & 3 {
            0 => None,
            1 => Some(Colors::Srgb8(all.clone().map(|i| [i as u8, 2, 3, 255]).collect())),
            2 => Some(Colors::Srgb8(all.clone().map(|i| [i as u8, 2, 3, 255 - i as u8]).collect())),
            _ => Some(Colors::Linear(all.clone().map(|i| [real(i, 5), 1e6, 0.0, 0.5]).collect())),
        },
        texture: on(6).then(|| all.map(|i| [real(i, 6), real(i, 7)]).collect()),
        ..Points::default()
    }
}

#[test]
fn every_attribute_survives_to_the_byte() {
    let folder = Folder::new();
    let (first, second) = (folder.path("first.ply"), folder.path("second.ply"));
    let mut contents = Vec::new();
    for attributes in 0..1 << 7 {
        let points = points_with(attributes);
        write_points(&first, &points, &()).unwrap();
        let read = epsplat::io::read(&first, &()).unwrap();
        let text = |points: &Points| format!("{points:?}");
        if points.axes.is_none() {
            assert_eq!(text(&read), text(&points), "{attributes:b}");
        } else {
            // Half-axes imply a normal and a radius.
            let rest = Points { normals: read.normals.clone(), radii: read.radii.clone(), ..points };
            assert_eq!(text(&read), text(&rest), "{attributes:b}");
        }
        write_points(&second, &read, &()).unwrap();
        let bytes = std::fs::read(&first).unwrap();
        assert_eq!(std::fs::read(&second).unwrap(), bytes, "{attributes:b}");
        contents.push(bytes);
    }
    contents.sort();
    contents.dedup();
    // All files differ, as the points' normals and radii are not those that their half-axes imply.
    assert_eq!(contents.len(), 1 << 7);
}

#[test]
fn half_axes_bring_a_normal_and_the_longer_radius() {
    let folder = Folder::new();
    let path = folder.path("a.ply");
    let axes = vec![[[0.0, 3.0, 0.0], [0.0, 0.0, 4.0]], [[2.0, 0.0, 0.0], [1.0, 0.0, 0.0]]];
    let points = Points { positions: vec![[0.0; 3]; 2], axes: Some(axes), ..Points::default() };
    write_points(&path, &points, &()).unwrap();
    let read = epsplat::io::read(&path, &()).unwrap();
    assert_eq!((read.normals.unwrap(), read.radii.unwrap()), (vec![[1.0, 0.0, 0.0], [0.0; 3]], vec![4.0, 2.0]));
}

#[test]
fn what_is_written_is_read_again() {
    let folder = Folder::new();
    let path = folder.path("out.ply");
    let vertices: Vec<Vertex> = (0..1000)
        .map(|i| Vertex {
            position: [6_000_000.001 + f64::from(i), 0.5 * f64::from(i), -1.0],
            normal: [0.0, 0.6, 0.8],
            radius: 0.25 + i as f32,
            color: (i % 2 == 0).then_some(Color::Srgb8([i as u8, 2, 3, 255])),
            ..Vertex::default()
        })
        .collect();
    for double_coordinates in [false, true] {
        for colors in [ColorProperties::Absent, ColorProperties::Srgb8] {
            let (normals, radii) = (true, true);
            let properties = Properties { double_coordinates, normals, radii, colors, ..Properties::default() };
            write(&path, properties, 1000, vertices.iter().copied()).unwrap();
            let points = epsplat::io::read(&path, &()).unwrap();
            for (i, vertex) in vertices.iter().enumerate() {
                let rounded = vertex.position.map(|v| if double_coordinates { v } else { f64::from(v as f32) });
                assert_eq!(points.positions[i], rounded);
            }
            assert_eq!(points.normals.unwrap(), vec![[0.0, 0.6, 0.8]; 1000]);
            assert_eq!(points.radii.unwrap()[7], 7.25);
            match points.colors {
                Some(Colors::Srgb8(codes)) if colors == ColorProperties::Srgb8 => {
                    assert_eq!(codes[..2], [[0, 2, 3, 255], [218, 218, 218, 255]])
                }
                other => assert!(colors == ColorProperties::Absent && other.is_none()),
            }
        }
    }
    let message = write(&path, Properties::default(), 999, vertices).unwrap_err().to_string();
    assert!(message.ends_with("999 vertices were announced, but 1000 came"), "{message}");
}
