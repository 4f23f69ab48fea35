//! Damaged LAS and LAZ files.

use super::las::{KINDS, file, point};
use super::las_forms::{pointwise, with_another_record};
use super::{Folder, Random, data, sentence};
use epsplat::io::{self, ReadOptions};

/// Offsets in the header of the legacy point count and of the point count of LAS 1.4.
const COUNT: usize = 107;
const LARGE_COUNT: usize = 247;

fn sample(kind: (u8, u8, bool)) -> Vec<u8> {
    file(kind.0, kind.1, kind.2, (0..60).map(|i| point(i, Some([i as u16, 3, 4]))))
}

#[test]
fn promises_of_the_header_are_held_against_the_file() {
    let folder = Folder::new();
    for kind in KINDS {
        for count in [61u32, 100_000, u32::MAX] {
            let mut bytes = sample(kind);
            // Point formats of LAS 1.4 have no legacy count.
            if kind.1 < 6 {
                bytes[COUNT..COUNT + 4].copy_from_slice(&count.to_le_bytes());
            } else {
                bytes[LARGE_COUNT..LARGE_COUNT + 8].copy_from_slice(&u64::from(count).to_le_bytes());
            }
            let message = folder.refusal("a.las", &bytes);
            let said = format!("the header promises {count} points, ");
            assert!(message.starts_with(&said), "{kind:?}: {message}");
            if !kind.2 || kind.0 == 4 {
                assert_eq!(message, format!("{said}the file ends after 60"), "{kind:?}");
            }
        }
        if kind.0 == 4 {
            let mut bytes = sample(kind);
            bytes[COUNT..COUNT + 4].fill(0);
            bytes[LARGE_COUNT..LARGE_COUNT + 8].copy_from_slice(&u64::MAX.to_le_bytes());
            let message = folder.refusal("a.las", &bytes);
            assert_eq!(message, format!("the header promises {} points, the file ends after 60", u64::MAX), "{kind:?}");
        }
    }
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    let folder = Folder::new();
    for kind in KINDS {
        let sample = sample(kind);
        for length in 0..sample.len() {
            let message = folder.refusal("a.laz", &sample[..length]);
            assert!(!message.contains("damaged"), "{kind:?} of {length} bytes: {message}");
        }
    }
}

#[test]
fn a_survey_cut_short_is_refused() {
    let folder = Folder::new();
    let whole = std::fs::read(data("autzen.laz")).unwrap();
    for length in (0..whole.len()).step_by(9973).chain(whole.len() - 40..whole.len()) {
        folder.refusal("a.laz", &whole[..length]);
    }
    let message = folder.refusal("a.laz", &whole[..300_000]);
    assert_eq!(message, "the header promises 110000 points, but the file ends at byte 300000, before its chunk table");
}

/// A count of 2^60 in a file of a kilobyte, and a plausible one: no memory is allocated for
/// promised points, and reading stops at the end of the data.
#[test]
fn promises_of_files_without_chunks_are_not_allocated() {
    let folder = Folder::new();
    let mut bytes = pointwise(&sample((4, 3, true)), 0);
    bytes[COUNT..COUNT + 4].fill(0);
    bytes[LARGE_COUNT..LARGE_COUNT + 8].copy_from_slice(&(1u64 << 60).to_le_bytes());
    let message = folder.refusal("a.laz", &bytes);
    let said = format!("the header promises {} points, more than a file of {} bytes can hold", 1u64 << 60, bytes.len());
    assert_eq!(message, said);
    bytes[LARGE_COUNT..LARGE_COUNT + 8].copy_from_slice(&100_000u64.to_le_bytes());
    let message = folder.refusal("a.laz", &bytes);
    assert!(message.starts_with("the header promises 100000 points, but decoding fails after 0"), "{message}");
}

/// A truncated file is refused, unless only trailing bytes that decode to nothing are missing.
#[test]
fn a_file_without_chunks_that_is_cut_is_refused() {
    let folder = Folder::new();
    let whole = pointwise(&sample((2, 3, true)), u32::MAX);
    let points = folder.read("a.laz", &whole).unwrap();
    for length in 0..whole.len() {
        match folder.read("a.laz", &whole[..length]) {
            Ok(cut) => assert!(cut == points && length + 4 > whole.len(), "{length} of {}", whole.len()),
            Err(error) => assert!(!sentence(&error, &folder.path("a.laz")).contains("damaged"), "{length}: {error}"),
        }
    }
}

#[test]
fn what_is_not_las_is_refused() {
    let folder = Folder::new();
    assert_eq!(folder.refusal("a.las", b""), "the file ends early");
    assert_eq!(folder.refusal("a.las", &[b'x'; 400]), "it is not a LAS file: it does not begin with 'LASF'");
}

#[test]
fn flipped_bytes_never_panic() {
    let folder = Folder::new();
    let mut random = Random(0x1a2);
    let path = folder.path("a.laz");
    let without_chunks = pointwise(&sample((2, 3, true)), 0);
    for sample in KINDS.into_iter().map(sample).chain([without_chunks]) {
        for _ in 0..200 {
            let mut bytes = sample.clone();
            for _ in 0..=random.below(3) {
                let at = random.below(bytes.len());
                bytes[at] = random.below(256) as u8;
            }
            if let Err(error) = folder.read("a.laz", &bytes) {
                sentence(&error, &path);
            }
        }
    }
}

#[test]
fn lengths_in_damaged_files_are_not_allocated() {
    let folder = Folder::new();
    // Each 32-bit word of a compressed file in turn becomes a value that would mean gigabytes of
    // points, layers, chunks or records.
    let copc = std::fs::read(data("simple.copc.laz")).unwrap();
    for sample in [sample((2, 3, true)), sample((4, 7, true)), pointwise(&sample((4, 3, true)), 0), copc] {
        for at in (90..sample.len() - 4).step_by(if sample.len() > 10_000 { 97 } else { 2 }) {
            let mut bytes = sample.clone();
            bytes[at..at + 4].copy_from_slice(&0x7fff_ff00u32.to_le_bytes());
            if let Err(error) = folder.read("a.laz", &bytes) {
                sentence(&error, &folder.path("a.laz"));
            }
        }
    }
    #[cfg(target_os = "linux")]
    {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let peak = status.lines().find(|line| line.starts_with("VmHWM")).unwrap();
        let kib: u64 = peak.split_whitespace().nth(1).unwrap().parse().unwrap();
        assert!(kib < 1 << 20, "{peak}");
    }
}

/// Eighteen bytes of GPS times make the decoder recurse some hundred thousand times (found by
/// fuzzing).
///
/// The recursion once overflowed the stack, which no error handling survives.
#[test]
fn a_deep_recursion_of_the_decoder_is_survived() {
    let message = Folder::new().refusal("deep.laz", include_bytes!("deep_gps_time.laz"));
    assert!(message.contains("decoding fails after 0"), "{message}");
}

/// Layered items in a file whose header denies layered chunks (found by fuzzing): the decoder once
/// trusted a layer size of 3 GB.
#[test]
fn layers_outside_chunks_of_layers_are_refused() {
    let message = Folder::new().refusal("layers.laz", include_bytes!("layers_outside_chunks.laz"));
    assert_eq!(message, "its LASzip record does not describe its points");
}

/// The LASzip record that is checked must be the one that the decoder uses. The decoder once used
/// another record, without items, and panicked.
#[test]
fn a_record_after_one_of_nearly_its_name_is_checked() {
    let message = Folder::new().refusal("a.laz", &with_another_record(&sample((2, 3, true))));
    assert_eq!(message, "its LASzip record does not describe its points");
}

/// Damage to a chunk loses at most that chunk. The file has three chunks of at most 50,000 points,
/// in which points are compressed one by one.
///
/// Such chunks have no checksum, so a damaged chunk may also be decoded to other points.
#[test]
fn a_chunk_that_cannot_be_decoded_is_left_out_and_told() {
    let folder = Folder::new();
    let path = folder.path("a.laz");
    let whole = std::fs::read(data("autzen.laz")).unwrap();
    let points = io::read(&data("autzen.laz"), &()).unwrap();
    let start = u32::from_le_bytes(*whole[96..].first_chunk().unwrap()) as usize;
    let table = u64::from_le_bytes(*whole[start..].first_chunk().unwrap()) as usize;
    let (mut told_of, mut random) = (0, Random(0xc4a));
    for round in 0..8 {
        let mut bytes = whole.clone();
        let at = start + 8 + (table - start - 8) * (2 * round + 1) / 16;
        let length = [4000, 40_000][round % 2].min(table - at);
        bytes[at..at + length].iter_mut().for_each(|byte| *byte = random.below(256) as u8);
        let read = folder.read("a.laz", &bytes).unwrap();
        let (strict, lost) = (ReadOptions { strict: true, ..ReadOptions::default() }, 110_000 - read.positions.len());
        assert_eq!(io::read_with(&path, strict, &()).is_err(), lost > 0, "{round}");
        assert!([0, 10_000, 50_000, 60_000, 100_000].contains(&lost), "{round}: {lost}");
        assert_eq!(read.unread.len(), usize::from(lost > 0));
        if let [told] = &read.unread[..] {
            assert!(told.contains(" of 3 chunks left out") && told.contains(&format!("with {lost} points")), "{told}");
            told_of += 1;
            // The first chunk is unchanged if it was not damaged.
            let numbers = read.numbers.as_ref().unwrap();
            let same = |(number, at): (&u32, &[f64; 3])| points.positions[*number as usize] == *at;
            let first = numbers.iter().zip(&read.positions).take_while(|(number, _)| **number < 50_000);
            assert!(round < 4 || first.clone().count() == 50_000 && first.clone().all(same), "{round}");
        }
    }
    assert!(told_of >= 3, "{told_of} of 8 chunks could not be decoded");
}
