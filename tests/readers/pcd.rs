//! PCD files, valid and damaged.

use super::{Folder, Random, sentence};
use epsplat::io::Points;
use epsplat::low_level::scene::Colors;

pub const DATA: [&str; 3] = ["ascii", "binary", "binary_compressed"];

/// Name, size in bytes, type and count of a field.
type Field = (&'static str, usize, char, usize);

const XYZ: [Field; 3] = [("x", 4, 'F', 1), ("y", 8, 'F', 1), ("z", 2, 'I', 1)];

/// A number as little-endian bytes of the field's type.
fn bytes_of(value: f64, (_, size, kind, _): Field) -> Vec<u8> {
    match (kind, size) {
        ('F', 4) => (value as f32).to_le_bytes().to_vec(),
        ('F', 8) => value.to_le_bytes().to_vec(),
        ('I', _) => (value as i64).to_le_bytes()[..size].to_vec(),
        ('U', _) => (value as u64).to_le_bytes()[..size].to_vec(),
        _ => panic!("{kind}{size}"),
    }
}

fn header(fields: &[Field], points: usize, data: &str) -> String {
    let each = |word: &str, of: fn(&Field) -> String| {
        format!("{word} {}\n", fields.iter().map(of).collect::<Vec<_>>().join(" "))
    };
    [
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n".to_owned(),
        each("FIELDS", |field| field.0.into()),
        each("SIZE", |field| field.1.to_string()),
        each("TYPE", |field| field.2.into()),
        each("COUNT", |field| field.3.to_string()),
        format!("WIDTH {points}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {data}\n"),
    ]
    .concat()
}

/// A file of `rows`; each row has all numbers of all fields.
fn file(fields: &[Field], rows: &[&[f64]], data: &str) -> Vec<u8> {
    let mut bytes = header(fields, rows.len(), data).into_bytes();
    let spread: Vec<Field> = fields.iter().flat_map(|field| vec![*field; field.3]).collect();
    match data {
        "ascii" => {
            for row in rows {
                let words: Vec<_> = row.iter().map(f64::to_string).collect();
                bytes.extend(format!("{}\n", words.join(" ")).bytes());
            }
        }
        "binary" => {
            rows.iter().for_each(|row| bytes.extend(row.iter().zip(&spread).flat_map(|(v, f)| bytes_of(*v, *f))))
        }
        _ => {
            let mut columns = Vec::new();
            let mut first = 0;
            for field in fields {
                for row in rows {
                    columns.extend(row[first..first + field.3].iter().flat_map(|value| bytes_of(*value, *field)));
                }
                first += field.3;
            }
            let packed = pack(&columns);
            bytes.extend((packed.len() as u32).to_le_bytes());
            bytes.extend((columns.len() as u32).to_le_bytes());
            bytes.extend(packed);
        }
    }
    bytes
}

/// An LZF encoder: the longest match at each position, otherwise a literal byte.
fn pack(bytes: &[u8]) -> Vec<u8> {
    let (mut packed, mut at, mut run) = (Vec::new(), 0, Vec::new());
    let flush = |packed: &mut Vec<u8>, run: &mut Vec<u8>| {
        for piece in run.chunks(32) {
            packed.push(piece.len() as u8 - 1);
            packed.extend(piece);
        }
        run.clear();
    };
    while at < bytes.len() {
        let alike =
            |start: usize| (at..bytes.len().min(at + 264)).take_while(|&k| bytes[k] == bytes[start + k - at]).count();
        let best = (at.saturating_sub(8192)..at).map(|start| (alike(start), start)).max().filter(|best| best.0 >= 3);
        let Some((length, start)) = best else {
            run.push(bytes[at]);
            at += 1;
            continue;
        };
        flush(&mut packed, &mut run);
        let (code, distance) = (length - 2, at - start - 1);
        packed.push((code.min(7) << 5 | distance >> 8) as u8);
        if code >= 7 {
            packed.push((code - 7) as u8);
        }
        packed.push((distance & 255) as u8);
        at += length;
    }
    flush(&mut packed, &mut run);
    packed
}

#[test]
fn fields_of_every_type_in_every_encoding() {
    let folder = Folder::new();
    let kinds = [(1, 'I'), (2, 'I'), (4, 'I'), (8, 'I'), (1, 'U'), (2, 'U'), (4, 'U'), (8, 'U'), (4, 'F'), (8, 'F')];
    for data in DATA {
        for (size, kind) in kinds {
            let fields = [("pad", size, kind, 3), ("z", 4, 'F', 1), ("x", size, kind, 1), ("y", size, kind, 2)];
            let rows: [&[f64]; 3] = [
                &[1.0, 2.0, 3.0, 0.5, 100.0, 7.0, 99.0],
                &[4.0, 5.0, 6.0, -1.5, 101.0, 8.0, 99.0],
                &[4.0, 5.0, 6.0, 1e9, 0.0, 9.0, 99.0],
            ];
            let points = folder.read("a.pcd", &file(&fields, &rows, data)).unwrap();
            let expected = [[100.0, 7.0, 0.5], [101.0, 8.0, -1.5], [0.0, 9.0, 1e9]];
            assert_eq!(points, Points { positions: expected.to_vec(), ..Points::default() }, "{data} {kind}{size}");
        }
        let signed = [("x", 2, 'I', 1), ("y", 8, 'I', 1), ("z", 8, 'F', 1)];
        let points = folder.read("a.pcd", &file(&signed, &[&[-300.0, -7e9, 6_000_000.001]], data)).unwrap();
        assert_eq!(points.positions, [[-300.0, -7e9, 6_000_000.001]]);
    }
}

#[test]
fn many_points_come_back_from_every_encoding() {
    let folder = Folder::new();
    let fields = [XYZ[0], XYZ[1], XYZ[2], ("normal_x", 4, 'F', 1), ("normal_y", 4, 'F', 1), ("normal_z", 4, 'F', 1)];
    let rows: Vec<[f64; 6]> = (0..30_000)
        .map(|i| [f64::from(i % 100), f64::from(i) / 8.0, f64::from(i % 77), 0.0, 0.25, f64::from(i % 2)])
        .collect();
    // The test's encoder tries every distance, which is slow, so compressed files are kept short.
    for (data, count) in [("ascii", 30_000), ("binary", 30_000), ("binary_compressed", 600)] {
        let rows: Vec<&[f64]> = rows.iter().take(count).map(<[f64; 6]>::as_slice).collect();
        let points = folder.read("a.pcd", &file(&fields, &rows, data)).unwrap();
        assert!(points.positions.iter().zip(&rows).all(|(p, row)| p == &row[..3]), "{data}");
        let normals = points.normals.unwrap();
        assert_eq!((points.positions.len(), normals.len(), normals[7]), (count, count, [0.0, 0.25, 1.0]));
    }
}

#[test]
fn colours_are_packed_into_one_number_of_any_type() {
    let folder = Folder::new();
    let code = 0x80_c8_64_0au32;
    let bits = |kind: char| match kind {
        'F' => f64::from(f32::from_bits(code)),
        'I' => f64::from(code.cast_signed()),
        _ => f64::from(code),
    };
    for data in DATA {
        for kind in ['F', 'U', 'I'] {
            for (name, alpha) in [("rgb", 255), ("rgba", 128)] {
                let fields = [XYZ[0], XYZ[1], XYZ[2], (name, 4, kind, 1), ("intensity", 4, 'F', 1)];
                let rows: [&[f64]; 2] = [&[0.0, 0.0, 0.0, bits(kind), 3.0], &[1.0, 0.0, 0.0, 0.0, 4.0]];
                let points = folder.read("a.pcd", &file(&fields, &rows, data)).unwrap();
                let clear = if name == "rgba" { 0 } else { 255 };
                let expected = Colors::Srgb8(vec![[200, 100, 10, alpha], [0, 0, 0, clear]]);
                assert_eq!(points.colors, Some(expected), "{data} {kind} {name}");
            }
        }
        // An alpha that is 0 everywhere counts as unset.
        let fields = [XYZ[0], XYZ[1], XYZ[2], ("rgba", 4, 'U', 1)];
        let points = folder.read("a.pcd", &file(&fields, &[&[0.0, 0.0, 0.0, f64::from(0x10203)]], data)).unwrap();
        assert_eq!(points.colors, Some(Colors::Srgb8(vec![[1, 2, 3, 255]])));
        let fields = [XYZ[0], XYZ[1], XYZ[2], ("intensity", 4, 'F', 1)];
        let rows: [&[f64]; 3] = [&[0.0; 4], &[0.0, 0.0, 0.0, 0.25], &[0.0, 0.0, 0.0, 0.5]];
        let points = folder.read("a.pcd", &file(&fields, &rows, data)).unwrap();
        let expected = Colors::Srgb8(vec![[0, 0, 0, 255], [128, 128, 128, 255], [255; 4]]);
        assert_eq!(points.colors, Some(expected), "{data}");
    }
}

#[test]
fn older_versions_and_files_without_points() {
    let folder = Folder::new();
    let text = "VERSION .5\r\nFIELDS x y z\r\nSIZE 4 4 4\r\nTYPE F F F\r\nWIDTH 2\r\nHEIGHT 1\r\nDATA ascii\r\nnan nan nan\r\n\r\n1 2 3\r\n";
    let points = folder.read("A.PCD", text.as_bytes()).unwrap();
    assert!(points.positions[0].iter().all(|c| c.is_nan()) && points.positions[1] == [1.0, 2.0, 3.0]);
    // Recognised by its first bytes, and without points.
    let none = header(&XYZ, 0, "binary_compressed");
    assert_eq!(folder.read("cloud", none.trim_end().as_bytes()).unwrap(), Points::default());
}

#[test]
fn headers_that_contradict_themselves_are_refused() {
    let folder = Folder::new();
    let good = header(&XYZ, 2, "binary");
    for (from, to, said) in [
        ("FIELDS x y z", "FIELDS x y", "its header names 2 fields, but gives 3 sizes, 3 types and 3 counts"),
        ("FIELDS x y z", "FIELDS x y w", "its points have no field z"),
        ("COUNT 1 1 1", "COUNT 1 1 0", "its points have no field z"),
        ("SIZE 4 8 2", "SIZE 4 8 3", "its field 'z' has numbers of 3 bytes, which its type forbids"),
        ("SIZE 4 8 2", "SIZE 2 8 2", "its field 'x' has numbers of 2 bytes, which its type forbids"),
        ("SIZE 4 8 2", "SIZE 4 -8 2", "line 4: not a whole number: 'SIZE 4 -8 2'"),
        ("TYPE F F I", "TYPE F F Q", "line 5: a type is I, U or F: 'TYPE F F Q'"),
        ("COUNT 1 1 1", "COUNT 1 9999999999999999999 1", "its points would be longer than any file"),
        ("POINTS 2", "POINTS 3", "its header gives 3 points, but WIDTH x HEIGHT is 2"),
        ("POINTS 2", "POINTS", "line 10: one number is needed: 'POINTS'"),
        ("WIDTH 2\nHEIGHT 1\n", "WIDTH 9999999999\nHEIGHT 9999999999\n", "its image is too large"),
        (
            "WIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\n",
            "",
            "its header does not say how many points there are",
        ),
        (
            "DATA binary",
            "DATA zip",
            "line 11: the data of a PCD file is ascii, binary or binary_compressed: 'DATA zip'",
        ),
        ("VERSION", "VERSIONS", "line 2: not a PCD header line: 'VERSIONS 0.7'"),
    ] {
        assert!(good.contains(from), "{from}");
        assert_eq!(folder.refusal("a.pcd", good.replace(from, to).as_bytes()), said);
    }
    assert_eq!(folder.refusal("a.pcd", b""), "it is not a PCD file: it has none of its header lines");
    assert_eq!(folder.refusal("a.pcd", &good.as_bytes()[..90]), "the file ends inside the PCD header, at line 6");
    let endless = [b"FIELDS ".to_vec(), vec![b'x'; 1 << 20]].concat();
    assert_eq!(folder.refusal("a.pcd", &endless), "line 1 of the PCD header is longer than 65536 bytes");
}

#[test]
fn promises_are_held_against_the_file() {
    let folder = Folder::new();
    let rows: [&[f64]; 3] = [&[1.0, 2.0, 3.0]; 3];
    for data in DATA {
        for points in [4u64, 1 << 40, u64::MAX / 14] {
            let bytes = file(&XYZ, &rows, data);
            let start = header(&XYZ, 3, data).len();
            let mut promising = header(&XYZ, 3, data);
            promising = promising
                .replace("WIDTH 3", &format!("WIDTH {points}"))
                .replace("POINTS 3", &format!("POINTS {points}"));
            let message = folder.refusal("a.pcd", &[promising.as_bytes(), &bytes[start..]].concat());
            let said = match data {
                "binary_compressed" => {
                    format!("the header promises {points} points, but the data of 42 bytes does not fit them")
                }
                _ => format!("the header promises {points} points, the file ends after 3"),
            };
            assert_eq!(message, said);
        }
    }
    // A compressed length beyond the file, and one too short for the promised data.
    let start = header(&XYZ, 3, DATA[2]).len();
    let mut long = file(&XYZ, &rows, DATA[2]);
    long[start..start + 4].fill(0xff);
    assert_eq!(folder.refusal("a.pcd", &long), "the header promises 3 points, the file ends after 0");
    let bomb =
        [header(&XYZ, 300_000_000, DATA[2]).as_bytes(), &4u32.to_le_bytes(), &4_200_000_000u32.to_le_bytes(), &[0; 4]]
            .concat();
    assert!(folder.refusal("a.pcd", &bomb).contains("cannot be decoded"));
}

#[test]
fn cut_and_flipped_files_are_refused_or_read() {
    let folder = Folder::new();
    let mut random = Random(0x9cd);
    let fields = [XYZ[0], ("_", 1, 'U', 2), XYZ[1], XYZ[2], ("rgb", 4, 'F', 1)];
    let rows: [&[f64]; 4] = [&[1.0, 2.0, 3.0, 4.0, 5.0, 1.25]; 4];
    for data in DATA {
        let whole = file(&fields, &rows, data);
        for length in 0..whole.len() {
            match folder.read("a.pcd", &whole[..length]) {
                // Truncated text may lack the last digits of its last number.
                Ok(points) => {
                    assert!(data == "ascii" && length + 6 > whole.len() && points.positions.len() == 4, "{length}")
                }
                Err(error) => assert!(!sentence(&error, &folder.path("a.pcd")).is_empty()),
            }
        }
        for _ in 0..300 {
            let mut bytes = whole.clone();
            for _ in 0..=random.below(3) {
                let at = random.below(bytes.len());
                bytes[at] = random.below(256) as u8;
            }
            if let Err(error) = folder.read("a.pcd", &bytes) {
                sentence(&error, &folder.path("a.pcd"));
            }
        }
    }
}

/// Headers in upper or lower case, with lines that end in carriage returns.
#[test]
fn headers_are_read_in_either_case() {
    let folder = Folder::new();
    let rows: [&[f64]; 2] = [&[1.0, 2.0, 3.0], &[4.0, 5.0, 6.0]];
    for data in DATA {
        let bytes = file(&XYZ, &rows, data);
        let expected = folder.read("a.pcd", &bytes).unwrap();
        let length = if data == "ascii" { bytes.len() } else { header(&XYZ, 2, data).len() };
        for change in [str::to_ascii_uppercase, str::to_ascii_lowercase, |text: &str| text.replace('\n', "\r")] {
            let changed = change(str::from_utf8(&bytes[..length]).unwrap());
            let changed = [changed.as_bytes(), &bytes[length..]].concat();
            assert_eq!(folder.read("a.pcd", &changed).unwrap(), expected, "{data}");
            assert_eq!(folder.read("a", &changed).unwrap(), expected, "{data}");
        }
    }
    // If two names differ only in case, the one in lower case is used.
    let fields = [("X", 4, 'F', 1), XYZ[0], XYZ[1], XYZ[2]];
    let points = folder.read("a.pcd", &file(&fields, &[&[9.0, 1.0, 2.0, 3.0]], "ascii")).unwrap();
    assert_eq!(points.positions, [[1.0, 2.0, 3.0]]);
}
