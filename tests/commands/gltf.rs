//! Scenes of glTF on the command line: the same picture as the same mesh in another form.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use super::common::command::{Folder, succeeds, text};
use base64::prelude::{BASE64_STANDARD, Engine};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Renders a file by the reference; returns the bytes of the picture.
fn picture(folder: &Folder, file: &str, more: &[&str]) -> Vec<u8> {
    let out = folder.path("out.png");
    let all = ["render", file, "-o", text(&out), "--backend", "reference", "--size", "64x64", "--eye", "3,4,2.6"];
    succeeds(&[&all[..], more].concat());
    std::fs::read(out).unwrap()
}

#[test]
fn a_textured_mesh_has_the_picture_of_its_obj() {
    let folder = Folder::new();
    let binary = format!("{ROOT}/tests/readers/trimesh_cube.glb");
    let obj = std::fs::read_to_string(format!("{ROOT}/data/cube.obj")).unwrap();
    std::fs::copy(format!("{ROOT}/data/cube.png"), folder.path("cube.png")).unwrap();
    folder.file("cube.mtl", "newmtl m\nKd 1 1 1\nmap_Kd cube.png\n");
    let obj = folder.file("cube.obj", obj.replacen("v ", "mtllib cube.mtl\nusemtl m\nv ", 1));
    let expected = picture(&folder, text(&obj), &[]);
    assert_eq!(picture(&folder, &binary, &[]), expected);
    assert_eq!(picture(&folder, &binary, &["--mesh", "triangles", "--up", "y"]), expected);
    // A control: without its image the cube has another picture.
    assert_ne!(picture(&folder, &format!("{ROOT}/data/cube.obj"), &[]), expected);
}

#[test]
fn info_says_what_a_scene_holds() {
    let folder = Folder::new();
    let said = |file: &str| {
        let output = succeeds(&["info", file]);
        String::from_utf8([output.stdout, output.stderr].concat()).unwrap()
    };
    let cube = said(&format!("{ROOT}/tests/readers/trimesh_cube.glb"));
    for words in ["glTF 2.0, binary, 1 node, 1 mesh, 1 material, 1 image", "POSITION, TEXCOORD_0", "trimesh"] {
        assert!(cube.contains(words), "{words}: {cube}");
    }
    let bytes = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5], [1.0, 1.0, 0.5]].concat();
    let data = BASE64_STANDARD.encode(bytes.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>());
    let cloud = folder.file(
        "cloud.gltf",
        format!(
            r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"mode":0}},{{"attributes":{{"POSITION":0}},"mode":3}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"type":"VEC3","count":4}}],"bufferViews":[{{"buffer":0,"byteLength":48}}],"buffers":[{{"byteLength":48,"uri":"data:;base64,{data}"}}]}}"#
        ),
    );
    let cloud = said(text(&cloud));
    assert!(cloud.contains("glTF 2.0, text") && cloud.contains("lines are left out"), "{cloud}");
}
