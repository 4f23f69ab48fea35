//! The index map, which names the strongest surfel of each pixel.
//!
//! The device must equal its f64 twin, for every organisation, page, band and order of the points.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::command::{Folder, ply, succeeds, text};
use common::scenes::sphere_camera;
use common::{Random, meshes};
use epsplat::io::{self, Mesh, Points};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::passes::index::NOTHING;
use epsplat::low_level::plan::{Optimisation, Organisation, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Colors, Kernel, LowPass, Map, Maps, Projection, Scene, Shading};
use epsplat::low_level::surfels::analytic::{Shape, generate};
use epsplat::low_level::surfels::{build, with_triangles};

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
            ply("x y z nx ny nz radius", 3, &format!("{center} 0 0 0 1 0.1\n-1 0 {z} 0 0 1 0.8\n1 0 {z} 0 0 1 0.8\n")),
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

/// A closed body of triangles whose colours count its faces, in this order.
fn counted(order: &[usize]) -> Mesh {
    let body = meshes::sphere(3, false);
    let triangles: Vec<[u32; 3]> = order.iter().map(|&face| body.triangles[face]).collect();
    let color =
        |&face: &usize| [(face % 16) as f32 / 16.0, (face / 16 % 16) as f32 / 16.0, (face / 256) as f32 / 16.0, 1.0];
    Mesh { face_colors: Some(order.iter().map(color).collect()), triangles, ..body }
}

/// The map names the face that a pixel shows, as its colour tells, or else the surfel. Kernels and
/// twins agree, and the order of faces in a file decides their numbers and nothing else.
#[test]
fn triangles_are_named_by_their_faces() {
    let Some(gpu) = common::gpu() else { return };
    let device = Backend::gpu(gpu);
    let count = meshes::sphere(3, false).triangles.len();
    assert!(count > 256 && !count.is_multiple_of(7));
    let own: Vec<usize> = (0..count).collect();
    let turned: Vec<usize> = (0..count).map(|k| (k * 7 + 3) % count).collect();
    let unlit = Settings { shading: Shading::Unlit, maps: Maps::of(&[Map::Index]), ..Settings::default() };
    for order in [&own, &turned] {
        let alone = with_triangles(None, &[counted(order)]).unwrap().0;
        for backend in [&device, &Backend::Reference] {
            let shown = frame(&alone, &unlit, backend);
            assert!(shown.map(Map::Depth).is_none());
            let mut seen = 0;
            for (color, [input, face]) in shown.color.iter().zip(named(&shown)) {
                if color[3] == 0.0 {
                    assert_eq!([*input, *face], [NOTHING; 2]);
                    continue;
                }
                let [low, middle, high] = [color[0], color[1], color[2]].map(|value| (value * 16.0).round() as usize);
                assert_eq!((*input, order[*face as usize]), (0, low + 16 * middle + 256 * high));
                seen += 1;
            }
            assert!(seen > 500, "{seen}");
        }
    }
    // Surfels that stick out of the body, and the body beside them.
    let surfels = scene(&points(3000));
    let mut body = counted(&own);
    body.positions.iter_mut().for_each(|place| *place = place.map(|x| 0.9 * x + 0.12));
    let both = with_triangles(Some(surfels), &[body]).unwrap().0;
    let twin = frame(&both, &options(), &Backend::Reference);
    let (differ, covered) = different(&frame(&both, &options(), &device), &twin);
    assert!(differ * 500 < covered && covered > 2000, "{differ} of {covered}");
    let sources = Sources::default().replace("index_triangles.wgsl", "depth > 0.0 &&", "false &&").unwrap();
    let Backend::Gpu { gpu, .. } = device else { return };
    let broken = Backend::Gpu { gpu, sources };
    let (differ, _) = different(&frame(&both, &options(), &broken), &twin);
    assert!(differ > 300, "{differ}");
}

/// In a picture of several files each is an input of its own, in the order of the command line.
#[test]
fn meshes_are_numbered_as_inputs() {
    let folder = Folder::new();
    let mesh = |name: &str, x: f64| {
        let text = format!("v {x} 0 0\nv {} 0 0\nv {x} 1 0\nf 1 2 3\n", x + 1.0);
        folder.file(name, text)
    };
    let cloud: String = (0..100)
        .map(|k| format!("{} {} 0 0 0 1 0.1\n", 4.0 + 0.1 * f64::from(k % 10), 0.1 * f64::from(k / 10)))
        .collect();
    let cloud = folder.file("cloud.ply", ply("x y z nx ny nz radius", 100, &cloud));
    let (first, last, output) = (mesh("first.obj", 0.0), mesh("last.obj", 2.0), folder.path("named.exr"));
    let inputs = ["render", text(&first), text(&cloud), text(&last), "-o", text(&output)];
    let view = ["--view", "front", "--up", "y", "--size", "96x48", "--aov", "index", "--backend", "reference"];
    succeeds(&[&inputs[..], &view].concat());
    let drawn = io::exr::read(&output).unwrap();
    let found: std::collections::BTreeSet<u32> = named(&drawn).iter().map(|[input, _]| *input).collect();
    assert_eq!(found, [0, 1, 2, NOTHING].into());
    // Left to right: the first mesh, the last one, the cloud.
    let in_row = named(&drawn).chunks(96).flat_map(|row| row.iter().enumerate());
    let places: std::collections::BTreeMap<u32, usize> = in_row.map(|(x, [input, _])| (*input, x)).collect();
    assert!(places[&0] < places[&2] && places[&2] < places[&1], "{places:?}");
}
