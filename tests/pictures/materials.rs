//! Meshes whose colours are not on vertices: surfels look like triangles, however a file gives the
//! colours.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::command::{Folder, succeeds, text};
use epsplat::io::{self, Mesh, Texture, png};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::plan::Settings;
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Colors, Scene, Shading, Up};
use epsplat::low_level::surfels::{Limits, build, build_painted, build_textured, with_triangles};
use glam::DVec3;
use std::path::Path;

const SIZE: u32 = 64;

/// A square image of four quarters: red and green above, blue and yellow below.
fn quarters() -> Texture {
    let color = |k: u32| match (k % 32 < 16, k / 32 < 16) {
        (true, true) => [255, 0, 0, 255],
        (false, true) => [0, 255, 0, 255],
        (true, false) => [0, 0, 255, 255],
        (false, false) => [255, 255, 0, 255],
    };
    Texture::new(32, 32, (0..32 * 32).map(color).collect()).unwrap()
}

/// An OBJ of a square in the xy plane that shows a whole image, followed by `more`.
fn square(library: &str, more: &str) -> String {
    format!(
        "mtllib {library}\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n\
         usemtl m\nf 1/1/1 2/2/1 3/3/1 4/4/1\n{more}"
    )
}

fn painted(path: &Path) -> Scene {
    build_painted(vec![io::read(path, &()).unwrap()], &Limits::default(), &()).unwrap().0
}

/// The triangles of a file. Those made of its points and faces are the same.
fn as_triangles(path: &Path) -> Scene {
    let scene = with_triangles(None, &[io::read_mesh(path, &()).unwrap()]).unwrap().0;
    let points = io::read(path, &()).unwrap();
    assert!(points.is_mesh(), "{}", path.display());
    let of_points = with_triangles(None, &[Mesh::of_points(points)]).unwrap().0;
    assert_eq!((of_points.up, of_points.origin), (scene.up, scene.origin));
    assert_eq!(of_points.triangles, scene.triangles, "{}", path.display());
    scene
}

fn seen(scene: &Scene, eye: DVec3) -> Frame {
    let lens = epsplat::low_level::scene::Lens::Fov(40.0);
    let camera = Camera::look_at((SIZE, SIZE), lens, eye, DVec3::ZERO, None, Up::Y, 1e-3).unwrap();
    let options = Settings { shading: Shading::Unlit, ..Settings::default() };
    render(scene, &camera, &options, &Backend::Reference, &()).unwrap().0
}

/// The share of pixels that differ by more than 0.02 between a file drawn as surfels and as
/// triangles.
fn apart(path: &Path, eye: DVec3) -> f64 {
    let [surfels, triangles] = [painted(path), as_triangles(path)].map(|scene| seen(&scene, eye));
    let covered = triangles.color.iter().filter(|color| color[3] > 0.5).count();
    assert!(covered > 200, "{}", path.display());
    let differs = |(a, b): &(&[f32; 4], &[f32; 4])| (0..4).any(|k| (a[k] - b[k]).abs() > 0.02);
    surfels.color.iter().zip(&triangles.color).filter(differs).count() as f64 / f64::from(SIZE * SIZE)
}

/// The sRGB codes at a point of the square, seen from the front.
fn at(frame: &Frame, x: f64, y: f64) -> [u8; 4] {
    // The square is 2 wide and 4 away.
    let scale = 0.5 * f64::from(SIZE) / (20f64.to_radians().tan() * 4.0);
    let pixel = |c: f64| (0.5 * f64::from(SIZE) + scale * c) as usize;
    epsplat::low_level::scene::color::srgb8(frame.color[pixel(-y) * SIZE as usize + pixel(x)])
}

const FRONT: DVec3 = DVec3::new(0.0, 0.0, 4.0);
const ASLANT: DVec3 = DVec3::new(2.0, 1.5, 3.0);
const RED: [u8; 4] = [255, 0, 0, 255];
const GREEN: [u8; 4] = [0, 255, 0, 255];
const BLUE: [u8; 4] = [0, 0, 255, 255];
const YELLOW: [u8; 4] = [255, 255, 0, 255];

#[test]
fn images_of_materials_show_as_their_options_say() {
    let folder = Folder::new();
    png::write_texture(&folder.path("Quarters.png"), &quarters()).unwrap();
    let show = |library: &str| {
        let path = folder.file("m.obj", square("m.mtl", ""));
        folder.file("m.mtl", library);
        let off = apart(&path, ASLANT);
        assert!(off < 0.03, "{library}: {off}");
        seen(&painted(&path), FRONT)
    };
    let corners = |frame: &Frame| [(-0.5, 0.5), (0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)].map(|(x, y)| at(frame, x, y));
    for library in [
        "newmtl m\nKd 1 1 1\nmap_Kd Quarters.png\n",
        "NEWMTL m\nkd 1 1 1\nmap_kd quarters.PNG\n",
        "newmtl m\nMAP_KD -clamp on .\\QUARTERS.png\n",
    ] {
        assert_eq!(corners(&show(library)), [RED, GREEN, BLUE, YELLOW], "{library}");
    }
    // Two by two tiles: each quarter of the square shows all four colours.
    let tiled = show("newmtl m\nmap_Kd -s 2 2 1 Quarters.png\n");
    for (x, y) in [(-0.5, 0.5), (0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)] {
        let parts = [(-0.25, 0.25), (0.25, 0.25), (-0.25, -0.25), (0.25, -0.25)];
        assert_eq!(parts.map(|(dx, dy)| at(&tiled, x + dx, y + dy)), [RED, GREEN, BLUE, YELLOW], "{x} {y}");
    }
    let moved = show("newmtl m\nmap_Kd -o 0.5 0 0 Quarters.png\n");
    assert_eq!(corners(&moved), [GREEN, RED, YELLOW, BLUE]);
    // A single copy, whose edge colours continue.
    let once = show("newmtl m\nmap_Kd -s 2 2 -o -0.5 -0.5 -clamp on Quarters.png\n");
    assert_eq!(corners(&once), [RED, GREEN, BLUE, YELLOW]);
    assert_eq!([(-0.9, 0.1), (0.9, -0.1), (0.1, 0.9)].map(|(x, y)| at(&once, x, y)), [RED, YELLOW, GREEN]);
    // The material's colour multiplies its image.
    let dyed = show("newmtl m\nKd 1 0 0\nmap_Kd Quarters.png\n");
    assert_eq!(corners(&dyed), [RED, [0, 0, 0, 255], [0, 0, 0, 255], RED]);
}

#[test]
fn a_black_colour_with_an_image_is_black_and_told() {
    let folder = Folder::new();
    png::write_texture(&folder.path("q.png"), &quarters()).unwrap();
    folder.file("m.mtl", "newmtl m\nKd 0.00 0 0\nmap_Kd q.png\n");
    let path = folder.file("m.obj", square("m.mtl", ""));
    assert_eq!(at(&seen(&painted(&path), FRONT), 0.5, 0.5), [0, 0, 0, 255]);
    for notes in [io::read(&path, &()).unwrap().notes, io::read_mesh(&path, &()).unwrap().notes] {
        assert!(
            notes.len() == 1 && notes[0].contains("material m is black") && notes[0].contains("Kd 1 1 1"),
            "{notes:?}"
        );
    }
}

/// Surfels look like triangles at seams, with several images (also BMP and TGA), with colours
/// without images, and where triangles have no material.
#[test]
fn surfels_look_as_triangles_do() {
    let folder = Folder::new();
    let image = image::RgbaImage::from_fn(24, 24, |x, y| image::Rgba([(10 * x) as u8, (10 * y) as u8, 90, 255]));
    for name in ["a.png", "b.bmp", "c.tga"] {
        image.save(folder.path(name)).unwrap();
    }
    folder.file("m.mtl", "newmtl a\nmap_Kd a.png\nnewmtl b\nKd 1 .5 1\nmap_Kd b.bmp\nnewmtl c\nmap_Kd -s 2 1 c.tga\nnewmtl red\nKd 0.8 0.1 0.1\n");
    let corners = [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]];
    let corners: String = corners.map(|[x, y, z]| format!("v {x} {y} {z}\n")).concat();
    let places = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt .25 .25\nvt .75 .5\n";
    let sides = ["1 4 3 2", "5 6 7 8", "1 2 6 5", "4 8 7 3", "1 5 8 4", "2 3 7 6"];
    let face = |side: usize, placed: bool| {
        let corner =
            |(k, vertex): (usize, &str)| if placed { format!(" {vertex}/{}", k + 1) } else { format!(" {vertex}") };
        format!("f{}\n", sides[side].split(' ').enumerate().map(corner).collect::<String>())
    };
    let mixed = format!(
        "mtllib m.mtl\n{corners}{places}{}usemtl a\n{}usemtl b\n{}usemtl c\n{}usemtl red\n{}{}",
        face(0, false),
        face(1, true),
        face(2, true),
        face(3, true),
        face(4, true),
        face(5, false)
    );
    let one_image =
        format!("mtllib m.mtl\n{corners}{places}usemtl a\n{}", (0..6).map(|k| face(k, true)).collect::<String>());
    let colours_alone =
        format!("mtllib m.mtl\n{corners}{}usemtl red\n{}", face(1, false), face(5, false) + &face(3, false));
    // A flat square of four triangles. Each has its own texture coordinates at their common middle,
    // so every inner edge is a seam.
    let seams = "mtllib m.mtl\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt .2 .9\nvt .5 .5\n\
                 usemtl a\nf 1/1 2/2 5/3\nf 2/2 3/3 5/4\nf 3/4 4/1 5/5\nf 4/6 1/2 5/6\n";
    // The same square with a normal at each corner, for smooth shading.
    let smooth =
        seams.replace("usemtl a\n", "vn -.3 -.3 1\nvn .3 -.3 1\nvn .3 .3 1\nvn -.3 .3 1\nvn 0 0 1\nusemtl a\n");
    let smooth = (1..=5).fold(smooth, |text, vertex| {
        let named = |place: usize| (format!(" {vertex}/{place}"), format!(" {vertex}/{place}/{vertex}"));
        (1..=6).map(named).fold(text, |text, (from, to)| {
            text.replace(&format!("{from} "), &format!("{to} ")).replace(&format!("{from}\n"), &format!("{to}\n"))
        })
    });
    for (name, text, most) in [
        ("mixed", mixed.as_str(), 0.03),
        ("one_image", &one_image, 0.03),
        ("colours_alone", &colours_alone, 0.03),
        ("seams", seams, 0.03),
        ("smooth", &smooth, 0.06),
    ] {
        let path = folder.file(&format!("{name}.obj"), text);
        for eye in [ASLANT, DVec3::new(-2.0, 2.5, 2.5)] {
            let off = apart(&path, eye);
            assert!(off < most, "{name}: {off}");
        }
        // Device and twin agree.
        let scene = painted(&path);
        if let Some(gpu) = common::gpu() {
            let lens = epsplat::low_level::scene::Lens::Fov(40.0);
            let camera = Camera::look_at((SIZE, SIZE), lens, ASLANT, DVec3::ZERO, None, Up::Y, 1e-3).unwrap();
            let options = Settings { shading: Shading::Unlit, ..Settings::default() };
            let drawn = render(&scene, &camera, &options, &Backend::gpu(gpu), &()).unwrap().0;
            let twin = seen(&scene, ASLANT);
            let differs = |(a, b): &(&[f32; 4], &[f32; 4])| (0..4).any(|k| (a[k] - b[k]).abs() > 5e-3);
            let off = drawn.color.iter().zip(&twin.color).filter(differs).count();
            assert!(off < 12, "{name}: {off}");
        }
    }
}

/// Where an image cannot be painted, surfels have its mean colour, and a note says so. A texture
/// given by the caller replaces all images of the file.
#[test]
fn means_stand_for_images_and_given_ones_take_their_place() {
    let folder = Folder::new();
    let left = Texture::new(2, 1, vec![[255, 0, 0, 255], [255, 0, 0, 255]]).unwrap();
    png::write_texture(&folder.path("a.png"), &left).unwrap();
    folder.file("m.mtl", "newmtl m\nKd 0.5 1 1\nmap_Kd a.png\n");
    let path = folder.file("m.obj", square("m.mtl", ""));
    let points = || vec![io::read(&path, &()).unwrap()];
    let (scene, preparation) = build(points(), &()).unwrap();
    assert_eq!(
        (preparation.averaged, scene.colors),
        (scene.surfels.len() as u64, Colors::Constant([0.5, 0.0, 0.0, 1.0]))
    );
    assert!(preparation.notes().iter().any(|note| note.contains("the mean of the image")));
    let given = build_textured(points(), vec![quarters()], &()).unwrap().0;
    let frame = seen(&given, FRONT);
    assert_eq!([(-0.5, 0.5), (0.5, -0.5)].map(|(x, y)| at(&frame, x, y)), [RED, YELLOW]);

    let (image, other) = (folder.path("out.png"), folder.path("q.png"));
    png::write_texture(&other, &quarters()).unwrap();
    let front = ["--eye", "0,0,4", "--target", "0,0,0", "--size", "48x48", "--backend", "reference"];
    let render = |more: &[&str]| succeeds(&[&["render", text(&path), "-o", text(&image)], &front[..], more].concat());
    let told = |more: &[&str]| String::from_utf8(render(more).stderr).unwrap();
    for more in
        [&["--composite", "layers"][..], &["--shading-at", "splat"], &["--blend", "nearest"], &["--facing", "circle"]]
    {
        let said = told(more);
        let middle = image::open(&image).unwrap().to_rgba8().get_pixel(24, 24).0;
        assert!(middle[0] > 100 && middle[1] == 0 && middle[2] == 0, "{more:?}: {middle:?} {said}");
    }
    assert!(!told(&[]).contains("mean of the image"));
    render(&["--texture", text(&other), "--shading", "unlit"]);
    let given = image::open(&image).unwrap().to_rgba8();
    assert_eq!([(16, 16), (30, 30)].map(|(x, y)| given.get_pixel(x, y).0), [RED, YELLOW]);
}

#[test]
fn face_colours_of_a_ply_file_show() {
    let folder = Folder::new();
    let vertices: String =
        (0..8).map(|k| format!("{} {} {}\n", 2 * (k / 4) - 1, 2 * (k / 2 % 2) - 1, 2 * (k % 2) - 1)).collect();
    let sides = ["0 1 3 2", "4 6 7 5", "0 4 5 1", "2 3 7 6", "0 2 6 4", "1 5 7 3"];
    let codes = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0], [255, 0, 255], [0, 255, 255]];
    let file = |kind: &str, full: f64, more: &str, colors: &str| {
        let channel = |name: &str| format!("property {kind} {name}\n");
        let header: String = ["red", "green", "blue"].map(channel).concat();
        let rows = sides.iter().zip(codes).map(|(side, color)| {
            let [r, g, b] = color.map(|code: i32| f64::from(code) / 255.0 * full);
            format!("4 {side} {r} {g} {b}\n")
        });
        let vertices: String = vertices.lines().map(|line| format!("{line}{colors}\n")).collect();
        format!(
            "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n{more}element face 6\n\
             property list uchar int vertex_indices\n{header}end_header\n{vertices}{}",
            rows.collect::<String>()
        )
    };
    let one = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    for (text, name) in [
        (file("uchar", 255.0, "", ""), "codes"),
        (file("ushort", 65535.0, "", ""), "ushort"),
        (file("int", 255.0, "", ""), "int"),
        (file("float", 1.0, "", ""), "float"),
        (file("double", 255.0, "", ""), "double"),
        (file("uchar", 255.0, one, " 255 255 255"), "white vertices"),
    ] {
        let path = folder.file("cube.ply", text);
        let mesh = io::read_mesh(&path, &()).unwrap();
        let colors = mesh.face_colors.unwrap();
        let expected = codes.map(|code| code.map(|code| if code == 255 { 1.0 } else { 0.0 }));
        let found: Vec<[f32; 3]> = colors.chunks(2).map(|two| [two[0][0], two[0][1], two[0][2]]).collect();
        assert_eq!(found, expected, "{name}");
        for eye in [ASLANT, -ASLANT] {
            let off = apart(&path, eye);
            assert!(off < 0.03, "{name}: {off}");
        }
        let mut shown: Vec<[u8; 4]> = [ASLANT, -ASLANT]
            .iter()
            .flat_map(|eye| seen(&painted(&path), *eye).color)
            .map(epsplat::low_level::scene::color::srgb8)
            .collect();
        shown.retain(|color| codes.iter().any(|[r, g, b]| *color == [*r as u8, *g as u8, *b as u8, 255]));
        shown.sort_unstable();
        shown.dedup();
        assert_eq!(shown.len(), 6, "{name}");
    }
    // Vertex colours that vary hide face colours, and a note says so.
    let mut text = file("uchar", 255.0, one, " 9 9 9");
    text = text.replacen(" 9 9 9", " 99 9 9", 1);
    let points = io::read(&folder.file("cube.ply", text), &()).unwrap();
    assert!(points.notes[0].contains("faces have colours too") && points.colors.is_some());
}

/// Images that a PLY file names paint its surfels, by texture coordinates of faces or of vertices.
#[test]
fn images_of_a_ply_file_show() {
    let folder = Folder::new();
    png::write_texture(&folder.path("quarters.png"), &quarters()).unwrap();
    let head = "ply\nformat ascii 1.0\ncomment TextureFile Quarters.PNG\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
    let list = "property list uchar int vertex_indices\n";
    let of_faces = format!(
        "{head}element face 1\n{list}property list uchar float texcoord\nend_header\n-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n4 0 1 2 3 8 0 0 1 0 1 1 0 1\n"
    );
    let of_vertices = format!(
        "{head}property float s\nproperty float t\nelement face 2\n{list}end_header\n-1 -1 0 0 0\n1 -1 0 1 0\n1 1 0 1 1\n-1 1 0 0 1\n3 0 1 2\n3 0 2 3\n"
    );
    for text in [of_faces, of_vertices] {
        let path = folder.file("m.ply", &text);
        let frame = seen(&painted(&path), FRONT);
        let corners = [(-0.5, 0.5), (0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)].map(|(x, y)| at(&frame, x, y));
        assert_eq!(corners, [RED, GREEN, BLUE, YELLOW]);
        assert!(apart(&path, ASLANT) < 0.03);
    }
}

/// Commands that use only the vertices of a mesh give them the colours of their triangles.
#[test]
fn vertices_take_the_colours_of_their_triangles() {
    let folder = Folder::new();
    folder.file("m.mtl", "newmtl m\nKd 0.25 0.5 1\n");
    let path = folder.file("m.obj", square("m.mtl", ""));
    let output = folder.path("out.ply");
    for command in [&["surfels"][..], &["lod"]] {
        succeeds(&[command, &[text(&path), "-o", text(&output)]].concat());
        let colors = io::read(&output, &()).unwrap().colors.unwrap();
        let [r, g, b, _] = colors.linear(0);
        assert!((r - 0.25).abs() < 0.01 && (g - 0.5).abs() < 0.01 && (b - 1.0).abs() < 0.01, "{command:?} {r} {g} {b}");
    }
    let info = String::from_utf8(succeeds(&["info", text(&path)]).stdout).unwrap();
    assert!(info.contains("of faces or materials"), "{info}");
}

#[test]
fn broken_triangles_are_told_apart_from_loose_vertices() {
    let folder = Folder::new();
    let path = folder.file(
        "m.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv nan 0 0\nv 5 5 5\nv 2 0 0\nf 1 2 3\nf 1 3 4\nf 3 4 5\nf 1 2 7\n",
    );
    let (_, preparation) = build(vec![io::read(&path, &()).unwrap()], &()).unwrap();
    assert_eq!((preparation.loose, preparation.stranded, preparation.broken), (1, 2, 1));
    let notes = preparation.notes();
    for said in [
        "1 vertices of no triangle",
        "1 triangles were left out: a coordinate is not finite",
        "2 vertices were left out: none of their",
    ] {
        assert!(notes.iter().any(|note| note.contains(said)), "{notes:?}");
    }
}
