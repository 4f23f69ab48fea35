//! Gaussians as programs write them: with filters, rows of zeros, colours, compressed, and in other
//! formats.

use super::Folder;
use super::ply::{ENCODINGS, file};
use epsplat::io::{self, Points, ReadOptions};
use epsplat::low_level::scene::Colors;
use epsplat::low_level::scene::gaussian::EXTENT;
use epsplat::low_level::surfels::build;

/// The properties of a Gaussian with three axes, in the order of its values.
const NAMES: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2",
    "rot_3",
];

/// A Gaussian with these standard deviations and opacity 0.9.
fn flat(x: f64, deviations: [f64; 3]) -> Vec<f64> {
    let [a, b, c] = deviations.map(f64::ln);
    vec![x, 0.5, -1.0, 0.3, -0.2, 1.1, 9f64.ln(), a, b, c, 1.0, 0.0, 0.0, 0.0]
}

/// A PLY file with these properties and rows.
fn of(encoding: &str, properties: &[(&str, &str)], rows: &[Vec<f64>]) -> Vec<u8> {
    let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
    file(encoding, &[("vertex", properties, &rows)])
}

fn floats<'a>(names: &[&'a str]) -> Vec<(&'static str, &'a str)> {
    names.iter().map(|name| ("float", *name)).collect()
}

fn flattened(folder: &Folder, bytes: &[u8]) -> Points {
    let path = folder.path("a.ply");
    std::fs::write(&path, bytes).unwrap();
    io::read_with(&path, ReadOptions { flatten: true, ..ReadOptions::default() }, &()).unwrap()
}

fn colors(points: &Points) -> Vec<[f32; 4]> {
    match points.colors.as_ref().unwrap() {
        Colors::Linear(colors) => colors.clone(),
        Colors::Harmonics(harmonics) => harmonics.colors().to_vec(),
        other => panic!("{other:?}"),
    }
}

fn length(axis: [f32; 3]) -> f64 {
    axis.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt()
}

fn near(a: f64, b: f64) {
    assert!((a / b - 1.0).abs() < 1e-5, "{a} {b}");
}

/// Mip-Splatting's `filter_3D` widens each standard deviation and lowers the opacity accordingly.
#[test]
fn the_filter_of_mip_splatting_is_applied() {
    let folder = Folder::new();
    let own = [0.02, 0.03, 0.0004];
    for encoding in ENCODINGS {
        for (kind, filter) in [("float", 0.0), ("float", 1e-5), ("double", 0.001), ("float", 0.05), ("double", 3.0)] {
            let properties: Vec<_> = floats(&NAMES).into_iter().chain([(kind, "filter_3D")]).collect();
            let rows = [[flat(1.0, own), vec![filter]].concat(), [flat(2.0, own), vec![0.0]].concat()];
            let points = flattened(&folder, &of(encoding, &properties, &rows));
            let wide = own.map(|deviation| deviation.hypot(filter));
            let [s, t] = points.axes.as_ref().unwrap()[0];
            near(length(s), EXTENT * wide[0]);
            near(length(t), EXTENT * wide[1]);
            let left: f64 = (0..3).map(|k| own[k] / wide[k]).product();
            near(colors(&points)[0][3].into(), 0.9 * left);
            near(colors(&points)[1][3].into(), 0.9);
            // Gaussians with two axes.
            let names: Vec<&str> = NAMES.into_iter().filter(|name| *name != "scale_2").collect();
            let properties: Vec<_> = floats(&names).into_iter().chain([(kind, "filter_3D")]).collect();
            let mut row = flat(1.0, own);
            row.remove(9);
            row.push(filter);
            let points = flattened(&folder, &of(encoding, &properties, &[row]));
            near(length(points.axes.as_ref().unwrap()[0][1]), EXTENT * wide[1]);
            near(colors(&points)[0][3].into(), 0.9 * own[0] * own[1] / wide[0] / wide[1]);
        }
    }
    // Thickness is judged after the filter.
    let properties: Vec<_> = floats(&NAMES).into_iter().chain([("float", "filter_3D")]).collect();
    let said = folder.refusal("a.ply", &of("ascii", &properties, &[[flat(0.0, own), vec![0.05]].concat()]));
    assert!(said.contains("1 of its 1 Gaussians are ellipsoids"), "{said}");
    // A Gaussian whose filter is NaN is left out.
    let rows = [[flat(0.0, own), vec![f64::NAN]].concat(), [flat(0.0, own), vec![0.0]].concat()];
    let (_, preparation) = build(vec![folder.read("a.ply", &of("ascii", &properties, &rows)).unwrap()], &()).unwrap();
    assert_eq!((preparation.shapeless, preparation.surfels), (1, 1));
}

/// Postshot writes rows of zeros: wherever and however many they are, they do not affect any
/// decision.
#[test]
fn rows_of_zeros_are_left_out_before_anything_is_judged() {
    let folder = Folder::new();
    let good: Vec<Vec<f64>> = (0..30).map(|k| flat(f64::from(k), [0.1, 0.12, 0.001])).collect();
    let zeros = |count: usize| vec![vec![0.0; NAMES.len()]; count];
    let files = [
        [zeros(1), good.clone()].concat(),
        [good.clone(), zeros(60)].concat(),
        [zeros(20), good.clone(), zeros(20)].concat(),
        good.iter().flat_map(|row| [vec![0.0; NAMES.len()], row.clone()]).collect(),
        [good.clone(), vec![vec![f64::NAN; NAMES.len()]; 5]].concat(),
    ];
    for encoding in ENCODINGS {
        for rows in &files {
            let points = folder.read("a.ply", &of(encoding, &floats(&NAMES), rows)).unwrap();
            let told = points.flattened.unwrap();
            assert_eq!((told.count, told.thick), (30, 0));
            near(told.ratio, 0.01);
            let (scene, preparation) = build(vec![points], &()).unwrap();
            let left_out = preparation.shapeless + preparation.dropped_non_finite;
            assert_eq!((preparation.surfels, left_out), (30, rows.len() as u64 - 30));
            assert_eq!(scene.bounds().extent().x, 29.0);
        }
    }
    let nothing = folder.read("a.ply", &of("ascii", &floats(&NAMES), &zeros(4))).unwrap();
    assert_eq!(nothing.flattened, None);
    assert!(build(vec![nothing], &()).unwrap_err().to_string().contains("none of the 4 Gaussians"));
    // Thick Gaussians are counted among those that are not zeros.
    let rows = [zeros(100), good, vec![flat(0.0, [0.1, 0.1, 0.1])]].concat();
    let said = folder.refusal("a.ply", &of("ascii", &floats(&NAMES), &rows));
    assert!(said.contains("1 of its 31 Gaussians"), "{said}");
}

/// nerfstudio's `rgb` holds sRGB codes instead of harmonics; if there are harmonics, it is ignored.
#[test]
fn colours_beside_gaussians_are_codes_where_there_are_no_harmonics() {
    let folder = Folder::new();
    let names: Vec<&str> = NAMES.into_iter().filter(|name| !name.starts_with("f_dc")).collect();
    for (kind, most) in [("uchar", 255.0), ("int", 255.0), ("ushort", 65535.0), ("float", 1.0), ("double", 1.0)] {
        for encoding in ENCODINGS {
            let colors_of = ["red", "green", "blue"].map(|name| (kind, name));
            let properties: Vec<_> = floats(&names).into_iter().chain(colors_of).collect();
            let row: Vec<f64> = flat(0.0, [0.1, 0.1, 0.001]);
            let row = [&row[..3], &row[6..], &[0.2 * most, most, 0.0]].concat();
            let points = folder.read("a.ply", &of(encoding, &properties, &[row])).unwrap();
            assert!(points.encoded);
            let [r, g, b, alpha] = colors(&points)[0];
            near(r.into(), 0.2);
            near(alpha.into(), 0.9);
            assert_eq!([g, b], [1.0, 0.0]);
        }
    }
    let both: Vec<_> = floats(&NAMES).into_iter().chain(["red", "green", "blue"].map(|name| ("uchar", name))).collect();
    let row = [flat(0.0, [0.1, 0.1, 0.001]), vec![9.0, 9.0, 9.0]].concat();
    let points = folder.read("a.ply", &of("ascii", &both, &[row])).unwrap();
    near(colors(&points)[0][0].into(), 0.5 + 0.282_094_79 * 0.3);
    // Two of three channels are not a colour.
    let two: Vec<_> = floats(&names).into_iter().chain(["red", "blue"].map(|name| ("uchar", name))).collect();
    let row = flat(0.0, [0.1, 0.1, 0.001]);
    let said = folder.refusal("a.ply", &of("ascii", &two, &[[&row[..3], &row[6..], &[1.0, 1.0]].concat()]));
    assert!(said.contains("no property f_dc_0"), "{said}");
}

/// A Gaussian packed as by SuperSplat; position, scale and colour are fractions of its chunk's
/// ranges.
fn packed(place: [f64; 3], turn: [f64; 4], scale: [f64; 3], color: [f64; 4]) -> Vec<f64> {
    let length = turn.iter().map(|c| c * c).sum::<f64>().sqrt();
    let turn = turn.map(|c| c / length);
    let bits = |part: f64, bits: u32| (part * f64::from((1 << bits) - 1) + 0.5).floor() as u32;
    let three = |of: [f64; 3]| bits(of[0], 11) << 21 | bits(of[1], 10) << 11 | bits(of[2], 11);
    let largest = (0..4).fold(0, |most, k| if turn[k].abs() > turn[most].abs() { k } else { most });
    let sign = turn[largest].signum();
    let others = (0..4).filter(|k| *k != largest).map(|k| bits(sign * turn[k] * 0.5f64.sqrt() + 0.5, 10));
    let turned = others.fold(largest as u32, |word, other| word << 10 | other);
    let color = color.into_iter().fold(0, |word, part| word << 8 | bits(part, 8));
    [three(place), turned, three(scale), color].map(f64::from).to_vec()
}

const WORDS: [(&str, &str); 4] =
    [("uint", "packed_position"), ("uint", "packed_rotation"), ("uint", "packed_scale"), ("uint", "packed_color")];

const RANGES: [&str; 18] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
    "min_r",
    "min_g",
    "min_b",
    "max_r",
    "max_g",
    "max_b",
];

/// The ranges of a chunk: positions from `x` to `x + 2`, scales -4 to -3 (the last -9 to -8),
/// colours -0.5 to 1.5.
fn chunk(x: f64) -> Vec<f64> {
    let places = [x, -1.0, 10.0, x + 2.0, 1.0, 10.0];
    let scales = [-4.0, -4.0, -9.0, -3.0, -3.0, -8.0];
    [&places[..], &scales, &[-0.5; 3], &[1.5; 3]].concat()
}

/// A compressed file with `rest` as the higher harmonics.
fn compressed(encoding: &str, chunks: &[Vec<f64>], rows: &[Vec<f64>], rest: &[Vec<f64>]) -> Vec<u8> {
    fn each(rows: &[Vec<f64>]) -> Vec<&[f64]> {
        rows.iter().map(Vec::as_slice).collect()
    }
    let ranges = floats(&RANGES[..chunks.first().map_or(18, Vec::len)]);
    let names: Vec<String> = (0..rest.first().map_or(0, Vec::len)).map(|k| format!("f_rest_{k}")).collect();
    let bytes: Vec<(&str, &str)> = names.iter().map(|name| ("uchar", name.as_str())).collect();
    let (chunks, rows, rest) = (each(chunks), each(rows), each(rest));
    let mut elements = vec![("chunk", &ranges[..], &chunks[..]), ("vertex", &WORDS[..], &rows[..])];
    if !rest.is_empty() {
        elements.push(("sh", &bytes[..], &rest[..]));
    }
    file(encoding, &elements)
}

/// Packed values are unpacked to the originals, within their quantisation steps.
#[test]
fn packed_gaussians_are_read() {
    let folder = Folder::new();
    let turns = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.1, 0.2, -0.9, 0.3], [-0.2, 0.1, 0.3, -0.9]];
    let row = |k: usize| {
        let part = k as f64 / 299.0;
        packed([part, 1.0 - part, 0.5], turns[k % 4], [part, 1.0, 0.0], [part, 0.5, 1.0, 0.25 + 0.5 * part])
    };
    let rows: Vec<Vec<f64>> = (0..300).map(row).collect();
    let rest: Vec<Vec<f64>> = (0..300).map(|k| (0..9).map(|n| f64::from((k * 7 + n * 50) % 256)).collect()).collect();
    for (rest, colored) in [(&rest[..], true), (&[], true), (&[], false)] {
        let cut = |chunk: Vec<f64>| if colored { chunk } else { chunk[..12].to_vec() };
        let chunks = [cut(chunk(0.0)), cut(chunk(100.0))];
        let points = folder.read("a.ply", &compressed("binary_little_endian", &chunks, &rows, rest)).unwrap();
        assert_eq!((points.positions.len(), points.encoded), (300, true));
        assert_eq!(points.flattened.unwrap().thick, 0);
        let (colors, axes) = (colors(&points), points.axes.as_ref().unwrap());
        for k in 0..300 {
            let part = k as f64 / 299.0;
            let first = if k < 256 { 0.0 } else { 100.0 };
            let [x, y, z] = points.positions[k];
            assert!((x - first - 2.0 * part).abs() < 6e-4 && (y - 1.0 + 2.0 * part).abs() < 1.1e-3, "{k}: {x} {y}");
            assert_eq!(z, 10.0);
            let [r, g, b, alpha] = colors[k].map(f64::from);
            let code = |part: f64| {
                if colored { (2.0 * part - 0.5).max(if rest.is_empty() { 0.0 } else { -1.0 }) } else { part }
            };
            assert!(
                (r - code(part)).abs() < 5e-3 && (g - code(0.5)).abs() < 5e-3 && (b - code(1.0)).abs() < 1e-6,
                "{k}: {r} {g}"
            );
            assert!((alpha - 0.25 - 0.5 * part).abs() < 2.1e-3, "{k}: {alpha}");
            let [s, t] = axes[k].map(length);
            assert!((s / (EXTENT * (part - 4.0).exp()) - 1.0).abs() < 6e-4, "{k}: {s}");
            near(t, EXTENT * (-3f64).exp());
            // The direction to which the quaternion turns x.
            let [w, i, j, l] = turns[k % 4].map(|c| c / turns[k % 4].iter().map(|c| c * c).sum::<f64>().sqrt());
            let along = [1.0 - 2.0 * (j * j + l * l), 2.0 * (i * j + l * w), 2.0 * (i * l - j * w)];
            for (c, axis) in along.into_iter().zip(axes[k][0]) {
                assert!((f64::from(axis) / s - c).abs() < 6e-3, "{k}: {axis} {c}");
            }
        }
        if let Some(Colors::Harmonics(harmonics)) = &points.colors {
            assert_eq!((harmonics.degree(), rest.is_empty()), (1, false));
            for k in [0usize, 1, 130, 299] {
                // The file stores harmonics channel by channel, the scene term by term.
                for (n, term) in harmonics.terms(k).iter().enumerate() {
                    let byte = rest[k][n % 3 * 3 + n / 3];
                    let part = if byte == 255.0 {
                        1.0
                    } else if byte == 0.0 {
                        0.0
                    } else {
                        (byte + 0.5) / 256.0
                    };
                    near(f64::from(*term) + 10.0, (part - 0.5) * 8.0 + 10.0);
                }
            }
        } else {
            assert!(rest.is_empty());
        }
    }
    let empty = folder.read("a.ply", &compressed("binary_little_endian", &[], &[], &[])).unwrap();
    assert!(empty.positions.is_empty());
}

/// Compressed files that lack an element are refused in one sentence.
#[test]
fn damaged_packed_files_are_refused() {
    let folder = Folder::new();
    let rows: Vec<Vec<f64>> = (0..257).map(|_| packed([0.5; 3], [1.0, 0.0, 0.0, 0.0], [0.5; 3], [0.5; 4])).collect();
    let chunks = [chunk(0.0), chunk(1.0)];
    let good = compressed("binary_little_endian", &chunks, &rows, &[]);
    assert_eq!(folder.read("a.ply", &good).unwrap().positions.len(), 257);
    let text = |bytes: &[u8], from: &str, to: &str| {
        let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
        [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
    };
    for (bytes, word) in [
        (compressed("ascii", &chunks, &rows, &[]), "binary_little_endian files alone"),
        (compressed("binary_little_endian", &chunks[..1], &rows, &[]), "there are 1"),
        (compressed("binary_little_endian", &chunks, &rows, &vec![vec![1.0; 8]; 257]), "8 bytes f_rest_0"),
        (compressed("binary_little_endian", &chunks, &rows, &vec![vec![1.0; 9]; 256]), "not have one row"),
        (text(&good, "packed_scale", "other_scale"), "has no uint packed_scale"),
        (text(&good, "float max_scale_y", "float mix_scale_y"), "has no float max_scale_y"),
        (text(&good, "element chunk", "element block"), "no element 'chunk'"),
        (good[..good.len() - 1].to_vec(), "the file ends after 256"),
        (text(&good, "vertex 257", "vertex 9999999999999"), "need one chunk for each 256"),
        (text(&good, "chunk 2", "chunk 99999999999999"), "promises"),
    ] {
        let said = folder.refusal("a.ply", &bytes);
        assert!(said.contains(word), "{word}: {said}");
    }
}

/// Other formats of Gaussians are refused with their name.
#[test]
fn other_formats_of_gaussians_are_named() {
    let folder = Folder::new();
    for (name, bytes, what) in [
        ("a.spz", &b"\x1f\x8b\x08\0\0\0\0\0"[..], "an SPZ file of Gaussians"),
        ("b.spz", b"NGSP\x03\0\0\0", "an SPZ file of Gaussians"),
        ("b", b"NGSP\x04\0\0\0", "an SPZ file of Gaussians"),
        ("a.splat", &[0; 64], "a .splat file of Gaussians"),
        ("A.SPLAT", b"", "a .splat file of Gaussians"),
        ("a.ksplat", &[0; 64], "a .ksplat file of Gaussians"),
        ("a.sog", b"PK\x03\x04", "a SOG file of Gaussians"),
    ] {
        let said = folder.refusal(name, bytes);
        assert!(said.starts_with(&format!("it is {what}, which is not read")) && said.contains("PLY"), "{said}");
    }
    // A PLY file is read whatever its file name.
    let row = flat(0.0, [0.1, 0.1, 0.001]);
    assert_eq!(folder.read("ply.splat", &of("ascii", &floats(&NAMES), &[row])).unwrap().positions.len(), 1);
}
