//! Fuzzes SuperSplat's compressed Gaussians.

use std::path::Path;

use super::mutate::Grammar;
use super::random::Random;
use super::{Outcome, Target, render};

pub const TARGET: Target = Target {
    name: "packed",
    extension: "ply",
    generate,
    grammar: Grammar {
        words: &[
            "element chunk",
            "element vertex",
            "element sh",
            "packed_position",
            "packed_rotation",
            "packed_scale",
            "packed_color",
            "min_x",
            "max_scale_z",
            "min_r",
            "f_rest_0",
            "f_rest_44",
            "uint",
            "uchar",
            "float",
            "binary_big_endian",
            "ascii",
            "\nelement chunk 0\n",
            "\nelement vertex 4294967295\n",
            "\nend_header\n",
        ],
        separators: b"",
        text: 1 << 10,
        numbers: |_| Vec::new(),
    },
    execute,
};

fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    let count = 1 + random.below(300);
    let colored = random.one_in(2);
    let terms = [0, 9, 24, 45][random.below(4)];
    let mut ranges: Vec<String> = Vec::new();
    for what in ["", "scale_"] {
        for end in ["min", "max"] {
            ranges.extend(["x", "y", "z"].map(|axis| format!("{end}_{what}{axis}")));
        }
    }
    if colored {
        ranges.extend(["min", "max"].iter().flat_map(|end| ["r", "g", "b"].map(|channel| format!("{end}_{channel}"))));
    }
    let chunks = count.div_ceil(256);
    let mut head = format!("ply\nformat binary_little_endian 1.0\nelement chunk {chunks}\n");
    head.extend(ranges.iter().map(|name| format!("property float {name}\n")));
    head += &format!("element vertex {count}\n");
    head.extend(["position", "rotation", "scale", "color"].map(|name| format!("property uint packed_{name}\n")));
    if terms > 0 {
        head += &format!("element sh {count}\n");
        head.extend((0..terms).map(|k| format!("property uchar f_rest_{k}\n")));
    }
    let mut out = (head + "end_header\n").into_bytes();
    for _ in 0..chunks {
        for name in &ranges {
            let value = match (name.starts_with("min"), name.contains("scale")) {
                (true, true) => random.between(-7.0, -4.0),
                (false, true) => random.between(-4.0, -1.0),
                (true, false) => random.between(-1.0, 0.0),
                (false, false) => random.between(0.0, 1.0),
            };
            out.extend((value as f32).to_le_bytes());
        }
    }
    for _ in 0..4 * count {
        out.extend((random.bits() as u32).to_le_bytes());
    }
    out.extend((0..terms * count).map(|_| random.bits() as u8));
    (out, count)
}

fn execute(path: &Path, valid: Option<usize>) -> Result<Outcome, String> {
    render::points(path, valid)
}
