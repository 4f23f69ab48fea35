//! The index map, which names the strongest surfel of each pixel.
//!
//! The device must equal its f64 twin, for every organisation, page, band and order of the points.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::Random;
use common::command::{Folder, succeeds, text};
use common::scenes::sphere_camera;
use epsplat::io::{self, Points};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::passes::index::NOTHING;
use epsplat::low_level::plan::{Optimisation, Organisation, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Colors, Kernel, LowPass, Map, Maps, Projection, Scene};
use epsplat::low_level::surfels::analytic::{Shape, generate};
use epsplat::low_level::surfels::build;

const WANTED: Maps = Maps::of(&[Map::Index, Map::Depth]);

fn options() -> Settings {
    Settings { maps: WANTED, ..Settings::default() }
}

/// Points on a sphere, each with its own colour, with radii that reach several neighbours.
fn points(count: u64) -> Points {
    let samples: Vec<_> = generate(Shape::Sphere, count).collect();
    let spacing = (4.0 * std::f64::consts::PI / count as f64).sqrt();
    Points {
        positions: samples.iter().map(|sample| sample.position).collect(),
        normals: Some(samples.iter().map(|sample| sample.normal).collect()),
        radii: Some((0..samples.len()).map(|k| (spacing * (1.0 + 0.1 * (k % 7) as f64)) as f32).collect()),
        colors: Some(Colors::Srgb8((0..samples.len()).map(|k| [(k % 251) as u8, (k % 13) as u8, 90, 255]).collect())),
        ..Points::default()
    }
}

/// The points in the order `order`.
fn ordered(points: &Points, order: &[usize]) -> Points {
    let Some(Colors::Srgb8(codes)) = &points.colors else { panic!("of 8 bits") };
    Points {
        positions: order.iter().map(|&k| points.positions[k]).collect(),
        normals: points.normals.as_ref().map(|all| order.iter().map(|&k| all[k]).collect()),
        radii: points.radii.as_ref().map(|all| order.iter().map(|&k| all[k]).collect()),
        colors: Some(Colors::Srgb8(order.iter().map(|&k| codes[k]).collect())),
        ..Points::default()
    }
}

fn scene(points: &Points) -> Scene {
    build(vec![points.clone()], &()).unwrap().0
}

fn frame(scene: &Scene, options: &Settings, backend: &Backend) -> Frame {
    render(scene, &sphere_camera(96, Projection::Pinhole), options, backend, &()).unwrap().0
}

/// The surfel's (input file, point in that file) for each pixel.
fn named(frame: &Frame) -> &[[u32; 2]] {
    frame.numbers(Map::Index).unwrap().as_chunks().0
}

/// The number of pixels in which two maps differ, and the number of covered pixels of `b`.
fn different(a: &Frame, b: &Frame) -> (usize, usize) {
    let differ = named(a).iter().zip(named(b)).filter(|(a, b)| a != b).count();
    (differ, named(b).iter().filter(|name| **name != [NOTHING; 2]).count())
}

#[test]
fn the_device_names_whom_the_twin_names() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    for (count, low_pass) in [(300, LowPass::None), (3000, LowPass::None), (3000, LowPass::Ewa), (30_000, LowPass::Max)]
    {
        let scene = scene(&points(count));
        let options = Settings { low_pass, ..options() };
        let twin = frame(&scene, &options, &Backend::Reference);
        let device = frame(&scene, &options, &backend);
        let (differ, covered) = different(&device, &twin);
        // f32 may decide differently if two weights are nearly equal or a fragment is nearly
        // accepted.
        assert!(covered > 4000 && differ * 1000 <= covered, "{count}, {low_pass:?}: {differ} of {covered} differ");
        let bare = |frame: &Frame| -> Vec<bool> { named(frame).iter().map(|name| *name == [NOTHING; 2]).collect() };
        let empty = |frame: &Frame| -> Vec<bool> {
            frame.map(Map::Depth).unwrap().iter().map(|depth| depth.is_infinite()).collect()
        };
        assert_eq!((bare(&device), bare(&twin)), (empty(&device), empty(&twin)));
    }
}

#[test]
fn a_kernel_that_takes_any_fragment_is_noticed() {
    let Some(gpu) = common::gpu() else { return };
    let sources = Sources::default().replace("index.wgsl", "weight + AS_GREAT >= ", "weight + 99999999u >= ").unwrap();
    let broken = Backend::Gpu { gpu: Box::new(gpu), sources };
    let scene = scene(&points(3000));
    let (differ, covered) =
        different(&frame(&scene, &options(), &broken), &frame(&scene, &options(), &Backend::Reference));
    assert!(differ * 10 > covered, "{differ} of {covered}");
}

#[test]
fn every_organisation_page_and_band_names_the_same() {
    let Some(gpu) = common::gpu() else { return };
    // With this many surfels, batches are skipped and tiles gather.
    let scene = scene(&points(20_000));
    let all = |gpu: Gpu| -> Vec<Frame> {
        let backend = Backend::gpu(gpu);
        let organisations = [Organisation::Auto, Organisation::Scatter, Organisation::Tile];
        let organised = organisations.map(|organisation| Settings { organisation, ..options() });
        let without = [Optimisation::Culling, Optimisation::Order, Optimisation::Gathering];
        let without = without.map(|left_out| Settings { without: vec![left_out], ..options() });
        let background = Settings { background: [0.1, 0.2, 0.3, 1.0], ..options() };
        let all = organised.into_iter().chain(without).chain([background]);
        all.map(|options| frame(&scene, &options, &backend)).collect()
    };
    let in_pieces = all(Gpu::with_buffer_limit(gpu, 1 << 17));
    let whole = all(common::gpu().unwrap());
    for (number, frame) in whole.iter().chain(&in_pieces).enumerate() {
        assert_eq!(different(frame, &whole[0]).0, 0, "render {number}");
    }
}

#[test]
fn ties_go_by_what_surfels_are_and_not_by_where_they_stood() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    // With this kernel every weight is 1, so every pixel is a tie.
    let options = Settings { kernel: Kernel::Constant, ..options() };
    let given = points(3000);
    let mut order: Vec<usize> = (0..3000).collect();
    let first = frame(&scene(&given), &options, &backend);
    Random(7).shuffle(&mut order);
    for backend in [&backend, &Backend::Reference] {
        let shuffled = frame(&scene(&ordered(&given, &order)), &options, backend);
        let back: Vec<_> = named(&shuffled)
            .iter()
            .map(|[input, point]| [*input, order.get(*point as usize).map_or(NOTHING, |k| *k as u32)])
            .collect();
        let differ = back.iter().zip(named(&first)).filter(|(a, b)| a != b).count();
        // The reference may differ at disk rims only.
        assert!(differ == 0 || matches!(backend, Backend::Reference) && differ < 10, "{differ}");
    }
}

#[test]
fn numbers_are_those_of_the_files() {
    let folder = Folder::new();
    let rows = |z: f64, lost: bool| {
        let center = if lost { "nan 0" } else { "0 0" };
        folder.file(
            if lost { "a.ply" } else { "b.ply" },
            common::command::ply(
                "x y z nx ny nz radius",
                3,
                &format!("{center} 0 0 0 1 0.1\n-1 0 {z} 0 0 1 0.8\n1 0 {z} 0 0 1 0.8\n"),
            ),
        )
    };
    let (a, b) = (rows(0.0, true), rows(5.0, false));
    let image = folder.path("index.exr");
    let view = ["--eye", "0,0,20", "--target", "0,0,0", "--ortho", "4", "--size", "80x40", "--backend", "reference"];
    let mut line = vec!["render", text(&a), text(&b), "-o", text(&image), "--aov", "index"];
    line.extend(view);
    succeeds(&line);
    let frame = io::exr::read(&image).unwrap();
    let at = |x: usize, y: usize| named(&frame)[y * 80 + x];
    // The second file is in front. Its points 1 and 2 are found; nothing covers the corner.
    assert_eq!([at(30, 20), at(50, 20), at(0, 0)], [[1, 1], [1, 2], [NOTHING; 2]]);
    line.remove(2);
    succeeds(&line);
    let frame = io::exr::read(&image).unwrap();
    let at = |x: usize, y: usize| named(&frame)[y * 80 + x];
    // Point 0 of the file is dropped as not finite; the others keep their numbers.
    assert_eq!([at(30, 20), at(50, 20)], [[0, 1], [0, 2]]);
    line.extend(["--backend", "raster"]);
    line.drain(line.iter().position(|word| *word == "reference").map(|at| at - 1..=at).unwrap());
    common::command::fails(&line, 2, &["rasteriser", "index"]);
}
