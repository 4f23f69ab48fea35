//! Fuzzes STL and OFF files.

use super::mutate::Grammar;
use super::random::{Place, Random};
use super::{Target, render};
use std::collections::HashSet;
use std::fmt::Write;

pub const STL: Target = Target {
    name: "stl",
    extension: "stl",
    generate: stl,
    grammar: Grammar {
        words: &[
            "solid", "endsolid", "facet", "normal", "outer", "loop", "vertex", "endloop", "endfacet", "COLOR=", "\n",
            "1.#INF",
        ],
        separators: b"",
        text: 1 << 16,
        // The number of triangles, and the colour of the first.
        numbers: |bytes| [(80, 4), (132, 2)].into_iter().filter(|(at, size)| at + size <= bytes.len()).collect(),
    },
    execute: render::points,
};

pub const OFF: Target = Target {
    name: "off",
    extension: "off",
    generate: off,
    grammar: Grammar {
        words: &[
            "OFF",
            "COFF",
            "NOFF",
            "STOFF",
            "4OFF",
            "BINARY",
            "#",
            "\n",
            "\r\n",
            "\n3 0 1 2\n",
            "\n4 0 1 2 3\n",
            "-1",
        ],
        separators: b"",
        text: 1 << 16,
        numbers: |_| Vec::new(),
    },
    execute: render::points,
};

fn stl(random: &mut Random) -> (Vec<u8>, usize) {
    let place = Place::any(random);
    let corners: Vec<[f32; 3]> = (0..1 + random.count(30)).map(|_| place.point(random).map(|c| c as f32)).collect();
    let triangles: Vec<[[f32; 3]; 3]> =
        (0..random.count(40)).map(|_| [0; 3].map(|_| corners[random.below(corners.len())])).collect();
    let used = triangles.as_flattened().iter().map(|corner| corner.map(|c| (f64::from(c) + 0.0).to_bits()));
    let count = used.collect::<HashSet<_>>().len();
    if random.one_in(2) {
        let mut out = String::from("solid made at random\n");
        for triangle in &triangles {
            out.push_str("facet normal 0 0 0\n outer loop\n");
            triangle.iter().for_each(|[x, y, z]| writeln!(out, "  vertex {x:?} {y:?} {z:?}").unwrap());
            out.push_str(" endloop\nendfacet\n");
        }
        out.push_str("endsolid\n");
        return (out.into_bytes(), count);
    }
    let mut bytes = vec![b' '; 80];
    if random.one_in(3) {
        bytes[20..30].copy_from_slice(b"COLOR=\x10\x20\x30\xff");
    }
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in &triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.as_flattened().iter().flat_map(|c| c.to_le_bytes()));
        bytes.extend((random.below(1 << 16) as u16).to_le_bytes());
    }
    (bytes, count)
}

fn off(random: &mut Random) -> (Vec<u8>, usize) {
    let place = Place::any(random);
    let (vertices, faces) = (random.count(40), random.count(40));
    let faces = if vertices == 0 { 0 } else { faces };
    let kinds = [("OFF", ""), ("COFF", " 1 2 255 128"), ("NOFF", " 0 0.6 0.8"), ("STOFF", " 0 1")];
    let (word, rest) = kinds[random.below(kinds.len())];
    let mut out = format!("{word}\n{vertices} {faces} 0\n");
    for _ in 0..vertices {
        let [x, y, z] = place.point(random);
        writeln!(out, "{x} {y} {z}{rest}").unwrap();
    }
    for _ in 0..faces {
        let corners = 3 + random.below(3);
        write!(out, "{corners}").unwrap();
        (0..corners).for_each(|_| write!(out, " {}", random.below(vertices)).unwrap());
        out.push_str(random.pick(&["\n", " 255 0 0\n", " 0.5 0.5 0.5 1\n", " # said\n", "\n\n"]));
    }
    (out.into_bytes(), vertices)
}
