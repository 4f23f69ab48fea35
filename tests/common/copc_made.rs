//! COPC files of any size: a bumpy square of points in an octree.

#![allow(dead_code)]

use std::collections::BTreeMap;
use std::io::{Cursor, Seek, SeekFrom, Write};

use laz::{LasZipCompressor, LazVlrBuilder};

/// Points per cube edge of a node.
const ALONG: u32 = 32;

/// Size of a point of format 7, bytes.
const RECORD: usize = 36;

/// A made file, and where its parts are.
pub struct Made {
    pub bytes: Vec<u8>,
    /// Offset and size of the page of the octree.
    pub page: (u64, u64),
    /// Corners of the box of all points, as in the header.
    pub bounds: [[f64; 3]; 2],
    pub points: u64,
}

/// Makes a COPC file with complete levels of `ALONG`² points a node: a square with this corner and
/// edge, at heights between 0 and an eighth of the edge. Colours have 16 bits.
pub fn copc([x, y]: [f64; 2], edge: f64, levels: u32) -> Made {
    let center = [x + edge / 2.0, y + edge / 2.0, edge / 2.0];
    let nodes = nodes(edge, levels);
    let points: u64 = nodes.values().map(|points| points.len() as u64).sum();
    let scale = edge / 1e6;
    let place = |at: &[f64; 3]| at.map(|part| (part / scale).round() as i32);
    let (mut min, mut max) = ([i32::MAX; 3], [i32::MIN; 3]);
    for at in nodes.values().flatten().map(&place) {
        for axis in 0..3 {
            (min[axis], max[axis]) = (min[axis].min(at[axis]), max[axis].max(at[axis]));
        }
    }
    let offset = [x, y, 0.0];
    let corner = |at: [i32; 3]| [0, 1, 2].map(|axis| f64::from(at[axis]) * scale + offset[axis]);
    let bounds = [corner(min), corner(max)];
    let vlr = LazVlrBuilder::default().with_point_format(7, 0).unwrap().with_variable_chunk_size().build();
    let mut laszip = Vec::new();
    vlr.write_to(&mut laszip).unwrap();
    let start = 375 + 54 + 160 + 54 + laszip.len();
    let mut file = Cursor::new(vec![0; start]);
    file.seek(SeekFrom::End(0)).unwrap();
    let mut compressor = LasZipCompressor::new(file, vlr).unwrap();
    compressor.reserve_offset_to_chunk_table().unwrap();
    let mut entries = Vec::new();
    for (&(level, cube), points) in &nodes {
        let before = compressor.get().position();
        let records: Vec<u8> = points.iter().flat_map(|at| record(place(at), at, edge)).collect();
        if !points.is_empty() {
            compressor.compress_many(&records).unwrap();
            compressor.finish_current_chunk().unwrap();
        }
        let size = compressor.get().position() - before;
        let cube = cube.map(|part| part as i32);
        entries.extend([level as i32, cube[0], cube[1], cube[2]].into_iter().flat_map(i32::to_le_bytes));
        entries.extend(before.to_le_bytes());
        entries.extend([size as i32, points.len() as i32].into_iter().flat_map(i32::to_le_bytes));
    }
    compressor.done().unwrap();
    let mut bytes = compressor.into_inner().into_inner();
    let evlr = bytes.len() as u64;
    bytes.extend(record_header(1000, entries.len() as u64, true));
    let page = (bytes.len() as u64, entries.len() as u64);
    bytes.extend(entries);
    let mut head = header(start as u32, evlr, (points, scale, offset), bounds);
    head.extend(record_header(1, 160, false));
    let spacing = edge / 128.0;
    head.extend([center[0], center[1], center[2], edge / 2.0, spacing].into_iter().flat_map(f64::to_le_bytes));
    head.extend([page.0, page.1].into_iter().flat_map(u64::to_le_bytes));
    head.resize(375 + 54 + 160, 0);
    head.extend(laszip_header(laszip.len()));
    head.extend(laszip);
    bytes[..start].copy_from_slice(&head);
    Made { bytes, page, bounds, points }
}

type Nodes = BTreeMap<(u32, [u32; 3]), Vec<[f64; 3]>>;

/// The points of each node, relative to the corner of the cube.
fn nodes(edge: f64, levels: u32) -> Nodes {
    let mut nodes = Nodes::new();
    for level in 0..levels {
        let side = ALONG << level;
        for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
            // A point a cell, at a place that differs from those of the other levels.
            let wiggle = |a: u32, b: u32| f64::from((a * 7919 + b * 104_729 + level * 31) % 1000) / 1000.0;
            let [u, v] = [(i, wiggle(i, j)), (j, wiggle(j, i))].map(|(k, w)| (f64::from(k) + w) / f64::from(side));
            let height = 0.0625 * (1.0 + (9.0 * u).sin() * (7.0 * v).cos());
            let at = [u, v, height];
            let cube = at.map(|part| (part * f64::from(1u32 << level)) as u32);
            nodes.entry((level, cube)).or_default().push(at.map(|part| part * edge));
        }
    }
    // Each node has a parent, with or without points.
    for (level, cube) in nodes.keys().copied().collect::<Vec<_>>() {
        for up in 1..=level {
            nodes.entry((level - up, cube.map(|part| part >> up))).or_default();
        }
    }
    nodes
}

fn record(place: [i32; 3], at: &[f64; 3], edge: f64) -> [u8; RECORD] {
    let mut record = [0; RECORD];
    for (axis, part) in place.into_iter().enumerate() {
        record[4 * axis..4 * axis + 4].copy_from_slice(&part.to_le_bytes());
    }
    let shade = |part: f64| (257.0 * (255.0 * (part / edge).clamp(0.0, 1.0)).round()) as u16;
    let noise = ((place[0] ^ place[1]) % 977) as u16;
    record[12..14].copy_from_slice(&(noise * 50).to_le_bytes());
    record[14] = 0x11;
    record[16] = 2;
    record[17] = noise as u8;
    record[22..30].copy_from_slice(&(f64::from(place[0]) * 1e-3).to_le_bytes());
    for (channel, value) in [shade(at[0]), shade(at[1]), shade(8.0 * at[2])].into_iter().enumerate() {
        record[30 + 2 * channel..32 + 2 * channel].copy_from_slice(&value.to_le_bytes());
    }
    record
}

fn header(start: u32, evlr: u64, (points, scale, offset): (u64, f64, [f64; 3]), bounds: [[f64; 3]; 2]) -> Vec<u8> {
    let mut header = vec![0; 375];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, b"LASF");
    put(6, &16u16.to_le_bytes());
    put(24, &[1, 4]);
    put(94, &375u16.to_le_bytes());
    put(96, &start.to_le_bytes());
    put(100, &2u32.to_le_bytes());
    put(104, &[7 | 0x80]);
    put(105, &(RECORD as u16).to_le_bytes());
    for axis in 0..3 {
        put(131 + 8 * axis, &scale.to_le_bytes());
        put(155 + 8 * axis, &offset[axis].to_le_bytes());
        put(179 + 16 * axis, &bounds[1][axis].to_le_bytes());
        put(187 + 16 * axis, &bounds[0][axis].to_le_bytes());
    }
    put(235, &evlr.to_le_bytes());
    put(243, &1u32.to_le_bytes());
    put(247, &points.to_le_bytes());
    put(255, &points.to_le_bytes());
    header
}

/// The header of a record of COPC; extended ones have lengths of 64 bits.
fn record_header(id: u16, length: u64, extended: bool) -> Vec<u8> {
    named_header("copc", id, length, extended)
}

fn laszip_header(length: usize) -> Vec<u8> {
    named_header("laszip encoded", 22204, length as u64, false)
}

fn named_header(name: &str, id: u16, length: u64, extended: bool) -> Vec<u8> {
    let mut header = vec![0; 2];
    header.write_all(name.as_bytes()).unwrap();
    header.resize(18, 0);
    header.extend(id.to_le_bytes());
    match extended {
        true => header.extend(length.to_le_bytes()),
        false => header.extend((length as u16).to_le_bytes()),
    }
    header.resize(if extended { 60 } else { 54 }, 0);
    header
}
