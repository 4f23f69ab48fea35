//! E57 files, written by the `e57` crate.

use super::e57_page::{CONTENT, PAGE, checksum};
use super::{Folder, Random, sentence};
use e57::{
    ColorLimits, E57Writer, Extension, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform,
    Translation,
};
use epsplat::io::{self, Points, ReadOptions, Up};
use epsplat::low_level::scene::Colors;
use epsplat::low_level::scene::color::srgb_to_linear;
use std::io::Cursor;

/// A scan: its attributes, pose and points.
struct Scan {
    prototype: Vec<Record>,
    pose: Option<Transform>,
    limits: Option<ColorLimits>,
    points: Vec<Vec<RecordValue>>,
}

fn file(scans: Vec<Scan>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").unwrap();
    writer.register_extension(Extension::new("nor", "http://www.libe57.org/E57_EXT_surface_normals.txt")).unwrap();
    for (number, scan) in scans.into_iter().enumerate() {
        let mut of_scan = writer.add_pointcloud(&format!("scan {number}"), scan.prototype).unwrap();
        of_scan.set_transform(scan.pose);
        of_scan.set_name((number == 1).then(|| "a room".into()));
        if scan.limits.is_some() {
            of_scan.set_color_limits(scan.limits);
        }
        scan.points.into_iter().for_each(|point| of_scan.add_point(point).unwrap());
        of_scan.finalize().unwrap();
    }
    writer.finalize().unwrap();
    drop(writer);
    bytes.into_inner()
}

fn record(name: RecordName, data_type: RecordDataType) -> Record {
    Record { name, data_type }
}

const INVALID: RecordDataType = RecordDataType::Integer { min: 0, max: 2 };

/// Points on a line with 8-bit colours; every third point is invalid.
fn cartesian(count: i64) -> Scan {
    let millimetres = RecordDataType::ScaledInteger { min: -1_000_000, max: 1_000_000, scale: 0.001, offset: 5e6 };
    let points = (0..count).map(|i| {
        vec![
            RecordValue::Double(i as f64 + 0.25),
            RecordValue::Single(i as f32),
            RecordValue::ScaledInteger(7 * i),
            RecordValue::Integer(if i % 3 == 2 { 2 } else { 0 }),
            RecordValue::Integer(i % 256),
            RecordValue::Integer(20),
            RecordValue::Integer(255),
        ]
    });
    Scan {
        prototype: vec![
            record(RecordName::CartesianX, RecordDataType::F64),
            record(RecordName::CartesianY, RecordDataType::F32),
            record(RecordName::CartesianZ, millimetres),
            record(RecordName::CartesianInvalidState, INVALID),
            record(RecordName::ColorRed, RecordDataType::U8),
            record(RecordName::ColorGreen, RecordDataType::U8),
            record(RecordName::ColorBlue, RecordDataType::U8),
        ],
        pose: None,
        limits: None,
        points: points.collect(),
    }
}

/// Two points two metres away at azimuth 90 degrees, at elevations 0 and 0.25, with a distant pose.
fn spherical() -> Scan {
    let intensity = RecordDataType::Single { min: None, max: None };
    Scan {
        prototype: vec![
            record(RecordName::SphericalRange, RecordDataType::F64),
            record(RecordName::SphericalAzimuth, RecordDataType::F64),
            record(RecordName::SphericalElevation, RecordDataType::F64),
            record(RecordName::Intensity, intensity),
        ],
        // A quarter turn about z.
        pose: Some(Transform {
            rotation: Quaternion { w: 0.5f64.sqrt(), x: 0.0, y: 0.0, z: 0.5f64.sqrt() },
            translation: Translation { x: 4e5, y: 5e6, z: 100.0 },
        }),
        limits: None,
        points: [(0.0, 0.5), (0.25, 1.0)]
            .map(|(elevation, intensity)| {
                let angles = [2.0, 90f64.to_radians(), elevation];
                angles.into_iter().map(RecordValue::Double).chain([RecordValue::Single(intensity)]).collect()
            })
            .into(),
    }
}

#[test]
fn every_kind_of_number_and_colours() {
    let folder = Folder::new();
    let points = folder.read("a.e57", &file(vec![cartesian(3000)])).unwrap();
    let kept: Vec<i64> = (0..3000).filter(|i| i % 3 != 2).collect();
    let expected = kept.iter().map(|&i| [i as f64 + 0.25, i as f64, (7 * i) as f64 * 0.001 + 5e6]);
    assert!(points.positions.iter().copied().eq(expected));
    assert_eq!((points.up, points.normals), (Some(Up::Z), None));
    let codes = kept.iter().map(|&i| [i as u8, 20, 255, 255]).collect();
    assert_eq!(points.colors, Some(Colors::Srgb8(codes)));
    // Recognised by its first bytes.
    assert_eq!(folder.read("scan", &file(vec![cartesian(9)])).unwrap().positions.len(), 6);
}

#[test]
fn scans_are_put_where_their_poses_say() {
    let folder = Folder::new();
    let points = folder.read("a.e57", &file(vec![spherical()])).unwrap();
    // The scan's y axis becomes the file's -x axis.
    let (level, up) = (2.0 * 0.25f64.cos(), 2.0 * 0.25f64.sin());
    for (position, expected) in points.positions.iter().zip([[4e5 - 2.0, 5e6, 100.0], [4e5 - level, 5e6, 100.0 + up]]) {
        assert!((0..3).all(|axis| (position[axis] - expected[axis]).abs() < 1e-9), "{position:?}");
    }
    assert_eq!(points.colors, Some(Colors::Srgb8(vec![[128, 128, 128, 255], [255; 4]])));

    // Without its pose the scan is elsewhere. Two scans with different poses are read as one file,
    // with colours of one and intensities of the other.
    let control = folder.read("a.e57", &file(vec![Scan { pose: None, ..spherical() }])).unwrap();
    assert!(control.positions[0][0].abs() < 1e-9 && control.positions[0][1] == 2.0);
    let both = folder.read("a.e57", &file(vec![spherical(), cartesian(2)])).unwrap();
    assert_eq!(both.positions.len(), 4);
    let Some(Colors::Srgb8(codes)) = both.colors else { panic!("{:?}", both.colors) };
    assert_eq!(codes, [[128, 128, 128, 255], [255; 4], [0, 20, 255, 255], [1, 20, 255, 255]]);
}

/// The scan with a normal at each point.
fn with_normals(mut scan: Scan, normal: [f64; 3]) -> Scan {
    let of = |axis: &str| RecordName::Unknown { namespace: "nor".into(), name: format!("normal{axis}") };
    let share = RecordDataType::ScaledInteger { min: -1000, max: 1000, scale: 0.001, offset: 0.0 };
    let kinds = [RecordDataType::F32, RecordDataType::F64, share];
    scan.prototype.extend(["X", "Y", "Z"].into_iter().zip(kinds).map(|(axis, kind)| record(of(axis), kind)));
    let [x, y, z] = normal;
    let values = [RecordValue::Single(x as f32), RecordValue::Double(y), RecordValue::ScaledInteger((z * 1e3) as i64)];
    scan.points.iter_mut().for_each(|point| point.extend(values.clone()));
    scan
}

#[test]
fn normals_are_turned_with_their_scan() {
    let folder = Folder::new();
    let tilted = |scan| with_normals(scan, [0.75, 0.5, -0.25]);
    let unturned = folder.read("a.e57", &file(vec![tilted(Scan { pose: None, ..spherical() })])).unwrap();
    assert_eq!(unturned.normals, Some(vec![[0.75, 0.5, -0.25]; 2]));
    // Normals are rotated by a quarter turn about z, but not translated; points of the other scan
    // have none.
    let both = folder.read("a.e57", &file(vec![tilted(spherical()), cartesian(3)])).unwrap();
    let normals = both.normals.unwrap();
    for turned in &normals[..2] {
        assert!(turned.iter().zip([-0.5, 0.75, -0.25]).all(|(a, b)| (a - b).abs() < 1e-6), "{turned:?}");
    }
    assert_eq!((&normals[2..], both.positions.len()), (&[[0.0; 3]; 2][..], 4));
    assert!(both.colors.is_some());
    // Two of the three components are not a normal.
    let mut scan = tilted(spherical());
    scan.prototype.pop();
    scan.points.iter_mut().for_each(|point| point.truncate(6));
    assert_eq!(folder.read("a.e57", &file(vec![scan])).unwrap().normals, None);
}

#[test]
fn scans_together_promise_no_more_than_the_file_holds() {
    let folder = Folder::new();
    let mut whole = file(vec![cartesian(2000), cartesian(2000)]);
    assert_eq!(folder.read("a.e57", &whole).unwrap().positions.len(), 2 * 1334);
    // Each scan alone would fit in the file.
    let promise = b"recordCount=\"2000\"";
    for _ in 0..2 {
        let at = whole.windows(promise.len()).position(|window| window == promise).unwrap();
        whole[at..at + promise.len()].copy_from_slice(b"recordCount=\"3500\"");
    }
    seal(&mut whole);
    let message = folder.refusal("a.e57", &whole);
    assert!(message.starts_with("its scan 2 promises 3500 points, the file holds "), "{message}");
}

#[test]
fn colours_of_other_ranges_become_linear() {
    let folder = Folder::new();
    let wide = RecordDataType::Integer { min: 0, max: 65535 };
    let mut scan = cartesian(2);
    for (record, name) in
        scan.prototype[4..].iter_mut().zip([RecordName::ColorRed, RecordName::ColorGreen, RecordName::ColorBlue])
    {
        *record = Record { name, data_type: wide.clone() };
    }
    for point in &mut scan.points {
        let wider = [7, 20 * 256 + 5, 65_535].map(RecordValue::Integer);
        point.splice(4.., wider);
    }
    let light = |share: f64| srgb_to_linear(share) as f32;
    let colors = |points: Points| match points.colors {
        Some(Colors::Linear(colors)) => colors[1],
        other => panic!("{other:?}"),
    };
    let points = folder.read("a.e57", &file(vec![scan])).unwrap();
    let expected = [7.0, 5125.0, 65_535.0].map(|code| light(code / 65535.0));
    assert_eq!(colors(points)[..3], expected);
    // Limits of the scan take precedence over those of the type.
    let mut scan = cartesian(2);
    let limit = |value| Some(RecordValue::Integer(value));
    scan.limits = Some(ColorLimits {
        red_min: limit(0),
        red_max: limit(2),
        green_min: limit(0),
        green_max: limit(40),
        blue_min: limit(0),
        blue_max: limit(255),
    });
    let points = folder.read("a.e57", &file(vec![scan])).unwrap();
    assert_eq!(colors(points)[..3], [light(0.5), light(0.5), 1.0]);
}

/// Rewrites the checksums of all pages, so that damaged content is read.
fn seal(bytes: &mut [u8]) {
    for page in bytes.chunks_exact_mut(PAGE) {
        let (content, sum) = page.split_at_mut(CONTENT);
        sum.copy_from_slice(&checksum(content));
    }
}

#[test]
fn promises_are_held_against_the_file() {
    let folder = Folder::new();
    let whole = file(vec![cartesian(1000)]);
    let mut same = whole.clone();
    seal(&mut same);
    assert!(same == whole);
    let replaced = |from: &str, to: &str| {
        let mut bytes = whole.clone();
        let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
        assert_eq!(from.len(), to.len());
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        seal(&mut bytes);
        folder.refusal("a.e57", &bytes)
    };
    let message = replaced("recordCount=\"1000\"", "recordCount=\"9999\"");
    assert!(message.contains("9999 points") || message.contains("ends early"), "{message}");
    let message = replaced("<cartesianX ", "<cartesianW ");
    assert!(message.contains("cartesianW") || message.contains("no coordinates"), "{message}");
    // Here the checksums are not corrected.
    let mut torn = whole.clone();
    torn[2000] ^= 1;
    assert!(folder.refusal("a.e57", &torn).contains("checksum"));
    assert!(folder.refusal("a.e57", b"").contains("early"));
    assert!(folder.refusal("a.e57", &[0; 4096]).contains("signature"));
}

#[test]
fn cut_and_flipped_files_are_refused_or_read() {
    let folder = Folder::new();
    let mut random = Random(0xe57);
    let whole = file(vec![cartesian(300), spherical()]);
    for length in (0..whole.len()).step_by(97) {
        sentence(&folder.read("a.e57", &whole[..length]).unwrap_err(), &folder.path("a.e57"));
    }
    let mut read = 0;
    for _ in 0..300 {
        let mut bytes = whole.clone();
        for _ in 0..=random.below(3) {
            let at = random.below(bytes.len());
            bytes[at] = random.below(256) as u8;
        }
        seal(&mut bytes);
        match folder.read("a.e57", &bytes) {
            Ok(_) => read += 1,
            Err(error) => assert!(!sentence(&error, &folder.path("a.e57")).is_empty()),
        }
    }
    assert!((1..300).contains(&read), "{read} of 300 were read");
}

/// Reads a file of which scans are left out; returns the points and the note. In strict mode it
/// must be refused.
fn left_out(folder: &Folder, bytes: &[u8]) -> (Points, String) {
    let points = folder.read("a.e57", bytes).unwrap();
    let [told] = &points.unread[..] else { panic!("{:?}", points.unread) };
    let path = folder.path("a.e57");
    let strict = ReadOptions { strict: true, ..ReadOptions::default() };
    assert!(!sentence(&io::read_with(&path, strict, &()).unwrap_err(), &path).is_empty());
    let told = told.strip_prefix(&format!("{}: ", path.display())).unwrap().to_owned();
    (points, told)
}

/// Valid points on a line.
fn line(count: i64) -> Scan {
    let mut scan = cartesian(count);
    scan.points.iter_mut().for_each(|point| point[3] = RecordValue::Integer(0));
    scan
}

fn replaced(bytes: &mut [u8], from: &str, to: &str) {
    let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
    bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
    seal(bytes);
}

#[test]
fn scans_without_points_are_left_out_and_told() {
    let folder = Folder::new();
    for (counts, named) in [
        (&[0, 5][..], "1 of 2 scans left out, with 0 points: scan 1 has no points"),
        (&[5, 0], "1 of 2 scans left out, with 0 points: scan 2 'a room' has no points"),
        (&[4, 0, 1], "1 of 3 scans left out, with 0 points: scan 2 'a room' has no points"),
        (&[0, 5, 0], "2 of 3 scans left out, with 0 points: scan 1 has no points; scan 3 has no points"),
    ] {
        let bytes = file(counts.iter().map(|&count| line(count)).collect());
        let (points, told) = left_out(&folder, &bytes);
        assert_eq!(points.positions.len(), 5, "{counts:?}");
        assert_eq!(told, format!("{named} (--strict refuses the file)"));
    }
    // A scan with an invalid file offset, as some programs write empty scans.
    let mut nowhere = file(vec![line(0), line(9)]);
    replaced(&mut nowhere, "fileOffset=\"48\"", "fileOffset=\"00\"");
    assert_eq!(left_out(&folder, &nowhere).0.positions.len(), 9);
    // A file that has only empty scans is a file without points.
    for count in [1, 2] {
        let empty = folder.read("a.e57", &file((0..count).map(|_| line(0)).collect())).unwrap();
        assert!(empty.positions.is_empty() && empty.unread.is_empty(), "{count} scans");
    }
    // Control: no note for complete scans.
    assert!(folder.read("a.e57", &file(vec![line(3), line(4)])).unwrap().unread.is_empty());
}

#[test]
fn a_scan_that_cannot_be_read_is_left_out_whole_and_told() {
    let folder = Folder::new();
    let pose = |w: f64| {
        let rotation = Quaternion { w, x: 0.0, y: 0.0, z: 0.0 };
        Some(Transform { rotation, translation: Translation { x: 0.0, y: 0.0, z: 0.0 } })
    };
    let bent = || Scan { pose: pose(2.0), ..line(7) };
    let (points, told) = left_out(&folder, &file(vec![bent(), line(3)]));
    assert!(told.starts_with("1 of 2 scans left out, with 7 points: scan 1: the quaternion"), "{told}");
    // Point numbers are those of the whole file.
    assert_eq!((points.positions.len(), &points.left_out[..]), (3, &[0, 1, 2, 3, 4, 5, 6][..]));
    assert!(
        points
            .colors
            .is_some_and(|colors| colors == folder.read("b.e57", &file(vec![line(3)])).unwrap().colors.unwrap())
    );
    // The first scan has a damaged page: its points that were already read are dropped too.
    let mut torn = file(vec![line(9000), line(50), line(2)]);
    torn[60_000] ^= 1;
    let (points, told) = left_out(&folder, &torn);
    assert_eq!((points.positions.len(), points.left_out.len()), (52, 9000), "{told}");
    assert!(told.contains("with 9000 points") && told.contains("checksum"), "{told}");
    // A scan that promises more points than the file holds.
    let mut promising = file(vec![line(2000), line(1000)]);
    replaced(&mut promising, "recordCount=\"1000\"", "recordCount=\"9999\"");
    let (points, told) = left_out(&folder, &promising);
    assert_eq!(points.positions.len(), 2000);
    assert!(told.contains("scan 2 'a room' promises 9999 points, the file holds "), "{told}");
    // If no scan can be read, the error is that of the first.
    assert!(folder.refusal("a.e57", &file(vec![bent(), bent()])).contains("quaternion"));
}
