//! Fuzzes glTF files, as text and binary.

use super::made::{Made, U8};
use super::mutate::Grammar;
use super::random::{Place, Random};
use super::{Target, render};
use std::collections::HashSet;

const WORDS: &[&str] = &[
    "\"POSITION\":0",
    "\"NORMAL\":1",
    "\"COLOR_0\":2",
    "\"TEXCOORD_0\":3",
    "\"mode\":5",
    "\"mode\":0",
    "\"sparse\":{\"count\":1,\"indices\":{\"bufferView\":0,\"componentType\":5121},\"values\":{\"bufferView\":1}}",
    "\"byteStride\":16",
    "\"byteStride\":0",
    "\"children\":[0]",
    "\"children\":[1,1]",
    "\"matrix\":[1,0,0,0,0,1,0,0,0,0,-1,0,0,0,0,1]",
    "\"scale\":[0,0,0]",
    "\"rotation\":[0,0,0,0]",
    "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"]",
    "\"scene\":1",
    "\"normalized\":true",
    "\"uri\":\"a.bin\"",
    "\"uri\":\"data:;base64,AAAA\"",
    "SCALAR",
    "VEC2",
    "MAT4",
    "5120",
    "5125",
    "5126",
    "BIN",
    "null",
    "{}",
    "[]",
    "{",
    "]",
    ",",
];

pub const TEXT: Target = Target {
    name: "gltf",
    extension: "gltf",
    generate: |random| {
        let (made, rest, count) = scene(random);
        (made.text(&rest).into_bytes(), count)
    },
    grammar: Grammar { words: WORDS, separators: b"{}[]:,\"", text: 1 << 14, numbers: |_| Vec::new() },
    execute: render::points,
};

pub const BINARY: Target = Target {
    name: "glb",
    extension: "glb",
    generate: |random| {
        let (made, rest, count) = scene(random);
        (made.binary(&rest), count)
    },
    grammar: Grammar {
        words: WORDS,
        separators: b"{}[]:,\"",
        text: 1 << 14,
        // The version, the length, and the length and kind of the first chunk.
        numbers: |bytes| [4, 8, 12, 16].map(|at| (at, 4)).into_iter().filter(|(at, _)| at + 4 <= bytes.len()).collect(),
    },
    execute: render::points,
};

/// A scene of one mesh or cloud; returns the number of its points.
fn scene(random: &mut Random) -> (Made, String, usize) {
    let place = Place::any(random);
    let mut made = Made::default();
    let vertices = 3 + random.count(30);
    let positions: Vec<[f32; 3]> = (0..vertices).map(|_| place.point(random).map(|c| c as f32)).collect();
    made.floats(&positions);
    made.floats(&vec![[0.0, 0.6, 0.8]; vertices]);
    let colors: Vec<u8> = (0..4 * vertices).map(|_| random.bits() as u8).collect();
    made.accessor(vertices, (U8, "VEC4"), &colors);
    let places: Vec<[f32; 2]> = (0..vertices).map(|_| [0; 2].map(|_| random.between(-1.0, 2.0) as f32)).collect();
    made.floats(&places);
    let corners: Vec<u16> = (0..3 * (1 + random.count(30))).map(|_| random.below(vertices) as u16).collect();
    made.indices(&corners);
    let png = made.view(include_bytes!("../commands/cases/files/obj/quad.png"));
    let attributes = random.pick(&[
        r#""POSITION":0"#,
        r#""POSITION":0,"NORMAL":1"#,
        r#""POSITION":0,"COLOR_0":2"#,
        r#""POSITION":0,"NORMAL":1,"COLOR_0":2,"TEXCOORD_0":3"#,
    ]);
    let is_cloud = random.one_in(4);
    let used = if is_cloud { corners.len() } else { corners.iter().collect::<HashSet<_>>().len() };
    let material = random.pick(&[
        "{}",
        r#"{"pbrMetallicRoughness":{"baseColorFactor":[1,0.5,0,0.5]},"alphaMode":"BLEND"}"#,
        r#"{"pbrMetallicRoughness":{"baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":{"scale":[2,2]}}}},"alphaMode":"MASK"}"#,
    ]);
    let node =
        random.pick(&[r#"{"mesh":0}"#, r#"{"mesh":0,"scale":[1,-1,1]}"#, r#"{"mesh":0,"rotation":[0,0.6,0,0.8]}"#]);
    let mode = if is_cloud { 0 } else { 4 };
    let rest = format!(
        r#""scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"children":[1]}},{node}],"meshes":[{{"primitives":[{{"attributes":{{{attributes}}},"indices":4,"mode":{mode},"material":0}}]}}],"materials":[{material}],"textures":[{{"source":0,"sampler":0}}],"samplers":[{{"wrapS":33071,"wrapT":33648}}],"images":[{{"bufferView":{png},"mimeType":"image/png"}}]"#
    );
    (made, rest, used)
}
