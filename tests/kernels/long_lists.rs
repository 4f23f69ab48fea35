//! Fragment lists too long for one invocation of a software adapter are sorted and composited in
//! rounds; the result must equal the twin's.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::Random;
use common::bits;
use common::scenes::{front, shuffled};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::metrics::DECISION_MARGIN;
use epsplat::low_level::passes::long_lists::most_at_once;
use epsplat::low_level::plan::Settings;
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::composite::ALL_LAYERS;
use epsplat::low_level::scene::{Colors, Composite, Epsilon, Map, Maps, Samples, Scene, Shading, Surfel};
use glam::Vec3;

/// A scene for 8 x 8 pixels: `deep` disks, about half of them facing the camera. Nearly all overlap
/// in the middle of the image, fewer in its corners.
fn pile(deep: usize) -> Scene {
    let mut random = Random(9);
    let mut disk = |_| {
        let [x, y] = [0; 2].map(|_| random.between(-2.0, 2.0) as f32);
        let facing = if random.unit() < 0.5 { Vec3::Z } else { Vec3::NEG_Z };
        let tilt = Vec3::new(random.between(-0.1, 0.1) as f32, random.between(-0.1, 0.1) as f32, 0.0);
        Surfel::disk(Vec3::new(x, y, random.between(5.0, 80.0) as f32), (facing + tilt).normalize(), 3.0)
    };
    let surfels: Vec<Surfel> = (0..deep).map(&mut disk).collect();
    let color = |_| [random.unit() as f32, random.unit() as f32, 0.5, random.between(0.2, 1.0) as f32];
    Scene { colors: Colors::Linear((0..deep).map(color).collect()), surfels, oriented: true, ..Scene::default() }
}

fn of(composite: Composite) -> Settings {
    let maps = [Map::Transmittance, Map::Layers, Map::Surfaces, Map::Tail];
    let maps = if composite == Composite::Layers(3) { &maps[..] } else { &maps[..3] };
    Settings {
        composite,
        shading: Shading::Unlit,
        opacity: 0.002,
        epsilon: Epsilon::Absolute(0.01),
        maps: Maps::of(maps),
        ..Settings::default()
    }
}

fn in_rounds(scene: &Scene, options: &Settings, backend: &Backend) -> Frame {
    let (frame, report) = render(scene, &front(8), options, backend, &()).unwrap();
    let on_device = matches!(backend, Backend::Gpu { .. });
    assert_eq!(report.needs.contains(&"long-lists"), on_device, "{:?}", report.needs);
    frame
}

fn all_bits(frame: &Frame) -> Vec<u32> {
    let maps = [Map::Transmittance, Map::Layers, Map::Surfaces, Map::Tail];
    let of = |map| frame.map(map).into_iter().flatten().map(|value| value.to_bits());
    bits(frame).into_iter().chain(maps.into_iter().flat_map(of)).collect()
}

/// Returns the adapter if it is a software one. Only these limit loops; a card processes any list
/// in one go.
fn software() -> Option<Gpu> {
    common::gpu().filter(|gpu| gpu.adapter.is_software())
}

fn with(changes: &[(&str, &str, &str)]) -> Backend {
    let sources =
        changes.iter().fold(Sources::default(), |sources, (file, from, to)| sources.replace(file, from, to).unwrap());
    Backend::Gpu { gpu: Box::new(software().unwrap()), sources }
}

/// Composite modes that traverse lists differently: all layers, three layers and a long tail, and
/// every fragment in order.
const WAYS: [Composite; 3] = [Composite::Layers(ALL_LAYERS), Composite::Layers(3), Composite::Sorted];

#[test]
fn the_twin_composites_alike() {
    let Some(gpu) = software() else { return };
    let backend = Backend::gpu(gpu);
    let scene = pile(9_000);
    for composite in WAYS {
        for samples in [Samples::ONE, "4".parse().unwrap()] {
            let one = samples == Samples::ONE;
            let own = Settings { samples, maps: if one { of(composite).maps } else { Maps::NONE }, ..of(composite) };
            let decisions = Settings { maps: Maps::of(&[Map::Decision]), ..own.clone() };
            let decided = in_rounds(&scene, &decisions, &Backend::Reference);
            let decided = decided.map(Map::Decision).unwrap();
            let [device, twin] = [&backend, &Backend::Reference].map(|backend| in_rounds(&scene, &own, backend));
            let nearest = |frame: &Frame| frame.map(Map::Surfaces).unwrap_or_default().to_vec();
            for (a, b) in nearest(&twin).iter().zip(nearest(&device)) {
                assert!(a == &b || (a - b).abs() < 1e-5 * a.abs() + 1e-8, "{composite:?}: {a} {b}");
            }
            let mut compared = 0;
            for (pixel, (a, b)) in twin.color.iter().zip(&device.color).enumerate() {
                // With thousands of fragments, almost any pixel has some near a decision, but each
                // of them changes the colour little.
                let near = if decided[pixel] > DECISION_MARGIN { 2e-5 } else { 2e-3 };
                compared += usize::from(a[3] > 0.002);
                assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < near), "{composite:?} {pixel}: {a:?} {b:?}");
            }
            assert!(compared > 32, "{compared}");
        }
    }
}

/// The work per dispatch, the order of fragments and the threshold for long lists do not change a
/// bit.
///
/// Controls: state that is lost between dispatches changes bits, and so do loops that the adapter
/// cuts off.
#[test]
fn rounds_do_not_show() {
    let Some(gpu) = software() else { return };
    let backend = Backend::gpu(gpu);
    let scene = pile(9_000);
    for (way, composite) in WAYS.into_iter().enumerate() {
        let own = of(composite);
        let first = all_bits(&in_rounds(&scene, &own, &backend));
        let same = |other: &Backend| all_bits(&in_rounds(&scene, &own, other)) == first;
        assert!(all_bits(&in_rounds(&shuffled(&scene, 5), &own, &backend)) == first, "{composite:?}");
        for change in [
            ("long_lists.wgsl", "rounds_left = LOOKS;", "rounds_left = 3u * LOOKS;"),
            ("long_lists.wgsl", "rounds_left = LOOKS;", "rounds_left = LOOKS - 300u;"),
            ("long_lists.wgsl", "first + HEAP_STEPS,", "first + 2u * HEAP_STEPS + 7u,"),
            ("long_lists.wgsl", "list.y > list.x + LONG;", "list.y > list.x + LONG / 2u;"),
        ] {
            assert!(same(&with(&[change])), "{composite:?}: {change:?}");
        }
        let forgets = [
            ("so_far.farthest);", "0.0);", [true, false, false]),
            ("so_far.told.x);", "-1.0);", [true, false, false]),
            ("so_far.key;", "so_far.first;", [false, true, false]),
            ("= layer_low[channel];", "= 0u;", [true, true, false]),
            ("so_far.shown.transmittance);", "1.0);", [true, true, true]),
            ("long_lists[kept + 1u] = end;", "long_lists[kept + 1u] = first;", [true; 3]),
            ("list.y > list.x + LONG;", "false;", [true; 3]),
        ];
        for (from, to, shows) in forgets {
            assert!(same(&with(&[("long_lists.wgsl", from, to)])) != shows[way], "{composite:?}: {from} {to}");
        }
    }
}

/// The limit of a list's length is divided by the number of samples, as the lists of all samples of
/// a pixel are processed together.
#[test]
fn a_list_is_long_by_its_samples() {
    assert_eq!(most_at_once(Samples::ONE), 2048);
    assert!(most_at_once("16".parse().unwrap()) * 16 <= 6554);
}
