//! The numbers of a LAS record under the names that PDAL gives them.

use las::PointData;
use las::point::Format;

use super::chunks::Scheme;
use super::extra::Field;
use super::{Kept, records, withheld};
use crate::io::ReadOptions;
use crate::io::dimensions::{ANGLE_STEP, Collector, Wanted};
use crate::io::fault::Fault;

/// The type of a number in a record.
#[derive(Clone, Copy, Debug)]
enum Kind {
    U8,
    U16,
    F64,
    /// An angle, as a byte of degrees.
    Degrees,
    /// An angle, as 16 bits of [`ANGLE_STEP`].
    Angle,
    /// Bits of a byte: the lowest one, and how many.
    Bits(u8, u8),
}

/// A number of every record.
#[derive(Clone, Debug)]
enum Dimension {
    /// A number of the point format: its offset, its type and the layer that it is compressed in.
    Own(usize, Kind, Layer),
    /// An attribute of the extra bytes, which follow the given number of bytes.
    Extra(usize, Field),
}

/// The layers of a chunk that numbers are compressed in ([`Scheme`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layer {
    /// A layer of the point itself.
    Point(usize),
    Color,
    Infrared,
}

/// The numbers of a file's records, and their names.
#[derive(Clone, Debug, Default)]
pub(super) struct Dimensions {
    names: Vec<String>,
    all: Vec<Dimension>,
}

/// Numbers of the point formats 0 to 5: name, offset, type.
const LEGACY: [(&str, usize, Kind); 12] = [
    ("Intensity", 12, Kind::U16),
    ("ReturnNumber", 14, Kind::Bits(0, 3)),
    ("NumberOfReturns", 14, Kind::Bits(3, 3)),
    ("ScanDirectionFlag", 14, Kind::Bits(6, 1)),
    ("EdgeOfFlightLine", 14, Kind::Bits(7, 1)),
    ("Classification", 15, Kind::Bits(0, 5)),
    ("Synthetic", 15, Kind::Bits(5, 1)),
    ("KeyPoint", 15, Kind::Bits(6, 1)),
    ("Withheld", 15, Kind::Bits(7, 1)),
    ("ScanAngleRank", 16, Kind::Degrees),
    ("UserData", 17, Kind::U8),
    ("PointSourceId", 18, Kind::U16),
];

/// Numbers of the point formats from 6 on: name, offset, type, index of the layer.
const EXTENDED: [(&str, usize, Kind, usize); 15] = [
    ("Intensity", 12, Kind::U16, 4),
    ("ReturnNumber", 14, Kind::Bits(0, 4), 0),
    ("NumberOfReturns", 14, Kind::Bits(4, 4), 0),
    ("Synthetic", 15, Kind::Bits(0, 1), 3),
    ("KeyPoint", 15, Kind::Bits(1, 1), 3),
    ("Withheld", 15, Kind::Bits(2, 1), 3),
    ("Overlap", 15, Kind::Bits(3, 1), 3),
    ("ScanChannel", 15, Kind::Bits(4, 2), 0),
    ("ScanDirectionFlag", 15, Kind::Bits(6, 1), 3),
    ("EdgeOfFlightLine", 15, Kind::Bits(7, 1), 3),
    ("Classification", 16, Kind::U8, 2),
    ("UserData", 17, Kind::U8, 6),
    ("ScanAngleRank", 18, Kind::Angle, 5),
    ("PointSourceId", 20, Kind::U16, 7),
    ("GpsTime", 22, Kind::F64, 8),
];

impl Dimensions {
    /// The numbers of a point format whose records have these attributes in their extra bytes.
    pub fn of(format: &Format, extra: &[Field]) -> Self {
        let mut dimensions = Self::default();
        let mut end = if format.is_extended {
            for (name, at, kind, layer) in EXTENDED {
                dimensions.add(name, Dimension::Own(at, kind, Layer::Point(layer)));
            }
            30
        } else {
            for (name, at, kind) in LEGACY {
                dimensions.add(name, Dimension::Own(at, kind, Layer::Point(0)));
            }
            if format.has_gps_time {
                dimensions.add("GpsTime", Dimension::Own(20, Kind::F64, Layer::Point(0)));
            }
            if format.has_gps_time { 28 } else { 20 }
        };
        if format.has_color {
            for (channel, name) in ["Red", "Green", "Blue"].into_iter().enumerate() {
                dimensions.add(name, Dimension::Own(end + 2 * channel, Kind::U16, Layer::Color));
            }
            end += 6;
        }
        if format.has_nir {
            dimensions.add("Infrared", Dimension::Own(end, Kind::U16, Layer::Infrared));
        }
        let own = usize::from(format.len() - format.extra_bytes);
        for field in extra.iter().filter(|field| field.is_number() && !field.name.is_empty()) {
            dimensions.add(&field.name, Dimension::Extra(own, field.clone()));
        }
        dimensions
    }

    fn add(&mut self, name: &str, dimension: Dimension) {
        self.names.push(name.to_owned());
        self.all.push(dimension);
    }

    /// Returns the collector of the wanted attributes; None if nothing is wanted.
    pub fn collector(&self, wanted: &Wanted) -> Result<Option<Wants>, Fault> {
        let collector = Collector::of(&self.names, wanted)?;
        Ok(collector.map(|collector| {
            let needed = collector.fields.iter().map(|field| self.all[*field].clone()).collect();
            Wants { needed, collector }
        }))
    }
}

/// A collector, and where its numbers are in a record.
pub(super) struct Wants {
    needed: Vec<Dimension>,
    pub collector: Collector,
}

impl Wants {
    /// Takes a point with its record; returns whether it is kept.
    pub fn take(&mut self, position: &[f64; 3], record: &[u8]) -> bool {
        let Self { needed, collector } = self;
        collector.take(position, |field| needed[field].number(record))
    }

    /// Marks the layers of the wanted numbers as needed. Returns whether one was not needed before.
    pub fn need(&self, scheme: &mut Scheme) -> bool {
        let before = scheme.needed.clone();
        for dimension in &self.needed {
            match dimension {
                Dimension::Own(_, _, layer) => scheme.need_layer(*layer),
                Dimension::Extra(_, field) => scheme.need_extra(field),
            }
        }
        scheme.needed != before
    }
}

impl Kept<'_> {
    /// Collects the wanted attributes of a block's points, except deleted ones. Returns whether
    /// each point passes the filter; nothing if no attribute is wanted.
    pub(super) fn passing(&mut self, block: &PointData, options: &ReadOptions) -> Vec<bool> {
        let Some(wants) = &mut self.wants else { return Vec::new() };
        let coordinates = block.x().zip(block.y()).zip(block.z()).map(|((x, y), z)| [x, y, z]);
        let points = records(block).zip(withheld(block)).zip(coordinates);
        let passes = |((record, withheld), position): ((&[u8], bool), [f64; 3])| {
            // A deleted point is left out for that reason, and counts as such.
            withheld && !options.keep_withheld || wants.take(&position, record)
        };
        points.map(passes).collect()
    }
}

impl Dimension {
    /// The number in a record; NaN if the record is too short.
    fn number(&self, record: &[u8]) -> f64 {
        fn bytes<const N: usize>(record: &[u8], at: usize) -> Option<[u8; N]> {
            record.get(at..)?.first_chunk().copied()
        }
        let number = match self {
            Self::Own(at, kind, _) => match *kind {
                Kind::U8 => bytes(record, *at).map(|[byte]| f64::from(byte)),
                Kind::U16 => bytes(record, *at).map(|two| f64::from(u16::from_le_bytes(two))),
                Kind::F64 => bytes(record, *at).map(f64::from_le_bytes),
                Kind::Degrees => bytes(record, *at).map(|[byte]| f64::from(byte.cast_signed())),
                Kind::Angle => bytes(record, *at).map(|two| f64::from(i16::from_le_bytes(two)) * ANGLE_STEP),
                Kind::Bits(first, count) => {
                    bytes(record, *at).map(|[byte]| f64::from((byte >> first) & ((1u8 << count) - 1)))
                }
            },
            Self::Extra(own, field) => record.get(*own..).and_then(|extra| field.number(extra)),
        };
        number.unwrap_or(f64::NAN)
    }
}
