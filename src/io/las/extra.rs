//! The record that names the bytes of points behind those of their format.

use las::raw::Vlr;

/// Whose record it is, and which.
const USER: &[u8] = b"LASF_Spec";
const EXTRA: u16 = 4;

/// Bytes of an entry, and where it has its type, its options and its name.
const ENTRY: usize = 192;
const KIND: usize = 2;
const OPTIONS: usize = 3;
const NAME: std::ops::Range<usize> = 4..36;

/// The names and the bytes of each attribute, in their order.
pub(super) fn names(record: &Vlr) -> Option<Vec<(String, u16)>> {
    let user = record.user_id.split(|byte| *byte == 0).next();
    if record.record_id != EXTRA || user != Some(USER) {
        return None;
    }
    let entry = |entry: &[u8; ENTRY]| {
        let name = entry[NAME].split(|byte| *byte == 0).next().unwrap_or_default();
        let name = String::from_utf8_lossy(name).trim().to_owned();
        (name, size(entry[KIND], entry[OPTIONS]))
    };
    Some(record.data.as_chunks().0.iter().map(entry).collect())
}

/// Bytes of a type: one to three numbers, or for 0 as many as the options say.
fn size(kind: u8, options: u8) -> u16 {
    const SIZES: [u16; 10] = [1, 1, 2, 2, 4, 4, 8, 8, 4, 8];
    match kind {
        0 => options.into(),
        1..=30 => SIZES[usize::from(kind - 1) % 10] * (1 + u16::from(kind - 1) / 10),
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn entries_are_named_and_measured() {
        let mut data = vec![0; 2 * ENTRY];
        (data[KIND], data[NAME.start]) = (9, b'A');
        (data[ENTRY + KIND], data[ENTRY + OPTIONS]) = (0, 5);
        let mut record = Vlr { user_id: [0; 16], record_id: EXTRA, data, ..Vlr::default() };
        assert_eq!(names(&record), None);
        record.user_id[..USER.len()].copy_from_slice(USER);
        assert_eq!(names(&record).unwrap(), [("A".to_owned(), 4), (String::new(), 5)]);
        assert_eq!([1, 10, 11, 23, 31].map(|kind| size(kind, 0)), [1, 8, 2, 6, 0]);
    }
}
