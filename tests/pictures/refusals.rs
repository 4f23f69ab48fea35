//! Combinations of options that work are drawn right, and refusals name a way out.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::command::{Folder, fails, ply, succeeds, text};
use common::scenes::{painted, sphere, sphere_camera};
use common::{Random, bits, meshes};
use epsplat::io::{self, Mesh, Texture};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::plan::{Accumulator, Facts, Organisation, Settings, check};
use epsplat::low_level::render::{Backend, Renderer, render};
use epsplat::low_level::scene::color::{decoded, srgb8};
use epsplat::low_level::scene::{
    Blend, Camera, Colors, Composite, Join, Map, Maps, Projection, Scene, Shading, gaussian,
};
use epsplat::low_level::surfels::with_triangles;

fn frame(scene: &Scene, camera: &Camera, options: &Settings, backend: &Backend) -> Frame {
    render(scene, camera, options, backend, &()).unwrap().0
}

fn backends() -> Option<[Backend; 2]> {
    Some([Backend::gpu(common::gpu()?), Backend::Reference])
}

/// A ball of triangles of radius `size` around `center`.
fn ball(center: [f64; 3], size: f64) -> Mesh {
    let mut mesh = meshes::sphere(2, true);
    for place in &mut mesh.positions {
        *place = [0, 1, 2].map(|k| center[k] + size * place[k]);
    }
    mesh.colors = Some(Colors::Constant([0.2, 0.5, 0.8, 1.0]));
    mesh
}

/// Where nothing is translucent, Gaussians and triangles in one picture look as they do alone.
#[test]
fn gaussians_and_triangles_are_one_picture_where_nothing_shows_through() {
    let Some(backends) = backends() else { return };
    let mut random = Random(5);
    let mut gaussians = sphere(600, 2.0);
    gaussians.colors = Colors::Linear(
        (0..600).map(|_| [0.1, 0.3, 0.9].map(|c| (c * random.unit()) as f32)).map(|[r, g, b]| [r, g, b, 1.0]).collect(),
    );
    (gaussians.encoded, gaussians.oriented) = (true, false);
    let camera = sphere_camera(64, Projection::Pinhole);
    // The ball of triangles lies beside the Gaussians and in front of them.
    let both = with_triangles(Some(gaussians.clone()), &[ball([0.0, 0.9, 0.9], 0.5)]).unwrap().0;
    let alone = Scene { triangles: both.triangles.clone(), ..Scene::default() };
    let options = Settings {
        shading: Shading::Unlit,
        kernel: gaussian::KERNEL,
        join: Join::Nearest,
        maps: Maps::of(&[Map::Depth]),
        ..Settings::default()
    };
    for backend in &backends {
        let [shown, splats, triangles] =
            [&both, &gaussians, &alone].map(|scene| frame(scene, &camera, &options, backend));
        let [of_splats, of_triangles] = [&splats, &triangles].map(|frame| frame.map(Map::Depth).unwrap());
        let mut seen = [0; 2];
        for (pixel, (near, far)) in of_splats.iter().zip(of_triangles).enumerate() {
            // Skips pixels where a blended depth may lie behind a triangle that is behind the
            // nearest fragment.
            if (near - far).abs() < 0.1 {
                continue;
            }
            let of_triangle = far < near;
            let expected = if of_triangle { &triangles } else { &splats }.color[pixel];
            let alike = shown.color[pixel].iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-5);
            assert!(alike, "{:?} is not {expected:?}", shown.color[pixel]);
            seen[usize::from(of_triangle)] += usize::from(expected[3] > 0.0);
        }
        assert!(seen.iter().all(|seen| *seen > 200), "{seen:?}");
    }
}

#[test]
fn finer_colours_are_rounded_where_one_fragment_shows() {
    let Some(backends) = backends() else { return };
    let mut random = Random(9);
    let mut scene = sphere(800, 1.8);
    let fine: Vec<[f32; 4]> = (0..800).map(|_| [0; 4].map(|_: u8| random.between(-0.1, 1.2) as f32)).collect();
    scene.colors = Colors::Linear(fine.iter().map(|[r, g, b, _]| [*r, *g, *b, 1.0]).collect());
    let Colors::Linear(colors) = &scene.colors else { unreachable!() };
    let rounded = Scene { colors: Colors::Srgb8(colors.iter().map(|color| srgb8(*color)).collect()), ..scene.clone() };
    assert_ne!(decoded(srgb8(colors[0])), colors[0]);
    let camera = sphere_camera(64, Projection::Pinhole);
    let options = Settings { shading: Shading::Unlit, blend: Blend::Nearest, ..Settings::default() };
    for backend in &backends {
        let [own, codes] = [&scene, &rounded].map(|scene| frame(scene, &camera, &options, backend));
        assert!(own.color == codes.color && own.color.iter().any(|color| color[3] > 0.0));
    }
    let why = check::scene(&Facts::of(&painted(1)), &options, false).unwrap_err().to_string();
    assert!(why.contains("--epsilon abs:0"), "{why}");
}

#[test]
fn tiles_are_taken_wherever_nobody_says_how_splats_are_drawn() {
    let Some([gpu, _]) = backends() else { return };
    let mut scene = sphere(500, 2.0);
    scene.colors = Colors::Constant([0.5, 0.4, 0.3, 0.5]);
    let camera = sphere_camera(48, Projection::Pinhole);
    let plain = Settings { shading: Shading::Unlit, ..Settings::default() };
    for options in [
        Settings { composite: Composite::Layers(2), ..plain.clone() },
        Settings { composite: Composite::Sorted, ..plain.clone() },
        Settings { composite: Composite::Moments, ..plain.clone() },
        Settings { blend: Blend::Nearest, ..plain.clone() },
        Settings { accumulator: Accumulator::Fixed32, ..plain.clone() },
    ] {
        let tiled = Settings { organisation: Organisation::Tile, ..options.clone() };
        assert!(
            bits(&frame(&scene, &camera, &tiled, &gpu)) == bits(&frame(&scene, &camera, &options, &gpu)),
            "{options:?}"
        );
        // Studies still refuse tiles here, because another organisation is not what the study
        // names.
        assert!(check::by_tiles(&tiled).is_err() && check::by_tiles(&options).is_ok());
    }
}

/// Triangles out of view change nothing, and they show in a view that includes them.
#[test]
fn triangles_out_of_view_change_nothing() {
    let Some(backends) = backends() else { return };
    let scene = sphere(700, 2.5);
    let options = Settings { maps: Maps::of(&[Map::Depth]), ..Settings::default() };
    for projection in [Projection::Pinhole, Projection::Orthographic] {
        let camera = sphere_camera(64, projection);
        let behind = camera.eye + (camera.eye - scene.origin);
        for place in [[0.0, 40.0, 0.0], behind.to_array(), [-60.0, 0.0, 30.0]] {
            let beside = with_triangles(Some(scene.clone()), &[ball(place, 0.5)]).unwrap().0;
            for backend in &backends {
                let [own, other] = [&scene, &beside].map(|scene| frame(scene, &camera, &options, backend));
                assert!(own == other, "{projection:?} {place:?}");
                // The same renderer then draws a view that includes the triangles.
                let mut renderer = Renderer::new(&beside, &options, backend).unwrap();
                let first = renderer.frame(&camera, &()).unwrap().0;
                let away = Camera { eye: camera.eye + glam::DVec3::from_array(place) - scene.origin, ..camera.clone() };
                let seen = renderer.frame(&away, &()).unwrap().0;
                assert!(first == own && seen == frame(&beside, &away, &options, backend));
                assert!(seen.color.iter().filter(|color| color[3] > 0.0).count() > 100, "{projection:?} {place:?}");
            }
        }
    }
}

/// Writes the files of the tests below: a textured grid, a plain one beside it, and an image.
fn files(folder: &Folder) -> [std::path::PathBuf; 3] {
    let grid = |x: f64, more: &dyn Fn(f64, f64) -> String| -> String {
        (0..400)
            .map(|k| {
                let (u, v) = (f64::from(k % 20) / 20.0, f64::from(k / 20) / 20.0);
                format!("{} {v} 0 0 0 1 0.06 {}\n", x + u, more(u, v))
            })
            .collect()
    };
    let names = "x y z nx ny nz radius";
    let painted = folder.file("painted.ply", ply(&format!("{names} u v"), 400, &grid(0.0, &|u, v| format!("{u} {v}"))));
    let plain = folder.file(
        "plain.ply",
        ply(&format!("{names} red green blue alpha"), 400, &grid(1.2, &|_, _| "0.2 0.6 0.3 0.5".into())),
    );
    let image = folder.path("image.png");
    let texels = (0..64).map(|k| if k / 8 < 4 { [250, 10, 10, 255] } else { [10, 10, 250, 128] }).collect();
    io::png::write_texture(&image, &Texture::new(8, 8, texels).unwrap()).unwrap();
    [painted, plain, image]
}

const VIEW: [&str; 12] = [
    "--size",
    "96x48",
    "--eye",
    "1.1,0.5,3",
    "--target",
    "1.1,0.5,0",
    "--up",
    "y",
    "--shading",
    "unlit",
    "--backend",
    "reference",
];

#[test]
fn an_input_without_coordinates_keeps_its_colours_beside_a_painted_one() {
    let folder = Folder::new();
    let [painted, plain, image] = files(&folder);
    let draw = |inputs: &[&str], more: &[&str]| {
        let output = folder.path("drawn.exr");
        let told = succeeds(&[&["render"], inputs, &["-o", text(&output)], &VIEW[..], more].concat());
        (io::exr::read(&output).unwrap(), String::from_utf8(told.stderr).unwrap())
    };
    let texture = ["--texture", text(&image)];
    let (both, told) = draw(&[text(&painted), text(&plain)], &texture);
    assert!(told.contains("plain.ply: no texture coordinates"), "{told}");
    let (swapped, _) = draw(&[text(&plain), text(&painted)], &texture);
    let (own, _) = draw(&[text(&painted)], &texture);
    let (other, _) = draw(&[text(&plain)], &[]);
    let near = |a: [f32; 4], b: [f32; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3);
    let mut seen = [0; 2];
    for pixel in 0..both.color.len() {
        let [of_painted, of_plain] = [own.color[pixel], other.color[pixel]];
        let alone = if of_painted[3] > 0.0 { of_painted } else { of_plain };
        if of_painted[3] == 0.0 || of_plain[3] == 0.0 {
            assert!(
                near(both.color[pixel], alone) && near(swapped.color[pixel], alone),
                "{:?} {alone:?}",
                both.color[pixel]
            );
        }
        seen[0] += usize::from(of_painted[3] > 0.0);
        seen[1] += usize::from(of_plain[3] > 0.0);
    }
    assert!(seen.iter().all(|seen| *seen > 150), "{seen:?}");
    let output = folder.path("x.png");
    fails(
        &["render", text(&plain), text(&plain), "-o", text(&output), "--texture", text(&image)],
        1,
        &["plain.ply", "epsplat sample"],
    );
    let two = ["--texture", text(&image), "--texture", text(&image)];
    fails(
        &[&["render", text(&painted), text(&plain), "-o", text(&output)][..], &two].concat(),
        2,
        &["2 textures are given", "1 is needed"],
    );
}

#[test]
fn defaults_that_are_given_and_choices_of_one_file_are_no_fault() {
    let folder = Folder::new();
    let [painted, plain, image] = files(&folder);
    let draw = |name: &str, more: &[&str]| {
        let output = folder.path(name);
        let told = succeeds(&[&["render"], more, &["-o", text(&output)], &VIEW[..]].concat());
        (std::fs::read(&output).unwrap(), String::from_utf8(told.stderr).unwrap())
    };
    let plain = text(&plain);
    let sorted = draw("a.png", &[plain, "--composite", "sorted"]).0;
    assert!(sorted == draw("b.png", &[plain, "--composite", "sorted", "--tail", "sum"]).0);
    assert!(sorted == draw("b.png", &[plain, "--composite", "sorted", "--organisation", "auto"]).0);
    let refused = ["render", plain, "-o", "x.png", "--composite", "sorted", "--tail", "none"];
    fails(&refused, 2, &["--composite layers:L"]);
    let (levels, _) = draw("c.png", &[plain, "--lod", "2px"]);
    let (apart, told) = draw("d.png", &[plain, "--lod", "2px", "--separate"]);
    assert!(levels == apart && told.contains("changes nothing"), "{told}");
    let two = ["render", plain, text(&painted), "-o", "x.png", "--lod", "2px", "--separate"];
    fails(&two, 2, &["blend all inputs", "depth map"]);
    // A texture with layers: its blue half is translucent.
    let texture = [text(&painted), "--texture", text(&image), "--composite", "layers:2"];
    let (_, told) = draw("e.png", &texture);
    assert!(told.contains("the mean colour of its texture"), "{told}");
}
