//! Valid LAS and LAZ files.

use super::las_forms::{laszip_record, of_las_1_5, pointwise};
use super::{Folder, data};
use epsplat::io::{self, ReadOptions, Up};
use epsplat::low_level::scene::Colors;
use epsplat::low_level::scene::color::srgb_to_linear;
use las::point::{Classification, Format};
use las::{Builder, Color, Point, Transform, Vector, Writer};
use std::io::Cursor;

/// A file of the given version and point format, written by the `las` crate.
pub fn file(minor: u8, format: u8, compressed: bool, points: impl IntoIterator<Item = Point>) -> Vec<u8> {
    let mut builder = Builder::from((1, minor));
    builder.point_format = Format::new(format).unwrap();
    builder.point_format.is_compressed = compressed;
    let transform = |offset| Transform { scale: 0.001, offset };
    builder.transforms = Vector { x: transform(500_000.0), y: transform(5_600_000.0), z: transform(0.0) };
    let format = builder.point_format;
    let mut writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    for mut point in points {
        point.gps_time = format.has_gps_time.then_some(1.0);
        point.color = point.color.filter(|_| format.has_color).or(format.has_color.then(Color::default));
        point.nir = format.has_nir.then_some(7);
        writer.write_point(point).unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

pub fn point(i: u32, color: Option<[u16; 3]>) -> Point {
    let [x, y, z] = coordinates(i);
    Point {
        x,
        y,
        z,
        color: color.map(|[red, green, blue]| Color { red, green, blue }),
        return_number: 1,
        number_of_returns: 1,
        ..Point::default()
    }
}

fn coordinates(i: u32) -> [f64; 3] {
    let i = f64::from(i);
    [500_000.0 + 0.017 * i, 5_600_000.0 + (0.1 * i).sin(), 0.001 * i]
}

fn assert_positions(positions: &[[f64; 3]], numbers: impl ExactSizeIterator<Item = u32>) {
    assert_eq!(positions.len(), numbers.len());
    for (position, i) in positions.iter().zip(numbers) {
        let expected = coordinates(i);
        assert!((0..3).all(|axis| (position[axis] - expected[axis]).abs() <= 0.000_51), "{i}: {position:?}");
    }
}

/// The tested versions and point formats, compressed or not: (minor, format, compressed).
pub const KINDS: [(u8, u8, bool); 16] = [
    (2, 0, false),
    (2, 1, false),
    (2, 2, false),
    (2, 3, false),
    (3, 3, false),
    (4, 6, false),
    (4, 7, false),
    (4, 8, false),
    (2, 0, true),
    (2, 1, true),
    (2, 2, true),
    (2, 3, true),
    (3, 2, true),
    (4, 6, true),
    (4, 7, true),
    (4, 8, true),
];

#[test]
fn every_version_and_format_with_and_without_compression() {
    let folder = Folder::new();
    for (minor, format, compressed) in KINDS {
        let color = |i: u32| Some([i as u16 % 256, 20, 30].map(|v| v * 257));
        let bytes = file(minor, format, compressed, (0..1000).map(|i| point(i, color(i))));
        let points = folder.read("a.laz", &bytes).unwrap();
        assert_positions(&points.positions, 0..1000);
        assert_eq!((points.normals, points.radii, points.up), (None, None, Some(Up::Z)));
        match points.colors {
            Some(Colors::Srgb8(codes)) => assert_eq!((codes[5], codes[999]), ([5, 20, 30, 255], [231, 20, 30, 255])),
            other => assert!([0, 1, 6].contains(&format) && other.is_none(), "{format}: {other:?}"),
        }
    }
}

#[test]
fn many_chunks_join_without_a_seam() {
    let folder = Folder::new();
    for format in [3, 7] {
        let bytes = file(4, format, true, (0..170_001).map(|i| point(i, None)));
        let points = folder.read("a.laz", &bytes).unwrap();
        assert_positions(&points.positions, 0..170_001);
        assert_eq!(points.colors, None);
    }
}

#[test]
fn a_file_of_no_points_is_no_error() {
    let folder = Folder::new();
    for (minor, format, compressed) in KINDS {
        let points = folder.read("a.las", &file(minor, format, compressed, [])).unwrap();
        assert_eq!((points.positions.len(), points.colors), (0, None));
    }
}

#[test]
fn colour_codes_are_understood_over_the_whole_file() {
    let folder = Folder::new();
    let read = |scale: u16, offset: u16| {
        let color = |i: u32| [(i as u16 % 200) * scale + offset, 50 * scale, 0];
        folder.read("a.las", &file(2, 2, false, (0..300).map(|i| point(i, Some(color(i)))))).unwrap().colors
    };
    for scale in [1, 256, 257] {
        let Some(Colors::Srgb8(codes)) = read(scale, 0) else { panic!("{scale} is an 8-bit code") };
        assert_eq!(codes[201], [1, 50, 0, 255]);
    }
    let Some(Colors::Linear(colors)) = read(256, 3) else { panic!("these are 16-bit codes") };
    let light = |code: f64| srgb_to_linear(code / 65535.0) as f32;
    assert_eq!(colors[201], [light(259.0), light(12800.0), 0.0, 1.0]);
    assert_eq!(folder.read("a.las", &file(2, 2, false, [point(1, None)])).unwrap().colors, None);
}

#[test]
fn intensities_stand_in_for_colours_where_there_are_none() {
    let folder = Folder::new();
    let with_intensity = |i: u32| Point { intensity: i as u16 * 10, ..point(i, None) };
    for format in [0, 2, 6, 7] {
        let colors = folder.read("a.las", &file(4, format, false, (0..101).map(with_intensity))).unwrap().colors;
        let Some(Colors::Srgb8(codes)) = colors else { panic!("{colors:?}") };
        assert_eq!((codes[0], codes[50], codes[100]), ([0, 0, 0, 255], [128, 128, 128, 255], [255; 4]));
    }
    let one_color = |i: u32| Point { intensity: i as u16 * 10, ..point(i, Some([u16::from(i == 7), 0, 0])) };
    let colors = folder.read("a.las", &file(2, 2, false, (0..101).map(one_color))).unwrap().colors;
    assert!(matches!(colors, Some(Colors::Srgb8(codes)) if codes[7] == [1, 0, 0, 255] && codes[8] == [0, 0, 0, 255]));
}

#[test]
fn withheld_points_are_left_out_and_counted_and_all_others_are_kept() {
    let folder = Folder::new();
    let keep_withheld = ReadOptions { keep_withheld: true, ..ReadOptions::default() };
    for (minor, format, compressed) in KINDS {
        let points = (0..100).map(|i| Point {
            is_withheld: i % 2 == 1,
            is_synthetic: i % 3 == 0,
            is_key_point: i % 5 == 0,
            // In point formats below 6, overlap is class 12.
            is_overlap: i % 7 == 0,
            ..point(i, Some([i as u16, 0, 255]))
        });
        let bytes = file(minor, format, compressed, points);
        let points = folder.read("a.las", &bytes).unwrap();
        assert_eq!(points.withheld, 50);
        assert_positions(&points.positions, (0..50).map(|i| 2 * i).collect::<Vec<_>>().into_iter());
        if let Some(Colors::Srgb8(codes)) = points.colors {
            assert_eq!((codes.len(), codes[49]), (50, [98, 0, 255, 255]));
        }
        let all = io::read_with(&folder.path("a.las"), keep_withheld.clone(), &()).unwrap();
        assert_eq!(all.withheld, 0);
        assert_positions(&all.positions, 0..100);
        if let Some(Colors::Srgb8(codes)) = all.colors {
            assert_eq!((codes.len(), codes[99]), (100, [99, 0, 255, 255]));
        }
    }
    let (_, preparation) =
        epsplat::low_level::surfels::build(vec![folder.read("a.las", &whole_and_deleted()).unwrap()], &()).unwrap();
    assert_eq!((preparation.points, preparation.withheld, preparation.surfels), (10, 895, 10));
    assert!(preparation.notes()[0].starts_with("895 points were left out: they are marked as withheld"));
}

/// Each point format stores classes differently. Points of classes with opacity 0 are left out,
/// besides withheld points.
#[test]
fn classes_have_opacities() {
    let folder = Folder::new();
    let rules = ReadOptions { classes: "2-3:0.4,5:0".parse().unwrap(), ..ReadOptions::default() };
    for (minor, format, compressed) in KINDS {
        let classes = [1u8, 2, 3, 5, 30].map(|class| Classification::new(class).unwrap());
        let points = (0..100u32).map(|i| Point {
            classification: classes[i as usize % 5],
            is_withheld: i % 10 == 3,
            ..point(i, Some([i as u16, 0, 255]))
        });
        folder.read("a.las", &file(minor, format, compressed, points)).unwrap();
        let points = io::read_with(&folder.path("a.las"), rules.clone(), &()).unwrap();
        // Ten of twenty points of class 5 are withheld.
        assert_eq!((points.positions.len(), points.withheld, points.unseen), (80, 10, 10), "{format}");
        let counts = [(1, 20), (2, 20), (3, 20), (5, 10), (30, 20)];
        assert_eq!(points.classes.iter().map(|(class, count)| (*class, *count)).collect::<Vec<_>>(), counts);
        let seen: Vec<u32> = (0..100).filter(|i| i % 5 != 3).collect();
        assert_positions(&points.positions, seen.into_iter());
        assert_eq!(points.left_out, (0..100).filter(|i| i % 5 == 3).collect::<Vec<u64>>());
        let alphas: Vec<f32> = match points.colors.unwrap() {
            Colors::Srgb8(codes) => codes.iter().map(|code| f32::from(code[3]) / 255.0).collect(),
            Colors::Linear(colors) => colors.iter().map(|color| color[3]).collect(),
            other => panic!("{other:?}"),
        };
        assert!(alphas.iter().zip([1.0, 0.4, 0.4, 1.0].iter().cycle()).all(|(a, b)| (a - b).abs() < 1e-6), "{format}");
    }
    let (_, preparation) = epsplat::low_level::surfels::build(
        vec![io::read_with(&folder.path("a.las"), rules.clone(), &()).unwrap()],
        &(),
    )
    .unwrap();
    assert!(preparation.notes().iter().any(|note| note == "10 points were left out: their class has the opacity 0"));
    let none = ReadOptions { classes: "0-255:0".parse().unwrap(), ..ReadOptions::default() };
    let nothing =
        epsplat::low_level::surfels::build(vec![io::read_with(&folder.path("a.las"), none, &()).unwrap()], &());
    assert!(
        nothing
            .unwrap_err()
            .to_string()
            .contains("90 points are left out as their classes have the opacity 0, and 10 as")
    );
}

/// Ten points, and 895 withheld ones.
fn whole_and_deleted() -> Vec<u8> {
    file(2, 1, false, (0..905).map(|i| Point { is_withheld: i >= 10, ..point(i, None) }))
}

#[test]
fn points_without_chunks_are_read_whatever_the_size_of_chunks() {
    let folder = Folder::new();
    for (minor, format, compressed) in KINDS.into_iter().filter(|kind| kind.1 < 6 && kind.2).chain([(4, 3, true)]) {
        let bytes = file(minor, format, compressed, (0..1000).map(|i| point(i, Some([i as u16, 2, 3]))));
        let chunked = folder.read("a.laz", &bytes).unwrap();
        for chunk_size in [0, u32::MAX, 50_000, 10] {
            assert_eq!(folder.read("a.laz", &pointwise(&bytes, chunk_size)).unwrap(), chunked, "{format} {chunk_size}");
        }
        // If not even the first point is complete, nothing is read.
        let pointwise = pointwise(&bytes, 0);
        let start = u32::from_le_bytes(*bytes[96..].first_chunk().unwrap()) as usize;
        let message = folder.refusal("a.laz", &pointwise[..start + 5]);
        assert!(message.starts_with("the header promises 1000 points, but the file ends at byte"), "{message}");
        assert!(folder.refusal("a.laz", &pointwise[..start + 500]).contains("decoding fails after"));
    }
}

#[test]
fn chunks_of_no_size_are_of_any() {
    let bytes = std::fs::read(data("simple.copc.laz")).unwrap();
    let at = laszip_record(&bytes) + 12;
    assert_eq!(bytes[at..at + 4], [0xff; 4]);
    let mut unsaid = bytes.clone();
    unsaid[at..at + 4].fill(0);
    let folder = Folder::new();
    assert_eq!(folder.read("a.laz", &unsaid).unwrap(), folder.read("b.laz", &bytes).unwrap());
}

#[test]
fn las_1_5_is_read_and_what_is_newer_is_named() {
    let folder = Folder::new();
    for (_, format, compressed) in KINDS.into_iter().filter(|kind| kind.1 >= 6) {
        let points = (0..1000).map(|i| Point { is_withheld: i % 10 == 0, ..point(i, Some([i as u16, 2, 3])) });
        let bytes = file(4, format, compressed, points);
        let older = folder.read("a.laz", &bytes).unwrap();
        let newer = of_las_1_5(&bytes);
        assert_eq!(folder.read("a.laz", &newer).unwrap(), older, "{format} {compressed}");
        assert_eq!((older.positions.len(), older.withheld), (900, 100));
        for version in [[1, 6], [2, 0], [0, 0]] {
            let mut other = newer.clone();
            other[24..26].copy_from_slice(&version);
            let said = format!("it is LAS {}.{}, but only 1.0 to 1.5 can be read", version[0], version[1]);
            assert!(folder.refusal("a.laz", &other).starts_with(&said));
        }
    }
}

#[test]
fn a_survey_keeps_its_digits() {
    let points = io::read(&data("autzen.laz"), &()).unwrap();
    assert_eq!(points.positions.len(), 110_000);
    assert!(points.positions.iter().all(|[x, y, z]| {
        (636_000.0..=638_990.0).contains(x) && (848_000.0..=854_000.0).contains(y) && (400.0..=620.0).contains(z)
    }));
    // Coordinates are whole hundredths of a foot.
    assert!(points.positions.iter().flatten().all(|v| (v * 100.0 - (v * 100.0).round()).abs() < 1e-4));
    assert!(matches!(points.colors, Some(Colors::Srgb8(codes)) if codes.len() == 110_000));
}

#[test]
fn a_cloud_optimised_file_is_read_whole() {
    let points = io::read(&data("simple.copc.laz"), &()).unwrap();
    assert_eq!(points.positions.len(), 1065);
    assert!(points.positions.iter().all(|[x, y, z]| {
        (635_600.0..=638_990.0).contains(x) && (848_890.0..=853_540.0).contains(y) && (406.0..=587.0).contains(z)
    }));
    assert!(matches!(points.colors, Some(Colors::Srgb8(codes)) if codes.len() == 1065));
}
