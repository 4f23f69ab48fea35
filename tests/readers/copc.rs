//! COPC files that are read by octree nodes, compared with a read of the whole file.

use super::{Folder, Random, data, sentence};
use epsplat::io::las::Copc;
use epsplat::io::{self, Input, ReadOptions};
use epsplat::low_level::scene::Colors;
use std::collections::BTreeSet;
use std::path::Path;

/// Offset of the COPC info record and, in it, of the root page's position.
const INFO: usize = 375 + 54;
const ROOT: usize = INFO + 40;

fn bytes() -> Vec<u8> {
    std::fs::read(data("simple.copc.laz")).unwrap()
}

fn open(path: &Path) -> Result<Option<Copc>, epsplat::Error> {
    Copc::open(Input::open(path, None).unwrap())
}

/// Offset of the octree's first page.
fn page(bytes: &[u8]) -> usize {
    u64::from_le_bytes(*bytes[ROOT..].first_chunk().unwrap()) as usize
}

/// The error on opening these bytes or on reading all their nodes.
fn refusal(folder: &Folder, bytes: &[u8]) -> String {
    let path = folder.path("a.copc.laz");
    std::fs::write(&path, bytes).unwrap();
    let read = open(&path).and_then(|copc| {
        let mut copc = copc.unwrap();
        let all: Vec<usize> = (0..copc.octree.nodes.len()).collect();
        copc.read(&all, &ReadOptions { strict: true, ..ReadOptions::default() }, &())
    });
    sentence(&read.unwrap_err(), &path)
}

#[test]
fn all_nodes_are_the_file() {
    let mut copc = open(&data("simple.copc.laz")).unwrap().unwrap();
    let all: Vec<usize> = (0..copc.octree.nodes.len()).rev().collect();
    for rules in ["", "2:0", "5:0.5"] {
        let classes = if rules.is_empty() { Default::default() } else { rules.parse().unwrap() };
        let options = ReadOptions { classes, ..ReadOptions::default() };
        let whole = io::read_with(&data("simple.copc.laz"), options.clone(), &()).unwrap();
        let mut read = copc.read(&all, &options, &()).unwrap();
        // Point numbers replace the list of points that were left out.
        let left_out: BTreeSet<u64> = whole.left_out.iter().copied().collect();
        let kept = (0..1065).filter(|number| !left_out.contains(number)).map(|number| number as u32);
        assert_eq!(read.numbers.take().unwrap(), kept.collect::<Vec<_>>());
        assert_eq!((left_out.is_empty(), read.left_out.len()), (rules != "2:0", 0));
        assert_eq!(read, io::Points { left_out: Vec::new(), ..whole });
    }
    assert_eq!((copc.count(), copc.octree.levels(), copc.octree.nodes.len()), (1065, 4, 65));
    // Point numbers are those of the file, even with some nodes only and some points left out.
    let whole = io::read(&data("simple.copc.laz"), &()).unwrap();
    let options = ReadOptions { classes: "2:0".parse().unwrap(), ..ReadOptions::default() };
    let some = copc.read(&[3, 10, 40, 64], &options, &()).unwrap();
    let numbers = some.numbers.unwrap();
    assert!(some.unseen > 0 && numbers.len() > 10 && numbers.len() == some.positions.len());
    let of_file = numbers.iter().map(|&number| whole.positions[number as usize]);
    assert!(of_file.eq(some.positions.iter().copied()));
}

#[test]
fn some_nodes_are_their_points() {
    let mut copc = open(&data("simple.copc.laz")).unwrap().unwrap();
    let whole = io::read(&data("simple.copc.laz"), &()).unwrap();
    let (Some(Colors::Srgb8(colors)), octree) = (&whole.colors, copc.octree.clone()) else { panic!() };
    let mut numbers = BTreeSet::new();
    for (index, node) in octree.nodes.iter().enumerate() {
        let read = copc.read(&[index], &ReadOptions::default(), &()).unwrap();
        assert_eq!(read.positions.len() as u64, node.points);
        let Some(Colors::Srgb8(own)) = read.colors else { panic!() };
        let edge = 2.0 * octree.half / f64::from(1u32 << node.level);
        for ((number, position), color) in read.numbers.unwrap().into_iter().zip(read.positions).zip(own) {
            assert_eq!((position, color), (whole.positions[number as usize], colors[number as usize]));
            assert!(numbers.insert(number));
            // Each point lies in its node's cube.
            let low = octree.center - octree.half + edge * glam::DVec3::from_array(node.place.map(f64::from));
            let within = glam::DVec3::from_array(position) - low;
            assert!(
                within.cmpge(glam::DVec3::splat(-0.01)).all() && within.cmple(glam::DVec3::splat(edge + 0.01)).all()
            );
        }
    }
    assert_eq!(numbers.len(), 1065);
    assert_eq!(copc.read(&[], &ReadOptions::default(), &()).unwrap().positions.len(), 0);
}

#[test]
fn other_files_are_none() {
    // Files too short to contain the COPC record, with any length.
    let folder = Folder::new();
    for length in [0, 4, 374, 375, 380, 393, 395, 429] {
        let path = folder.path("a.laz");
        std::fs::write(&path, vec![0; length]).unwrap();
        assert!(open(&path).unwrap().is_none(), "{length}");
    }
    assert!(open(&data("autzen.laz")).unwrap().is_none() && open(&data("bunny.obj")).unwrap().is_none());
}

#[test]
fn octrees_that_are_none_are_told() {
    let (folder, whole) = (Folder::new(), bytes());
    let page = page(&whole);
    let with = |at: usize, value: &[u8]| {
        let mut bytes = whole.clone();
        bytes[at..at + value.len()].copy_from_slice(value);
        refusal(&folder, &bytes)
    };
    let (word, entry) = (|value: i32| value.to_le_bytes(), |k: usize| page + 32 * k);
    for (message, said) in [
        (with(INFO + 24, &f64::NAN.to_le_bytes()), "has no valid centre, size or spacing"),
        (with(INFO + 32, &0f64.to_le_bytes()), "has no valid centre, size or spacing"),
        (with(ROOT, &u64::MAX.to_le_bytes()), "does not fit in the file"),
        (with(ROOT + 8, &(1u64 << 40).to_le_bytes()), "does not fit in the file"),
        (with(ROOT + 8, &33u64.to_le_bytes()), "does not fit in the file"),
        (with(ROOT + 8, &64u64.to_le_bytes()), "its octree has 43 points, and its header promises 1065"),
        (with(entry(0), &word(-1)), "node -1-0-0-0 of its octree has an invalid position or size"),
        (with(entry(0), &word(1_000_000)), "node 1000000-0-0-0 lies outside"),
        (with(entry(0) + 4, &word(1)), "node 0-1-0-0 lies outside"),
        (with(entry(1) + 4, &word(1)), "node 1-1-0-0 is twice"),
        (with(entry(1), &word(2)), "node 2-0-0-0 is twice"),
        (with(entry(0), &word(5)), "has no parent"),
        (with(entry(3) + 28, &word(-2)), "node 3-0-0-0 of its octree has -2 points"),
        (with(entry(3) + 28, &word(0x7fff_ffff)), "do not fit in the file"),
        (with(entry(3) + 16, &(1u64 << 60).to_le_bytes()), "do not fit in the file"),
        (with(entry(3) + 24, &word(10)), "do not fit in the file"),
        (with(entry(3) + 16, &28853u64.to_le_bytes()), "overlap in the file"),
        // A page that refers to itself.
        (
            with(entry(0) + 16, &[&(page as u64).to_le_bytes()[..], &word(2080), &word(-1)].concat()),
            "node 1-0-0-0 is twice",
        ),
        // One point more in a node; in the next test another node has one less.
        (with(entry(3) + 28, &[&word(18)[..]].concat()), "its octree has 1066 points"),
    ] {
        assert!(message.contains(said), "{message}");
    }
    let mut swapped = whole.clone();
    swapped[entry(3) + 28..entry(3) + 32].copy_from_slice(&word(18));
    swapped[entry(4) + 28..entry(4) + 32].copy_from_slice(&word(13));
    let message = refusal(&folder, &swapped);
    assert_eq!(message, "a node of its octree has 17 points, not the 18 that it promises");
    // A truncated file whose octree page is missing.
    assert!(refusal(&folder, &whole[..30_000]).contains("2080 bytes at byte 31604, does not fit in the file"));
}

#[test]
fn damaged_nodes_are_survived() {
    let (folder, whole) = (Folder::new(), bytes());
    let path = folder.path("a.copc.laz");
    let mut random = Random(0x5b1);
    let look = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        let Ok(Some(mut copc)) = open(&path).map_err(|error| sentence(&error, &path)) else { return };
        let all: Vec<usize> = (0..copc.octree.nodes.len()).collect();
        if let Err(error) = copc.read(&all, &ReadOptions::default(), &()) {
            sentence(&error, &path);
        }
    };
    // Each 32-bit word in turn becomes a value that would mean gigabytes of points, layers or
    // records.
    for at in (90..whole.len() - 4).step_by(151) {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&0x7fff_ff00u32.to_le_bytes());
        look(&bytes);
    }
    for _ in 0..100 {
        let mut bytes = whole.clone();
        for _ in 0..=random.below(3) {
            let at = random.below(bytes.len());
            bytes[at] = random.below(256) as u8;
        }
        look(&bytes);
    }
}

/// The file with layer sizes in some nodes that exceed their chunks.
fn with_broken(nodes: &[usize]) -> Vec<u8> {
    let mut bytes = bytes();
    let record = usize::from(u16::from_le_bytes(*bytes[105..].first_chunk().unwrap()));
    let copc = open(&data("simple.copc.laz")).unwrap().unwrap();
    let page = page(&bytes);
    let place =
        |entry: usize, word: usize| i32::from_le_bytes(*bytes[page + 32 * entry + 4 * word..].first_chunk().unwrap());
    let offsets: Vec<usize> = nodes
        .iter()
        .map(|&node| {
            let (level, [x, y, z]) = copc.octree.nodes[node].key();
            let own = [level, x, y, z].map(|number| number as i32);
            let entry = (0..65).find(|&entry| own == [0, 1, 2, 3].map(|word| place(entry, word))).unwrap();
            u64::from_le_bytes(*bytes[page + 32 * entry + 16..].first_chunk().unwrap()) as usize
        })
        .collect();
    for offset in offsets {
        let at = offset + record + 4;
        bytes[at..at + 4].copy_from_slice(&0x7fff_ff00u32.to_le_bytes());
    }
    bytes
}

/// Broken nodes are left out and reported, whether the file is read by nodes or as a whole; the
/// other nodes are unchanged.
#[test]
fn broken_nodes_are_left_out_and_the_rest_is_read() {
    let folder = Folder::new();
    let path = folder.path("a.copc.laz");
    let whole = open(&data("simple.copc.laz")).unwrap().unwrap();
    let (all, whole_file) = ((0..65).collect::<Vec<_>>(), io::read(&data("simple.copc.laz"), &()).unwrap());
    for broken in [&[3usize][..], &[0], &[64], &[7, 8, 9], &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]] {
        let broken: Vec<usize> = broken.iter().copied().filter(|&node| whole.octree.nodes[node].points > 0).collect();
        let lost: u64 = broken.iter().map(|&node| whole.octree.nodes[node].points).sum();
        std::fs::write(&path, with_broken(&broken)).unwrap();
        let mut copc = open(&path).unwrap().unwrap();
        let read = copc.read(&all, &ReadOptions::default(), &()).unwrap();
        let by_chunks = io::read(&path, &()).unwrap();
        for (points, kind) in [(&read, "nodes"), (&by_chunks, "chunks")] {
            assert_eq!(points.positions.len() as u64, 1065 - lost, "{broken:?}");
            let numbers = points.numbers.as_ref().unwrap().iter();
            let expected = numbers.map(|&number| whole_file.positions[number as usize]);
            assert!(expected.eq(points.positions.iter().copied()), "{broken:?} {kind}");
            let [told] = &points.unread[..] else { panic!("{:?}", points.unread) };
            let count = broken.len();
            assert!(told.contains(&format!("a.copc.laz: {count} of ")), "{told}");
            assert!(told.contains(&format!("{kind} left out, with {lost} points: ")), "{told}");
            let is_named = |node: &&usize| told.contains(&format!("node {}: ", whole.octree.nodes[**node].name()));
            assert!(kind == "chunks" || broken.iter().filter(is_named).count() == count.min(8), "{told}");
            assert_eq!(told.contains("; and "), count > 8, "{told}");
        }
        let strict = ReadOptions { strict: true, ..ReadOptions::default() };
        assert!(copc.read(&all, &strict, &()).is_err() && io::read_with(&path, strict, &()).is_err());
        // If all requested nodes are broken, that is an error.
        sentence(&copc.read(&broken, &ReadOptions::default(), &()).unwrap_err(), &path);
    }
}
