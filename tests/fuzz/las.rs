//! Fuzzes LAS and LAZ files of random version, point format and size, and a COPC file.

use super::las_forms::{of_las_1_5, pointwise};
use super::mutate::Grammar;
use super::random::{Place, Random};
use super::session::sentence;
use super::{Outcome, Target, render};
use epsplat::io::{self, ReadOptions};
use las::point::Format;
use las::{Builder, Color, Point, Transform, Vector, Version, Vlr, Writer};
use std::io::Cursor;
use std::path::Path;

pub const TARGET: Target = Target {
    name: "las",
    extension: "laz",
    generate,
    grammar: Grammar {
        words: &["LASF", "laszip encoded", "copc", "LASF_Projection", "\n\u{e4}\n", "\0\0\0\0"],
        separators: b"\0",
        text: 1 << 10,
        numbers,
    },
    execute,
};

/// Reads and draws the points, then reads again with withheld points, which must add as many as
/// were counted.
fn execute(path: &Path, valid: Option<usize>) -> Result<Outcome, String> {
    let outcome = render::points(path, valid)?;
    let all = io::read_with(path, ReadOptions { keep_withheld: true, ..ReadOptions::default() }, &());
    match (io::read(path, &()), all) {
        (Ok(points), Ok(all)) => {
            let (kept, withheld, all) = (points.positions.len() as u64, points.withheld, all.positions.len() as u64);
            if kept + withheld != all {
                return Err(format!("{kept} points are kept and {withheld} withheld, but there are {all}"));
            }
        }
        (Err(error), Err(_)) => sentence(&error, Some(path))?,
        (points, all) => return Err(format!("withheld points make a difference: {:?}, {:?}", points.err(), all.err())),
    }
    Ok(outcome)
}

/// Offsets and sizes of the numbers in the public header block.
const HEADER: [(usize, usize); 30] = [
    (4, 2),
    (6, 2),
    (24, 1),
    (25, 1),
    (26, 4),
    (30, 4),
    (90, 2),
    (92, 2),
    (94, 2),
    (96, 4),
    (100, 4),
    (104, 1),
    (105, 2),
    (107, 4),
    (111, 4),
    (131, 8),
    (139, 8),
    (147, 8),
    (155, 8),
    (163, 8),
    (171, 8),
    (179, 8),
    (187, 8),
    (227, 8),
    (235, 8),
    (243, 4),
    (247, 8),
    (255, 8),
    (327, 8),
    (335, 8),
];

/// Offsets and sizes of the numbers in the header, in the LASzip record, in the chunk table and in
/// the layers of the first chunk.
pub(super) fn numbers(bytes: &[u8]) -> Vec<(usize, usize)> {
    let mut places = HEADER.to_vec();
    if let Some(record) = bytes.windows(14).position(|window| window == b"laszip encoded") {
        let data = record + 52;
        places.extend([(record + 16, 2), (record + 18, 2), (data, 2), (data + 2, 2), (data + 8, 4), (data + 12, 4)]);
        places.extend([(data + 32, 2), (data + 34, 2), (data + 36, 2), (data + 38, 2), (data + 40, 2), (data + 42, 2)]);
    }
    if let Some(&start) = bytes.get(96..).and_then(|rest| rest.first_chunk()) {
        let start = u32::from_le_bytes(start) as usize;
        places.push((start, 8));
        places.extend((0..12).map(|layer| (start.saturating_add(38 + 4 * layer), 4)));
        if let Some(&table) = bytes.get(start..).and_then(|rest| rest.first_chunk()) {
            let table = usize::try_from(u64::from_le_bytes(table)).unwrap_or(usize::MAX);
            places.extend([(table, 4), (table.saturating_add(4), 4), (table.saturating_add(8), 4)]);
        }
    }
    places.retain(|&(at, size)| at.checked_add(size).is_some_and(|end| end <= bytes.len()));
    places
}

fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    static CLOUD_OPTIMISED: &[u8] = include_bytes!("../../data/simple.copc.laz");
    if random.one_in(64) {
        return (CLOUD_OPTIMISED.to_vec(), 1065);
    }
    let (minor, number) =
        [(2, 0), (2, 1), (2, 2), (2, 3), (3, 2), (3, 3), (4, 0), (4, 3), (4, 6), (4, 7), (4, 8)][random.below(11)];
    let mut builder = Builder::default();
    builder.version = Version::new(1, minor);
    builder.point_format = Format::new(number).unwrap();
    builder.point_format.is_compressed = random.below(3) > 0;
    builder.point_format.extra_bytes = if random.one_in(4) { random.below(5) as u16 } else { 0 };
    let scale = [0.001, 0.01, 1.0, 1e-7][random.below(4)];
    let transform = |offset| Transform { scale, offset };
    builder.transforms = Vector { x: transform(5e5), y: transform(6e6), z: transform(0.0) };
    builder.system_identifier = "fuzz".into();
    if random.one_in(4) {
        let data = (0..random.below(80)).map(|_| random.bits() as u8).collect();
        builder.vlrs.push(Vlr { user_id: "epsplat".into(), record_id: 7, description: "noise".into(), data });
    }
    let format = builder.point_format;
    let header = builder.into_header().unwrap();
    let mut writer = Writer::new(Cursor::new(Vec::new()), header).unwrap();
    let place = [Place::Grid, Place::Survey, Place::One][random.below(3)];
    let (points, mut kept) = (random.count(120), 0);
    for _ in 0..points {
        // Within the range of 32-bit coordinates at the finest scale.
        let [x, y, z] = place.point(random).map(|c| c % 100.0);
        let is_withheld = random.one_in(16);
        kept += usize::from(!is_withheld);
        let color = Color { red: random.bits() as u16, green: random.below(256) as u16, blue: 0 };
        writer
            .write_point(Point {
                x: 5e5 + x,
                y: 6e6 + y,
                z,
                intensity: random.below(3000) as u16,
                return_number: 1,
                number_of_returns: 1,
                is_withheld,
                is_synthetic: random.one_in(16),
                is_key_point: random.one_in(16),
                is_overlap: random.one_in(16),
                gps_time: format.has_gps_time.then_some(random.between(0.0, 1e5)),
                color: format.has_color.then_some(color),
                nir: format.has_nir.then_some(random.bits() as u16),
                extra_bytes: (0..format.extra_bytes).map(|_| random.bits() as u8).collect(),
                ..Point::default()
            })
            .unwrap();
    }
    let bytes = writer.into_inner().unwrap().into_inner();
    let chunk_size = [0, u32::MAX, 50_000][random.below(3)];
    let bytes = match (minor, format.is_compressed && !format.is_extended && points > 0) {
        (_, true) if random.one_in(4) => pointwise(&bytes, chunk_size),
        (4, false) if random.one_in(4) => of_las_1_5(&bytes),
        _ => bytes,
    };
    (bytes, kept)
}
