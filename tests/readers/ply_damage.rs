//! PLY files that cannot be read, or only in part.

use super::{Folder, Random, ply::file, sentence};

fn header(lines: &str) -> Vec<u8> {
    format!("ply\n{lines}end_header\n").into_bytes()
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";

#[test]
fn headers_that_are_none_are_refused_with_their_line() {
    let folder = Folder::new();
    let cases: &[(&str, &str)] = &[
        ("plx\n", "it is not a PLY file: its first line is not 'ply'"),
        ("", "it is not a PLY file: its first line is not 'ply'"),
        ("ply\n", "the file ends inside the PLY header, at line 2"),
        ("ply\nformat ascii 1.0\nelem", "the file ends inside the PLY header, at line 3"),
        ("ply\nformat middle_endian 1.0\n", "line 2: not a supported PLY format"),
        ("ply\nformat ascii 2.0\n", "line 2: not a supported PLY format"),
        ("ply\nelement vertex 1\nend_header\n", "line 3: the PLY header has no format line"),
        (
            "ply\nformat ascii 1.0\nelement vertex many\n",
            "line 3: the element's count is not a number of rows: 'element vertex many'",
        ),
        ("ply\nformat ascii 1.0\nelement vertex -1\n", "line 3: the element's count is not a number of rows"),
        (
            "ply\nformat ascii 1.0\nelement vertex 99999999999999999999\n",
            "line 3: the element's count is not a number of rows",
        ),
        ("ply\nformat ascii 1.0\nelement vertex\n", "line 3: an element needs a name and a count"),
        ("ply\nformat ascii 1.0\nproperty float x\n", "line 3: a property before any element"),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty real x\n", "line 4: not a property: 'property real x'"),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty float\n", "line 4: not a property"),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty list float int a\n", "line 4: not a property"),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar a\n", "line 4: not a property"),
        ("ply\nformat ascii 1.0\nwhat\n", "line 3: not a PLY header line: 'what'"),
        ("ply\nformat ascii 1.0\nend_header\n", "its header has no element 'vertex'"),
        ("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header", "its vertices have no property y, z"),
        (
            "ply\nformat ascii 1.0\nelement vertex 0\nproperty list uchar float x\nproperty float y\nproperty float z\nend_header",
            "its vertices have no property x",
        ),
    ];
    for (text, said) in cases {
        let message = folder.refusal("a.ply", text.as_bytes());
        assert!(message.starts_with(said), "{text:?}: {message}");
    }
    let endless = [b"ply\ncomment ".to_vec(), vec![b'x'; 1 << 20]].concat();
    assert_eq!(folder.refusal("a.ply", &endless), "line 2 of the PLY header is longer than 65536 bytes");
}

#[test]
fn counts_are_promises_and_not_trusted() {
    let folder = Folder::new();
    for count in [4u64, 1 << 40, u64::MAX] {
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            let mut bytes = header(&format!("format {format} 1.0\nelement vertex {count}\n{XYZ}"));
            bytes.extend(if format == "ascii" { b"1 2 3\n".repeat(3) } else { vec![0; 36] });
            let message = folder.refusal("a.ply", &bytes);
            assert_eq!(message, format!("the header promises {count} vertices, the file ends after 3"), "{format}");

            // The same for an element before the vertices, with and without a list.
            for property in ["property int a\n", "property list uchar int a\n"] {
                let face = format!("format {format} 1.0\nelement face {count}\n{property}element vertex 1\n{XYZ}");
                let message = folder.refusal("a.ply", &header(&face));
                let said = format!("the header promises {count} rows of element 'face', the file ends after 0");
                assert_eq!(message, said, "{format}");
            }
            // Rows without properties take no space and no time.
            let empty = format!("format {format} 1.0\nelement ghost {count}\nelement vertex 0\n{XYZ}");
            assert_eq!(folder.read("a.ply", &header(&empty)).unwrap().positions.len(), 0);
        }
    }
}

#[test]
fn words_that_are_no_numbers_are_named_with_their_line() {
    let folder = Folder::new();
    let lines = format!("format ascii 1.0\ncomment c\nelement vertex 3\n{XYZ}");
    let read = |body: &str| folder.refusal("a.ply", &[header(&lines), body.as_bytes().to_vec()].concat());
    assert_eq!(read("1 2 3\n\n1 two 3\n"), "line 11: 'two' is not a number");
    assert_eq!(read("1 2 3\r\n1 2 3\r\n1 2 0x3"), "line 11: '0x3' is not a number");
    let long = read(&"9x".repeat(1 << 20));
    assert!(long.starts_with("line 9: '9x9x") && long.ends_with("...' is not a number"), "{long}");
    assert_eq!(read("1 2 \u{1b}[2J\n"), "line 9: '\u{fffd}[2J' is not a number");
}

#[test]
fn lists_of_impossible_length_are_refused() {
    let folder = Folder::new();
    for (encoding, minus) in [("ascii", &b"-3 "[..]), ("binary_little_endian", b"\xfd"), ("binary_big_endian", b"\xfd")]
    {
        let lines = format!("format {encoding} 1.0\nelement face 1\nproperty list char int a\nelement vertex 0\n{XYZ}");
        let message = folder.refusal("a.ply", &[header(&lines), minus.to_vec()].concat());
        assert_eq!(message, "row 1 of element 'face' has a list of negative length", "{encoding}");
        let lines = format!("format {encoding} 1.0\nelement vertex 1\n{XYZ}property list uint double a\n");
        let mut bytes = header(&lines);
        bytes.extend(if encoding == "ascii" { b"1 2 3 4294967295 1".to_vec() } else { vec![0xff; 40] });
        let message = folder.refusal("a.ply", &bytes);
        assert_eq!(message, "the header promises 1 vertices, the file ends after 0", "{encoding}");
    }
    for length in ["2.5", "nan", "inf"] {
        let lines = format!("format ascii 1.0\nelement face 1\nproperty list char int a\nelement vertex 0\n{XYZ}");
        let message = folder.refusal("a.ply", &[header(&lines), length.as_bytes().to_vec()].concat());
        assert_eq!(message, format!("line 10: '{length}' is not the length of a list"));
    }
}

/// Small files of each encoding that contain everything.
fn samples() -> Vec<Vec<u8>> {
    let vertex = [
        ("float", "x"),
        ("double", "y"),
        ("short", "z"),
        ("float", "nx"),
        ("float", "ny"),
        ("float", "nz"),
        ("list uchar short", "list"),
        ("ushort", "red"),
        ("uchar", "green"),
        ("float", "blue"),
        ("float", "radius"),
    ];
    let plain: Vec<(&str, &str)> = vertex.iter().copied().filter(|(_, name)| *name != "list").collect();
    let rows: [&[f64]; 3] = [
        &[1.0, 2.0, 3.0, 0.0, 0.0, 1.0, 2.0, 7.0, 8.0, 65535.0, 255.0, 0.5, 0.1],
        &[1.5, 2.5, -3.0, 0.0, 1.0, 0.0, 0.0, 10.0, 13.0, 0.5, 0.2],
        &[-1.0, 1e9, 32.0, 1.0, 0.0, 0.0, 1.0, 9.0, 1.0, 2.0, 0.25, 0.3],
    ];
    let plain_rows: [&[f64]; 2] = [
        &[1.5, 2.5, -3.0, 0.0, 1.0, 0.0, 10.0, 13.0, 0.5, 0.2],
        &[-1.0, 1e9, 32.0, 1.0, 0.0, 0.0, 1.0, 2.0, 0.25, 0.3],
    ];
    let faces: [&[f64]; 2] = [&[3.0, 0.0, 1.0, 1.0], &[4.0, 0.0, 1.0, 1.0, 0.0]];
    let face: [(&str, &str); 1] = [("list uchar int", "vertex_indices")];
    ["ascii", "binary_little_endian", "binary_big_endian"]
        .iter()
        .flat_map(|encoding| {
            [
                file(encoding, &[("face", &face, &faces), ("vertex", &vertex, &rows)]),
                file(encoding, &[("vertex", &plain, &plain_rows), ("face", &face, &faces)]),
            ]
        })
        .collect()
}

#[test]
fn a_file_cut_anywhere_is_refused_or_read() {
    let folder = Folder::new();
    for sample in samples() {
        let whole = folder.read("a.ply", &sample).unwrap().positions.len();
        let mut lengths = Vec::new();
        for length in 0..sample.len() {
            match folder.read("a.ply", &sample[..length]) {
                // Data after the vertices may be missing, and in text the last digits of the last
                // number.
                Ok(points) => assert_eq!(points.positions.len(), whole),
                Err(error) => {
                    lengths.push(length);
                    sentence(&error, &folder.path("a.ply"));
                }
            }
        }
        assert!(lengths.iter().copied().eq(0..lengths.len()) && lengths.len() > 200, "refused up to {}", lengths.len());
    }
}

#[test]
fn flipped_bytes_never_panic() {
    let folder = Folder::new();
    let mut random = Random(0x5eed);
    for sample in samples() {
        for _ in 0..200 {
            let mut bytes = sample.clone();
            for _ in 0..=random.below(3) {
                let at = random.below(bytes.len());
                bytes[at] = random.below(256) as u8;
            }
            if let Err(error) = folder.read("a.ply", &bytes) {
                sentence(&error, &folder.path("a.ply"));
            }
        }
    }
}
