//! Point clouds as text, as other programs write them, and damaged ones.

use super::{Error, Folder, Points, ReadOptions, io, sentence};
use epsplat::io::{Format, Wanted};
use epsplat::low_level::scene::Colors;

/// The 8-bit sRGB codes of the colours.
pub fn codes(points: &Points) -> Vec<[u8; 4]> {
    let code = |light: f32| {
        let light = f64::from(light);
        let code = if light <= 0.0031308 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
        (255.0 * code).round() as u8
    };
    match &points.colors {
        Some(Colors::Srgb8(codes)) => codes.clone(),
        Some(Colors::Linear(colors)) => {
            colors.iter().map(|[r, g, b, a]| [code(*r), code(*g), code(*b), (255.0 * a).round() as u8]).collect()
        }
        other => panic!("{other:?}"),
    }
}

/// The note about a guess, without the name of the file.
fn guess(points: &Points) -> &str {
    points
        .notes
        .iter()
        .find_map(|note| note.split_once(": columns are taken as "))
        .map_or("", |(_, guess)| guess.strip_suffix("; a first line with names would decide").unwrap())
}

#[test]
fn tables_of_many_programs_are_read() {
    let folder = Folder::new();
    let positions = [[1.5, 2.0, -3.25], [4.0, 5e-1, 6.0]];
    for (name, text) in [
        // CloudCompare, with and without the number of points.
        (
            "a.asc",
            "//X Y Z R G B\n1.50000000 2.00000000 -3.25000000 255 0 16\n4.00000000 0.50000000 6.00000000 1 2 3\n",
        ),
        ("b.txt", "//X Y Z R G B\n2\n1.5 2 -3.25 255 0 16\n4.0 0.5 6 1 2 3\n"),
        // PDAL's writers.text.
        (
            "c.csv",
            "\"X\",\"Y\",\"Z\",\"Red\",\"Green\",\"Blue\"\n1.500,2.000,-3.250,255.000,0.000,16.000\n4.0,0.5,6.0,1,2,3\n",
        ),
        // numpy.savetxt.
        ("d.txt", "# x y z r g b\n1.5e+00 2.0e+00 -3.25e+00 2.55e+02 0.0e+00 1.6e+01\n4.0e+00 5.0e-01 6.0e+00 1 2 3\n"),
        ("e.xyz", "1.5 2 -3.25 255 0 16\r\n\r\n# a comment\r\n4 .5 6 1 2 3 # another\r\n"),
        ("f.csv", "Easting [m];Northing [m];Height [m];r;g;b\n1.5;2;-3.25;255;0;16;\n4;0.5;6;1;2;3;\n"),
        ("g.txt", "x\ty\tz\tred\tgreen\tblue\tname\n1.5\t2\t-3.25\t255\t0\t16\ta wall\n4\t0.5\t6\t1\t2\t3\tfloor\n"),
        ("h.csv", "blue,z,green,y,red,x\n16,-3.25,0,2,255,1.5\n3,6,2,.5,1,4"),
        ("i.xyz", "1.5 2 -3.25 255 0 16\r4 0.5 6 1 2 3\r"),
    ] {
        let points = folder.read(name, text.as_bytes()).unwrap();
        assert_eq!(points.positions, positions, "{name}");
        assert_eq!(codes(&points), [[255, 0, 16, 255], [1, 2, 3, 255]], "{name}");
        assert_eq!(guess(&points), if name.ends_with("xyz") { "x y z red green blue" } else { "" }, "{name}");
        let utf16: Vec<u8> = format!("\u{feff}{text}").encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(folder.read(name, &utf16).unwrap(), points, "{name}");
        let marked = [b"\xef\xbb\xbf", text.as_bytes()].concat();
        assert_eq!(folder.read(name, &marked).unwrap(), points, "{name}");
    }
    // The first bytes overrule the name, and `--input-format` overrules both.
    let ply = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n7 8 9\n";
    assert_eq!(folder.read("a.txt", ply).unwrap().positions, [[7.0, 8.0, 9.0]]);
    let xyz = ReadOptions { format: Some(Format::Xyz), ..ReadOptions::default() };
    std::fs::write(folder.path("points"), "7 8 9\n").unwrap();
    assert_eq!(io::read_with(&folder.path("points"), xyz, &()).unwrap().positions, [[7.0, 8.0, 9.0]]);
    for empty in ["", "\n", "# nothing\n", "x,y,z,intensity\n"] {
        assert!(folder.read("e.csv", empty.as_bytes()).unwrap().positions.is_empty(), "{empty:?}");
    }
}

#[test]
fn columns_without_names_are_guessed() {
    let folder = Folder::new();
    let read = |rest: &str| folder.read("a.xyz", format!("0 0 1 {rest}\n1 2 3 {rest}\n").as_bytes()).unwrap();
    assert_eq!(guess(&read("")), "");
    let points = read("0.6 0 -0.8");
    assert_eq!(guess(&points), "x y z nx ny nz");
    assert_eq!(points.normals.unwrap(), [[0.6, 0.0, -0.8]; 2]);
    assert!(points.colors.is_none());
    let points = read("-2048 17 0 255");
    assert_eq!(guess(&points), "x y z intensity red green blue");
    assert_eq!(codes(&points), [[17, 0, 255, 255]; 2]);
    let points = read("1 2 3 0 1 0");
    assert_eq!(guess(&points), "x y z red green blue nx ny nz");
    assert_eq!((codes(&points), points.normals.unwrap()), (vec![[1, 2, 3, 255]; 2], vec![[0.0, 1.0, 0.0]; 2]));
    // Shares of white are sRGB, as in all formats but PLY.
    assert_eq!(codes(&read("1 0.2 0")), [[255, 51, 0, 255]; 2]);
    // A late number that is not whole makes all of them shares.
    let black = "1 2 3 0 0 0\n".repeat(2000) + "1 2 3 1 0.2 0\n";
    assert_eq!(codes(&folder.read("b.xyz", black.as_bytes()).unwrap())[2000], [255, 51, 0, 255]);
}

#[test]
fn other_columns_are_attributes() {
    let folder = Folder::new();
    let path = folder.path("a.csv");
    let rows = "x,y,z,Scalar field,Classification,word\n0,0,0,7.5,2,a\n1,0,0,,6,b\n2,0,0,-1,2,c\n";
    std::fs::write(&path, rows).unwrap();
    let read = |column: Option<&str>, filter: &str| {
        let filter = filter.parse().unwrap_or_default();
        let wanted = Wanted { column: column.map(str::to_owned), filter, spans: true };
        io::read_with(&path, ReadOptions { wanted, ..ReadOptions::default() }, &())
    };
    let column = read(Some("SCALAR FIELD"), "").unwrap().column.unwrap();
    assert_eq!((column.value(0), column.value(2)), (7.5, -1.0));
    assert!(column.value(1).is_nan());
    let kept = read(None, "class[2:2]").unwrap();
    assert_eq!((kept.positions.len(), kept.left_out), (2, vec![1]));
    let names: Vec<_> = kept.spans.iter().map(|span| span.name.as_str()).collect();
    assert_eq!(names, ["X", "Y", "Z", "Scalar field", "Classification"]);
    let said = read(Some("word"), "").unwrap_err().to_string();
    assert!(said.contains("it has no attribute 'word': it has X, Y, Z, Scalar field"), "{said}");
}

#[test]
fn large_tables_keep_their_order() {
    let folder = Folder::new();
    // Several blocks of a megabyte, which threads parse side by side.
    let text: String = (0..300_000).map(|k| format!("{k} {}.25 -{k}e-3\n", k % 7)).collect();
    let points = folder.read("a.xyz", text.as_bytes()).unwrap();
    assert_eq!(points.positions.len(), 300_000);
    for (k, [x, y, z]) in points.positions.iter().enumerate() {
        let k = k as f64;
        assert_eq!([*x, *y], [k, k % 7.0 + 0.25]);
        assert!((z + k / 1000.0).abs() < 1e-9);
    }
    let damaged = text.replacen("\n250000 ", "\n25000o ", 1);
    assert_eq!(folder.refusal("a.xyz", damaged.as_bytes()), "line 250001: '25000o' is not a number");
}

#[test]
fn pts_files_count_their_points() {
    let folder = Folder::new();
    let text = "2\n1 2 3 -2048 10 20 30\n4 5 6 2047 40 50 60\n1\n7 8 9 0 70 80 90\n";
    let points = folder.read("a.pts", text.as_bytes()).unwrap();
    assert_eq!(points.positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]);
    assert_eq!(codes(&points)[2], [70, 80, 90, 255]);
    assert_eq!(points.up, Some(io::Up::Z));
    assert!(points.unread.is_empty());
    // Without colours, intensities become grey; the smallest is black.
    let grey = codes(&folder.read("a.pts", b"2\n1 2 3 -2048\n4 5 6 2047\n").unwrap());
    assert_eq!((grey[0], grey[1]), ([0, 0, 0, 255], [255; 4]));
    // A count promises nothing that is not there.
    let path = folder.path("a.pts");
    let points = folder.read("a.pts", b"1099511627776\n1 2 3 4\n").unwrap();
    assert_eq!(points.positions.len(), 1);
    assert_eq!(
        points.unread,
        ["a.pts: it promises 1099511627776 points, and ends after 1 (--strict refuses the file)"]
    );
    let strict = ReadOptions { strict: true, ..ReadOptions::default() };
    let error = io::read_with(&path, strict, &()).unwrap_err();
    assert_eq!(sentence(&error, &path), "it promises 1099511627776 points, and ends after 1");
}

/// A scan of a PTX file of `size` columns and rows, with a matrix in the order of the format.
fn scan(size: [usize; 2], matrix: [[f64; 4]; 4], points: &[&str]) -> String {
    let line = |row: &[f64]| row.iter().map(f64::to_string).collect::<Vec<_>>().join(" ") + "\n";
    let pose: String = [matrix[3], matrix[0], matrix[1], matrix[2]].iter().map(|row| line(&row[..3])).collect();
    let matrix: String = matrix.iter().map(|row| line(row)).collect();
    format!("{}\n{}\n{pose}{matrix}{}\n", size[0], size[1], points.join("\n"))
}

/// A quarter turn around z, and a step of 10, 20, 30.
const TURN: [[f64; 4]; 4] =
    [[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [10.0, 20.0, 30.0, 1.0]];

#[test]
fn ptx_scans_are_put_in_their_places() {
    let folder = Folder::new();
    let still = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    let first = scan([2, 2], TURN, &["1 0 0 0.5 255 0 0", "0 0 0 0.5 0 0 0", "0 2 0 0.25 0 255 0", "0 0 3 1 0 0 255"]);
    let second = scan([1, 2], still, &["0 0 0 0.5 0 0 0", "7 8 9 0.5 1 2 3"]);
    let text = first.clone() + &second;
    let points = folder.read("a.ptx", text.as_bytes()).unwrap();
    assert_eq!(points.positions, [[10.0, 21.0, 30.0], [8.0, 20.0, 30.0], [10.0, 20.0, 33.0], [7.0, 8.0, 9.0]]);
    assert_eq!(codes(&points), [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [1, 2, 3, 255]]);
    assert_eq!((points.left_out.as_slice(), points.up), (&[1, 4][..], Some(io::Up::Z)));
    // A filter leaves out more, by the numbers that points have in the file.
    let wanted = Wanted { filter: "intensity[:0.4],Z[:31]".parse().unwrap(), ..Wanted::default() };
    let options = ReadOptions { wanted, ..ReadOptions::default() };
    let kept = io::read_with(&folder.path("a.ptx"), options, &()).unwrap();
    assert_eq!((kept.positions, kept.left_out), (vec![[8.0, 20.0, 30.0]], vec![0, 1, 3, 4, 5]));
    // Without colours.
    let plain = scan([1, 2], TURN, &["1 0 0 0.5", "0 0 0 0.5"]);
    assert_eq!(folder.read("b.ptx", plain.as_bytes()).unwrap().positions, [[10.0, 21.0, 30.0]]);
    // A file that ends early.
    let cut = &text[..text.rfind('7').unwrap()];
    let points = folder.read("a.ptx", cut.as_bytes()).unwrap();
    assert_eq!(points.positions.len(), 3);
    assert_eq!(points.unread.len(), 1);
    assert!(points.unread[0].contains("its scan 2 lacks 1 of its points"), "{:?}", points.unread);
    for (from, to, said) in [
        (
            "2\n2\n",
            "1099511627776\n1099511627776\n",
            "line 15: its scan still lacks 1208925819614629174706172 points, but it has 1 number",
        ),
        ("2\n2\n", "2.5\n2\n", "line 1: a whole number is needed here, the number of columns of a scan, not 2.5"),
        ("2\n2\n", "2\n", "line 2: a row of 1 number is needed here, the number of rows of a scan; it has 3 numbers"),
        ("0.25 0 255 0", "0.25 0 x 0", "line 13: 'x' is not a number"),
    ] {
        let said = said.replace("1208925819614629174706172", &(u64::MAX - 4).to_string());
        assert_eq!(folder.refusal("a.ptx", text.replacen(from, to, 1).as_bytes()), said);
    }
}

#[test]
fn texts_that_are_no_tables_are_refused_in_a_sentence() {
    let folder = Folder::new();
    for (text, said) in [
        ("Dear reader,\n1 2 3\n", "line 1: it is no row of numbers, and names no columns x, y and z: 'Dear reader,'"),
        ("name,value\nwidth,3\n", "line 1: it is no row of numbers, and names no columns x, y and z: 'name,value'"),
        ("1 2 3\n4 5\n", "line 2: it has 2 columns, not 3 as the rows before"),
        ("x y z i\n1 2 3\n", "line 2: it has 3 columns, but line 1 names 4"),
        ("1 2\n3 4\n", "line 1: it has 2 columns: x, y and z are needed"),
        ("1,5;2,5;3,5\n", "line 1: '1,5' has a decimal comma: write numbers with a decimal point"),
        ("1,5 2,5 3,5\n", "line 1: '1,5' has a decimal comma: write numbers with a decimal point"),
        ("x;y;z\n1,5;2,5;3,5\n", "line 2: '1,5' has a decimal comma: write numbers with a decimal point"),
        ("x y z\n1 2 3\n\n4 five 6\n", "line 4: 'five' is not a number"),
        ("3\nH\nC 0 0 0\n", "line 2: it is no row of numbers, and names no columns x, y and z: 'H'"),
    ] {
        assert_eq!(folder.refusal("a.txt", text.as_bytes()), said, "{text:?}");
    }
    let mut long = b"1 2 3\n".repeat(3);
    long.resize(3 << 20, b'1');
    assert_eq!(folder.refusal("a.txt", &long), "it has a line of more than 1048576 bytes");
    let wide = "1 ".repeat(300_000) + "\n";
    assert_eq!(folder.refusal("a.txt", wide.as_bytes()), "line 1: it has 300000 columns, more than 256");
    assert!(folder.refusal("a.xyz", b"\x1f\x8b\x08\0\0").contains("gzip"));
    // Numbers that are not finite are points that no scene takes, as in all formats.
    let points = folder.read("a.txt", b"nan 1 2\n1 inf 2\n-1.#IND 0 0\n").unwrap();
    assert!(points.positions.len() == 3 && points.positions.iter().flatten().filter(|c| !c.is_finite()).count() == 3);
    // Empty cells, also at the end of a line.
    let points = folder.read("a.csv", b"x,y,z,a,b\n1,2,3,,\n1,,3,4,5\n").unwrap();
    assert!(points.positions[0] == [1.0, 2.0, 3.0] && points.positions[1][1].is_nan());
    let missing = std::path::Path::new("no/such/file.csv");
    assert!(matches!(io::read(missing, &()), Err(Error::Read { .. })));
}
