//! Meshes as surfels and triangles: the files that `epsplat hybrid` writes look like the mesh, and
//! can be read again completely.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::sync::Arc;

use common::command::{DATA, Folder, fails, succeeds, text};
use common::meshes::sphere;
use epsplat::io::{self, Material, Mesh, Texture};
use epsplat::low_level::metrics::compare;
use epsplat::low_level::scene::{Colors, Scene};
use epsplat::low_level::surfels::hybrid::{hybrid, pixel};
use epsplat::low_level::surfels::with_triangles;

const VIEW: [&str; 8] = ["--size", "96x96", "--eye=20,15,50", "--target=0,5,0", "--fov", "30", "--shading", "unlit"];

fn scene(mesh: &Mesh) -> Scene {
    with_triangles(None, std::slice::from_ref(mesh)).unwrap().0
}

/// A mesh with everything that a file can hold: two materials, one with an image, colours, normals,
/// and coordinates that exceed f32 precision.
fn rich() -> Mesh {
    let texel = |k: u8| [40 * k, 255 - 30 * k, 7, 255];
    let image = Arc::new(Texture::new(2, 3, (0..6).map(texel).collect()).unwrap());
    let material = |texture: Option<&Arc<Texture>>| Material {
        name: "m".into(),
        diffuse: [1.0; 4],
        texture: texture.cloned(),
        image: None,
    };
    Mesh {
        positions: vec![[1e6 + 0.001, 0.0, 0.0], [1e6 + 1.0, 0.0, 0.5], [1e6, 1.0, 0.0], [1e6 + 1.0, 1.0, -0.25]],
        triangles: vec![[0, 1, 2], [2, 1, 3]],
        normals: Some(vec![[[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [0.0, 0.0, 1.0]]; 2]),
        colors: Some(Colors::Linear((0..4).map(|k| [0.1 * k as f32, 0.5, 1.0, 1.0]).collect())),
        texture: Some(vec![[[0.0, 0.0], [1.0, 0.25], [0.0, 1.0]], [[0.5, 0.5], [1.0, 0.0], [-2.0, 1.5]]]),
        materials: vec![material(None), material(Some(&image))],
        material: Some(vec![1, 0]),
        ..Mesh::default()
    }
}

#[test]
fn a_mesh_that_is_written_is_read_again() {
    let folder = Folder::new();
    let mesh = rich();
    io::png::write_texture(&folder.path("a.png"), mesh.materials[1].texture.as_ref().unwrap()).unwrap();
    io::ply::write_mesh(&folder.path("a.ply"), &mesh, &["a.png".into()], &()).unwrap();
    let again = io::read_mesh(&folder.path("a.ply"), &()).unwrap();
    assert!(again.notes.is_empty(), "{:?}", again.notes);
    assert_eq!(scene(&again).triangles, scene(&mesh).triangles);
    let other = Mesh { material: Some(vec![0, 1]), ..mesh.clone() };
    assert_ne!(scene(&other).triangles, scene(&mesh).triangles);
    // A mesh without images, colours and normals is read without them.
    let bare = Mesh { positions: mesh.positions, triangles: mesh.triangles, ..Mesh::default() };
    io::ply::write_mesh(&folder.path("b.ply"), &bare, &[], &()).unwrap();
    let again = io::read_mesh(&folder.path("b.ply"), &()).unwrap();
    assert_eq!((again.colors.is_none(), again.normals.is_none(), again.texture.is_none()), (true, true, true));
    assert_eq!((again.positions, again.triangles), (bare.positions, bare.triangles));
}

#[test]
fn parts_of_a_mesh_are_the_mesh() {
    let mesh = rich();
    let [first, second] = [[true, false], [false, true]].map(|keep| mesh.part(&keep));
    assert_eq!((first.positions.len(), second.positions.len()), (3, 3));
    let both = with_triangles(None, &[first, second]).unwrap().0;
    assert_eq!(both.triangles, scene(&mesh).triangles);
    let none = mesh.part(&[false; 2]);
    assert!(none.positions.is_empty() && none.triangles.is_empty() && none.check().is_ok());
    let pixel = pixel(&mesh, 100.0).unwrap();
    // Two triangles of thousands of pixels stay triangles.
    let divided = hybrid(&mesh, pixel, &()).unwrap();
    assert_eq!((divided.report.kept, divided.report.surfels, divided.surfels), (2, 0, None));
    assert!(hybrid(&Mesh { material: Some(vec![0]), ..mesh }, pixel, &()).is_err());
}

/// A hall of a few large triangles around a bunny of many small ones: the size of a triangle
/// decides whether surfels replace it.
///
/// One command draws surfels and triangles, also after `simplify`. This picture and that of the
/// whole mesh cover the same pixels, except for less than 1 %.
#[test]
fn one_command_draws_surfels_and_triangles() {
    let folder = Folder::new();
    let mut mesh = io::read_mesh(format!("{DATA}/bunny.obj").as_ref(), &()).unwrap();
    let small = mesh.triangles.len() as u64;
    let first = mesh.positions.len() as u32;
    mesh.positions.extend([[-200.0, 0.0, -200.0], [200.0, 0.0, -200.0], [200.0, 0.0, 200.0], [-200.0, 0.0, 200.0]]);
    mesh.triangles.extend([[first, first + 2, first + 1], [first, first + 3, first + 2]]);
    (mesh.normals, mesh.texture, mesh.material, mesh.colors) = (None, None, None, None);
    let input = folder.path("hall.ply");
    io::ply::write_mesh(&input, &mesh, &[], &()).unwrap();
    let (output, json) = (folder.path("out.ply"), folder.path("out.json"));
    succeeds(&["hybrid", text(&input), "-o", text(&output), "--pixels", "400", "--json", text(&json)]);
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    let (kept, surfels) = (report["kept"].as_u64().unwrap(), report["surfels"].as_u64().unwrap());
    assert!(kept < 2 + small / 10 && kept >= 2 && surfels > 100 && surfels < small, "{report}");
    assert_eq!(report["triangles"].as_u64(), Some(small + 2));

    let [whole, both, less] = ["whole.exr", "both.exr", "less.exr"].map(|name| folder.path(name));
    let render = |arguments: &[&str], image: &std::path::Path| {
        let told = succeeds(&[&["render"], arguments, &["-o", text(image), "--backend", "reference"], &VIEW].concat());
        String::from_utf8(told.stderr).unwrap()
    };
    render(&["--triangles", text(&input)], &whole);
    let told = render(&[text(&output)], &both);
    let triangles = format!("{kept} triangles drawn");
    assert!(told.contains("surfels and") && told.contains(&triangles), "{told}");
    // A file that is given twice has its triangles drawn once.
    let twice = render(&[text(&output), text(&output)], &folder.path("twice.exr"));
    assert!(twice.contains(&triangles), "{twice}");
    let difference =
        |image: &std::path::Path| compare(&io::exr::read(image).unwrap(), &io::exr::read(&whole).unwrap()).unwrap();
    assert!(difference(&both).coverage_mismatch < 0.01, "{:?}", difference(&both));

    let simplified = folder.path("less.ply");
    succeeds(&["simplify", text(&output), "-o", text(&simplified), "--tolerance", "rel:0.002", "--shape", "cap"]);
    assert!(render(&[text(&simplified)], &less).contains("triangles drawn"));
    assert!(difference(&less).coverage_mismatch < 0.01);
    let info = String::from_utf8(succeeds(&["info", text(&output)]).stdout).unwrap();
    assert!(info.contains("out.mesh.ply are drawn beside them"), "{info}");

    // A render must not overwrite the mesh file, and fails if that file is missing.
    let named = folder.path("out.mesh.ply");
    fails(&["render", text(&output), "-o", text(&named)], 2, &["out.mesh.ply"]);
    std::fs::remove_file(&named).unwrap();
    fails(
        &["render", text(&output), "-o", text(&both), "--backend", "reference"],
        1,
        &["out.mesh.ply", "No such file"],
    );
}

/// If no triangle is small, the picture equals that of the mesh bit by bit, with images too.
#[test]
fn large_triangles_all_stay() {
    let folder = Folder::new();
    let (cube, image) = (format!("{DATA}/cube.obj"), format!("{DATA}/cube.png"));
    let output = folder.path("cube.ply");
    succeeds(&["hybrid", &cube, "-o", text(&output), "--texture", &image, "--pixels", "2000"]);
    let names = folder.names();
    assert!(["cube.ply", "cube.mesh.ply", "cube.mesh-1.png"].iter().all(|name| names.contains(&(*name).to_owned())));
    let [a, b] = ["a.png", "b.png"].map(|name| folder.path(name));
    let view = ["--size", "64x64", "--eye=3,2.6,4", "--target=0,0,0", "--fov", "30", "--backend", "reference"];
    succeeds(&[&["render", text(&output), "-o", text(&a)][..], &view].concat());
    let own = ["render", "--triangles", &cube, "--triangle-texture", &image, "-o", text(&b)];
    succeeds(&[&own[..], &view].concat());
    assert!(std::fs::read(&a).unwrap() == std::fs::read(&b).unwrap());
    assert!(String::from_utf8(succeeds(&["info", text(&output)]).stdout).unwrap().contains("cube.mesh.ply"));
}

/// With normals that contradict the winding, the surface does not count as closed. The diffuse
/// factor of a textured material is preserved.
#[test]
fn normals_and_materials_stay_what_they_are() {
    let mut ball = sphere(5, true);
    let pixel = pixel(&ball, 15.0).unwrap();
    let closed = |mesh: &Mesh| hybrid(mesh, pixel, &()).unwrap().surfels.unwrap().closed;
    assert!(closed(&ball));
    let inverted =
        |normals: &mut Vec<[[f32; 3]; 3]>| normals.as_flattened_mut().iter_mut().for_each(|n| *n = n.map(|c| -c));
    ball.normals.iter_mut().for_each(inverted);
    assert!(ball.normals.is_some() && !closed(&ball));

    let image = Arc::new(Texture::new(1, 1, vec![[188, 255, 0, 200]]).unwrap());
    let dim =
        Material { name: String::new(), diffuse: [0.5, 1.0, 1.0, 0.5], texture: Some(image.clone()), image: None };
    // Half the light of code 188 is code 137.
    assert_eq!(dim.painted().unwrap().texels(), [[137, 255, 0, 100]]);
    assert!(Arc::ptr_eq(&Material { diffuse: [1.0; 4], ..dim }.painted().unwrap(), &image));
    // Materials without triangles are dropped.
    let mesh = rich();
    assert_eq!(mesh.part(&[true, false]).materials.len(), 1);
    assert!(mesh.part(&[true, false]).materials[0].texture.is_some());
}

/// Only files that epsplat wrote can name triangles, and names that a header cannot hold are
/// refused.
#[test]
fn names_of_triangles_are_read_whole_or_refused() {
    let folder = Folder::new();
    let cloud = |comments: &str| {
        let rows = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n";
        let path = folder.file("c.ply", format!("ply\nformat ascii 1.0\n{comments}{rows}"));
        io::read(&path, &()).unwrap().beside
    };
    assert_eq!(cloud("comment triangles 69451\n"), None);
    assert_eq!(cloud("comment epsplat 0.1.0\ncomment triangles a b.ply\n"), Some(folder.path("a b.ply")));
    for name in ["a\nb.ply", " a.ply", "a\\b.ply"] {
        let output = folder.path(name);
        fails(&["hybrid", &format!("{DATA}/bunny.obj"), "-o", text(&output)], 2, &["choose another name"]);
    }
    assert_eq!(folder.names(), ["c.ply"]);
}

#[test]
fn what_cannot_be_divided_is_told() {
    let folder = Folder::new();
    let (bunny, output) = (&format!("{DATA}/bunny.obj"), &folder.path("o.ply"));
    let cloud = folder.file("c.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n");
    fails(&["hybrid", text(&cloud), "-o", text(output)], 1, &["c.ply", "no triangles"]);
    fails(&["hybrid", text(&cloud), "-o", text(&cloud)], 2, &["overwrite"]);
    fails(&["hybrid", bunny, "-o", "o.png"], 2, &[".ply"]);
    fails(&["hybrid", bunny, "-o", text(output), "--pixels", "0"], 2, &["1 to 1000000"]);
    fails(
        &["hybrid", bunny, "-o", text(output), "--texture", &format!("{DATA}/cube.png")],
        1,
        &["no texture coordinates"],
    );
    let image = folder.path("o.png");
    let joined = ["render", bunny, "--mesh", "surfels", "-o", text(&image), "--join", "nearest"];
    fails(&joined, 2, &["--join", "none"]);
    assert_eq!(folder.names(), ["c.ply"]);
}
