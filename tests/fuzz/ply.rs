//! Fuzzes PLY files in ASCII and in both byte orders.

use super::mutate::Grammar;
use super::random::{Place, Random};
use super::{Target, render};

pub const TARGET: Target = Target {
    name: "ply",
    extension: "ply",
    generate,
    grammar: Grammar {
        words: &[
            "ply",
            "format",
            "ascii",
            "binary_little_endian",
            "binary_big_endian",
            "1.0",
            "element",
            "vertex",
            "face",
            "property",
            "list",
            "char",
            "uchar",
            "short",
            "ushort",
            "int",
            "uint",
            "float",
            "double",
            "float64",
            "x",
            "y",
            "z",
            "nx",
            "radius",
            "red",
            "alpha",
            "scale_0",
            "scale_2",
            "rot_3",
            "opacity",
            "f_dc_2",
            "f_rest_44",
            "filter_3D",
            "chunk",
            "packed_position",
            "max_scale_x",
            "nan",
            "-1e9",
            "\nproperty list uint double l\n",
            "\nelement vertex 4294967295\n",
            "\nelement ghost 18446744073709551615\n",
            "\nend_header\n",
            "comment",
            "\r\n",
            "\r",
            "\u{7}",
            "\u{fffd}",
        ],
        separators: b"",
        text: 1 << 12,
        numbers: |_| Vec::new(),
    },
    execute: render::points,
};

const INTEGERS: [&str; 12] =
    ["char", "int8", "uchar", "uint8", "short", "int16", "ushort", "uint16", "int", "int32", "uint", "uint32"];
const REALS: [&str; 4] = ["float", "float32", "double", "float64"];

/// Names of the spherical harmonic coefficients above degree 0.
const REST: [&str; 45] = [
    "f_rest_0",
    "f_rest_1",
    "f_rest_2",
    "f_rest_3",
    "f_rest_4",
    "f_rest_5",
    "f_rest_6",
    "f_rest_7",
    "f_rest_8",
    "f_rest_9",
    "f_rest_10",
    "f_rest_11",
    "f_rest_12",
    "f_rest_13",
    "f_rest_14",
    "f_rest_15",
    "f_rest_16",
    "f_rest_17",
    "f_rest_18",
    "f_rest_19",
    "f_rest_20",
    "f_rest_21",
    "f_rest_22",
    "f_rest_23",
    "f_rest_24",
    "f_rest_25",
    "f_rest_26",
    "f_rest_27",
    "f_rest_28",
    "f_rest_29",
    "f_rest_30",
    "f_rest_31",
    "f_rest_32",
    "f_rest_33",
    "f_rest_34",
    "f_rest_35",
    "f_rest_36",
    "f_rest_37",
    "f_rest_38",
    "f_rest_39",
    "f_rest_40",
    "f_rest_41",
    "f_rest_42",
    "f_rest_43",
    "f_rest_44",
];

/// The encoding of numbers.
#[derive(Clone, Copy)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

fn put(out: &mut Vec<u8>, encoding: Encoding, kind: &str, value: f64) {
    macro_rules! bytes {
        ($type:ty) => {
            match encoding {
                Encoding::Ascii => out.extend(format!("{} ", value as $type).bytes()),
                Encoding::Little => out.extend((value as $type).to_le_bytes()),
                Encoding::Big => out.extend((value as $type).to_be_bytes()),
            }
        };
    }
    match kind {
        "char" | "int8" => bytes!(i8),
        "uchar" | "uint8" => bytes!(u8),
        "short" | "int16" => bytes!(i16),
        "ushort" | "uint16" => bytes!(u16),
        "int" | "int32" => bytes!(i32),
        "uint" | "uint32" => bytes!(u32),
        "float" | "float32" => bytes!(f32),
        _ => bytes!(f64),
    }
}

/// A property: type of a list's length (`None` for a scalar), type of its values, and name.
type Property = (Option<&'static str>, &'static str, &'static str);

fn scalar(random: &mut Random, name: &'static str) -> Property {
    let kind = if random.one_in(3) { INTEGERS[random.below(12)] } else { REALS[random.below(4)] };
    (None, kind, name)
}

fn vertex_properties(random: &mut Random) -> Vec<Property> {
    let mut names = vec!["x", "y", "z"];
    let groups: [&[&str]; 9] = [
        &["nx", "ny", "nz"],
        &["red", "green", "blue"],
        &["red", "green", "blue", "alpha"],
        &["radius"],
        &["scale", "quality"],
        &["normal_x", "normal_y", "normal_z", "r", "g", "b"],
        &["sx", "sy", "sz", "tx", "ty", "tz"],
        &["clip1_u", "clip1_v", "clip1_w", "clip2_u", "clip2_v", "clip2_w"],
        &["cap_uu", "cap_uv", "cap_vv"],
    ];
    for group in groups {
        if random.one_in(3) {
            names.extend(group);
        }
    }
    let gaussian = random.one_in(3);
    if gaussian {
        names.extend([
            "rot_0", "rot_1", "rot_2", "rot_3", "opacity", "f_dc_0", "f_dc_1", "f_dc_2", "scale_0", "scale_1",
        ]);
        names.extend(random.one_in(3).then_some("scale_2"));
        // Coefficients of degree 0, 1, 2 or 3.
        names.extend(&REST[..[0, 9, 24, 45][random.below(4)]]);
    }
    let one_color_type = random.one_in(2).then_some("uchar");
    let mut properties: Vec<Property> = names
        .into_iter()
        .map(|name| match one_color_type {
            Some(kind) if ["red", "green", "blue", "alpha", "r", "g", "b"].contains(&name) => (None, kind, name),
            _ => scalar(random, name),
        })
        .collect();
    if random.one_in(4) {
        properties.push((Some(INTEGERS[random.below(12)]), INTEGERS[random.below(12)], "neighbours"));
    }
    for last in (1..properties.len()).rev() {
        properties.swap(last, random.below(last + 1));
    }
    properties
}

fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    let (encoding, name) =
        [(Encoding::Ascii, "ascii"), (Encoding::Little, "binary_little_endian"), (Encoding::Big, "binary_big_endian")]
            [random.below(3)];
    let line = random.pick(&["\n", "\n", "\r\n", "\r"]);
    let points = random.count(60);
    let faces: Vec<Property> = vec![(Some("uchar"), "int", "vertex_indices"), (None, "float", "flags")];
    let mut elements = vec![("vertex", points, vertex_properties(random))];
    if random.one_in(3) {
        let at = random.below(2);
        elements.insert(at, ("face", random.count(10), faces[random.below(2)..].to_vec()));
    }
    let mut out = format!("ply{line}format {name} 1.0{line}");
    if random.one_in(3) {
        out += &format!("comment made at random{line}obj_info {}{line}", random.bits());
    }
    for (name, count, properties) in &elements {
        out += &format!("element {name} {count}{line}");
        for (list, kind, name) in properties {
            out += &match list {
                Some(length) => format!("property list {length} {kind} {name}{line}"),
                None => format!("property {kind} {name}{line}"),
            };
        }
    }
    let mut out = (out + "end_header" + line).into_bytes();
    let place = Place::any(random);
    for (_, count, properties) in elements {
        for _ in 0..count {
            let point = place.point(random);
            for (list, kind, name) in &properties {
                let mut length = 1;
                if let Some(counter) = list {
                    length = random.below(5);
                    put(&mut out, encoding, counter, length as f64);
                }
                for _ in 0..length {
                    let value = match *name {
                        "x" => point[0],
                        "y" => point[1],
                        "z" => point[2],
                        "red" | "green" | "blue" | "r" | "g" | "b" => random.between(0.0, 300.0),
                        "opacity" => [0.0, -1e9, 1e9, f64::NAN, 3.0, -2.0][random.below(6)],
                        _ if name.starts_with("scale_") && random.one_in(40) => {
                            [f64::NAN, -400.0, 400.0][random.below(3)]
                        }
                        _ if name.starts_with("scale_") => random.between(-6.0, -1.0),
                        "radius" | "scale" if random.one_in(8) => place.point(random)[0],
                        "radius" | "scale" => random.between(0.0, 0.2),
                        _ => random.between(-1.0, 1.0),
                    };
                    put(&mut out, encoding, kind, value);
                }
            }
            if matches!(encoding, Encoding::Ascii) {
                out.extend(line.bytes());
            }
        }
    }
    (out, points)
}
