//! The header of a PCD file: the fields of a point, the number of points, and their encoding.

use std::io::{BufRead, Read};
use std::str::{FromStr, SplitAsciiWhitespace};

use crate::io::fault::Fault;
use crate::io::values::{line_end, shown};

/// The longest header line, in bytes.
const LINE_LIMIT: u64 = 1 << 16;

/// The encoding of the points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Data {
    Ascii,
    Binary,
    Compressed,
}

/// The type of a field's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    Signed,
    Unsigned,
    Float,
}

/// A field of a point: `count` numbers of `size` bytes.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    pub(super) size: u64,
    pub(super) count: u64,
}

/// The header of a PCD file.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) fields: Vec<Field>,
    pub(super) points: u64,
    /// Width and height of an organised cloud.
    pub(super) image: Option<[u64; 2]>,
    pub(super) data: Data,
    /// Bytes per point.
    pub(super) row: u64,
    /// The number of lines of the header, and of its bytes.
    pub(super) lines: u64,
    pub(super) bytes: u64,
    /// The byte that ends a line: `\n` or `\r`.
    pub(super) line_end: u8,
}

/// Reads the header up to and including the line `DATA`.
pub(super) fn read(reader: &mut impl BufRead) -> Result<Header, Fault> {
    let line_end = line_end(reader)?;
    let mut raw = Raw::default();
    let (mut line, mut bytes) = (Vec::new(), 0);
    for number in 1.. {
        line.clear();
        bytes += reader.take(LINE_LIMIT).read_until(line_end, &mut line)? as u64;
        let complete = line.last() == Some(&line_end);
        let text = String::from_utf8_lossy(&line);
        let mut words = text.split_ascii_whitespace();
        // Keywords may be upper or lower case.
        let keyword = words.next().map(str::to_ascii_uppercase);
        let keyword = keyword.as_deref();
        // The last line of a file without points may lack its line end.
        if !complete && keyword != Some("DATA") {
            return Err(Fault::Malformed(if line.len() as u64 == LINE_LIMIT {
                format!("line {number} of the PCD header is longer than {LINE_LIMIT} bytes")
            } else if raw.is_empty() {
                "it is not a PCD file: it has none of its header lines".into()
            } else {
                format!("the file ends inside the PCD header, at line {number}")
            }));
        }
        let bad = |what: &str| Fault::Malformed(format!("line {number}: {what}: '{}'", shown(text.trim().as_bytes())));
        let data = raw.take(keyword, words).map_err(|what| bad(&what))?;
        if let Some(data) = data {
            let image = raw.width.zip(raw.height).filter(|(_, height)| *height > 1).map(<[u64; 2]>::from);
            let (fields, points) = raw.finish().map_err(Fault::Malformed)?;
            let sizes = fields.iter().map(|field| field.size.checked_mul(field.count));
            let row = sizes.reduce(|a, b| a?.checked_add(b?)).flatten();
            let row = row.ok_or_else(|| Fault::Malformed("its points would be longer than any file".into()))?;
            return Ok(Header { fields, points, image, data, row, lines: number, bytes, line_end });
        }
    }
    Err(Fault::Malformed("the PCD header has no end".into()))
}

/// The values of the header lines.
#[derive(Default)]
struct Raw {
    names: Vec<String>,
    sizes: Vec<u64>,
    scalars: Vec<Scalar>,
    counts: Option<Vec<u64>>,
    width: Option<u64>,
    height: Option<u64>,
    points: Option<u64>,
}

impl Raw {
    fn is_empty(&self) -> bool {
        self.names.is_empty() && self.sizes.is_empty() && self.scalars.is_empty()
    }

    /// Adds a header line. Returns the encoding for the line `DATA`, which ends the header.
    fn take(&mut self, keyword: Option<&str>, words: SplitAsciiWhitespace<'_>) -> Result<Option<Data>, String> {
        match keyword {
            None | Some("VERSION" | "VIEWPOINT") => {}
            Some(comment) if comment.starts_with('#') => {}
            Some("FIELDS" | "COLUMNS") => self.names = words.map(str::to_owned).collect(),
            Some("SIZE") => self.sizes = numbers(words)?,
            Some("TYPE") => {
                let scalar = |word| match word {
                    "I" | "i" => Ok(Scalar::Signed),
                    "U" | "u" => Ok(Scalar::Unsigned),
                    "F" | "f" => Ok(Scalar::Float),
                    _ => Err("a type is I, U or F"),
                };
                self.scalars = words.map(scalar).collect::<Result<_, _>>()?;
            }
            Some("COUNT") => self.counts = Some(numbers(words)?),
            Some("WIDTH") => self.width = Some(one(words)?),
            Some("HEIGHT") => self.height = Some(one(words)?),
            Some("POINTS") => self.points = Some(one(words)?),
            Some("DATA") => {
                let words: Vec<_> = words.map(str::to_ascii_lowercase).collect();
                return match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
                    ["ascii"] => Ok(Some(Data::Ascii)),
                    ["binary"] => Ok(Some(Data::Binary)),
                    ["binary_compressed"] => Ok(Some(Data::Compressed)),
                    _ => Err("the data of a PCD file is ascii, binary or binary_compressed".into()),
                };
            }
            Some(_) => return Err("not a PCD header line".into()),
        }
        Ok(None)
    }

    /// Checks that the header lines agree, and returns the fields and the number of points.
    fn finish(self) -> Result<(Vec<Field>, u64), String> {
        let count = self.names.len();
        let counts = self.counts.unwrap_or_else(|| vec![1; count]);
        if self.sizes.len() != count || self.scalars.len() != count || counts.len() != count || count == 0 {
            return Err(format!(
                "its header names {count} fields, but gives {} sizes, {} types and {} counts",
                self.sizes.len(),
                self.scalars.len(),
                counts.len()
            ));
        }
        let fields = self.names.into_iter().zip(self.sizes).zip(self.scalars).zip(counts);
        let fields: Vec<_> =
            fields.map(|(((name, size), scalar), count)| Field { name, scalar, size, count }).collect();
        let sized = |field: &&Field| match field.scalar {
            Scalar::Float => [4, 8].contains(&field.size),
            Scalar::Signed | Scalar::Unsigned => [1, 2, 4, 8].contains(&field.size),
        };
        if let Some(field) = fields.iter().find(|field| !sized(field)) {
            let name = shown(field.name.as_bytes());
            return Err(format!("its field '{name}' has numbers of {} bytes, which its type forbids", field.size));
        }
        let area = match (self.width, self.height) {
            (Some(width), height) => Some(width.checked_mul(height.unwrap_or(1)).ok_or("its image is too large")?),
            (None, _) => None,
        };
        match (self.points, area) {
            (Some(points), Some(area)) if points != area => {
                Err(format!("its header gives {points} points, but WIDTH x HEIGHT is {area}"))
            }
            (Some(points), _) | (None, Some(points)) => Ok((fields, points)),
            (None, None) => Err("its header does not say how many points there are".into()),
        }
    }
}

fn numbers(words: SplitAsciiWhitespace<'_>) -> Result<Vec<u64>, String> {
    words.map(|word| u64::from_str(word).map_err(|_| "not a whole number".to_owned())).collect()
}

fn one(words: SplitAsciiWhitespace<'_>) -> Result<u64, String> {
    match numbers(words)?[..] {
        [number] => Ok(number),
        _ => Err("one number is needed".into()),
    }
}
