//! The meaning of a PCD file's fields, and their conversion to points.

use super::header::{Field, Header, Scalar};
use crate::io::about::{Attribute, Role};
use crate::io::attributes::{self, find, find_triple};
use crate::io::color_range::{Kind, Number, Numbers, RawColors, Shades, Values};
use crate::io::dimensions::{self, Collector};
use crate::io::fault::{Fault, reserve};
use crate::io::values::finite;
use crate::io::{Points, ReadOptions};

/// One number of a point: the index of its field, and its index within that field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cell {
    pub(super) field: usize,
    pub(super) part: u64,
}

/// The numbers of a point that are used: `cells`. All other members are indices into `cells`.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    pub(super) cells: Vec<Cell>,
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    color: Option<Color>,
    intensity: Option<usize>,
    /// The attributes that options ask for.
    wants: Option<dimensions::Columns>,
    /// The number of cells that are used without these attributes.
    pub(super) plain: usize,
}

/// The attributes of a point that are one number: the names and cells of all of them. The numbers
/// of a longer field have an index in brackets, but a packed colour is none.
fn numbers(header: &Header) -> (Vec<String>, Vec<Cell>) {
    let is_number =
        |field: &Field| field.name != "_" && !(field.size == 4 && ["rgb", "rgba"].contains(&field.name.as_str()));
    let fields = header.fields.iter().enumerate().filter(|(_, field)| is_number(field));
    fields
        .flat_map(|(index, field)| {
            (0..field.count.min(MOST_NUMBERS)).map(move |part| {
                let name = if field.count > 1 { format!("{}[{part}]", field.name) } else { field.name.clone() };
                (name, Cell { field: index, part })
            })
        })
        .unzip()
}

/// The most numbers of a field that are attributes; descriptors of shapes have hundreds.
const MOST_NUMBERS: u64 = 16;

/// The cells of a colour.
#[derive(Clone, Copy, Debug)]
enum Color {
    /// A cell whose four bytes are the colour, its type, and whether it has an alpha.
    Packed(usize, Scalar, bool),
    /// Cells of red, green and blue, the cell of alpha, and the types of colour and alpha.
    Channels([usize; 3], Option<usize>, [Number; 2]),
}

impl Field {
    fn number_kind(&self) -> Number {
        match (self.scalar, self.size) {
            (Scalar::Float, _) => Number::Float,
            (_, 1) => Number::Byte,
            (_, 2) => Number::WORD,
            (_, 4) => Number::Integer(u32::MAX.into()),
            _ => Number::Integer(u64::MAX),
        }
    }
}

impl Columns {
    /// Finds the numbers that the options need.
    pub(super) fn of(header: &Header, options: &ReadOptions) -> Result<Self, Fault> {
        let mut columns = Self::without_wants(header, options.ignore_alpha)?;
        columns.plain = columns.cells.len();
        let (names, cells) = numbers(header);
        let place = |field: usize| {
            let cell = cells[field];
            columns.cells.iter().position(|known| *known == cell).unwrap_or_else(|| {
                columns.cells.push(cell);
                columns.cells.len() - 1
            })
        };
        columns.wants = dimensions::Columns::of(names, &options.wanted, place)?;
        Ok(columns)
    }

    fn without_wants(header: &Header, ignore_alpha: bool) -> Result<Self, Fault> {
        let fields = &header.fields;
        // A field with a count of 0 is ignored, whatever its name.
        let names = fields.iter().map(|field| if field.count > 0 { field.name.as_str() } else { "" });
        let named = |name: &str| find(&[name], names.clone());
        let mut cells = Vec::new();
        let mut cell = |field: usize, part: u64| {
            cells.push(Cell { field, part });
            cells.len() - 1
        };
        let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(named) else {
            let missing: Vec<&str> = ["x", "y", "z"].into_iter().filter(|name| named(name).is_none()).collect();
            return Err(Fault::Malformed(format!("its points have no field {}", missing.join(", "))));
        };
        let position = [x, y, z].map(|field| cell(field, 0));
        let vector = |names_of: &[&str]| find(names_of, names.clone()).filter(|&field| fields[field].count >= 3);
        let normal = match (find_triple(attributes::NORMAL, names.clone()), vector(attributes::NORMAL_VECTOR)) {
            (Some(normal), _) => Some(normal.map(|field| cell(field, 0))),
            (None, Some(field)) => Some([0, 1, 2].map(|part| cell(field, part))),
            (None, None) => None,
        };
        let packed = |name: &str| named(name).filter(|&field| fields[field].size == 4 && fields[field].count == 1);
        let color = if let Some((field, has_alpha)) =
            packed("rgba").map(|rgba| (rgba, !ignore_alpha)).or_else(|| Some((packed("rgb")?, false)))
        {
            Some(Color::Packed(cell(field, 0), fields[field].scalar, has_alpha))
        } else if let Some(channels) = find_triple(attributes::COLOR, names.clone()) {
            let alpha = find(attributes::ALPHA, names.clone()).filter(|_| !ignore_alpha);
            let kind = |field: Option<usize>| field.map_or(Number::Byte, |field| fields[field].number_kind());
            let widest =
                channels.into_iter().max_by_key(|&field| (fields[field].scalar == Scalar::Float, fields[field].size));
            let kinds = [kind(widest), kind(alpha)];
            Some(Color::Channels(channels.map(|field| cell(field, 0)), alpha.map(|field| cell(field, 0)), kinds))
        } else {
            vector(attributes::COLOR_VECTOR).map(|field| {
                let channels = [0, 1, 2].map(|part| cell(field, part));
                let alpha = (fields[field].count > 3 && !ignore_alpha).then(|| cell(field, 3));
                Color::Channels(channels, alpha, [fields[field].number_kind(); 2])
            })
        };
        let intensity = find(attributes::INTENSITY, names.clone()).map(|field| cell(field, 0));
        Ok(Self { cells, position, normal, color, intensity, wants: None, plain: 0 })
    }

    /// Whether a cell's four bytes are a packed colour, whatever its type.
    pub(super) fn is_packed(&self, cell: usize) -> bool {
        matches!(self.color, Some(Color::Packed(packed, ..)) if packed == cell)
    }

    /// The attributes of a point, and whether each is used.
    pub(super) fn attributes(&self, header: &Header) -> Vec<Attribute> {
        let colors: Vec<usize> = match self.color {
            Some(Color::Packed(cell, ..)) => vec![cell],
            Some(Color::Channels(channels, alpha, _)) => channels.into_iter().chain(alpha).collect(),
            None => Vec::new(),
        };
        let of_field = |(field, own): (usize, &Field)| {
            let cell = self.cells[..self.plain].iter().position(|cell| cell.field == field);
            let role = match cell {
                Some(cell) if colors.contains(&cell) => Role::Color,
                Some(cell) if self.intensity == Some(cell) => Role::Intensity,
                _ => Role::Other,
            };
            Attribute::new(own.name.clone(), cell.is_some(), role)
        };
        // Padding has the name `_`.
        header.fields.iter().enumerate().filter(|(_, field)| field.name != "_").map(of_field).collect()
    }
}

/// The points of a file while it is being read.
pub(super) struct Reading {
    columns: Columns,
    positions: Vec<[f64; 3]>,
    normals: Vec<[f32; 3]>,
    codes: Vec<[u8; 4]>,
    floats: Vec<[f32; 4]>,
    /// Intensities, stored until the first non-zero colour.
    shades: Vec<f32>,
    colored: bool,
    /// Whether the intensities are integers.
    integer: bool,
    collector: Option<Collector>,
}

impl Reading {
    /// Reserves memory for `rows` points; the caller has checked that number against the file's
    /// length.
    pub(super) fn with_capacity(columns: Columns, header: &Header, rows: u64) -> Result<Self, Fault> {
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        let of = |used: bool| if used { rows } else { 0 };
        reserve(&mut positions, rows)?;
        reserve(&mut normals, of(columns.normal.is_some()))?;
        let (mut codes, mut floats, mut shades) = (Vec::new(), Vec::new(), Vec::new());
        let has_floats = matches!(columns.color, Some(Color::Channels(..)));
        reserve(&mut codes, of(columns.color.is_some() && !has_floats))?;
        reserve(&mut floats, of(has_floats))?;
        reserve(&mut shades, of(columns.intensity.is_some() && columns.color.is_none()))?;
        let field = columns.intensity.map(|cell| &header.fields[columns.cells[cell].field]);
        let integer = field.is_some_and(|field| field.scalar != Scalar::Float);
        let collector = columns.wants.as_ref().map_or(Ok(None), dimensions::Columns::collector)?;
        Ok(Self { columns, positions, normals, codes, floats, shades, colored: false, integer, collector })
    }

    pub(super) fn len(&self) -> u64 {
        self.positions.len() as u64
    }

    /// Appends `rows` points. `value(cell, row)` is the number of a cell, or the bits of a packed
    /// colour.
    pub(super) fn extend(&mut self, rows: usize, value: impl Fn(usize, usize) -> f64) {
        let columns = &self.columns;
        self.positions.extend((0..rows).map(|row| columns.position.map(|cell| value(cell, row))));
        if let (Some(collector), Some(wants)) = (&mut self.collector, &columns.wants) {
            wants.mark(collector, (rows, columns.position), &value);
        }
        if let Some(normal) = columns.normal {
            self.normals.extend((0..rows).map(|row| normal.map(|cell| value(cell, row) as f32)));
        }
        let mut colored = false;
        match columns.color {
            Some(Color::Packed(color, ..)) => {
                let before = self.codes.len();
                self.codes.extend((0..rows).map(|row| {
                    let [blue, green, red, alpha] = (value(color, row) as u32).to_le_bytes();
                    [red, green, blue, alpha]
                }));
                colored = self.codes[before..].iter().any(|[r, g, b, _]| [*r, *g, *b] != [0; 3]);
            }
            Some(Color::Channels(channels, alpha, [kind, alpha_kind])) => {
                let before = self.floats.len();
                self.floats.extend((0..rows).map(|row| {
                    let [r, g, b] = channels.map(|cell| unsigned(value(cell, row), kind));
                    [r, g, b, alpha.map_or(1.0, |cell| unsigned(value(cell, row), alpha_kind))]
                }));
                colored = self.floats[before..].iter().any(|[r, g, b, _]| [*r, *g, *b] != [0.0; 3]);
            }
            None => {}
        }
        if colored && !self.colored {
            (self.colored, self.shades) = (true, Vec::new());
        }
        if let Some(intensity) = columns.intensity.filter(|_| !self.colored) {
            self.shades.extend((0..rows).map(|row| value(intensity, row) as f32));
        }
    }

    pub(super) fn into_points(mut self) -> Result<Points, Fault> {
        let count = self.positions.len();
        let colors = match self.columns.color {
            Some(Color::Packed(_, scalar, has_alpha)) => {
                if scalar == Scalar::Float {
                    unpack_values(&mut self.codes);
                }
                if !(has_alpha && self.codes.iter().any(|code| code[3] > 0)) {
                    self.codes.iter_mut().for_each(|code| code[3] = 255);
                }
                let alpha = has_alpha.then_some(Number::Byte);
                Some(Numbers { values: Values::Bytes(self.codes), kind: Kind::of(Number::Byte), alpha })
            }
            Some(Color::Channels(_, alpha, [kind, alpha_kind])) => {
                // 8-bit numbers are stored as codes.
                let is_byte = kind == Number::Byte && (alpha.is_none() || alpha_kind == Number::Byte);
                let code = |[r, g, b, a]: &[f32; 4]| {
                    [*r as u8, *g as u8, *b as u8, if alpha.is_some() { *a as u8 } else { 255 }]
                };
                let values = match is_byte {
                    true => Values::Bytes(self.floats.iter().map(code).collect()),
                    false => Values::Floats(self.floats),
                };
                let kind = if is_byte || kind != Number::Byte { kind } else { Number::WORD };
                Some(Numbers { values, kind: Kind::of(kind), alpha: alpha.map(|_| alpha_kind) })
            }
            None => None,
        };
        let shades = self.columns.intensity.filter(|_| !self.colored);
        let shades = shades.map(|_| Shades::Floats { values: self.shades, integer: self.integer });
        let raw = (colors.is_some() || shades.is_some()).then(|| Box::new(RawColors::of_run(count, colors, shades)));
        let normals = self.columns.normal.map(|_| self.normals);
        let mut points = Points { positions: self.positions, normals, raw, ..Points::default() };
        self.collector.map_or(Ok(()), |collector| collector.finish(&mut points, false))?;
        Ok(points)
    }
}

/// Converts a colour number to f32. Negative 8-bit and 16-bit numbers are unsigned ones that a
/// program declared as signed.
fn unsigned(value: f64, kind: Number) -> f32 {
    match kind {
        Number::Byte if value < 0.0 => (value + 256.0) as f32,
        Number::WORD if value < 0.0 => (value + 65536.0) as f32,
        _ => finite(value),
    }
}

/// Converts packed colours that a program wrote as the value of a float, not as its bits.
///
/// Such floats are recognised because all of them are whole numbers and their upper bytes differ,
/// which hardly happens to the bits of colours.
fn unpack_values(codes: &mut [[u8; 4]]) {
    let value = |[red, green, blue, alpha]: [u8; 4]| f32::from_le_bytes([blue, green, red, alpha]);
    let is_whole = |value: f32| (0.0..=u32::MAX as f32).contains(&value) && value.fract() == 0.0;
    let all_whole = codes.iter().all(|code| is_whole(value(*code)));
    // Packed bits whose fourth byte was never set, as in PCL's own sample, may be whole numbers
    // too. If all upper bytes are equal, the floats are taken as bits.
    let one_exponent = codes.windows(2).all(|pair| pair[0][3] == pair[1][3]);
    if !all_whole || one_exponent {
        return;
    }
    for code in codes {
        let [blue, green, red, alpha] = (value(*code) as u32).to_le_bytes();
        *code = [red, green, blue, alpha];
    }
}

/// The place of a field's numbers in the data: the first point's offset, and the stride per point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    pub(super) start: usize,
    pub(super) stride: usize,
}

impl Field {
    /// The little-endian number at the offset `at`, or the bits of a `packed` colour.
    pub(super) fn number(&self, bytes: &[u8], at: usize, packed: bool) -> f64 {
        use Scalar::{Float, Signed, Unsigned};
        macro_rules! number {
            ($type:ty) => {
                // Offsets lie within the data, as its length was checked.
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
