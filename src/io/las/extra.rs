//! The record that describes the extra bytes of points, which follow those of the point format.

use crate::io::attributes::{NORMAL, find_triple};
use las::raw::Vlr;

/// User and id of the record.
const USER: &[u8] = b"LASF_Spec";
const EXTRA: u16 = 4;

/// Size of an entry, bytes, and the offsets of its type, its options and its name.
const ENTRY: usize = 192;
const KIND: usize = 2;
const OPTIONS: usize = 3;
const NAME: std::ops::Range<usize> = 4..36;

/// An attribute among the extra bytes; only its first number is used.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Field {
    pub name: String,
    /// Offset within the extra bytes, bytes.
    pub start: usize,
    /// Size, bytes.
    pub size: u16,
    kind: u8,
    scale: f64,
    offset: f64,
}

/// Bits of an entry's options: it has a scale, it has an offset.
const HAS_SCALE: u8 = 1 << 3;
const HAS_OFFSET: u8 = 1 << 4;

/// Where the scale and the offset are in an entry, bytes.
const SCALE: usize = 112;
const OFFSET: usize = 136;

/// Parses the attributes that the record describes, in order; None for any other record.
pub(super) fn fields(record: &Vlr) -> Option<Vec<Field>> {
    let user = record.user_id.split(|byte| *byte == 0).next();
    if record.record_id != EXTRA || user != Some(USER) {
        return None;
    }
    let mut start = 0;
    let field = |entry: &[u8; ENTRY]| {
        let name = entry[NAME].split(|byte| *byte == 0).next().unwrap_or_default();
        let name = String::from_utf8_lossy(name).trim().to_owned();
        let (kind, options) = (entry[KIND], entry[OPTIONS]);
        let number = |at: usize| entry[at..].first_chunk().map_or(0.0, |bytes| f64::from_le_bytes(*bytes));
        let is = |option: u8| kind > 0 && options & option != 0;
        let scale = if is(HAS_SCALE) { number(SCALE) } else { 1.0 };
        let offset = if is(HAS_OFFSET) { number(OFFSET) } else { 0.0 };
        let field = Field { name, start, size: size(kind, options), kind, scale, offset };
        start += usize::from(field.size);
        field
    };
    Some(record.data.as_chunks().0.iter().map(field).collect())
}

impl Field {
    /// Whether the attribute is one number or several.
    pub fn is_number(&self) -> bool {
        (1..=30).contains(&self.kind)
    }

    /// The attribute's first number in a point's extra bytes; None if they are too short.
    pub fn number(&self, bytes: &[u8]) -> Option<f64> {
        macro_rules! number {
            ($type:ty) => {
                bytes.get(self.start..)?.first_chunk().map(|bytes| <$type>::from_le_bytes(*bytes) as f64)
            };
        }
        let value = match (self.kind.wrapping_sub(1) % 10) + 1 {
            _ if !self.is_number() => None,
            1 => number!(u8),
            2 => number!(i8),
            3 => number!(u16),
            4 => number!(i16),
            5 => number!(u32),
            6 => number!(i32),
            7 => number!(u64),
            8 => number!(i64),
            9 => number!(f32),
            10 => number!(f64),
            _ => None,
        };
        value.map(|value| value * self.scale + self.offset)
    }
}

/// The three attributes that are the components of normals. They follow the `own` bytes of the
/// point format.
#[derive(Clone, Debug)]
pub(super) struct Normals {
    own: usize,
    pub fields: [Field; 3],
}

impl Normals {
    /// Finds normals among `fields`, for a format of `own` bytes; None unless all three components
    /// exist and are numbers.
    pub fn of(fields: &[Field], own: u16) -> Option<Self> {
        let found = find_triple(NORMAL, fields.iter().map(|field| field.name.as_str()))?;
        let fields = found.map(|index| fields[index].clone());
        fields.iter().all(|field| (1..=10).contains(&field.kind)).then_some(Self { own: own.into(), fields })
    }

    /// The normal of a record; zero if the record is too short.
    pub fn of_record(&self, record: &[u8]) -> [f32; 3] {
        let bytes = record.get(self.own..).unwrap_or_default();
        [0, 1, 2].map(|axis: usize| self.fields[axis].number(bytes).unwrap_or(0.0) as f32)
    }
}

/// Size of an attribute, bytes: one to three numbers, or for type 0 as many bytes as the options
/// say.
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
        assert_eq!(fields(&record), None);
        record.user_id[..USER.len()].copy_from_slice(USER);
        let found: Vec<_> = fields(&record).unwrap().into_iter().map(|f| (f.name, f.start, f.size)).collect();
        assert_eq!(found, [("A".to_owned(), 0, 4), (String::new(), 4, 5)]);
        assert_eq!([1, 10, 11, 23, 31].map(|kind| size(kind, 0)), [1, 8, 2, 6, 0]);
    }
}
