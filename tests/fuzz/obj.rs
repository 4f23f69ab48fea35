//! Fuzzes OBJ files.

use super::mutate::Grammar;
use super::random::{Place, Random};
use super::{Target, render};
use std::fmt::Write;

pub const TARGET: Target = Target {
    name: "obj",
    extension: "obj",
    generate,
    grammar: Grammar {
        words: &[
            "v",
            "vn",
            "vt",
            "f",
            "\nf 1 2 3\n",
            "\nf -1 -2 -3\n",
            "\nf 1//1 2//2 3//3 4//4\n",
            "\nf 0 0 0\n",
            "\nv 1 2 3\n",
            "\nvn 0 0 1\n",
            "\nv 1 2 3 0\n",
            "1/1/1",
            "-1//-1",
            "2//",
            "//",
            "/",
            "1/",
            "#",
            "\\\n",
            "\\",
            "\ng a\n",
            "\nusemtl m\n",
            "\nmtllib m.mtl\n",
            "\np 1\n",
            "\nl 1 2\n",
            "\nvp 1\n",
            "1.#INF",
            "-nan(ind)",
            "\u{7}",
        ],
        separators: b"/",
        text: 1 << 16,
        numbers: |_| Vec::new(),
    },
    execute: render::points,
};

fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    let place = Place::any(random);
    let vertices = random.count(60);
    let normals = [0, vertices, random.count(9)][random.below(3)];
    let colors = random.below(3);
    let mut out = String::from("# made at random\nmtllib none.mtl\no object\n");
    for _ in 0..vertices {
        let [x, y, z] = place.point(random);
        write!(out, "v {x} {y} {z}").unwrap();
        match random.below(4) {
            0 if colors == 1 => out.push_str(" 1 0.5 0"),
            1.. if colors == 2 => write!(out, " {} 0 1 0.5", random.between(-0.1, 2.0)).unwrap(),
            2 if colors == 0 => out.push_str(" 2.0"),
            _ => {}
        }
        out.push_str(random.pick(&["\n", "\r\n", " # said\n", "  \n"]));
    }
    for _ in 0..normals {
        let [x, y, z] = Place::Unit.point(random);
        writeln!(out, "vn {x} {y} {z}").unwrap();
    }
    out.push_str("vt 0 0\nvt 1 1\n");
    let style = random.below(5);
    for _ in 0..if vertices == 0 { 0 } else { random.count(40) } {
        if random.one_in(6) {
            out.push_str(random.pick(&["g part\n", "usemtl stone\n", "s 1\n", "\n", "# face\n", "p 1\n", "l 1 1\n"]));
        }
        out.push('f');
        for corner in 0..3 + random.below(3) {
            let index = |random: &mut Random, count: usize| {
                let number = 1 + random.below(count) as i64;
                if random.one_in(4) { number - 1 - count as i64 } else { number }
            };
            let vertex = index(random, vertices);
            match style {
                1 => write!(out, " {vertex}/1").unwrap(),
                2 | 3 if normals > 0 => write!(out, " {vertex}//{}", index(random, normals)).unwrap(),
                4 if normals > 0 => write!(out, " {vertex}/2/{}", index(random, normals)).unwrap(),
                _ => write!(out, " {vertex}").unwrap(),
            }
            if corner == 1 && random.one_in(9) {
                out.push_str(" \\\n");
            }
        }
        out.push('\n');
    }
    let in_utf_16 = |bytes: fn(u16) -> [u8; 2]| format!("\u{feff}{out}").encode_utf16().flat_map(bytes).collect();
    let bytes = match random.below(16) {
        0 => in_utf_16(u16::to_le_bytes),
        1 => in_utf_16(u16::to_be_bytes),
        2 => out.replace("\r\n", "\n").replace('\n', "\r").into_bytes(),
        _ => out.into_bytes(),
    };
    (bytes, vertices)
}
