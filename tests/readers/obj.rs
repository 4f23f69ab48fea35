//! OBJ files.

use super::{Folder, Random, data, sentence};
use epsplat::io::{self, Up};
use epsplat::low_level::scene::Colors;
use epsplat::low_level::scene::color::{DEFAULT_COLOR, srgb_to_linear};

fn close(a: [f32; 3], b: [f32; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6)
}

#[test]
fn vertices_keep_their_number_whatever_uses_them() {
    let folder = Folder::new();
    let text = "mtllib none.mtl\no one\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 9 9 9\nvt 0 0\nvt 1 1\ng a\nusemtl red\nf 1/1 2/1 3/2\n\
                o two\nv 0 0 0\nv 0 0 1\nv nan 0 1e400\nusemtl blue\nf -6/2 5 1\ng b\nf 1 -2/2 6/1\nl 1 2\np 4\n";
    let points = folder.read("a.obj", text.as_bytes()).unwrap();
    assert_eq!(points.positions.len(), 7);
    assert_eq!(points.positions[3], [9.0; 3]);
    assert_eq!(points.positions[5], [0.0, 0.0, 1.0]);
    assert!(points.positions[6][0].is_nan() && points.positions[6][2].is_infinite());
    assert_eq!(points.up, Some(Up::Y));
    let (normals, radii) = (points.normals.unwrap(), points.radii.unwrap());
    assert_eq!((normals[3], radii[3]), ([0.0; 3], 0.0));
    assert!(close(normals[1], [0.0, 0.0, 1.0]) && close(normals[2], [0.0, 0.0, 1.0]));
    // Half the diagonal of the unit square, times 1.1.
    assert!((radii[1] - 1.1 * 0.5f32.sqrt()).abs() < 1e-6);
}

#[test]
fn normals_are_weighted_by_area_or_the_files_own() {
    let folder = Folder::new();
    let faces = "v 0 0 0\nv 2 0 0\nv 0 1 0\nv 0 0 1\n";
    let computed = folder.read("a.obj", format!("{faces}f 1 2 3\nf 1 3 4\n").as_bytes()).unwrap().normals.unwrap();
    // Cross products (twice the areas): (0, 0, 2) and (1, 0, 0).
    let length = 5f32.sqrt();
    assert!(close(computed[0], [1.0 / length, 0.0, 2.0 / length]), "{computed:?}");
    assert!(close(computed[1], [0.0, 0.0, 1.0]) && close(computed[3], [1.0, 0.0, 0.0]));

    let named = format!("{faces}vn 0 0 3\nvn 4 0 0\nf 1//1 2//1 3//1\nf 1//-1 3//2 4//2\n");
    let own = folder.read("a.obj", named.as_bytes()).unwrap().normals.unwrap();
    let half = 0.5f32.sqrt();
    assert!(close(own[0], [half, 0.0, half]) && close(own[3], [1.0, 0.0, 0.0]), "{own:?}");

    // If one corner has no normal, all normals are computed.
    let partly = format!("{faces}vn 0 0 3\nvn 4 0 0\nf 1//1 2//1 3\nf 1//2 3//2 4//2\n");
    assert_eq!(folder.read("a.obj", partly.as_bytes()).unwrap().normals.unwrap(), computed);
    // Indices of normals and texture coordinates are ignored if the file has none of these.
    let without = format!("{faces}f 1/1/1 2/2/1 3/9/1\nf 1/1/-7 3//2 4/1/2\n");
    assert_eq!(folder.read("a.obj", without.as_bytes()).unwrap().normals.unwrap(), computed);
    // A face may precede its vertices.
    let early = format!("f 1 2 3\nf 1 3 4\n{faces}");
    assert_eq!(folder.read("a.obj", early.as_bytes()).unwrap().normals.unwrap(), computed);
}

#[test]
fn vertices_without_faces_are_points() {
    let folder = Folder::new();
    for faces in ["", "p 1 2\n", "l 1 2\n", "f 1 2\nf 2\n"] {
        let points = folder.read("a.obj", format!("v 1 2 3\nv 1 2 3\n{faces}").as_bytes()).unwrap();
        assert_eq!(points.positions, [[1.0, 2.0, 3.0]; 2]);
        assert_eq!((points.normals, points.radii, points.colors), (None, None, None));
    }
    let paired = folder.read("a.obj", b"vn 0 0 1\nv 1 2 3\nvn 0 1 0\nv 4 5 6\n").unwrap();
    assert_eq!(paired.normals.unwrap(), [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]);
    assert_eq!(folder.read("a.obj", b"# nothing\n").unwrap().positions.len(), 0);
}

#[test]
fn weights_colours_and_alpha_follow_the_coordinates() {
    let folder = Folder::new();
    let light = |code: f64| srgb_to_linear(code) as f32;
    let points = folder.read("a.obj", b"v 2 4 6 2\nv 1 2 3 0.5 0 1\nv 1 2 3\nv 1 2 3 1 0.5 0 0.25 # seven\n").unwrap();
    assert_eq!(points.positions, [[1.0, 2.0, 3.0]; 4]);
    let expected = vec![DEFAULT_COLOR, [light(0.5), 0.0, 1.0, 1.0], DEFAULT_COLOR, [1.0, light(0.5), 0.0, 0.25]];
    assert_eq!(points.colors, Some(Colors::Linear(expected)));
}

#[test]
fn colours_may_be_codes_of_eight_bits() {
    let folder = Folder::new();
    let colors = |text: &str| match folder.read("a.obj", text.as_bytes()).unwrap().colors {
        Some(Colors::Linear(colors)) => colors,
        Some(Colors::Srgb8(codes)) => {
            let count = codes.len();
            (0..count).map(|index| Colors::Srgb8(codes.clone()).linear(index)).collect()
        }
        other => panic!("{other:?}"),
    };
    let light = |code: f64| srgb_to_linear(code / 255.0) as f32;
    let coded = colors("v 1 2 3 0 128 255\nv 1 2 3\nv 1 2 3 1 1 1 0.5\n");
    assert_eq!(coded, [[0.0, light(128.0), 1.0, 1.0], DEFAULT_COLOR, [light(1.0), light(1.0), light(1.0), 0.5]]);
    assert_eq!(colors("v 1 2 3 0 2 0 255\n"), [[0.0, light(2.0), 0.0, 1.0]]);
    // Values slightly above 1 do not make colours 8-bit codes.
    assert_eq!(colors("v 1 2 3 1 1.5 0\n"), [[1.0, srgb_to_linear(1.5) as f32, 0.0, 1.0]]);
}

/// ZBrush stores vertex colours in comments.
#[test]
fn polypaint_gives_colours() {
    let folder = Folder::new();
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
    let read = |text: &str| folder.read("a.obj", text.as_bytes()).unwrap().colors;
    let codes = |all: &[[u8; 4]]| Some(Colors::Srgb8(all.to_vec()));
    let [red, mixed, grey] = [[255, 0, 0, 255], [1, 35, 171, 255], [218, 218, 218, 255]];
    // Lines may have any length; the mask of a vertex is not its alpha.
    let block = "#MRGB \n# The following MRGB block contains ZBrush Vertex Color\n#MRGB ffff000000ff0000\n#MRGB FF0123ABff0123ab\n# End of MRGB block\n";
    assert_eq!(read(&format!("{vertices}{block}f 1 2 3\n")), codes(&[red, red, mixed, mixed]));
    // Too few colours, too many, and invalid ones.
    assert_eq!(read(&format!("{vertices}#MRGB ffff0000\n")), codes(&[red, grey, grey, grey]));
    assert_eq!(read(&format!("{vertices}#MRGB {}\n", "ffff0000".repeat(6))), codes(&[red; 4]));
    assert_eq!(read(&format!("{vertices}#MRGB ffff0000xyzxyzxyffff0000ff\n")), codes(&[red, grey, grey, grey]));
    assert_eq!(read(&format!("{vertices}#MRGB\n")), None);
    // Colours on the vertex lines take precedence.
    let own = read("v 0 0 0 0 0 1\n#MRGB ffff0000\n");
    assert_eq!(own, Some(Colors::Linear(vec![[0.0, 0.0, 1.0, 1.0]])));
}

#[test]
fn a_byte_order_mark_is_no_part_of_the_first_vertex() {
    let folder = Folder::new();
    let text = "v 1 2 3\nv 4 5 6\n";
    let plain = folder.read("a.obj", text.as_bytes()).unwrap();
    assert_eq!(folder.read("a.obj", format!("\u{feff}{text}").as_bytes()).unwrap(), plain);
    assert_eq!(plain.positions.len(), 2);
    // A byte order mark is skipped only at the start of the file.
    assert_eq!(folder.read("a.obj", text.replace("\nv", "\n\u{feff}v").as_bytes()).unwrap().positions.len(), 1);
}

#[test]
fn text_of_other_writers() {
    let folder = Folder::new();
    let text =
        b"# caf\xe9\r\n  v 0 0 0\r\nv\t1 0 \\\r\n 0\r\n\r\nv 1 1 0\r\nv 0 1 0\r\no caf\xe9\r\nf 1 2 3 \\\r\n4\r\n";
    let points = folder.read("a.obj", text).unwrap();
    assert_eq!(points.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(points.normals.unwrap(), [[0.0, 0.0, 1.0]; 4]);
}

#[test]
fn triangles_without_area_give_nothing() {
    let folder = Folder::new();
    let text = "v 0 0 0\nv 1 0 0\nv 2 0 0\nv nan 0 0\nf 1 2 3\nf 1 1 1\nf 1 2 4\nf 1 2 2\n";
    let points = folder.read("a.obj", text.as_bytes()).unwrap();
    assert_eq!(points.normals.unwrap(), [[0.0; 3]; 4]);
    assert_eq!(points.radii.unwrap(), [0.0; 4]);
}

#[test]
fn what_is_wrong_is_said_with_its_line() {
    let folder = Folder::new();
    let cases = [
        ("v 1 2\n", "line 1: a vertex has three numbers"),
        ("v 1 2 3 0\n", "line 1: a vertex has three numbers"),
        ("v 1 2 3 4 5\n", "line 1: a vertex has three numbers"),
        ("v 1 2 3 4 5 6 7 8\n", "line 1: a vertex has three numbers"),
        ("v 1 2 3\n\nv 1 x 3\n", "line 3: 'x' is not a number"),
        ("v 1 2 3\nvn 1 2\n", "line 2: too few numbers"),
        ("v 1 2 3\nf 1 nan 1\n", "line 2: 'nan' is not a corner"),
        ("v 1 2 3\nf 1 1 1.5\n", "line 2: '1.5' is not a corner"),
        ("v 1 2 3\nf 1 1 2\n", "a face names a vertex that does not exist"),
        ("v 1 2 3\nf 1 1 0\n", "a face names a vertex that does not exist"),
        ("v 1 2 3\nf 1 1 -2\n", "a face names a vertex that does not exist"),
        ("v 1 2 3\nf 1 1 9223372036854775807\n", "a face names a vertex that does not exist"),
        ("v 1 2 3\nf 1 1 -9223372036854775808\n", "a face names a vertex that does not exist"),
        ("v 1 2 3\nf 1 1 99999999999999999999\n", "line 2: '99999999999999999999' is not a corner"),
        ("v 1 2 3\nvn 0 0 1\nf 1//1 1//1 1//2\n", "a face names a normal that does not exist"),
        ("v 1 2 3\nvn 0 0 1\nf 1//1 1//1 1//6148914691236517207\n", "a face names a normal that does not exist"),
    ];
    for (text, said) in cases {
        let message = folder.refusal("a.obj", text.as_bytes());
        assert!(message.starts_with(said), "{text:?}: {message}");
    }
    let endless = folder.refusal("a.obj", &vec![b'x'; (1 << 24) + 10]);
    assert_eq!(endless, "line 1 is longer than 16777216 bytes");
}

#[test]
fn flipped_bytes_never_panic() {
    let folder = Folder::new();
    let mut random = Random(0xb0b);
    let sample = b"o a\nv 0 0 0 1 1 1\nv 1 0 0\nv 1 1 0\nv 0 1 0 2\nvn 0 0 1\nvt 0 0\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -1 -2 -3\nl 1 2\nusemtl x\n";
    for _ in 0..2000 {
        let mut bytes = sample.to_vec();
        for _ in 0..=random.below(3) {
            let at = random.below(bytes.len());
            bytes[at] = b"0123456789-/. \n\\#vnfe\xff"[random.below(22)];
        }
        if let Err(error) = folder.read("a.obj", &bytes) {
            sentence(&error, &folder.path("a.obj"));
        }
    }
}

#[test]
fn the_bunny_is_covered_and_faces_outwards() {
    let points = io::read(&data("bunny.obj"), &()).unwrap();
    let (normals, radii) = (points.normals.unwrap(), points.radii.unwrap());
    assert_eq!((points.positions.len(), normals.len(), radii.len()), (1839, 1839, 1839));
    assert!(radii.iter().all(|radius| (0.01..1.0).contains(radius)));
    let count = points.positions.len() as f64;
    let center: [f64; 3] = std::array::from_fn(|axis| points.positions.iter().map(|p| p[axis]).sum::<f64>() / count);
    let outwards = points.positions.iter().zip(&normals).filter(|(position, normal)| {
        (0..3).map(|axis| (position[axis] - center[axis]) * f64::from(normal[axis])).sum::<f64>() > 0.0
    });
    assert!(outwards.count() > 1500);
}

/// UTF-16 text in both byte orders, with a byte order mark.
fn in_utf_16(text: &str) -> [Vec<u8>; 2] {
    let with_mark = || {
        text.encode_utf16().fold(vec![0xfeff], |mut codes, code| {
            codes.push(code);
            codes
        })
    };
    [u16::to_le_bytes, u16::to_be_bytes].map(|bytes| with_mark().into_iter().flat_map(bytes).collect())
}

#[test]
fn text_may_be_in_utf_16() {
    let folder = Folder::new();
    let text =
        "# \u{fc}ber \u{1f430}\r\nmtllib m\u{e4}rz.mtl\r\nv 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nusemtl rot\r\nf 1 2 3\r\n";
    let library = "newmtl rot\nKd 1 0 0\n";
    std::fs::write(folder.path("m\u{e4}rz.mtl"), library).unwrap();
    let expected = folder.read("a.obj", text.as_bytes()).unwrap();
    for (bytes, library) in in_utf_16(text).into_iter().zip(in_utf_16(library)) {
        assert_eq!(folder.read("a.obj", &bytes).unwrap(), expected);
        std::fs::write(folder.path("m\u{e4}rz.mtl"), library).unwrap();
        let mesh = io::read_mesh(&folder.path("a.obj"), &()).unwrap();
        assert_eq!((mesh.triangles.len(), mesh.materials[0].diffuse, mesh.notes), (1, [1.0, 0.0, 0.0, 1.0], vec![]));
        // Half a code unit at the end, and an invalid one.
        let mut damaged = bytes.clone();
        damaged.extend([0xd8, 0xd8, 0xd8]);
        assert_eq!(folder.read("a.obj", &damaged).unwrap(), expected);
    }
    let said = folder.refusal("a.obj", &in_utf_16("v 0 0 0\nv 0 zw\u{f6}lf 0\n")[1]);
    assert_eq!(said, "line 2: 'zw\u{f6}lf' is not a number");
}

#[test]
fn lines_may_end_in_carriage_returns() {
    let text = "# old\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 \\\n3\n";
    let folder = Folder::new();
    let expected = folder.read("a.obj", text.as_bytes()).unwrap();
    assert_eq!(folder.read("a.obj", text.replace('\n', "\r").as_bytes()).unwrap(), expected);
    assert_eq!(expected.radii.unwrap().len(), 3);
}
