//! glTF files in both forms, made by hand and by another program, and damaged ones.

use super::made::{F32, I16, Made, U8, U16, U32};
use super::{Folder, ReadOptions, io};
use epsplat::io::{Points, Up};
use epsplat::low_level::scene::Colors;

const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
const OUTWARD: [u16; 12] = [0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3];

/// A tetrahedron at the accessors 0 (POSITION) and 1 (indices).
fn tetrahedron() -> Made {
    let mut made = Made::default();
    made.floats(&CORNERS);
    made.indices(&OUTWARD);
    made
}

/// The members of a scene of one node with a mesh of these primitives.
fn scene(primitives: &str) -> String {
    format!(r#""scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{primitives}]}}]"#)
}

const PLAIN: &str = r#"{"attributes":{"POSITION":0},"indices":1}"#;

/// The corners of all triangles.
fn corners(points: &Points) -> Vec<[[f64; 3]; 3]> {
    let faces = points.faces.as_ref().unwrap();
    faces.triangles.iter().map(|corners| corners.map(|vertex| points.positions[vertex as usize])).collect()
}

fn linear(points: &Points) -> Vec<[f32; 4]> {
    match &points.colors {
        Some(Colors::Linear(colors)) => colors.clone(),
        _ => Vec::new(),
    }
}

/// An image of two by one texels, red and half transparent blue, as a data URI.
fn image() -> String {
    use base64::prelude::{BASE64_STANDARD, Engine};
    use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
    let mut png = Vec::new();
    PngEncoder::new(&mut png).write_image(&[255, 0, 0, 255, 0, 0, 255, 128], 2, 1, ExtendedColorType::Rgba8).unwrap();
    format!("data:image/png;base64,{}", BASE64_STANDARD.encode(png))
}

#[test]
fn every_form_becomes_the_same_mesh_as_obj() {
    let folder = Folder::new();
    let made = tetrahedron();
    let scene = scene(PLAIN);
    let of_text = folder.read("a.gltf", made.text(&scene).as_bytes()).unwrap();
    assert!(of_text.closed && of_text.is_mesh() && of_text.up == Some(Up::Y), "{of_text:?}");
    assert!(of_text.notes.is_empty() && of_text.colors.is_none(), "{:?}", of_text.notes);
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    assert_eq!(of_text, folder.read("a.obj", obj.as_bytes()).unwrap());
    let binary = made.binary(&scene);
    for name in ["a.glb", "a.GLB", "a.gltf", "a", "a.txt"] {
        assert_eq!(folder.read(name, &binary).unwrap(), of_text, "{name}");
    }
    // A buffer beside the file, with a name that its URI escapes.
    std::fs::write(folder.path("a b.bin"), &made.bytes).unwrap();
    for (name, uri) in [("b.gltf", "a%20b.bin"), ("c", "a b.bin"), ("d.gltf", "A%20B.BIN")] {
        assert_eq!(folder.read(name, made.json(Some(uri), &scene).as_bytes()).unwrap(), of_text, "{name}");
        assert_eq!(io::companions(&folder.path(name), None).unwrap(), [folder.path("a b.bin")]);
    }
    let mesh = io::read_mesh(&folder.path("a.glb"), &()).unwrap();
    assert_eq!((mesh.triangles.len(), mesh.positions.len()), (4, 4));
    let options = ReadOptions { describe: true, ..ReadOptions::default() };
    let about = *io::read_with(&folder.path("a.glb"), options, &()).unwrap().about.unwrap();
    assert_eq!(
        (about.format.as_str(), about.software.as_deref()),
        ("glTF 2.0, binary, 1 node, 1 mesh", Some("by hand"))
    );
}

#[test]
fn all_modes_and_indices_give_the_same_triangles() {
    let folder = Folder::new();
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [9.0, 9.0, 9.0]];
    let mut made = Made::default();
    made.floats(&square);
    made.floats(&square[..4]);
    made.indices(&[0, 1, 2, 2, 1, 3]);
    made.accessor(6, (U8, "SCALAR"), &[0, 1, 2, 2, 1, 3]);
    made.accessor(6, (U32, "SCALAR"), &[0u32, 1, 2, 2, 1, 3].map(u32::to_le_bytes).concat());
    made.indices(&[0, 1, 2, 3, 3, 3]);
    made.indices(&[1, 3, 2, 0]);
    made.floats(&[0, 1, 2, 2, 1, 3].map(|vertex| square[vertex]));
    let of = |primitive: &str| {
        let points = folder.read("a.gltf", made.text(&scene(primitive)).as_bytes()).unwrap();
        assert!(points.positions.iter().all(|p| p[0] < 2.0), "a vertex of no triangle is read: {primitive}");
        // A triangle may begin at any of its corners.
        let turned = |[a, b, c]: [[f64; 3]; 3]| [[a, b, c], [b, c, a], [c, a, b]];
        let first = |corners| turned(corners).into_iter().min_by(|a, b| a.partial_cmp(b).unwrap()).unwrap();
        corners(&points).into_iter().map(first).collect::<Vec<_>>()
    };
    let [a, b, c, d] = [0, 1, 2, 3].map(|vertex| square[vertex].map(f64::from));
    for primitive in [
        r#"{"attributes":{"POSITION":0},"indices":2}"#,
        r#"{"attributes":{"POSITION":0},"indices":3,"mode":4}"#,
        r#"{"attributes":{"POSITION":0},"indices":4}"#,
        r#"{"attributes":{"POSITION":1},"mode":5}"#,
        r#"{"attributes":{"POSITION":0},"indices":5,"mode":5}"#,
        r#"{"attributes":{"POSITION":7}}"#,
    ] {
        assert_eq!(of(primitive), [[a, b, c], [c, b, d]], "{primitive}");
    }
    assert_eq!(of(r#"{"attributes":{"POSITION":0},"indices":6,"mode":6}"#), [[c, b, d], [a, b, c]]);
    let said =
        folder.refusal("a.gltf", made.text(&scene(r#"{"attributes":{"POSITION":1},"indices":2,"mode":9}"#)).as_bytes());
    assert_eq!(said, "a primitive has an unknown mode");
}

#[test]
fn nodes_place_meshes_in_f64_and_mirrors_turn_the_winding() {
    let folder = Folder::new();
    let mut made = Made::default();
    made.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    made.floats(&[[0.0, 0.6, 0.8]; 3]);
    let mesh = r#""meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1}}]}]"#;
    let of = |nodes: &str| folder.read("a.gltf", made.text(&format!("{nodes},{mesh}")).as_bytes()).unwrap();
    // The parent turns by 90 degrees about z, as a matrix; the child scales, then moves.
    let points = of(r#""scene":1,"scenes":[{},{"nodes":[0]}],"nodes":[
        {"children":[1],"matrix":[0,1,0,0,-1,0,0,0,0,0,1,0,500000.125,5000000.001,0,1]},
        {"mesh":0,"scale":[1,2,4],"translation":[10,0,0]}, {"mesh":0}]"#);
    let at = [500_000.125, 5_000_000.001 + 10.0, 0.0];
    assert_eq!(points.positions, [at, [at[0], at[1] + 1.0, 0.0], [at[0] - 2.0, at[1], 0.0]]);
    let [x, y, z] = points.normals.unwrap()[0].map(f64::from);
    // The inverse transpose of the scale gives (0, 0.3, 0.2), and the parent turns it.
    let length = 0.13f64.sqrt();
    assert!((x + 0.3 / length).abs() < 1e-6 && y.abs() < 1e-6 && (z - 0.2 / length).abs() < 1e-6, "{x} {y} {z}");
    // A mirror along x: the triangle still faces +z, and so does its normal.
    let mirrored = of(r#""nodes":[{"mesh":0,"scale":[-1,1,1]}]"#);
    assert_eq!(mirrored.faces.as_ref().unwrap().triangles, [[0, 2, 1]]);
    assert_eq!(mirrored.positions[1], [-1.0, 0.0, 0.0]);
    assert!(mirrored.normals.unwrap()[0][2] > 0.7);
    // Without a scene, each node without a parent shows, and a quaternion turns about y.
    let half = 0.5f64.sqrt();
    let both = of(&format!(r#""nodes":[{{"mesh":0}},{{"children":[2]}},{{"mesh":0,"rotation":[0,{half},0,{half}]}}]"#));
    assert_eq!(both.faces.as_ref().unwrap().triangles, [[0, 1, 2], [3, 4, 5]]);
    assert!((both.positions[4][2] + 1.0).abs() < 1e-12, "{:?}", both.positions);
    // A flattened mesh keeps its normals' side.
    let flat = of(r#""nodes":[{"mesh":0,"scale":[1,1,0]}]"#);
    assert_eq!(flat.normals.unwrap()[0], [0.0, 0.0, 1.0]);
}

#[test]
fn colours_are_linear_and_the_mode_decides_about_alpha() {
    let folder = Folder::new();
    let mut made = tetrahedron();
    made.accessor(4, (U8, "VEC4"), &[[255, 0, 51, 102], [0, 255, 0, 255], [0; 4], [255; 4]].concat());
    made.floats(&[[0.25, 0.5, 1.0]; 4]);
    let of = |primitive: &str, materials: &str| {
        let rest = format!(r#"{},"materials":[{materials}]"#, scene(primitive));
        folder.read("a.gltf", made.text(&rest).as_bytes()).unwrap()
    };
    let colored = r#"{"attributes":{"POSITION":0,"COLOR_0":2},"indices":1,"material":0}"#;
    let factor = r#""pbrMetallicRoughness":{"baseColorFactor":[0.5,1,1,0.5]}"#;
    for (mode, alphas) in [
        ("", [1.0; 4]),
        (r#","alphaMode":"BLEND""#, [0.2, 0.5, 0.0, 0.5]),
        (r#","alphaMode":"MASK""#, [0.0, 1.0, 0.0, 1.0]),
        (r#","alphaMode":"MASK","alphaCutoff":0.2"#, [1.0, 1.0, 0.0, 1.0]),
    ] {
        let colors = linear(&of(colored, &format!("{{{factor}{mode}}}")));
        assert_eq!(colors[0][..3], [0.5, 0.0, 0.2]);
        assert!(colors.iter().zip(alphas).all(|(color, alpha)| (color[3] - alpha).abs() < 1e-6), "{mode}: {colors:?}");
    }
    let three = r#"{"attributes":{"POSITION":0,"COLOR_0":3},"indices":1}"#;
    assert_eq!(linear(&of(three, "")), [[0.25, 0.5, 1.0, 1.0]; 4]);
    // A material without colours of vertices paints triangles.
    let points = of(r#"{"attributes":{"POSITION":0},"indices":1,"material":0}"#, &format!("{{{factor}}}"));
    assert!(points.colors.is_none());
    assert_eq!(points.faces.unwrap().paint.unwrap().colors, [[0.5, 1.0, 1.0, 1.0]; 4]);
    // One primitive has colours, the other has a material alone.
    let both =
        of(&format!(r#"{three},{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}"#), &format!("{{{factor}}}"));
    assert_eq!(linear(&both)[3..5], [[0.25, 0.5, 1.0, 1.0], [0.5, 1.0, 1.0, 1.0]]);
}

#[test]
fn images_are_placed_by_their_samplers_and_transforms() {
    let folder = Folder::new();
    let mut made = Made::default();
    made.floats(&CORNERS[..3]);
    made.floats(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    made.floats(&[[0.0, 0.25], [3.0, 0.25], [0.0, 0.5]]);
    made.floats(&[[0.5, 0.5, 0.5, 1.0]; 3]);
    let of = |texture: &str, more: &str| {
        let attributes = r#"{"POSITION":0,"TEXCOORD_0":1,"TEXCOORD_1":2,"COLOR_0":3}"#;
        let scene = scene(&format!(r#"{{"attributes":{attributes},"material":0}}"#));
        let rest = format!(
            r#"{scene},"materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[1,0.5,1,0.5],"baseColorTexture":{{"index":0{texture}}}}}{more}}}],
            "textures":[{{"source":0,"sampler":0}}],"samplers":[{{"wrapS":33071,"wrapT":10497}}],"images":[{{"uri":"{}"}}]"#,
            image()
        );
        let points = folder.read("a.gltf", made.text(&rest).as_bytes()).unwrap();
        let paint = *points.faces.as_ref().unwrap().paint.clone().unwrap();
        (points, paint)
    };
    let (points, paint) = of("", "");
    assert_eq!(paint.places, [[[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]]]);
    // The colour that all vertices share multiplies the image; an opaque material ignores alphas.
    assert_eq!((paint.colors.as_slice(), paint.numbers.as_slice()), (&[[0.5, 0.25, 0.5, 1.0]][..], &[0][..]));
    assert_eq!(paint.textures[0].texels(), [[255, 0, 0, 255], [0, 0, 255, 255]]);
    assert!(paint.textures[0].clamps() && points.colors.is_none() && points.notes.is_empty(), "{:?}", points.notes);
    let (_, blended) = of("", r#","alphaMode":"BLEND""#);
    assert_eq!((blended.colors[0][3], blended.textures[0].texels()[1]), (0.5, [0, 0, 255, 128]));
    let (_, cut) = of("", r#","alphaMode":"MASK","alphaCutoff":0.3"#);
    assert_eq!((cut.colors[0][3], cut.textures[0].texels()[1]), (1.0, [0, 0, 255, 0]));
    // The second set leaves the image along the axis that clamps.
    let (_, second) = of(r#","texCoord":1"#, "");
    assert_eq!(second.places, [[[0.0, 0.75], [3.0, 0.75], [0.0, 0.5]]]);
    assert!(second.textures[0].clamps());
    // The example of KHR_texture_transform: "only the lower left quadrant of the source image".
    let moved =
        r#","extensions":{"KHR_texture_transform":{"offset":[0,1],"rotation":1.57079632679,"scale":[0.5,0.5]}}"#;
    let (_, moved) = of(moved, "");
    for (found, expected) in moved.places[0].iter().zip([[0.0, 0.0], [0.0, 0.5], [0.5, 0.0]]) {
        assert!(found.iter().zip(expected).all(|(a, b): (&f32, f32)| (a - b).abs() < 1e-6), "{:?}", moved.places);
    }
    let (points, apart) = of(r#","texCoord":1,"extensions":{"KHR_texture_transform":{"scale":[1,8]}}"#, "");
    assert!(!apart.textures[0].clamps() && points.notes.len() == 1 && points.notes[0].contains("repeats"));
}

#[test]
fn images_that_cannot_be_read_are_left_out_with_a_note() {
    let folder = Folder::new();
    let mut made = Made::default();
    made.floats(&CORNERS[..3]);
    made.floats(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    let of = |textures: &str, images: &str| {
        let scene = scene(r#"{"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":0}"#);
        let material = r#"{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}"#;
        let rest = format!(r#"{scene},"materials":[{material}],"textures":[{textures}],"images":[{images}]"#);
        folder.read("a.gltf", made.text(&rest).as_bytes()).map(|points| points.notes)
    };
    for (textures, images, word) in [
        (r#"{"source":0}"#, r#"{"uri":"lost.png"}"#, "lost.png"),
        (r#"{"source":0}"#, r#"{"uri":"data:image/png;base64,AAAA"}"#, "not a readable PNG"),
        (r#"{"source":0}"#, r#"{"uri":"https://example.org/a.png"}"#, "only files are read"),
        (r#"{"source":0}"#, r#"{"bufferView":9}"#, "buffer view 9"),
        (r#"{"source":0}"#, "{}", "no place"),
        (r#"{"extensions":{"KHR_texture_basisu":{"source":0}}}"#, "{}", "KHR_texture_basisu"),
    ] {
        let notes = of(textures, images).unwrap();
        assert!(notes.len() == 1 && notes[0].contains(word) && notes[0].contains("texture is left out"), "{notes:?}");
    }
    for (textures, images) in [("", ""), (r#"{"source":3}"#, "{}"), (r#"{"source":0,"sampler":1}"#, "{}")] {
        assert!(of(textures, images).unwrap_err().to_string().contains("does not exist"));
    }
    // An image that can be read shows after any number of others that cannot, up to a limit.
    for (missing, is_shown) in [(20, true), (255, true), (256, false)] {
        let materials = (0..=missing)
            .map(|k| format!(r#"{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":{k}}}}}}}"#))
            .collect::<Vec<_>>();
        let textures = (0..=missing).map(|k| format!(r#"{{"source":{k}}}"#)).collect::<Vec<_>>();
        let images = (0..missing).map(|k| format!(r#"{{"uri":"{k}.png"}}"#));
        let images = images.chain([format!(r#"{{"uri":"{}"}}"#, image())]).collect::<Vec<_>>();
        let primitives = (0..=missing)
            .map(|k| format!(r#"{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"material":{k}}}"#))
            .collect::<Vec<_>>();
        let [materials, textures, images] = [materials, textures, images].map(|all| all.join(","));
        let scene = scene(&primitives.join(","));
        let rest = format!(r#"{scene},"materials":[{materials}],"textures":[{textures}],"images":[{images}]"#);
        let points = folder.read("a.gltf", made.text(&rest).as_bytes()).unwrap();
        let paint = points.faces.unwrap().paint.unwrap();
        assert_eq!(paint.textures.len(), usize::from(is_shown), "{missing} {:?}", points.notes);
        let last = points.notes.last().unwrap();
        let more = missing - 16 + usize::from(!is_shown);
        assert_eq!(*last, format!("and {more} more notes about its materials"));
    }
    assert!(!io::companions(&folder.path("a.gltf"), None).unwrap().is_empty());
}

#[test]
fn quantised_and_sparse_accessors_are_read() {
    let folder = Folder::new();
    let mut made = Made::default();
    let shorts: [i16; 12] = [0, 0, 0, 0, 32767, 0, 0, 0, 0, -32767, 0, 0];
    let view = made.view(&shorts.map(i16::to_le_bytes).concat());
    // A step of 8 bytes for elements of 6.
    made.described(&format!(
        r#"{{"bufferView":{view},"componentType":{I16},"type":"VEC3","count":3,"normalized":true}}"#
    ));
    let (numbers, values) =
        (made.view(&[1, 3]), made.view(&[7.0f32, 8.0, 9.0, 4.0, 5.0, 6.0].map(f32::to_le_bytes).concat()));
    made.described(&format!(
        r#"{{"componentType":{F32},"type":"VEC3","count":4,"sparse":{{"count":2,"indices":{{"bufferView":{numbers},"componentType":{U8}}},"values":{{"bufferView":{values}}}}}}}"#
    ));
    let of = |rest: &str| folder.read("a.gltf", rest.as_bytes()).unwrap().positions;
    let text = made.text(&scene(r#"{"attributes":{"POSITION":0}}"#)).replacen(
        r#""byteLength":24"#,
        r#""byteStride":8,"byteLength":24"#,
        1,
    );
    assert_eq!(of(&text), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]);
    let text = made.text(&scene(r#"{"attributes":{"POSITION":1},"mode":0}"#));
    assert_eq!(of(&text), [[0.0; 3], [7.0, 8.0, 9.0], [0.0; 3], [4.0, 5.0, 6.0]]);
    let stored = made.view(&[1.0f32, 2.0, 3.0, 1.0, 2.0, 3.0].map(f32::to_le_bytes).concat());
    let (numbers, values) =
        (made.view(&1u16.to_le_bytes()), made.view(&[7.0f32, 8.0, 9.0].map(f32::to_le_bytes).concat()));
    made.described(&format!(
        r#"{{"bufferView":{stored},"componentType":{F32},"type":"VEC3","count":2,"sparse":{{"count":1,"indices":{{"bufferView":{numbers},"componentType":{U16}}},"values":{{"bufferView":{values}}}}}}}"#
    ));
    let text = made.text(&scene(r#"{"attributes":{"POSITION":2},"mode":0}"#));
    assert_eq!(of(&text), [[1.0, 2.0, 3.0], [7.0, 8.0, 9.0]]);
}

#[test]
fn points_alone_are_a_cloud_and_what_is_not_drawn_is_told() {
    let folder = Folder::new();
    let mut made = tetrahedron();
    made.accessor(4, (U8, "VEC4"), &[255; 16]);
    let of = |primitives: &str, more: &str| {
        folder.read("a.glb", &made.binary(&format!("{}{more}", scene(primitives)))).unwrap()
    };
    let cloud = of(r#"{"attributes":{"POSITION":0,"COLOR_0":2},"mode":0}"#, "");
    assert_eq!((cloud.positions.len(), linear(&cloud).len()), (4, 4));
    assert!(cloud.faces.is_none() && !cloud.is_mesh() && cloud.radii.is_none() && cloud.notes.is_empty());
    let lines = r#"{"attributes":{"POSITION":0},"mode":1}"#;
    let mixed = of(&format!(r#"{PLAIN},{{"attributes":{{"POSITION":0}},"mode":0}},{lines},{lines}"#), "");
    assert_eq!(mixed.notes, ["4 points are left out, as the file has triangles too", "lines are left out"]);
    assert_eq!(mixed.positions.len(), 4);
    let target = r#"{"attributes":{"POSITION":0},"indices":1,"targets":[{"POSITION":0}]}"#;
    let still = of(target, r#","animations":[{"channels":[],"samplers":[]},7]"#);
    assert_eq!(still.notes.len(), 2, "{:?}", still.notes);
    let rest =
        scene(PLAIN).replace(r#"{"mesh":0}"#, r#"{"mesh":0,"skin":0,"extensions":{"EXT_mesh_gpu_instancing":{}}}"#);
    let notes = folder.read("a.glb", &made.binary(&rest)).unwrap().notes;
    assert!(notes.len() == 2 && notes[0].contains("skin") && notes[1].contains("EXT_mesh_gpu_instancing"), "{notes:?}");
}

/// The file is the cube of `data` as trimesh 5.2.0 exports it.
#[test]
fn a_file_of_another_program_is_the_mesh_that_it_was_made_from() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/readers/trimesh_cube.glb");
    let options = ReadOptions { describe: true, ..ReadOptions::default() };
    let points = io::read_with(&path, options, &()).unwrap();
    let obj = io::read(&super::data("cube.obj"), &()).unwrap();
    // The program has another order of triangles, and begins some at another corner.
    let painted = |points: &Points| {
        let places = points.faces.as_ref().unwrap().paint.as_ref().unwrap().places.clone();
        let turned = |(at, places): ([[f64; 3]; 3], [[f32; 2]; 3])| {
            let from = |first: usize| [0, 1, 2].map(|k| (at[(first + k) % 3], places[(first + k) % 3]));
            [0, 1, 2].map(from).into_iter().min_by(|a, b| a.partial_cmp(b).unwrap()).unwrap()
        };
        let mut all: Vec<_> = corners(points).into_iter().zip(places).map(turned).collect();
        all.sort_by(|a, b| a.partial_cmp(b).unwrap());
        all
    };
    let (found, expected) = (painted(&points), painted(&obj));
    assert_eq!(found.len(), expected.len());
    for ((at, [u, v]), (there, [s, t])) in found.as_flattened().iter().zip(expected.as_flattened()) {
        assert!(at == there && (u - s).abs() < 1e-6 && (v - t).abs() < 1e-6, "{at:?} {u} {v}: {there:?} {s} {t}");
    }
    let about = points.about.unwrap();
    assert_eq!(about.software.as_deref(), Some("https://github.com/mikedh/trimesh"));
    assert!(points.closed && points.notes.is_empty());
}

#[test]
fn damaged_files_are_refused_in_a_sentence() {
    let folder = Folder::new();
    let made = tetrahedron();
    let whole = made.binary(&scene(PLAIN));
    for length in 0..whole.len() {
        folder.refusal("a.glb", &whole[..length]);
    }
    let text = made.text(&scene(PLAIN));
    for length in 0..text.len() {
        folder.refusal("a.gltf", &text.as_bytes()[..length]);
    }
    for (from, to, said) in [
        (r#""count":4"#, r#""count":5"#, "the accessor 0 goes beyond the end of its buffer view"),
        (r#""count":4"#, r#""count":4294967296"#, "the accessor 0 goes beyond"),
        (r#""count":4"#, r#""count":18446744073709551615"#, "the accessor 0 goes beyond"),
        (r#""count":12"#, r#""count":2147483648"#, "the limit for files of"),
        (r#""count":4"#, r#""count":3"#, "a primitive names the vertex 3 of 3"),
        (r#""byteLength":48"#, r#""byteLength":480"#, "the buffer view 0 goes beyond the end of its buffer"),
        (r#""byteOffset":48"#, r#""byteOffset":18446744073709551615"#, "the buffer view 1 goes beyond"),
        (r#""byteLength":48"#, r#""byteLength":48,"byteStride":4"#, "goes beyond the end of its buffer view"),
        (r#""type":"VEC3""#, r#""type":"VEC2""#, "elements of 2 numbers"),
        (r#""type":"VEC3""#, r#""type":"VEC9""#, "unknown type"),
        ("5123", "5126", "goes beyond"),
        ("5123", "5122", "no unsigned integers"),
        (r#""POSITION":0"#, r#""POSITION":7"#, "it names the accessor 7, which does not exist"),
        (r#""POSITION":0"#, r#""NORMAL":0"#, "a primitive has no POSITION"),
        (r#""indices":1"#, r#""indices":1,"material":3"#, "it names the material 3, which does not exist"),
        (r#"{"mesh":0}"#, r#"{"mesh":1}"#, "it names the mesh 1, which does not exist"),
        (r#"{"mesh":0}"#, r#"{"children":[0]}"#, "the node 0 has two parents or is below itself"),
        (r#"{"mesh":0}"#, r#"{"children":[4]}"#, "it names the node 4, which does not exist"),
        (r#""scene":0"#, r#""scene":1"#, "it names the scene 1, which does not exist"),
        (r#""version":"2.0""#, r#""version":"1.0""#, "it is glTF of version 1.0"),
        (r#""bufferView":0,"#, "", "neither a buffer view nor sparse values"),
        (
            r#""scene":0"#,
            r#""extensionsRequired":["KHR_draco_mesh_compression"]"#,
            "compressed by KHR_draco_mesh_compression",
        ),
        (r#""scene":0"#, r#""extensionsRequired":["EXT_x"]"#, "it needs the extension EXT_x, which is not read"),
        (r#""uri":"data:"#, r#""uri":"http://a/"#, "its buffer 0 cannot be read: only files are read"),
        (r#""uri":"data:"#, r#""uri":"lost/"#, "its buffer 0 cannot be read"),
    ] {
        assert!(text.contains(from), "{from}");
        let found = folder.refusal("a.gltf", text.replacen(from, to, 1).as_bytes());
        assert!(found.contains(said), "{from} {to}: {found}");
    }
    let refused = |text: &str| folder.refusal("a.gltf", text.as_bytes());
    assert!(
        refused(r#"{"asset":{"version":"2.0"},"nodes":[{"children":[1]},{"children":[0]}]}"#).contains("below another")
    );
    assert!(refused(&"[".repeat(100_000)).contains("it is no glTF file"));
    assert!(refused(r#"{"asset":{},"meshes":{"a":{}}}"#).contains("it is glTF of version 1.0"));
    assert!(folder.refusal("a.glb", b"glTF\x01\0\0\0\x14\0\0\0").contains("version 1"));
    assert!(folder.read("e.gltf", br#"{"asset":{"version":"2.0"},"scenes":[{}]}"#).unwrap().positions.is_empty());
}

/// Each node of a long chain, and many nodes that share one mesh, are read in time and memory in
/// proportion to the file.
#[test]
fn sizes_are_bounded_by_that_of_the_file() {
    let folder = Folder::new();
    let made = tetrahedron();
    let mesh = format!(r#""meshes":[{{"primitives":[{PLAIN}]}}]"#);
    let chain: Vec<_> = (1..200_000).map(|child| format!(r#"{{"children":[{child}]}}"#)).collect();
    let rest = format!(r#""nodes":[{},{{"mesh":0}}],{mesh}"#, chain.join(","));
    assert_eq!(folder.read("a.gltf", made.text(&rest).as_bytes()).unwrap().positions.len(), 4);
    let shared = vec![r#"{"mesh":0}"#; 10_000].join(",");
    let points = folder.read("a.gltf", made.text(&format!(r#""nodes":[{shared}],{mesh}"#)).as_bytes()).unwrap();
    assert_eq!(points.positions.len(), 40_000);
    let many = vec![PLAIN; 1000].join(",");
    let rest = format!(r#""nodes":[{shared}],"meshes":[{{"primitives":[{many}]}}]"#);
    assert!(folder.refusal("a.gltf", made.text(&rest).as_bytes()).contains("vertices and corners"));
    // A file that many buffers name counts once.
    std::fs::write(folder.path("large.bin"), vec![0; 1 << 20]).unwrap();
    let named = vec![r#"{"uri":"large.bin","byteLength":1}"#; 1000].join(",");
    let text = made.text(&rest).replacen(r#""buffers":["#, &format!(r#""buffers":[{named},"#), 1);
    let text = text.replace(r#""buffer":0"#, r#""buffer":1000"#);
    assert!(folder.refusal("a.gltf", text.as_bytes()).contains("vertices and corners"));
    let rest = format!(r#""nodes":[],"extras":[{}]"#, vec!["[]"; 1 << 22].join(","));
    assert!(folder.refusal("a.gltf", made.text(&rest).as_bytes()).contains("values or more"));
    let rest = format!(r#""nodes":[{}]"#, vec!["{}"; (1 << 20) + 1].join(","));
    assert!(folder.refusal("a.gltf", made.text(&rest).as_bytes()).contains("1048577 nodes"));
}
