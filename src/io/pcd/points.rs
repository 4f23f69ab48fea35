//! What the fields of a PCD file mean, and the points they become.

use super::header::{Field, Header};
use crate::io::Points;
use crate::io::fault::{Fault, reserve};
use crate::io::intensity;
use crate::scene::Colors;

/// Which fields are used, by their index in the header.
pub(super) struct Columns {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    /// The packed colour, and whether it has an alpha.
    color: Option<(usize, bool)>,
    /// Only where there is no colour.
    intensity: Option<usize>,
}

impl Columns {
    pub(super) fn of(header: &Header) -> Result<Self, Fault> {
        // In either case; a name that is written as here comes first.
        let first =
            |is: &dyn Fn(&str) -> bool| header.fields.iter().position(|field| is(&field.name) && field.count > 0);
        let named =
            |name: &str| first(&|given| given == name).or_else(|| first(&|given| given.eq_ignore_ascii_case(name)));
        let triple = |names: [&str; 3]| Some([named(names[0])?, named(names[1])?, named(names[2])?]);
        let Some(position) = triple(["x", "y", "z"]) else {
            let missing: Vec<&str> = ["x", "y", "z"].into_iter().filter(|name| named(name).is_none()).collect();
            return Err(Fault::Malformed(format!("its points have no field {}", missing.join(", "))));
        };
        let packed = |name: &str| named(name).filter(|&index| header.fields[index].size == 4);
        let color = packed("rgba").map(|rgba| (rgba, true)).or_else(|| Some((packed("rgb")?, false)));
        let intensity = named("intensity").filter(|_| color.is_none());
        Ok(Self { position, normal: triple(["normal_x", "normal_y", "normal_z"]), color, intensity })
    }

    /// The fields that are used.
    pub(super) fn used(&self) -> impl Iterator<Item = usize> {
        let color = self.color.map(|(color, _)| color);
        self.position.into_iter().chain(self.normal.into_iter().flatten()).chain(color).chain(self.intensity)
    }

    /// Whether a field's four bytes are colours, whatever the type of its number.
    pub(super) fn is_packed(&self, field: usize) -> bool {
        self.color.is_some_and(|(color, _)| color == field)
    }
}

/// The points of a file while they are being read.
pub(super) struct Reading {
    columns: Columns,
    positions: Vec<[f64; 3]>,
    normals: Vec<[f32; 3]>,
    codes: Vec<[u8; 4]>,
    intensities: Vec<f32>,
}

impl Reading {
    /// Room for `rows`, which must be a number that the file's length allows.
    pub(super) fn with_capacity(columns: Columns, rows: u64) -> Result<Self, Fault> {
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        let (mut codes, mut intensities) = (Vec::new(), Vec::new());
        let of = |used: bool| if used { rows } else { 0 };
        reserve(&mut positions, rows)?;
        reserve(&mut normals, of(columns.normal.is_some()))?;
        reserve(&mut codes, of(columns.color.is_some()))?;
        reserve(&mut intensities, of(columns.intensity.is_some()))?;
        Ok(Self { columns, positions, normals, codes, intensities })
    }

    pub(super) fn len(&self) -> u64 {
        self.positions.len() as u64
    }

    /// Takes `rows` points; `value` gives a field's first number in each, of a packed colour its bits.
    pub(super) fn extend(&mut self, rows: usize, value: impl Fn(usize, usize) -> f64) {
        let columns = &self.columns;
        self.positions.extend((0..rows).map(|row| columns.position.map(|field| value(field, row))));
        if let Some(normal) = columns.normal {
            self.normals.extend((0..rows).map(|row| normal.map(|field| value(field, row) as f32)));
        }
        if let Some((color, _)) = columns.color {
            self.codes.extend((0..rows).map(|row| {
                let [blue, green, red, alpha] = (value(color, row) as u32).to_le_bytes();
                [red, green, blue, alpha]
            }));
        }
        if let Some(intensity) = columns.intensity {
            self.intensities.extend((0..rows).map(|row| value(intensity, row) as f32));
        }
    }

    pub(super) fn into_points(mut self) -> Points {
        let columns = self.columns;
        if let Some((_, has_alpha)) = columns.color
            && !(has_alpha && self.codes.iter().any(|code| code[3] > 0))
        {
            self.codes.iter_mut().for_each(|code| code[3] = 255);
        }
        Points {
            positions: self.positions,
            normals: columns.normal.map(|_| self.normals),
            colors: match columns.color {
                Some(_) => Some(Colors::Srgb8(self.codes)),
                None => intensity::grey(&intensity::codes(&self.intensities)),
            },
            ..Points::default()
        }
    }
}

/// Where a field's numbers lie in bytes: the first, and how far each point's is from that of the one before.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    pub(super) start: usize,
    pub(super) stride: usize,
}

impl Field {
    /// The number at `at`, little-endian; of a packed colour its bits.
    pub(super) fn number(&self, bytes: &[u8], at: usize, packed: bool) -> f64 {
        use super::header::Scalar::{Float, Signed, Unsigned};
        macro_rules! number {
            ($type:ty) => {
                // Places lie within the bytes.
                bytes
                    .get(at..)
                    .and_then(|rest| rest.first_chunk().copied())
                    .map_or(0.0, |b| <$type>::from_le_bytes(b) as f64)
            };
        }
        match (self.scalar, self.size) {
            (_, 4) if packed => number!(u32),
            (Float, 4) => number!(f32),
            (Float, _) => number!(f64),
            (Signed, 1) => number!(i8),
            (Signed, 2) => number!(i16),
            (Signed, 4) => number!(i32),
            (Signed, _) => number!(i64),
            (Unsigned, 1) => number!(u8),
            (Unsigned, 2) => number!(u16),
            (Unsigned, 4) => number!(u32),
            (Unsigned, _) => number!(u64),
        }
    }
}
