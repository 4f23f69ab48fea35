//! Statements in the headers of LAS files, and fields that contradict each other.

use super::las::{file, point};
use super::{Folder, data};
use epsplat::io::{self, Points};
use las::Point;

/// Offsets of fields in the header.
const VERSION: usize = 25;
const LEGACY_COUNT: usize = 107;
const SCALE: usize = 131;
const MAX: usize = 179;
const COUNT: usize = 247;

/// Points whose z differs from x and y.
fn points(count: u32) -> impl Iterator<Item = Point> {
    (0..count).map(|i| point(i, Some([i as u16 % 256, 2, 3])))
}

fn patched(mut bytes: Vec<u8>, at: usize, value: &[u8]) -> Vec<u8> {
    bytes[at..at + value.len()].copy_from_slice(value);
    bytes
}

fn notes(points: &Points) -> String {
    points.notes.join("\n")
}

#[test]
fn the_count_of_64_bits_is_that_of_extended_formats() {
    let folder = Folder::new();
    for format in [6, 7, 8] {
        for compressed in [false, true] {
            let whole = file(4, format, compressed, points(3000));
            let sound = folder.read("a.laz", &whole).unwrap();
            assert_eq!((sound.positions.len(), notes(&sound)), (3000, String::new()));
            for legacy in [7u32, 2999, 3001, u32::MAX] {
                let read = folder.read("a.laz", &patched(whole.clone(), LEGACY_COUNT, &legacy.to_le_bytes())).unwrap();
                assert_eq!(read.positions, sound.positions);
                let said = format!(
                    "a.laz: its header says 3000 points, and {legacy} in the field of older versions: 3000 are read"
                );
                assert_eq!(notes(&read), said);
            }
        }
    }
    // Point formats of older versions have both counts.
    let whole = file(4, 3, false, points(3000));
    let read = folder.read("a.las", &patched(whole.clone(), COUNT, &7u64.to_le_bytes())).unwrap();
    assert_eq!(read.positions.len(), 3000);
    assert!(notes(&read).contains("its header says 7 points, and 3000 in the field of older versions: 3000 are read"));
    let read = folder.read("a.las", &patched(whole, LEGACY_COUNT, &0u32.to_le_bytes())).unwrap();
    assert_eq!((read.positions.len(), notes(&read)), (3000, String::new()));
}

#[test]
fn octrees_have_the_count_of_64_bits_too() {
    let folder = Folder::new();
    let path = folder.path("a.copc.laz");
    let bytes = std::fs::read(data("simple.copc.laz")).unwrap();
    std::fs::write(&path, patched(bytes, LEGACY_COUNT, &7u32.to_le_bytes())).unwrap();
    let mut copc = io::las::Copc::open(io::Input::open(&path, None).unwrap()).unwrap().unwrap();
    assert_eq!(copc.count(), 1065);
    let read = copc.read(&[0], &io::ReadOptions::default(), &()).unwrap();
    assert!(notes(&read).contains("and 7 in the field of older versions"), "{}", notes(&read));
}

#[test]
fn fields_that_disagree_are_told() {
    let folder = Folder::new();
    let whole = || file(2, 3, false, points(500));
    let told = |bytes: Vec<u8>| notes(&folder.read("a.las", &bytes).unwrap());
    assert_eq!(told(whole()), "");
    // A version older than the point format.
    assert!(told(patched(whole(), VERSION, &[1])).contains("LAS 1.1, and point format 3, which LAS 1.2 introduced"));
    // Fewer points than the file has, or than all returns together.
    let fewer = patched(whole(), LEGACY_COUNT, &400u32.to_le_bytes());
    assert!(told(fewer.clone()).contains("its header says 400 points, and 500 points over all returns"));
    let no_returns = patched(fewer, LEGACY_COUNT + 4, &[0; 20]);
    assert!(told(no_returns).contains("its header says 400 points, and the file has bytes for 500"));
    // A bounding box that does not contain all points, and an inverted one.
    let narrow = patched(whole(), MAX, &500_001.0f64.to_le_bytes());
    let said = told(narrow);
    assert!(said.contains("of 500 points lie outside of the box in its header"), "{said}");
    let reversed = patched(whole(), MAX, &499_999.0f64.to_le_bytes());
    assert!(told(reversed).contains("the box in its header is upside down"));
    // Records that overlap the points.
    let mut records = whole();
    records[100..104].copy_from_slice(&1u32.to_le_bytes());
    let said = folder.read("a.las", &records).map(|points| notes(&points)).unwrap_or_else(|error| error.to_string());
    assert!(said.contains("its points start at byte 227") || said.contains("offset"), "{said}");
}

#[test]
fn a_scale_of_zero_is_told() {
    let folder = Folder::new();
    for (minor, format, compressed) in [(2, 3, false), (4, 7, true), (2, 0, true)] {
        let whole = file(minor, format, compressed, points(500));
        let read = folder.read("a.las", &patched(whole.clone(), SCALE, &[0; 24])).unwrap();
        assert_eq!(read.positions.len(), 500);
        let said = notes(&read);
        assert!(said.contains("warning: a.las: its header says that the scale along x, y, z is 0"), "{said}");
        let said = notes(&folder.read("a.las", &patched(whole.clone(), SCALE + 16, &[0; 8])).unwrap());
        assert!(said.contains("the scale along z is 0"), "{said}");
        let negative = notes(&folder.read("a.las", &patched(whole, SCALE, &(-0.001f64).to_le_bytes())).unwrap());
        assert!(negative.contains("a scale along x that is no positive number"), "{negative}");
    }
}

#[test]
fn degrees_with_heights_in_metres_are_told() {
    let folder = Folder::new();
    let grid = |i: u32| [11.5 + f64::from(i % 70) * 1e-4, 48.1 + f64::from(i / 70) * 1e-4, 500.0 + f64::from(i % 20)];
    let mut text = String::from(
        "ply\nformat ascii 1.0\nelement vertex 4900\nproperty double x\nproperty double y\nproperty double z\nend_header\n",
    );
    for [x, y, z] in (0..4900).map(grid) {
        text += &format!("{x} {y} {z}\n");
    }
    let read = folder.read("a.ply", text.as_bytes()).unwrap();
    assert!(
        notes(&read).contains("a.ply: its coordinates look like degrees of longitude and latitude"),
        "{}",
        notes(&read)
    );
    // Control: coordinates in metres give no note.
    let metres = text.lines().enumerate().map(|(line, text)| {
        let numbers: Vec<f64> = text.split(' ').filter_map(|word| word.parse().ok()).collect();
        match numbers[..] {
            [x, y, z] if line > 6 => format!("{} {} {z}\n", (x - 11.0) * 7e4, (y - 48.0) * 1e5),
            _ => format!("{text}\n"),
        }
    });
    assert_eq!(notes(&folder.read("b.ply", metres.collect::<String>().as_bytes()).unwrap()), "");
    let las_points = (0..4900u32).map(|i| {
        let [x, y, z] = grid(i);
        Point { x, y, z, ..point(0, None) }
    });
    let mut builder = las::Builder::from((1, 2));
    let transform = |scale| las::Transform { scale, offset: 0.0 };
    builder.transforms = las::Vector { x: transform(1e-7), y: transform(1e-7), z: transform(0.01) };
    let mut writer = las::Writer::new(std::io::Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    las_points.for_each(|point| writer.write_point(point).unwrap());
    let bytes = writer.into_inner().unwrap().into_inner();
    let said = notes(&folder.read("a.las", &bytes).unwrap());
    assert!(said.contains("degrees of longitude and latitude"), "{said}");
}

/// Normals are read from the extra bytes that PDAL and CloudCompare write, of any type.
#[test]
fn normals_are_read_from_extra_bytes() {
    let folder = Folder::new();
    // Type 9 is f32; type 4 is i16 with a scale.
    for (format, compressed, kind) in [(2, false, 9u8), (7, true, 9), (7, true, 4), (3, true, 4)] {
        let mut data = Vec::new();
        for name in ["Amplitude", "NormalX", "NormalY", "NormalZ"] {
            let mut entry = vec![0; 192];
            (entry[2], entry[3]) = (kind, if kind == 4 { 1 << 3 } else { 0 });
            entry[4..4 + name.len()].copy_from_slice(name.as_bytes());
            entry[112..120].copy_from_slice(&0.25f64.to_le_bytes());
            data.extend(entry);
        }
        let mut builder = las::Builder::from((1, 4));
        builder.point_format = las::point::Format::new(format).unwrap();
        builder.point_format.is_compressed = compressed;
        builder.point_format.extra_bytes = if kind == 4 { 8 } else { 16 };
        let record = las::Vlr { user_id: "LASF_Spec".into(), record_id: 4, description: String::new(), data };
        builder.vlrs.push(record);
        let has_time = builder.point_format.has_gps_time;
        let mut writer = las::Writer::new(std::io::Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
        for i in 0..1000 {
            let values = [7.0, 0.5, -0.25, 1.0f32];
            let extra_bytes = match kind {
                4 => values.iter().flat_map(|value| ((value * 4.0) as i16).to_le_bytes()).collect(),
                _ => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
            };
            let color = Some(las::Color { red: 1, green: 2, blue: 3 });
            let gps_time = has_time.then_some(1.0);
            let [x, y, z] = [f64::from(i), 0.0, 1.0];
            writer
                .write_point(Point {
                    x,
                    y,
                    z,
                    color,
                    gps_time,
                    extra_bytes,
                    return_number: 1,
                    number_of_returns: 1,
                    ..Point::default()
                })
                .unwrap();
        }
        let bytes = writer.into_inner().unwrap().into_inner();
        let read = folder.read("a.laz", &bytes).unwrap();
        assert_eq!(read.normals, Some(vec![[0.5, -0.25, 1.0]; 1000]), "{format} {compressed} {kind}");
        let options = io::ReadOptions { describe: true, ..io::ReadOptions::default() };
        let about = io::read_with(&folder.path("a.laz"), options, &()).unwrap().about.unwrap();
        let used = |name: &str| {
            about.attributes.iter().find(|attribute| attribute.name == name).map(|attribute| attribute.used)
        };
        assert_eq!((used("NormalX"), used("Amplitude")), (Some(true), Some(false)));
    }
}
