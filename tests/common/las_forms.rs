//! LAS and LAZ files in variants that the `las` crate does not write.

#![allow(dead_code)]

/// Returns the offset of the LASzip record's data.
pub fn laszip_record(bytes: &[u8]) -> usize {
    bytes.windows(14).position(|window| window == b"laszip encoded").unwrap() + 52
}

/// A LAZ file as LASzip wrote it before it had chunks: one chunk without a chunk table. The input
/// has at most 50,000 points.
pub fn pointwise(bytes: &[u8], chunk_size: u32) -> Vec<u8> {
    let start = u32::from_le_bytes(*bytes[96..].first_chunk().unwrap()) as usize;
    let table = u64::from_le_bytes(*bytes[start..].first_chunk().unwrap()) as usize;
    let mut pointwise = [&bytes[..start], &bytes[start + 8..table]].concat();
    let record = laszip_record(bytes);
    pointwise[record] = 1;
    pointwise[record + 12..record + 16].copy_from_slice(&chunk_size.to_le_bytes());
    pointwise
}

/// The same file as LAS 1.5, whose header is 18 bytes longer. `bytes` is LAS 1.4 with legacy and
/// 64-bit point counts.
pub fn of_las_1_5(bytes: &[u8]) -> Vec<u8> {
    let longer = |bytes: &mut Vec<u8>, at: usize| {
        let place = u32::from_le_bytes(*bytes[at..].first_chunk().unwrap()) + 18;
        bytes[at..at + 4].copy_from_slice(&place.to_le_bytes());
    };
    let times = [9.0f64.to_le_bytes(), 1.0f64.to_le_bytes()].concat();
    let mut newer = [&bytes[..375], &times, &[0; 2], &bytes[375..]].concat();
    newer[25] = 5;
    newer[94..96].copy_from_slice(&393u16.to_le_bytes());
    longer(&mut newer, 96);
    if newer[104] & 0x80 != 0 {
        let start = u32::from_le_bytes(*newer[96..].first_chunk().unwrap()) as usize;
        longer(&mut newer, start);
    }
    // LAS 1.5 ignores the legacy point counts, so they are filled with garbage.
    newer[107..131].fill(7);
    newer
}

/// A compressed file with two LASzip records: a decoy, whose name differs by one letter, and behind
/// it the real one, with no items.
pub fn with_another_record(bytes: &[u8]) -> Vec<u8> {
    let data = laszip_record(bytes);
    let length = 54 + usize::from(u16::from_le_bytes([bytes[data - 34], bytes[data - 33]]));
    let end = data - 54 + length;
    let mut twice = [&bytes[..end], &bytes[data - 54..]].concat();
    twice[data - 52 + 14] = b'x';
    twice[data + length + 32] = 0;
    twice[100] += 1;
    let start = u32::from_le_bytes(*bytes[96..].first_chunk().unwrap()) as usize + length;
    twice[96..100].copy_from_slice(&(start as u32).to_le_bytes());
    let table = u64::from_le_bytes(*twice[start..].first_chunk().unwrap()) + length as u64;
    twice[start..start + 8].copy_from_slice(&table.to_le_bytes());
    twice
}
