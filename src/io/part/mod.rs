//! Files of parts: values of pixels that one of several processes leaves for the others.
//!
//! All numbers are little-endian.
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 8 | `epsplatP` |
//! | 8 | 4 | version of this layout, [`VERSION`] |
//! | 12 | 4 | length H of the header, bytes |
//! | 16 | 8 | length of the file, bytes |
//! | 24 | H | header: what the values belong to, as CBOR (RFC 8949) |
//! | 24 + H | | [sections](Section), one after the other |
//! | last 4 | 4 | CRC-32 (that of ZIP and PNG) of all bytes before |
//!
//! A section begins with 28 bytes, and its runs follow ([`runs`]).
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 1 | [`Values`]: 0 triangles, 1 nearest depths, 2 sums |
//! | 1 | 1 | bytes of each value, 1 to 8 |
//! | 2 | 2 | values of each sample |
//! | 4 | 4 | number of the render that the values belong to |
//! | 8 | 4 | columns of that render, samples |
//! | 12 | 4 | first row of the section, samples |
//! | 16 | 4 | rows of the section, samples |
//! | 20 | 8 | length of the runs, bytes |
//!
//! The header belongs to one version of epsplat, and no other version reads it.

pub mod runs;

use std::ops::Range;

/// The version of the layout.
pub const VERSION: u32 = 1;

const MAGIC: &[u8; 8] = b"epsplatP";
const START: usize = 24;
const SECTION: usize = 28;
const CHECKSUM: usize = 4;

/// The kind of values in a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Values {
    /// Shaded triangles: 8 words of 32 bits, all 0 where no triangle shows.
    Triangles,
    /// The nearest depth, stored as bits(+inf) - bits(depth): 0 is nothing.
    Nearest,
    /// Integer sums.
    Sums,
}

impl Values {
    const ALL: [Self; 3] = [Self::Triangles, Self::Nearest, Self::Sums];

    /// The value that several parts have together: the nearest depth is the greatest word.
    pub fn reduced(self, one: u64, other: u64) -> u64 {
        match self {
            Self::Sums => one.wrapping_add(other),
            Self::Nearest | Self::Triangles => one.max(other),
        }
    }
}

/// Values of some rows of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// The kind of values.
    pub values: Values,
    /// Number of the render that they belong to.
    pub render: u32,
    /// Columns of that render, samples.
    pub width: u32,
    /// The first row, samples.
    pub first: u32,
    /// Number of rows, samples.
    pub rows: u32,
    /// Values of each sample.
    pub each: u16,
    /// Bytes of each value, 1 to 8.
    bytes: u8,
    /// The runs ([`runs`]).
    runs: Vec<u8>,
}

impl Section {
    /// A section of `all` values, `each` for each sample.
    pub fn new(
        values: Values,
        render: u32,
        (width, first, rows): (u32, u32, u32),
        each: u16,
        all: impl Fn(Range<usize>) -> Vec<u64>,
    ) -> Self {
        let (bytes, runs) = runs::encoded(width as usize * rows as usize, each.into(), all);
        Self { values, render, width, first, rows, each, bytes, runs }
    }

    /// The range of its samples among those of the render.
    pub fn samples(&self) -> Range<usize> {
        let [width, first, rows] = [self.width, self.first, self.rows].map(|n| n as usize);
        width * first..width * (first + rows)
    }

    /// Combines the values of the `samples` of the render with those in `all`, which begin at the
    /// first of these samples.
    ///
    /// # Errors
    /// A sentence if the runs are damaged.
    pub fn reduce(&self, samples: Range<usize>, all: &mut [u64]) -> Result<(), String> {
        let (each, own) = (usize::from(self.each), self.samples());
        if own.end <= samples.start || samples.end <= own.start {
            return Ok(());
        }
        let size = each * usize::from(self.bytes);
        runs::filled(&self.runs, own.len(), size, |at, bytes| {
            let at = own.start + at;
            let skipped = samples.start.saturating_sub(at).saturating_mul(size);
            let Some(bytes) = bytes.get(skipped..) else { return };
            let Some(into) = all.get_mut(at.saturating_sub(samples.start) * each..) else { return };
            let values = bytes.chunks_exact(self.bytes.into()).map(runs::value);
            into.iter_mut().zip(values).for_each(|(all, own)| *all = self.values.reduced(*all, own));
        })
    }

    /// Checks that the runs cover the section's samples, and that each value fits its kind.
    ///
    /// # Errors
    /// A sentence if they do not.
    pub fn check(&self) -> Result<(), String> {
        let size = usize::from(self.each) * usize::from(self.bytes);
        if self.values != Values::Sums && self.bytes > 4 {
            return Err("its values are larger than any: draw the part again".into());
        }
        runs::filled(&self.runs, self.samples().len(), size, |_, _| {})
    }

    fn write(&self, into: &mut Vec<u8>) {
        into.extend([self.values as u8, self.bytes]);
        into.extend(self.each.to_le_bytes());
        [self.render, self.width, self.first, self.rows].iter().for_each(|word| into.extend(word.to_le_bytes()));
        into.extend((self.runs.len() as u64).to_le_bytes());
        into.extend(&self.runs);
    }

    /// Reads the section at the start of `bytes`, and returns it with the bytes behind it.
    fn read(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let (head, rest) = bytes.split_at_checked(SECTION)?;
        let word = |at: usize| Some(u32::from_le_bytes(head.get(at..at + 4)?.try_into().ok()?));
        let len = u64::from_le_bytes(head.get(20..28)?.try_into().ok()?);
        let (runs, rest) = rest.split_at_checked(usize::try_from(len).ok()?)?;
        let section = Self {
            values: *Values::ALL.get(usize::from(*head.first()?))?,
            bytes: *head.get(1)?,
            each: u16::from_le_bytes(head.get(2..4)?.try_into().ok()?),
            render: word(4)?,
            width: word(8)?,
            first: word(12)?,
            rows: word(16)?,
            runs: runs.to_vec(),
        };
        let sound = (1..=8).contains(&section.bytes)
            && section.each > 0
            && section.first.checked_add(section.rows).is_some_and(|end| end <= MOST_SIDE)
            && section.width <= MOST_SIDE;
        sound.then_some((section, rest))
    }
}

/// The most rows or columns of samples.
const MOST_SIDE: u32 = crate::scene::camera::MAX_SIDE;

/// The content of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Content {
    /// The header's bytes.
    pub header: Vec<u8>,
    /// The sections.
    pub sections: Vec<Section>,
}

impl Content {
    /// The bytes of the file.
    pub fn encoded(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((self.header.len() as u32).to_le_bytes());
        bytes.extend([0; 8]);
        bytes.extend(&self.header);
        self.sections.iter().for_each(|section| section.write(&mut bytes));
        let len = (bytes.len() + CHECKSUM) as u64;
        bytes[16..START].copy_from_slice(&len.to_le_bytes());
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        bytes
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// A sentence that says how the bytes differ from those of a file.
    pub fn decoded(bytes: &[u8]) -> Result<Self, String> {
        if !bytes.starts_with(MAGIC) {
            let whole = bytes.len() >= MAGIC.len() || !MAGIC.starts_with(bytes) || bytes.is_empty();
            return Err(if whole {
                "it is no part of a picture: name files of render --part".into()
            } else {
                ended(bytes.len(), START)
            });
        }
        let word = |at: usize| bytes.get(at..at + 4).and_then(|word| Some(u32::from_le_bytes(word.try_into().ok()?)));
        let len = bytes.get(16..START).and_then(|word| Some(u64::from_le_bytes(word.try_into().ok()?)));
        let (Some(version), Some(header), Some(len)) = (word(8), word(12), len) else {
            return Err(ended(bytes.len(), START));
        };
        if version != VERSION {
            return Err(format!("its layout has version {version}, and this epsplat reads {VERSION}: draw it again"));
        }
        if (bytes.len() as u64) < len {
            return Err(ended(bytes.len(), len));
        }
        let damaged = || "its checksum is wrong, so the file is damaged: draw the part again".to_owned();
        let (body, sum) = bytes.split_last_chunk::<CHECKSUM>().ok_or_else(damaged)?;
        if bytes.len() as u64 != len || crc32fast::hash(body) != u32::from_le_bytes(*sum) {
            return Err(damaged());
        }
        let (header, mut rest) = body[START..].split_at_checked(header as usize).ok_or_else(damaged)?;
        let mut sections = Vec::new();
        while !rest.is_empty() {
            let (section, behind) = Section::read(rest).ok_or_else(damaged)?;
            sections.push(section);
            rest = behind;
        }
        Ok(Self { header: header.to_vec(), sections })
    }
}

fn ended(len: usize, of: impl std::fmt::Display) -> String {
    format!("it ends after {len} of {of} bytes: draw the part again, or copy it again")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::Random;

    fn below(random: &mut Random, count: usize) -> usize {
        (random.number() * count as f64) as usize
    }

    fn bits(random: &mut Random) -> u64 {
        let half = |random: &mut Random| (random.number() * 2f64.powi(32)) as u64;
        half(random) << 32 | half(random)
    }

    /// A file with sections of every kind, and their values.
    fn content(random: &mut Random) -> (Content, Vec<Vec<u64>>) {
        let (mut sections, mut all) = (Vec::new(), Vec::new());
        for (number, values) in Values::ALL.into_iter().enumerate() {
            let (width, rows, each) =
                (1 + below(random, 9) as u32, below(random, 7) as u32, 1 + below(random, 4) as u16);
            let most = 1 + below(random, 64) as u32;
            let mut of = vec![0; (width * rows) as usize * usize::from(each)];
            for sample in of.chunks_mut(each.into()) {
                if below(random, 3) == 0 {
                    for value in sample {
                        *value = bits(random) >> (64 - most);
                    }
                }
            }
            let taken =
                |range: Range<usize>| of[range.start * usize::from(each)..range.end * usize::from(each)].to_vec();
            sections.push(Section::new(values, number as u32, (width, 3, rows), each, taken));
            all.push(of);
        }
        (Content { header: vec![7; below(random, 40)], sections }, all)
    }

    #[test]
    fn what_is_written_is_read() {
        let random = &mut Random::stream(5, 0);
        for _ in 0..200 {
            let (content, all) = content(random);
            let read = Content::decoded(&content.encoded()).unwrap();
            assert_eq!(read, content);
            for (section, values) in read.sections.iter().zip(all) {
                let each = usize::from(section.each);
                // Any range of the render, before, across and behind the section.
                let end = section.samples().end + 5;
                let from = below(random, end);
                let range = from..from + below(random, end - from + 1);
                let mut got = vec![0; range.len() * each];
                section.reduce(range.clone(), &mut got).unwrap();
                let expected = range.flat_map(|sample| {
                    let at = sample.checked_sub(section.samples().start).filter(|at| (at + 1) * each <= values.len());
                    at.map_or(vec![0; each], |at| values[at * each..(at + 1) * each].to_vec())
                });
                assert_eq!(got, expected.collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn empty_rows_cost_nothing() {
        let one = |sample: usize| move |range: Range<usize>| range.map(|at| u64::from(at == sample)).collect();
        let size = |rows: u32| Section::new(Values::Nearest, 0, (1000, 0, rows), 1, one(5)).runs.len();
        assert!(size(100_000) <= size(10) + 3 && size(10) < 10, "{} {}", size(10), size(100_000));
    }

    #[test]
    fn damaged_bytes_are_refused() {
        let bytes = content(&mut Random::stream(8, 0)).0.encoded();
        for len in 0..bytes.len() {
            let error = Content::decoded(&bytes[..len]).unwrap_err();
            assert!(len == 0 || error.starts_with("it ends after"), "{len}: {error}");
        }
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut other = bytes.clone();
                other[at] ^= 1 << bit;
                assert!(Content::decoded(&other).is_err(), "{at} {bit}");
            }
        }
        assert!(Content::decoded(&[&bytes[..], &[0]].concat()).is_err());
    }

    /// A file whose checksum is right may still have any bytes: reading it never panics, and its
    /// sections are within limits.
    #[test]
    fn any_bytes_with_a_right_checksum_are_read_or_refused() {
        let random = &mut Random::stream(9, 0);
        let mut read = 0;
        for _ in 0..20_000 {
            let mut bytes = content(random).0.encoded();
            for _ in 0..1 + below(random, 3) {
                let at = below(random, bytes.len());
                bytes[at] = bits(random) as u8;
            }
            let body = bytes.len() - CHECKSUM;
            let sum = crc32fast::hash(&bytes[..body]);
            bytes[body..].copy_from_slice(&sum.to_le_bytes());
            let Ok(content) = Content::decoded(&bytes) else { continue };
            for section in &content.sections {
                read += 1;
                let mut all = vec![0; 64];
                let _ = section.reduce(0..64 / usize::from(section.each), &mut all);
            }
        }
        assert!(read > 1000, "{read}");
    }
}
