//! Partly read files with levels of detail: the part that a picture needs gives the same bits as
//! the whole file.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::path::{Path, PathBuf};

use common::bits;
use common::levels::levels;
use common::scenes::sphere;
use epsplat::io::ply::{self, Levels};
use epsplat::io::{self, Input};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::plan::Settings;
use epsplat::low_level::render::{Backend, render, taken};
use epsplat::low_level::scene::{
    Camera, Clip, Colors, Composite, Cull, Detail, DetailMeasure, Lens, LowPass, Map, Maps, Samples, Scene, Surfel, Up,
    Whole,
};
use epsplat::low_level::surfels;
use epsplat::low_level::surfels::part::{Taken, nothing};
use epsplat::{Error, Result};
use glam::{DVec3, Vec3};

fn written(scene: Scene, folder: &Path) -> PathBuf {
    let path = folder.join("levels.ply");
    ply::write_scene(&path, &levels(scene), None, &()).unwrap();
    path
}

fn opened(path: &Path) -> Levels {
    Levels::open(Input::open(path, None).unwrap()).unwrap().unwrap()
}

fn whole(path: &Path) -> Scene {
    surfels::build(vec![io::read(path, &()).unwrap()], &()).unwrap().0
}

fn part(path: &Path, camera: &Camera, options: &Settings) -> Result<(Scene, Taken)> {
    taken(&opened(path), &[(camera, options)], |_| Ok(()), &())
}

/// Spheres with everything that a file can hold: map coordinates, one colour, 8-bit and linear
/// colours, clip lines, normals, low parts of coordinates.
fn all() -> Vec<(&'static str, Scene)> {
    let plain = Scene { closed: true, ..sphere(8000, 1.7) };
    let count = plain.surfels.len();
    let number = |k: usize, step: usize| (k * step % 97) as f32 / 97.0;
    let linear = Colors::Linear((0..count).map(|k| [number(k, 5), 3.0 * number(k, 7), 0.5, 1.0]).collect());
    let clips =
        (0..count).map(|k| if k % 3 == 0 { Clip([[0.0; 3], [1.0, 0.2, 0.1 * number(k, 3)]]) } else { Clip::NONE });
    let normals = plain.surfels.iter().map(|s| (s.normal().normalize() + 0.1).normalize().to_array()).collect();
    let mut far = plain.clone();
    far.low = vec![[0.0; 3]; count];
    for index in 0..40 {
        far.surfels[index].center[0] += 3e6;
        far.low[index][0] = 0.002 * index as f32;
    }
    vec![
        ("plain", plain.clone()),
        ("in map coordinates", Scene { origin: DVec3::new(6e5, 5.3e6, 0.0), up: Up::Z, ..plain.clone() }),
        (
            "one colour, rough",
            common::scenes::roughened(Scene { colors: Colors::Constant([0.3, 0.5, 0.9, 1.0]), ..plain.clone() }),
        ),
        ("linear, without sides", Scene { oriented: false, closed: false, colors: linear, ..plain.clone() }),
        ("rounded about another origin", rounded()),
        ("lines, normals", Scene { clips: clips.collect(), normals, ..plain.clone() }),
        ("trailing parts", far),
    ]
}

/// Points whose middle is almost equally far from two candidates for the scene's origin, so that
/// f32 rounding matters.
fn rounded() -> Scene {
    let plain = sphere(8000, 1.7);
    let places = plain.surfels.iter().map(|surfel| {
        let [x, y, z] = surfel.center.map(|c| 499.96 * f64::from(c));
        [500_512.0 + x, 4_000_000.0 + y, z]
    });
    let axes = plain.surfels.iter().map(|surfel| [surfel.s, surfel.t].map(|axis| axis.map(|c| 500.0 * c)));
    let points = io::Points { positions: places.collect(), axes: Some(axes.collect()), ..io::Points::default() };
    surfels::build(vec![points], &()).unwrap().0
}

/// Views of a scene that resembles a ball of radius 1.
fn views(scene: &Scene) -> Vec<(&'static str, Camera)> {
    let body = scene.body().0;
    let (center, radius) = (scene.origin + body.center(), 0.5 * body.extent().max_element());
    let look = |eye: [f64; 3], target: [f64; 3], lens| {
        let [eye, target] = [eye, target].map(|place| center + radius * DVec3::from_array(place));
        let lens = match lens {
            Lens::OrthographicHeight(height) => Lens::OrthographicHeight(radius * height),
            lens => lens,
        };
        Camera::look_at((72, 56), lens, eye, target, None, Up::Y, 0.05 * radius).unwrap()
    };
    vec![
        ("outside", look([1.2, 0.7, 2.4], [0.0; 3], Lens::Fov(45.0))),
        ("near", look([0.0, 0.2, 1.1], [0.5, 0.0, 0.0], Lens::Fov(70.0))),
        ("inside", look([0.3, 0.1, 0.2], [0.9, 0.0, 0.0], Lens::Fov(60.0))),
        ("orthographic", look([0.0, 1.0, 3.0], [0.7, 0.5, 0.0], Lens::OrthographicHeight(1.0))),
        ("afar", look([0.0, 10.0, 90.0], [0.0; 3], Lens::Fov(20.0))),
        ("away", look([0.0, 0.0, 9.0], [0.0, 0.0, 12.0], Lens::Fov(40.0))),
    ]
}

fn ways() -> Vec<Settings> {
    let maps = Maps::of(&[Map::Depth, Map::Normal, Map::Weight, Map::Count]);
    let at = |pixels: f64| Settings { detail: Detail::Pixels(pixels), maps, ..Settings::default() };
    vec![
        at(60.0),
        Settings { detail_fades: true, ..at(60.0) },
        Settings { detail_measure: DetailMeasure::Area, samples: Samples { across: 2, down: 1 }, ..at(20.0) },
        Settings { cull: Cull::Back, detail_caps: false, ..at(300.0) },
        Settings { detail: Detail::Splats(300), maps: Maps::NONE, ..at(0.0) },
        // These two show back faces in the colours but not in the maps, or vice versa, and differ
        // in samples.
        Settings {
            composite: Composite::Layers(4),
            opacity: 0.5,
            samples: Samples { across: 2, down: 2 },
            ..at(300.0)
        },
        Settings { composite: Composite::Layers(4), maps: Maps::of(&[Map::Surfaces]), ..at(300.0) },
        Settings { low_pass: LowPass::Max, cull: Cull::Back, detail_measure: DetailMeasure::Area, ..at(100.0) },
    ]
}

#[test]
fn a_picture_of_a_part_is_that_of_the_whole() {
    let Some(gpu) = common::gpu() else { return };
    let small = common::gpu().unwrap().with_buffer_limit(70_000);
    let backends = [Backend::gpu(gpu), Backend::gpu(small), Backend::Reference];
    let folder = tempfile::tempdir().unwrap();
    let (mut less, mut apart) = (0, 0);
    for (number, (name, scene)) in all().into_iter().enumerate() {
        let path = written(scene, folder.path());
        let whole = whole(&path);
        let (nodes, count) = (whole.hierarchy.as_ref().unwrap().nodes.len() as u64, whole.surfels.len() as u64);
        // The first scene is drawn with all options, the others with one of the first two.
        let ways = if number == 0 { ways() } else { ways().into_iter().skip(number % 2).take(1).collect() };
        for (way, options) in ways.into_iter().enumerate() {
            let mut last: Option<Scene> = None;
            for (view, camera) in views(&whole) {
                let (part, taken) = part(&path, &camera, &options).unwrap();
                let held = (part.hierarchy.as_ref().unwrap().nodes.len() as u64, part.surfels.len() as u64);
                assert_eq!((taken.nodes, taken.surfels), held);
                // The first scene is drawn with the first options on all backends, other
                // combinations on one.
                let turn = (number + way) % 2;
                let on = match options.composite {
                    Composite::Opaque if number + way == 0 => 0..3,
                    Composite::Opaque => turn..turn + 1,
                    // The small adapter has no memory for fragment lists.
                    _ => 0..1,
                };
                for backend in &backends[on] {
                    let (all, all_report) = render(&whole, &camera, &options, backend, &()).unwrap();
                    let (some, report) = render(&part, &camera, &options, backend, &()).unwrap();
                    assert!(bits(&all) == bits(&some), "{name} {view} {options:?}");
                    assert_eq!(report.cut, all_report.cut, "{name} {view} {options:?}");
                    // The control: the part of another view is not sufficient.
                    if let Some(last) = last.as_ref().filter(|_| way == 0) {
                        let (other, _) = render(last, &camera, &options, backend, &()).unwrap();
                        apart += usize::from(bits(&all) != bits(&other));
                    }
                }
                less += usize::from(taken.nodes < nodes / 2 && taken.surfels < count / 2);
                last = Some(part);
            }
        }
    }
    assert!(less > 30 && apart > 15, "{less} {apart}");
}

/// The part for several pictures together suffices for each of them. The part for the first picture
/// alone does not.
#[test]
fn a_part_of_several_pictures_is_enough_for_each() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let folder = tempfile::tempdir().unwrap();
    let path = written(sphere(8000, 1.7), folder.path());
    let whole = whole(&path);
    let cameras: Vec<Camera> = views(&whole).into_iter().take(2).map(|(_, camera)| camera).collect();
    let mut ways = ways().into_iter().skip(2);
    let ways = [ways.next().unwrap(), ways.next().unwrap()];
    let pictures: Vec<_> = cameras.iter().flat_map(|camera| ways.iter().map(move |way| (camera, way))).collect();
    let (part, of_all) = taken(&opened(&path), &pictures, |_| Ok(()), &()).unwrap();
    let mut apart = 0;
    for (camera, options) in &pictures {
        let all = render(&whole, camera, options, &backend, &()).unwrap().0;
        assert!(bits(&all) == bits(&render(&part, camera, options, &backend, &()).unwrap().0), "{options:?}");
        let of_one = taken(&opened(&path), &[(*camera, *options)], |_| Ok(()), &()).unwrap().1;
        assert!(of_one.nodes <= of_all.nodes && of_one.surfels <= of_all.surfels);
        // The control: the part for the first picture is not sufficient for the others.
        let other = taken(&opened(&path), &pictures[..1], |_| Ok(()), &()).unwrap().0;
        apart += usize::from(bits(&all) != bits(&render(&other, camera, options, &backend, &()).unwrap().0));
    }
    assert!(apart >= 2 && of_all.surfels < 8000, "{apart} {of_all:?}");
}

/// If a picture needs nodes that are missing in the part, their parents are drawn, which leaves no
/// holes.
#[test]
fn what_is_missing_leaves_no_holes() {
    let Some(gpu) = common::gpu() else { return };
    let backends = [Backend::gpu(gpu), Backend::Reference];
    let folder = tempfile::tempdir().unwrap();
    let path = written(sphere(8000, 1.7), folder.path());
    let whole = whole(&path);
    let (_, camera) = views(&whole).swap_remove(0);
    let coarse = Settings { detail: Detail::Pixels(300.0), maps: Maps::NONE, ..ways().swap_remove(0) };
    let (part, _) = part(&path, &camera, &coarse).unwrap();
    for detail in [20.0, 100.0] {
        let fine = Settings { detail: Detail::Pixels(detail), ..coarse.clone() };
        let mut cuts = Vec::new();
        for backend in &backends {
            let (shown, report) = render(&part, &camera, &fine, backend, &()).unwrap();
            let (all, of_all) = render(&whole, &camera, &fine, backend, &()).unwrap();
            // Only pixels that both cuts cover count, as the coarse cut has another outline.
            let (outline, _) = render(&whole, &camera, &coarse, backend, &()).unwrap();
            let covers = |frame: &Frame, pixel: usize| frame.color[pixel][3] > 0.0;
            let both = |pixel: &usize| covers(&all, *pixel) && covers(&outline, *pixel);
            let missed = (0..all.color.len()).filter(both).filter(|pixel| !covers(&shown, *pixel)).count();
            assert_eq!(missed, 0, "{detail}");
            assert!(report.cut < of_all.cut && report.cut > Some(100), "{:?} {:?}", report.cut, of_all.cut);
            cuts.push(report.cut);
        }
        assert_eq!(cuts[0], cuts[1]);
    }
}

/// The element `scene` of a file describes the scene that a full read finds.
#[test]
fn a_file_says_what_a_reader_of_all_finds() {
    let folder = tempfile::tempdir().unwrap();
    for (name, scene) in all() {
        let path = written(scene, folder.path());
        assert_eq!(Whole::of(&whole(&path)), Some(opened(&path).whole), "{name}");
    }
}

#[test]
fn a_part_may_not_fit() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(sphere(8000, 1.7), folder.path());
    let (_, camera) = views(&sphere(8000, 1.7)).swap_remove(0);
    let options = ways().swap_remove(0);
    let (_, taken) = part(&path, &camera, &options).unwrap();
    let limited = |most: u64| {
        let fits = |taken: &Taken| if taken.nodes <= most { Ok(()) } else { Err(Error::Usage("too much".into())) };
        epsplat::low_level::render::taken(&opened(&path), &[(&camera, &options)], fits, &()).map(|(_, taken)| taken)
    };
    assert_eq!(limited(taken.nodes).unwrap(), taken);
    assert!(matches!(limited(taken.nodes - 1), Err(Error::Usage(_))));
}

/// Offset of `first`, `count` and `leaf` of node `index`: the last nine bytes of its row.
fn place_of(bytes: &[u8], levels: &Levels, index: u64) -> usize {
    let rows = levels.bytes(0, u64::from(levels.whole.nodes) - index - 1) + 8 * 44;
    bytes.len() - rows as usize - 9
}

#[test]
fn damaged_files_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(sphere(3000, 1.7), folder.path());
    let (_, camera) = views(&sphere(3000, 1.7)).swap_remove(0);
    let options = Settings { detail: Detail::Pixels(1.0), ..ways().swap_remove(0) };
    let bytes = std::fs::read(&path).unwrap();
    let levels = opened(&path);
    let damaged = |at: usize, with: &[u8]| {
        let mut bytes = bytes.clone();
        bytes[at..at + with.len()].copy_from_slice(with);
        let other = folder.path().join("damaged.ply");
        std::fs::write(&other, bytes).unwrap();
        let opened = Levels::open(Input::open(&other, None).unwrap());
        opened.and_then(|levels| taken(&levels.unwrap(), &[(&camera, &options)], |_| Ok(()), &()))
    };
    let told = |at: usize, with: &[u8], what: &str| match damaged(at, with) {
        Err(Error::Malformed { what: said, .. }) => assert!(said.contains(what), "{said}"),
        other => panic!("{what}: {:?}", other.map(|(_, taken)| taken)),
    };
    assert!(damaged(0, b"ply").is_ok());
    let root = place_of(&bytes, &levels, 0);
    for first in [0u32, 2, 3_000_000_000, u32::MAX] {
        told(root, &first.to_le_bytes(), "levels of detail");
    }
    for count in [0u32, 9, u32::MAX] {
        told(root + 4, &count.to_le_bytes(), "no tree");
    }
    // As a leaf, the root would name points that do not exist.
    told(root + 4, &[255, 255, 255, 255, 1], "levels of detail");
    // An inner node with another node's children, one with children outside the file, and a leaf
    // with another leaf's points.
    let tree = &io::read(&path, &()).unwrap().tree.unwrap().rows;
    let of_kind = |leaf: bool| (1..tree.len()).filter(move |&k| tree[k].leaf == leaf && (!leaf || tree[k].count > 1));
    let inner: Vec<usize> = of_kind(false).take(3).collect();
    told(place_of(&bytes, &levels, inner[1] as u64), &tree[inner[0]].first.to_le_bytes(), "no tree");
    told(place_of(&bytes, &levels, inner[2] as u64), &3_000_000_000u32.to_le_bytes(), "levels of detail");
    let leaves: Vec<usize> = of_kind(true).collect();
    let [first, last] = [leaves[0], leaves[leaves.len() - 1]];
    told(place_of(&bytes, &levels, last as u64), &tree[first].first.to_le_bytes(), "do not follow");
    // NaN in the element `scene`, and bounds that do not cover the points.
    let whole = bytes.len() - 8 * 44;
    told(whole, &f64::NAN.to_le_bytes(), "not a number");
    told(whole + 8 * 6, &(-9.0f64).to_le_bytes(), "does not cover");
    told(whole + 8 * 35, &1e-9f64.to_le_bytes(), "does not cover");
    // Surfels without a position or an axis.
    let header = bytes.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    let size = levels.bytes(1, 0) as usize;
    let mut some = 0;
    for point in (0..3000).step_by(50) {
        match damaged(header + point * size, &f32::NAN.to_le_bytes()) {
            Ok(_) => {}
            Err(Error::Malformed { what, .. }) => {
                some += 1;
                assert!(what.contains("has no "), "{what}");
            }
            Err(other) => panic!("{other}"),
        }
    }
    assert!(some > 10, "{some}");
    // A truncated file is left to the full reader.
    let other = folder.path().join("short.ply");
    std::fs::write(&other, &bytes[..bytes.len() - 1]).unwrap();
    assert!(Levels::open(Input::open(&other, None).unwrap()).unwrap().is_none());
}

/// Files without the element `scene` (of other versions) or with additional content are not read in
/// parts.
#[test]
fn other_files_are_read_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("levels.ply");
    let open = || Levels::open(Input::open(&path, None).unwrap()).unwrap().is_some();
    let scene = levels(sphere(500, 1.7));
    ply::write_scene(&path, &Scene { hierarchy: None, ..scene.clone() }, None, &()).unwrap();
    assert!(!open());
    ply::write_scene(&path, &scene, Some(Path::new("mesh.obj")), &()).unwrap();
    assert!(!open());
    ply::write_scene(&path, &scene, None, &()).unwrap();
    assert!(open());
    let mut bytes = std::fs::read(&path).unwrap();
    let name = b"element scene";
    let at = bytes.windows(name.len()).position(|words| words == name).unwrap();
    bytes[at..at + name.len()].copy_from_slice(b"element other");
    std::fs::write(&path, &bytes).unwrap();
    assert!(!open());
    let obj = folder.path().join("points.obj");
    std::fs::write(&obj, "v 0 0 0\n").unwrap();
    assert!(Levels::open(Input::open(&obj, None).unwrap()).unwrap().is_none());
}

/// A view that shows nothing reads no surfel. A scene of one surfel is read as one node.
#[test]
fn the_smallest_parts() {
    let folder = tempfile::tempdir().unwrap();
    let surfel = Surfel::disk(Vec3::new(0.5, 0.25, -1.0), Vec3::new(0.0, 0.6, 0.8), 0.3);
    let path = written(Scene { surfels: vec![surfel], oriented: true, ..Scene::default() }, folder.path());
    let levels = opened(&path);
    assert!(nothing(&levels).surfels.is_empty() && nothing(&levels).oriented);
    let options = ways().swap_remove(0);
    let counts = |eye: DVec3| {
        let camera = Camera::look_at((40, 40), Lens::Fov(40.0), eye, eye - DVec3::Z, None, Up::Y, 0.05).unwrap();
        let (scene, taken) = part(&path, &camera, &options).unwrap();
        let (frame, _) = render(&scene, &camera, &options, &Backend::Reference, &()).unwrap();
        (taken.nodes, taken.surfels, frame.color.iter().any(|color| color[3] > 0.0))
    };
    assert_eq!(counts(DVec3::new(0.5, 0.25, 2.0)), (1, 1, true));
    assert_eq!(counts(DVec3::new(0.5, 0.25, -9.0)), (1, 0, false));
}
