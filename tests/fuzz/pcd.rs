//! Fuzzes PCD files with random fields, in ASCII, binary and compressed binary form.

use super::mutate::Grammar;
use super::random::{Place, Random};
use super::{Target, render};

pub const TARGET: Target = Target {
    name: "pcd",
    extension: "pcd",
    generate,
    grammar: Grammar {
        words: &[
            "# .PCD",
            "FIELDS",
            "COLUMNS",
            "SIZE",
            "TYPE",
            "COUNT",
            "WIDTH",
            "HEIGHT",
            "POINTS",
            "VIEWPOINT",
            "DATA",
            "ascii",
            "binary",
            "binary_compressed",
            "x",
            "_",
            "rgba",
            "intensity",
            "I",
            "U",
            "F",
            "\n",
            "\r\n",
            "\nPOINTS 4294967295\n",
            "\nWIDTH 18446744073709551615\n",
        ],
        separators: b"",
        text: 1 << 9,
        numbers,
    },
    execute: render::points,
};

/// Last line of the header of compressed data.
const COMPRESSED: &[u8] = b"DATA binary_compressed\n";

/// Offsets and sizes of the two lengths and the first LZF tokens of compressed data.
fn numbers(bytes: &[u8]) -> Vec<(usize, usize)> {
    let Some(header) = bytes.windows(COMPRESSED.len()).position(|window| window == COMPRESSED) else { return vec![] };
    let data = header + COMPRESSED.len();
    let lengths = [(data, 4), (data + 4, 4)];
    let places = lengths.into_iter().chain((8..16).map(|token| (data + token, 1)));
    places.filter(|&(at, size)| at + size <= bytes.len()).collect()
}

/// A field of a point: `count` numbers of `size` bytes each.
struct Field {
    name: &'static str,
    size: usize,
    kind: char,
    count: usize,
}

fn fields(random: &mut Random) -> Vec<Field> {
    let coordinate = |random: &mut Random, name| {
        let (size, kind) = [(4, 'F'), (8, 'F'), (4, 'F'), (8, 'I'), (2, 'I')][random.below(5)];
        Field { name, size, kind, count: 1 + usize::from(random.one_in(9)) }
    };
    let mut fields: Vec<Field> = ["x", "y", "z"].map(|name| coordinate(random, name)).into();
    let groups: [&[&str]; 4] = [&["normal_x", "normal_y", "normal_z"], &["rgb"], &["rgba"], &["intensity"]];
    for group in groups {
        if random.one_in(3) {
            let kind = ['F', 'U'][random.below(2)];
            fields.extend(group.iter().map(|name| Field { name, size: 4, kind, count: 1 }));
        }
    }
    if random.one_in(3) {
        fields.insert(random.below(fields.len()), Field { name: "_", size: 1, kind: 'U', count: random.below(5) });
    }
    fields
}

fn header(random: &mut Random, fields: &[Field], points: usize, data: &str) -> String {
    let each = |of: &dyn Fn(&Field) -> String| fields.iter().map(of).collect::<Vec<_>>().join(" ");
    let line = |random: &mut Random, text: &str| if random.one_in(2) { text.to_owned() } else { String::new() };
    let height = if points.is_multiple_of(2) && random.one_in(3) { 2 } else { 1 };
    [
        line(random, "# .PCD v0.7 - Point Cloud Data file format\n"),
        format!("VERSION 0.7\nFIELDS {}\n", each(&|field| field.name.into())),
        format!("SIZE {}\n", each(&|field| field.size.to_string())),
        format!("TYPE {}\n", each(&|field| field.kind.into())),
        format!("COUNT {}\n", each(&|field| field.count.to_string())),
        format!("WIDTH {}\nHEIGHT {height}\n", points / height),
        line(random, "VIEWPOINT 1 2 3 1 0 0 0\n"),
        line(random, &format!("POINTS {points}\n")),
        format!("DATA {data}\n"),
    ]
    .concat()
}

/// The numbers of each field of a point.
fn row(random: &mut Random, place: Place, fields: &[Field]) -> Vec<Vec<f64>> {
    let point = place.point(random);
    let number = |random: &mut Random, name| match name {
        "x" => point[0],
        "y" => point[1],
        "z" => point[2],
        "rgb" | "rgba" => (random.bits() >> 40) as f64,
        _ => random.between(-1.0, 1.0),
    };
    fields.iter().map(|field| (0..field.count).map(|_| number(random, field.name)).collect()).collect()
}

impl Field {
    fn text(&self, value: f64) -> String {
        match self.kind {
            'F' => value.to_string(),
            'I' => (value as i64).to_string(),
            _ => (value as u32).to_string(),
        }
    }

    fn bytes(&self, value: f64) -> Vec<u8> {
        match (self.kind, self.size) {
            ('F', 4) => (value as f32).to_le_bytes().into(),
            ('F', _) => value.to_le_bytes().into(),
            ('I', size) => (value as i64).to_le_bytes()[..size].into(),
            (_, size) => (value as u64).to_le_bytes()[..size].into(),
        }
    }
}

fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    let fields = fields(random);
    let points = random.count(60);
    let data = random.pick(&["ascii", "binary", "binary_compressed"]);
    let mut out = match (header(random, &fields, points, data), random.below(6)) {
        (header, 0) => header.to_ascii_uppercase(),
        (header, 1) => header.to_ascii_lowercase(),
        (header, 2) if *data != *"ascii" => header.replace('\n', "\r"),
        (header, _) => header,
    }
    .into_bytes();
    let place = Place::any(random);
    let rows: Vec<Vec<Vec<f64>>> = (0..points).map(|_| row(random, place, &fields)).collect();
    let of_field = |row: &[Vec<f64>], index: usize| -> Vec<u8> {
        row[index].iter().flat_map(|&value| fields[index].bytes(value)).collect()
    };
    match data {
        "ascii" => {
            for row in &rows {
                let numbers = row.iter().zip(&fields).flat_map(|(values, field)| values.iter().map(|&v| field.text(v)));
                out.extend(numbers.collect::<Vec<_>>().join(" ").bytes().chain([b'\n']));
            }
        }
        "binary" => out.extend(rows.iter().flat_map(|row| (0..fields.len()).flat_map(|index| of_field(row, index)))),
        // Without points, writers omit even the lengths.
        _ if points == 0 => {}
        _ => {
            let by_field = (0..fields.len()).flat_map(|index| rows.iter().flat_map(move |row| of_field(row, index)));
            let bytes: Vec<u8> = by_field.collect();
            let packed = pack(&bytes);
            out.extend((packed.len() as u32).to_le_bytes());
            out.extend((bytes.len() as u32).to_le_bytes());
            out.extend(packed);
        }
    }
    (out, points)
}

/// A minimal LZF encoder: three bytes equal to their predecessor are a back-reference, all others
/// are literal runs of one.
fn pack(bytes: &[u8]) -> Vec<u8> {
    let mut packed = Vec::new();
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        if at > 0 && bytes[at..].starts_with(&[bytes[at - 1]; 3]) {
            packed.extend([1 << 5, 0]);
            at += 3;
        } else {
            packed.extend([0, byte]);
            at += 1;
        }
    }
    packed
}
