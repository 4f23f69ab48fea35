//! Attributes that are read on demand, and filters, in each format.
//!
//! The figures of files in `data/` are those of laspy 2.6 with lazrs; other files are written here.

use super::{Folder, data};
use epsplat::io::dimensions::Wanted;
use epsplat::io::las::Copc;
use epsplat::io::{self, Column, Input, Points, ReadOptions};
use epsplat::{Error, low_level::scene::Colors};
use las::point::{Classification, Format, ScanDirection};
use las::{Builder, Point, Transform, Vector, Writer};
use std::io::Cursor;
use std::path::Path;

fn wanting(column: &str, filter: &str) -> ReadOptions {
    let filter = if filter.is_empty() { Default::default() } else { filter.parse().unwrap() };
    let column = (!column.is_empty()).then(|| column.to_owned());
    ReadOptions { wanted: Wanted { column, filter, spans: false }, ..ReadOptions::default() }
}

fn read(path: &Path, column: &str, filter: &str) -> Points {
    io::read_with(path, wanting(column, filter), &()).unwrap()
}

fn values(points: &Points) -> Vec<f64> {
    let column: &Column = points.column.as_ref().unwrap();
    assert_eq!(column.values.len(), points.positions.len());
    (0..column.values.len()).map(|index| column.value(index)).collect()
}

/// The name of the stored attribute, its smallest and largest value, and the sum.
fn summary(path: &Path, column: &str) -> (String, f64, f64, f64) {
    let points = read(path, column, "");
    let all = values(&points);
    let (low, high) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    (points.column.unwrap().name, low, high, all.iter().sum())
}

#[test]
fn the_attributes_of_a_scan_are_those_that_laspy_reads() {
    let path = data("autzen.laz");
    for (asked, name, low, high, sum) in [
        ("intensity", "Intensity", 0.0, 254.0, 11_220_547.0),
        ("return", "ReturnNumber", 1.0, 4.0, 122_564.0),
        ("number_of_returns", "NumberOfReturns", 1.0, 4.0, 135_174.0),
        ("ScanDirectionFlag", "ScanDirectionFlag", 0.0, 1.0, 55_998.0),
        ("class", "Classification", 1.0, 2.0, 136_107.0),
        ("scan-angle", "ScanAngleRank", -18.0, -1.0, -911_726.0),
        ("user data", "UserData", 117.0, 135.0, 13_763_736.0),
        ("PointSourceId", "PointSourceId", 7326.0, 7326.0, 805_860_000.0),
        ("red", "Red", 40.0, 236.0, 12_255_922.0),
        ("blue", "Blue", 52.0, 219.0, 10_938_029.0),
    ] {
        assert_eq!(summary(&path, asked), (name.into(), low, high, sum), "{asked}");
    }
    let (_, low, high, sum) = summary(&path, "gps-time");
    assert!(
        (low - 245_379.398_436_825_14).abs() < 1e-6 && (high - 245_385.911_121_044_54).abs() < 1e-6,
        "{low} {high}"
    );
    assert!((sum - 26_992_173_910.630_775).abs() < 0.05, "{sum}");
    let (_, low, high, _) = summary(&path, "z");
    assert!((low - 406.26).abs() < 1e-4 && (high - 520.51).abs() < 1e-4, "{low} {high}");
    // Control: without the option nothing is stored, and the rest is the same.
    let (plain, with) = (read(&path, "", ""), read(&path, "intensity", ""));
    assert!(plain.column.is_none() && plain == Points { column: None, ..with });
}

#[test]
fn nodes_of_an_octree_have_the_attributes_of_the_file() {
    let path = data("simple.copc.laz");
    for (asked, low, high, sum) in [
        ("intensity", 0.0, 254.0, 81_361.0),
        ("return", 1.0, 4.0, 1236.0),
        ("class", 1.0, 2.0, 1341.0),
        ("UserData", 117.0, 149.0, 134_663.0),
        ("PointSourceId", 7326.0, 7334.0, 7_806_350.0),
        ("Green", 57.0, 239.0, 118_582.0),
        // Steps of 0.006 degrees.
        ("scan-angle", -3167.0 * 0.006, 3000.0 * 0.006, -134_504.0 * 0.006),
        ("gps-time", 245_370.417_064_559_82, 249_783.162_158_371_88, 263_704_809.390_784_8),
    ] {
        let (_, found_low, found_high, found_sum) = summary(&path, asked);
        assert!(
            (found_low - low).abs() < 1e-3 && (found_high - high).abs() < 1e-3,
            "{asked}: {found_low} {found_high}"
        );
        assert!((found_sum - sum).abs() < 1e-2, "{asked}: {found_sum}");
        // The nodes are read with the layers of this attribute alone, after another one was read.
        let mut copc = Copc::open(Input::open(&path, None).unwrap()).unwrap().unwrap();
        let all: Vec<usize> = (0..copc.octree.nodes.len()).collect();
        copc.read(&all[..1], &ReadOptions::default(), &()).unwrap();
        let points = copc.read(&all, &wanting(asked, ""), &()).unwrap();
        assert!((values(&points).iter().sum::<f64>() - sum).abs() < 1e-2, "{asked}");
    }
    let mut copc = Copc::open(Input::open(&path, None).unwrap()).unwrap().unwrap();
    let all: Vec<usize> = (0..copc.octree.nodes.len()).collect();
    let points = copc.read(&all, &wanting("z", "Classification[2:2],Z[:430]"), &()).unwrap();
    assert_eq!((points.positions.len(), points.filtered, points.withheld), (252, 1065 - 252, 0));
    assert_eq!((points.numbers.unwrap().len(), points.column.unwrap().values.len()), (252, 252));
}

#[test]
fn filters_keep_the_points_that_numpy_counts() {
    for (name, all, ground, strong) in [("autzen.laz", 110_000, 23_794, 83_445), ("simple.copc.laz", 1065, 252, 734)] {
        let path = data(name);
        let points = read(&path, "", "Classification[2:2],z[:430]");
        assert_eq!((points.positions.len(), points.filtered), (ground, (all - ground) as u64), "{name}");
        assert!(points.positions.iter().all(|position| position[2] <= 430.0));
        assert_eq!((points.left_out.len(), points.classes.len()), (all - ground, 1));
        let points = read(&path, "return", "Intensity(20:],ReturnNumber[1:1]");
        assert_eq!(points.positions.len(), strong, "{name}");
        assert!(values(&points).iter().all(|number| *number == 1.0));
        // Everything passes; the colours are those of the whole file.
        let (plain, passing) = (read(&path, "", ""), read(&path, "", "Intensity[0:]"));
        assert_eq!((plain.colors, passing.filtered), (passing.colors, 0));
    }
}

#[test]
fn every_point_format_has_its_numbers_where_the_specification_says() {
    let folder = Folder::new();
    for (minor, format, compressed) in super::las::KINDS {
        let mut builder = Builder::from((1, minor));
        builder.point_format = Format::new(format).unwrap();
        builder.point_format.is_compressed = compressed;
        let transform = Transform { scale: 0.001, offset: 0.0 };
        builder.transforms = Vector { x: transform, y: transform, z: transform };
        let own = builder.point_format;
        let mut writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
        for k in 0..40u16 {
            let point = Point {
                x: f64::from(k),
                intensity: 1000 + k,
                return_number: 1 + (k % 3) as u8,
                number_of_returns: 5,
                scan_direction: if k % 2 == 1 { ScanDirection::LeftToRight } else { ScanDirection::RightToLeft },
                is_edge_of_flight_line: k % 5 == 0,
                classification: Classification::new(2 + (k % 7) as u8).unwrap(),
                is_key_point: k % 4 == 0,
                scan_angle: -f32::from(k),
                user_data: 200 - k as u8,
                point_source_id: 40_000 + k,
                gps_time: own.has_gps_time.then_some(3e8 + 0.25 * f64::from(k)),
                color: own.has_color.then_some(las::Color { red: k, green: 300 + k, blue: 65_535 - k }),
                nir: own.has_nir.then_some(500 + k),
                ..Point::default()
            };
            writer.write_point(point).unwrap();
        }
        let path = folder.path("a.laz");
        std::fs::write(&path, writer.into_inner().unwrap().into_inner()).unwrap();
        let check = |name: &str, exists: bool, expected: &dyn Fn(f64) -> f64| {
            let what = format!("{name} of format {format}");
            if !exists {
                assert!(matches!(io::read_with(&path, wanting(name, ""), &()), Err(Error::Usage(_))), "{what}");
                return;
            }
            let points = read(&path, name, "");
            for (k, value) in values(&points).into_iter().enumerate() {
                // Angles have steps of 0.006 degrees.
                let most = if name == "ScanAngleRank" { 0.0061 } else { 2e-3 };
                assert!((value - expected(k as f64)).abs() < most, "{what}, point {k}: {value}");
            }
        };
        check("Intensity", true, &|k| 1000.0 + k);
        check("ReturnNumber", true, &|k| 1.0 + k % 3.0);
        check("NumberOfReturns", true, &|_| 5.0);
        check("ScanDirectionFlag", true, &|k| k % 2.0);
        check("EdgeOfFlightLine", true, &|k| f64::from(u8::from(k % 5.0 == 0.0)));
        check("Classification", true, &|k| 2.0 + k % 7.0);
        check("KeyPoint", true, &|k| f64::from(u8::from(k % 4.0 == 0.0)));
        check("Synthetic", true, &|_| 0.0);
        check("ScanAngleRank", true, &|k| -k);
        check("UserData", true, &|k| 200.0 - k);
        check("PointSourceId", true, &|k| 40_000.0 + k);
        check("GpsTime", own.has_gps_time, &|k| 3e8 + 0.25 * k);
        check("Red", own.has_color, &|k| k);
        check("Blue", own.has_color, &|k| 65_535.0 - k);
        check("Infrared", own.has_nir, &|k| 500.0 + k);
        check("Overlap", own.is_extended, &|_| 0.0);
    }
}

/// A LAS file whose points have two attributes in their extra bytes: `Amplitude` is a scaled u16,
/// and `height above ground` an f64.
fn with_extra_bytes(compressed: bool) -> Vec<u8> {
    let entry = |kind: u8, name: &str, scale: Option<[f64; 2]>| {
        let mut entry = vec![0; 192];
        entry[2] = kind;
        entry[4..4 + name.len()].copy_from_slice(name.as_bytes());
        if let Some([scale, offset]) = scale {
            entry[3] = 0b11000;
            entry[112..120].copy_from_slice(&scale.to_le_bytes());
            entry[136..144].copy_from_slice(&offset.to_le_bytes());
        }
        entry
    };
    let mut builder = Builder::from((1, 4));
    builder.point_format = Format::new(6).unwrap();
    builder.point_format.is_compressed = compressed;
    builder.point_format.extra_bytes = 10;
    builder.vlrs.push(las::Vlr {
        user_id: "LASF_Spec".into(),
        record_id: 4,
        data: [entry(3, "Amplitude", Some([0.01, -5.0])), entry(10, "height above ground", None)].concat(),
        ..las::Vlr::default()
    });
    let mut writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    for k in 0..50u16 {
        let extra = [(100 * k).to_le_bytes().as_slice(), &(0.125 * f64::from(k)).to_le_bytes()].concat();
        writer.write_point(Point { x: k.into(), extra_bytes: extra, gps_time: Some(0.0), ..Point::default() }).unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

#[test]
fn extra_bytes_are_attributes_by_name() {
    let folder = Folder::new();
    for compressed in [false, true] {
        let path = folder.path("a.laz");
        std::fs::write(&path, with_extra_bytes(compressed)).unwrap();
        let amplitude = values(&read(&path, "amplitude", ""));
        assert!((0..50).all(|k| (amplitude[k] - (k as f64 - 5.0)).abs() < 1e-5), "{amplitude:?}");
        let points = read(&path, "Amplitude", "HeightAboveGround[1:2)");
        assert_eq!(values(&points).iter().map(|value| value.round() as i32).collect::<Vec<_>>(), Vec::from_iter(3..11));
        let error = io::read_with(&path, wanting("width", ""), &()).unwrap_err();
        let told = error.to_string();
        assert!(matches!(error, Error::Usage(_)) && told.starts_with(&path.display().to_string()), "{told}");
        assert!(
            told.contains("no attribute 'width'") && told.ends_with("GpsTime, Amplitude, height above ground"),
            "{told}"
        );
    }
}

#[test]
fn properties_of_ply_vertices_are_attributes() {
    let folder = Folder::new();
    let names = [
        "float x",
        "float y",
        "float z",
        "uchar red",
        "uchar green",
        "uchar blue",
        "double time",
        "short scalar_Class",
    ];
    let properties: String = names.iter().map(|name| format!("property {name}\n")).collect();
    let rows: Vec<(f32, f64, i16)> = (0..1000).map(|k| (k as f32, 4e8 + f64::from(k) / 8.0, (k % 5) as i16)).collect();
    let header = |kind: &str| format!("ply\nformat {kind} 1.0\nelement vertex 1000\n{properties}end_header\n");
    let text: String = rows.iter().map(|(x, time, class)| format!("{x} 1 2 9 8 7 {time} {class}\n")).collect();
    let binary = |big: bool| -> Vec<u8> {
        let turned = |mut bytes: Vec<u8>| {
            if big {
                bytes.reverse();
            }
            bytes
        };
        let row = |(x, time, class): &(f32, f64, i16)| {
            let place = [*x, 1.0, 2.0].map(|c| turned(c.to_le_bytes().to_vec())).concat();
            [place, vec![9, 8, 7], turned(time.to_le_bytes().to_vec()), turned(class.to_le_bytes().to_vec())].concat()
        };
        rows.iter().flat_map(row).collect()
    };
    for (kind, body) in
        [("ascii", text.into_bytes()), ("binary_little_endian", binary(false)), ("binary_big_endian", binary(true))]
    {
        let path = folder.path("a.ply");
        std::fs::write(&path, [header(kind).into_bytes(), body].concat()).unwrap();
        let time = values(&read(&path, "TIME", ""));
        assert!(time.iter().zip(&rows).all(|(value, row)| (value - row.1).abs() < 1e-4), "{kind}");
        // The prefix does not matter, and neither does the case.
        for name in ["class", "scalar_class", "Classification"] {
            assert_eq!(values(&read(&path, name, ""))[..6], [0.0, 1.0, 2.0, 3.0, 4.0, 0.0], "{kind} {name}");
        }
        assert_eq!(values(&read(&path, "red", ""))[7], 9.0);
        let points = read(&path, "x", "class[2:3],X[500:]");
        assert_eq!((points.positions.len(), points.filtered), (200, 800), "{kind}");
        assert_eq!((values(&points)[0], values(&points)[1], points.left_out.len()), (502.0, 503.0, 800));
        assert_eq!(points.colors, Some(Colors::Srgb8(vec![[9, 8, 7, 255]; 200])));
    }
}

#[test]
fn filters_are_refused_for_meshes_and_heights_are_read_of_them() {
    let path = data("bunny.obj");
    let told = io::read_with(&path, wanting("", "z[0:]"), &()).unwrap_err().to_string();
    assert!(told.contains("it is a mesh"), "{told}");
    let points = read(&path, "z", "");
    let expected: Vec<f64> = points.positions.iter().map(|position| position[2]).collect();
    assert!(values(&points).iter().zip(expected).all(|(value, z)| (value - z).abs() < 1e-6));
    let told = io::read_with(&path, wanting("intensity", ""), &()).unwrap_err().to_string();
    assert!(told.ends_with("it has no attribute 'intensity': it has X, Y, Z"), "{told}");
}

#[cfg(feature = "pcd")]
#[test]
fn fields_of_pcd_files_are_attributes() {
    let folder = Folder::new();
    let header = |data: &str| {
        format!(
            "VERSION 0.7\nFIELDS x y z rgb label fpfh\nSIZE 4 4 4 4 2 4\nTYPE F F F F U F\nCOUNT 1 1 1 1 1 3\nWIDTH 100\nHEIGHT 1\n\
             POINTS 100\nDATA {data}\n"
        )
    };
    let text: String = (0..100).map(|k| format!("{k} 0 0 4.2e-39 {} 1 2.5 {k}\n", k % 4)).collect();
    let row = |k: u16| {
        let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
        [floats(&[f32::from(k), 0.0, 0.0, 4.2e-39]), (k % 4).to_le_bytes().to_vec(), floats(&[1.0, 2.5, f32::from(k)])]
            .concat()
    };
    for (data, body) in [("ascii", text.into_bytes()), ("binary", (0..100).flat_map(row).collect())] {
        let path = folder.path("a.pcd");
        std::fs::write(&path, [header(data).into_bytes(), body].concat()).unwrap();
        assert_eq!(values(&read(&path, "label", ""))[..5], [0.0, 1.0, 2.0, 3.0, 0.0], "{data}");
        assert_eq!(values(&read(&path, "fpfh[2]", ""))[99], 99.0, "{data}");
        let points = read(&path, "fpfh[1]", "label[3:3]");
        assert_eq!((values(&points), points.filtered), (vec![2.5; 25], 75), "{data}");
        assert!(io::read_with(&path, wanting("rgb", ""), &()).is_err());
    }
}

#[cfg(feature = "e57")]
#[test]
fn attributes_of_e57_scans_are_joined() {
    use e57::{E57Writer, Record, RecordDataType, RecordName, RecordValue};
    let folder = Folder::new();
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").unwrap();
    let place = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
    let place = place.map(|name| Record { name, data_type: RecordDataType::F64 });
    let returns = Record { name: RecordName::ReturnIndex, data_type: RecordDataType::Integer { min: 0, max: 9 } };
    let count = Record { name: RecordName::ReturnCount, data_type: RecordDataType::Integer { min: 0, max: 9 } };
    for (scan, prototype) in [[&place[..], &[returns, count]].concat(), place.to_vec()].into_iter().enumerate() {
        let mut points = writer.add_pointcloud(&format!("scan {scan}"), prototype).unwrap();
        for k in 0..6 {
            let mut point = [f64::from(k), 0.0, scan as f64].map(RecordValue::Double).to_vec();
            let own = [i64::from(k) % 3, 3].map(RecordValue::Integer);
            point.extend(own.into_iter().filter(|_| scan == 0));
            points.add_point(point).unwrap();
        }
        points.finalize().unwrap();
    }
    writer.finalize().unwrap();
    drop(writer);
    let path = folder.path("a.e57");
    std::fs::write(&path, bytes.into_inner()).unwrap();
    let all = values(&read(&path, "returnIndex", ""));
    assert_eq!(all[..6], [0.0, 1.0, 2.0, 0.0, 1.0, 2.0]);
    // The other scan lacks the attribute, so its points have none and pass no filter of it.
    assert!(all[6..].iter().all(|value| value.is_nan()));
    let points = read(&path, "x", "return[1:]");
    assert_eq!((values(&points), points.filtered), (vec![1.0, 2.0, 4.0, 5.0], 8));
    assert_eq!(points.left_out, [0, 3, 6, 7, 8, 9, 10, 11]);
}

#[test]
fn ranges_of_all_attributes_are_found_while_reading() {
    let mut options = ReadOptions::default();
    options.wanted.spans = true;
    let points = io::read_with(&data("autzen.laz"), options, &()).unwrap();
    let range = |name: &str| points.spans.iter().find(|span| span.name == name).unwrap().range.unwrap();
    assert_eq!(points.spans.len(), 3 + 16);
    assert_eq!((range("Intensity"), range("ReturnNumber"), range("Green")), ([0.0, 254.0], [1.0, 4.0], [55.0, 228.0]));
    assert_eq!((range("ScanAngleRank"), range("Withheld")), ([-18.0, -1.0], [0.0; 2]));
    assert!((range("X")[0] - 636_001.76).abs() < 1e-6 && (range("Z")[1] - 520.51).abs() < 1e-6);
}
