//! Fuzzes COPC files of which only some nodes are read.

use std::path::Path;

use epsplat::io::las::Copc;
use epsplat::io::{Input, ReadOptions};

use super::mutate::Grammar;
use super::random::Random;
use super::session::sentence;
use super::{Outcome, Target, las};

pub const TARGET: Target = Target {
    name: "copc",
    extension: "laz",
    generate,
    grammar: Grammar {
        words: &["LASF", "copc", "laszip encoded", "\0\0\0\0", "\u{ff}\u{ff}"],
        separators: b"",
        text: 0,
        numbers,
    },
    execute,
};

static FILE: &[u8] = include_bytes!("../../data/simple.copc.laz");

/// Offsets and sizes of the numbers in the header, in the COPC info record and in the octree's
/// pages.
fn numbers(bytes: &[u8]) -> Vec<(usize, usize)> {
    let mut places = las::numbers(bytes);
    places.extend((0..10).map(|k| (429 + 8 * k, 8)));
    if let Some(start) = bytes.get(469..477).and_then(|start| start.first_chunk()) {
        let start = usize::try_from(u64::from_le_bytes(*start)).unwrap_or(usize::MAX);
        // An entry of a node: level and position, offset and bytes of its chunk, number of points.
        let of_node = |node: usize| {
            [(0, 4), (4, 4), (8, 4), (12, 4), (16, 8), (24, 4), (28, 4)].map(|(at, size)| (32 * node + at, size))
        };
        places.extend((0..64).flat_map(of_node).map(|(at, size)| (start.saturating_add(at), size)));
    }
    places.retain(|&(at, size)| at.checked_add(size).is_some_and(|end| end <= bytes.len()));
    places
}

fn generate(_: &mut Random) -> (Vec<u8>, usize) {
    (FILE.to_vec(), 1065)
}

/// Reads every other node, then all nodes.
fn execute(path: &Path, valid: Option<usize>) -> Result<Outcome, String> {
    let refused = |error: epsplat::Error| match valid {
        Some(_) => Err(format!("a valid file is refused: {error}")),
        None => sentence(&error, Some(path)).map(|()| Outcome::Refused),
    };
    let mut file = match Input::open(path, None).and_then(Copc::open) {
        Ok(Some(file)) => file,
        Ok(None) if valid.is_some() => return Err("a valid file is no COPC".into()),
        Ok(None) => return Ok(Outcome::Read),
        Err(error) => return refused(error),
    };
    let all: Vec<usize> = (0..file.octree.nodes.len()).collect();
    let some: Vec<usize> = all.iter().copied().step_by(2).collect();
    let mut counts = Vec::new();
    for nodes in [&some, &all] {
        let promised = file.octree.points(nodes);
        match file.read_raw(nodes, &ReadOptions::default(), &()) {
            Ok(points) if points.positions.len() as u64 > promised => {
                return Err(format!("{} points are read, but the nodes promise {promised}", points.positions.len()));
            }
            Ok(points) => counts.push(points.positions.len()),
            Err(error) => return refused(error),
        }
    }
    if valid.is_some_and(|valid| counts[1] != valid || counts[0] >= counts[1]) {
        return Err(format!("a valid file has {counts:?} points"));
    }
    Ok(Outcome::Drawn)
}
