//! Fuzzes texts with a point per line, and PTX scans.

use super::mutate::Grammar;
use super::random::{Place, Random};
use super::{Target, render};
use std::fmt::Write;

/// Words of both kinds.
const GRAMMAR: Grammar = Grammar {
    words: &[
        "x",
        "y",
        "z",
        "red",
        "green",
        "blue",
        "nx",
        "ny",
        "nz",
        "intensity",
        "Classification",
        ",",
        ";",
        "\t",
        "\"",
        "\"\"",
        "#",
        "//",
        "\n",
        "\r\n",
        "\r",
        "\n\n",
        "1,5",
        "1.#INF",
        "-nan(ind)",
        "null",
        "N/A",
        "\n1099511627776\n",
        "\n18446744073709551615\n",
        "x y z\n",
        "//X Y Z R G B\n",
        "\u{7}",
        "\0",
    ],
    separators: b",;",
    text: 1 << 16,
    numbers: |_| Vec::new(),
};

pub const TEXT: Target =
    Target { name: "text", extension: "txt", generate: table, grammar: GRAMMAR, execute: render::points };

pub const PTX: Target =
    Target { name: "ptx", extension: "ptx", generate: scans, grammar: GRAMMAR, execute: render::points };

/// Writes a text in one of the encodings that are read.
fn encoded(random: &mut Random, text: String) -> Vec<u8> {
    let in_utf_16 = |bytes: fn(u16) -> [u8; 2]| format!("\u{feff}{text}").encode_utf16().flat_map(bytes).collect();
    match random.below(16) {
        0 => in_utf_16(u16::to_le_bytes),
        1 => in_utf_16(u16::to_be_bytes),
        2 => format!("\u{feff}{text}").into_bytes(),
        3 => text.replace('\n', "\r").into_bytes(),
        4 => text.replace('\n', "\r\n").into_bytes(),
        _ => text.into_bytes(),
    }
}

fn table(random: &mut Random) -> (Vec<u8>, usize) {
    let place = Place::any(random);
    let rows = random.count(60);
    let separator = random.pick(&[" ", "\t", ", ", ";", "  "]);
    let kinds: [&[&str]; 6] = [
        &[],
        &["intensity"],
        &["red", "green", "blue"],
        &["nx", "ny", "nz"],
        &["intensity", "red", "green", "blue"],
        &["Classification", "label", "radius"],
    ];
    let names = kinds[random.below(kinds.len())];
    let mut out = String::new();
    if random.one_in(2) {
        out.push_str(random.pick(&["", "//", "# "]));
        let all: Vec<&str> = ["x", "y", "z"].iter().chain(names).copied().collect();
        writeln!(out, "{}", all.join(separator)).unwrap();
    }
    if random.one_in(4) {
        writeln!(out, "{rows}").unwrap();
    }
    for _ in 0..rows {
        let mut cells: Vec<String> = place.point(random).map(|c| c.to_string()).to_vec();
        for name in names {
            cells.push(match *name {
                "nx" | "ny" | "nz" => random.between(-1.0, 1.0).to_string(),
                _ => random.below(256).to_string(),
            });
        }
        writeln!(out, "{}", cells.join(separator)).unwrap();
        if random.one_in(30) {
            out.push_str(random.pick(&["\n", "# said\n", "// said\n"]));
        }
    }
    (encoded(random, out), rows)
}

fn scans(random: &mut Random) -> (Vec<u8>, usize) {
    let (place, has_colors) = (Place::any(random), random.one_in(2));
    let mut count = 0;
    let mut out = String::new();
    for _ in 0..random.below(3) {
        let size = [random.below(6), random.below(6)];
        writeln!(out, "{}\n{}\n1 2 3\n1 0 0\n0 1 0\n0 0 1", size[0], size[1]).unwrap();
        for _ in 0..4 {
            let [a, b, c] = Place::Unit.point(random);
            writeln!(out, "{a} {b} {c} 0").unwrap();
        }
        for _ in 0..size[0] * size[1] {
            let [x, y, z] = if random.one_in(4) { [0.0; 3] } else { place.point(random) };
            count += usize::from([x, y, z] != [0.0; 3]);
            write!(out, "{x} {y} {z} {}", random.between(0.0, 1.0)).unwrap();
            out.push_str(if has_colors { " 1 2 255\n" } else { "\n" });
        }
    }
    (encoded(random, out), count)
}
