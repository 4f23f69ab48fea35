//! Fuzzes E57 files with random attributes.
//!
//! They are damaged without their page checksums, which are added afterwards; otherwise every
//! damaged file would be refused at once.

use super::e57_page::{CONTENT, PAGE, checksum};
use super::mutate::Grammar;
use super::random::{Place, Random};
use super::{Outcome, Target, render};
use e57::{E57Writer, Extension, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform, Translation};
use std::io::Cursor;
use std::path::Path;

pub const TARGET: Target = Target {
    name: "e57",
    extension: "e57",
    generate,
    grammar: Grammar {
        words: &[
            "data3D",
            "vectorChild",
            "points",
            "prototype",
            "pose",
            "Structure",
            "CompressedVector",
            "Integer",
            "ScaledInteger",
            "Float",
            "single",
            "cartesianX",
            "cartesianInvalidState",
            "sphericalRange",
            "colorRed",
            "intensity",
            "nor:normalX",
            "minimum=\"0\"",
            "maximum=\"0\"",
            "maximum=\"1\"",
            "minimum=\"-9223372036854775808\"",
            "scale=\"0\"",
            "fileOffset=\"0\"",
            "recordCount=\"4294967295\"",
            "<nor:normalX type=\"Integer\" minimum=\"7\" maximum=\"7\"/>",
            "<!DOCTYPE a [<!ENTITY b \"c\">]>",
            "&b;",
            "<![CDATA[",
            "<!--",
            "</e57Root>",
            "\u{fffd}",
        ],
        separators: b"<>=\"/",
        text: 1 << 14,
        numbers,
    },
    execute,
};

/// Offsets and sizes of the numbers in the file header, in the first section and in its first
/// packet.
const NUMBERS: [(usize, usize); 19] = [
    (8, 4),
    (12, 4),
    (16, 8),
    (24, 8),
    (32, 8),
    (40, 8),
    (48, 1),
    (56, 8),
    (64, 8),
    (72, 8),
    (80, 1),
    (81, 1),
    (82, 2),
    (84, 2),
    (86, 2),
    (88, 2),
    (90, 2),
    (92, 2),
    (94, 2),
];

fn numbers(bytes: &[u8]) -> Vec<(usize, usize)> {
    NUMBERS.into_iter().filter(|&(at, size)| at + size <= bytes.len()).collect()
}

/// Adds the page checksums and reads the file.
fn execute(path: &Path, valid: Option<usize>) -> Result<Outcome, String> {
    let mut content = std::fs::read(path).unwrap();
    // If damage moved the end of the XML, the header is updated, so that the XML is still read.
    if !content.len().is_multiple_of(CONTENT)
        && let Some(start) = content.windows(5).position(|window| window == b"<?xml")
        && let Some(length) = content[start..].windows(10).position(|window| window == b"</e57Root>")
    {
        let physical = start / CONTENT * PAGE + start % CONTENT;
        content[24..32].copy_from_slice(&(physical as u64).to_le_bytes());
        content[32..40].copy_from_slice(&(length as u64 + 10).to_le_bytes());
    }
    content.resize(content.len().next_multiple_of(CONTENT), 0);
    let pages: Vec<u8> = content.chunks_exact(CONTENT).flat_map(|page| [page, &checksum(page)].concat()).collect();
    std::fs::remove_file(path).unwrap();
    std::fs::write(path, pages).unwrap();
    render::points(path, valid)
}

const INVALID: RecordDataType = RecordDataType::Integer { min: 0, max: 2 };
const FLAG: RecordDataType = RecordDataType::Integer { min: 0, max: 1 };

fn coordinate(random: &mut Random) -> RecordDataType {
    let (min, max) = (-1_000_000, 1_000_000);
    match random.below(4) {
        0 => RecordDataType::F32,
        1 => RecordDataType::ScaledInteger { min, max, scale: [0.001, 1.0][random.below(2)], offset: 0.5 },
        2 => RecordDataType::Integer { min, max: [max, min][usize::from(random.one_in(8))] },
        _ => RecordDataType::F64,
    }
}

fn prototype(random: &mut Random) -> Vec<Record> {
    let record = |name, data_type| Record { name, data_type };
    let (axes, invalid) = if random.one_in(3) {
        let spherical = [RecordName::SphericalRange, RecordName::SphericalAzimuth, RecordName::SphericalElevation];
        (spherical.map(|name| record(name, RecordDataType::F64)), RecordName::SphericalInvalidState)
    } else {
        let cartesian = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
        (cartesian.map(|name| record(name, coordinate(random))), RecordName::CartesianInvalidState)
    };
    let mut records: Vec<_> = axes.into();
    if random.one_in(3) {
        records.push(record(invalid, INVALID));
    }
    if random.one_in(2) {
        let data_type = [RecordDataType::U8, RecordDataType::U16, RecordDataType::UNIT_F32][random.below(3)].clone();
        let names = [RecordName::ColorRed, RecordName::ColorGreen, RecordName::ColorBlue];
        records.extend(names.map(|name| record(name, data_type.clone())));
        if random.one_in(3) {
            records.push(record(RecordName::IsColorInvalid, FLAG));
        }
    }
    if random.one_in(2) {
        records.push(record(
            RecordName::Intensity,
            [RecordDataType::U16, RecordDataType::UNIT_F32][random.below(2)].clone(),
        ));
    }
    if random.one_in(2) {
        let name = |name: &str| RecordName::Unknown { namespace: "nor".into(), name: name.into() };
        let data_type = [RecordDataType::F32, RecordDataType::F64][random.below(2)].clone();
        records.extend(["normalX", "normalY", "normalZ"].map(|axis| record(name(axis), data_type.clone())));
    }
    for last in (1..records.len()).rev() {
        records.swap(last, random.below(last + 1));
    }
    records
}

fn value(number: f64, kind: &RecordDataType) -> RecordValue {
    match *kind {
        RecordDataType::Single { .. } => RecordValue::Single(number as f32),
        RecordDataType::Double { .. } => RecordValue::Double(number),
        RecordDataType::ScaledInteger { min, max, scale, offset } => {
            RecordValue::ScaledInteger((((number - offset) / scale) as i64).clamp(min, max))
        }
        RecordDataType::Integer { min, max } => RecordValue::Integer((number as i64).clamp(min, max)),
    }
}

/// The values of a point, and whether it is valid.
fn point(random: &mut Random, place: Place, prototype: &[Record]) -> (Vec<RecordValue>, bool) {
    let position = place.point(random);
    let invalid = random.below(3);
    let mut valid = true;
    let mut one = |record: &Record| {
        let number = match record.name {
            RecordName::CartesianX | RecordName::SphericalRange => position[0],
            RecordName::CartesianY | RecordName::SphericalAzimuth => position[1],
            RecordName::CartesianZ | RecordName::SphericalElevation => position[2],
            RecordName::CartesianInvalidState | RecordName::SphericalInvalidState => {
                valid = invalid == 0;
                invalid as f64
            }
            RecordName::Unknown { .. } => random.between(-1.0, 1.0),
            _ => random.between(0.0, 300.0),
        };
        value(number, &record.data_type)
    };
    let values = prototype.iter().map(&mut one).collect();
    (values, valid)
}

fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").unwrap();
    writer.register_extension(Extension::new("nor", "http://www.libe57.org/E57_EXT_surface_normals.txt")).unwrap();
    let place = Place::any(random);
    let mut kept = 0;
    for _ in 0..1 + random.below(2) {
        let prototype = prototype(random);
        let mut scan = writer.add_pointcloud("scan", prototype.clone()).unwrap();
        if random.one_in(2) {
            let [x, y, z] = Place::Survey.point(random);
            let (w, turn) = (random.between(0.0, 6.3).cos(), random.below(2));
            let across = (1.0 - w * w).sqrt();
            scan.set_transform(Some(Transform {
                rotation: Quaternion { w, x: [across, 0.0][turn], y: 0.0, z: [0.0, across][turn] },
                translation: Translation { x, y, z },
            }));
        }
        for _ in 0..random.count(40) {
            let (values, valid) = point(random, place, &prototype);
            scan.add_point(values).unwrap();
            kept += usize::from(valid);
        }
        scan.finalize().unwrap();
    }
    writer.finalize().unwrap();
    drop(writer);
    let content = bytes.into_inner().chunks(PAGE).flat_map(|page| page[..CONTENT].to_vec()).collect();
    (content, kept)
}
