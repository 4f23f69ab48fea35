//! PCD files of random fields, in each of the three ways they are written.

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
            "rgba",
            "intensity",
            "I",
            "U",
            "F",
            "\n",
        ],
        separators: b" \n",
        text: 1 << 9,
        numbers,
    },
    execute: render::points,
};

/// Name, bytes and type, and how many numbers.
type Field = (&'static str, (usize, char), usize);

/// The lengths and the first tokens of compressed data.
fn numbers(bytes: &[u8]) -> Vec<(usize, usize)> {
    let header = bytes.windows(18).position(|window| window == b"binary_compressed\n");
    let data = header.map(|at| at + 18).filter(|at| at + 16 <= bytes.len());
    data.map_or(Vec::new(), |at| (0..2).map(|k| (at + 4 * k, 4)).chain((8..16).map(|k| (at + k, 1))).collect())
}

fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    let kind = |random: &mut Random| [(4, 'F'), (8, 'F'), (4, 'F'), (8, 'I'), (2, 'I')][random.below(5)];
    let mut fields: Vec<Field> =
        ["x", "y", "z"].map(|name| (name, kind(random), 1 + usize::from(random.one_in(9)))).into();
    let groups: [&[&str]; 4] = [&["normal_x", "normal_y", "normal_z"], &["rgb"], &["rgba"], &["intensity"]];
    for group in groups {
        if random.one_in(3) {
            fields.extend(group.iter().map(|name| (*name, (4, random.pick(&["F", "U"]).chars().last().unwrap()), 1)));
        }
    }
    if random.one_in(3) {
        let at = random.below(fields.len());
        fields.insert(at, ("_", (1, 'U'), random.below(5)));
    }
    let points = random.count(60);
    let data = random.pick(&["ascii", "binary", "binary_compressed"]);
    let each = |of: &dyn Fn(&Field) -> String| fields.iter().map(of).collect::<Vec<_>>().join(" ");
    let header = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\nWIDTH {points}\nHEIGHT 1\nPOINTS {points}\nDATA {data}\n",
        each(&|field| field.0.into()),
        each(&|field| field.1.0.to_string()),
        each(&|field| field.1.1.to_string()),
        each(&|field| field.2.to_string()),
    );
    let mut out = header.into_bytes();
    let place = Place::any(random);
    let rows: Vec<Vec<Vec<f64>>> = (0..points)
        .map(|_| {
            let point = place.point(random);
            let of = |name: &str, random: &mut Random| match name {
                "x" => point[0],
                "y" => point[1],
                "z" => point[2],
                "rgb" | "rgba" => (random.bits() >> 40) as f64,
                _ => random.between(-1.0, 1.0),
            };
            fields.iter().map(|(name, _, count)| (0..*count).map(|_| of(name, random)).collect()).collect()
        })
        .collect();
    if data == "ascii" {
        for row in &rows {
            let words = row.iter().zip(&fields).flat_map(|(values, (_, kind, _))| {
                values.iter().map(move |&value| match kind {
                    (_, 'F') => value.to_string(),
                    (_, 'I') => (value as i64).to_string(),
                    _ => (value as u32).to_string(),
                })
            });
            out.extend(words.collect::<Vec<_>>().join(" ").bytes().chain([b'\n']));
        }
        return (out, points);
    }
    let put = |out: &mut Vec<u8>, value: f64, kind: (usize, char)| match kind {
        (4, 'F') => out.extend((value as f32).to_le_bytes()),
        (_, 'F') => out.extend(value.to_le_bytes()),
        (size, 'I') => out.extend(&(value as i64).to_le_bytes()[..size]),
        (size, _) => out.extend(&(value as u64).to_le_bytes()[..size]),
    };
    let mut bytes = Vec::new();
    if data == "binary" {
        for row in &rows {
            for (values, (_, kind, _)) in row.iter().zip(&fields) {
                values.iter().for_each(|value| put(&mut bytes, *value, *kind));
            }
        }
        out.extend(bytes);
        return (out, points);
    }
    for (field, (_, kind, _)) in fields.iter().enumerate() {
        rows.iter().flat_map(|row| &row[field]).for_each(|value| put(&mut bytes, *value, *kind));
    }
    // Runs as they are, and of a byte that repeats the one before a copy of 3.
    let mut packed = Vec::new();
    let mut rest = &bytes[..];
    while let Some(&first) = rest.first() {
        let alike = bytes.len() > rest.len() && rest.len() >= 3 && {
            let before = bytes[bytes.len() - rest.len() - 1];
            rest[..3] == [before; 3]
        };
        if alike {
            packed.extend([1 << 5, 0]);
            rest = &rest[3..];
        } else {
            packed.extend([0, first]);
            rest = &rest[1..];
        }
    }
    if points > 0 {
        out.extend((packed.len() as u32).to_le_bytes());
        out.extend((bytes.len() as u32).to_le_bytes());
        out.extend(packed);
    }
    (out, points)
}
