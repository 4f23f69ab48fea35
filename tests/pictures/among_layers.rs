//! Triangles among surfaces that show through each other: judged by closed forms and f64 twins.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::scenes::{front, sphere, sphere_camera};
use common::{Random, bits, meshes};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::metrics::DECISION_MARGIN;
use epsplat::low_level::plan::{Facts, Settings, check};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::composite::ALL_LAYERS;
use epsplat::low_level::scene::{
    Camera, Colors, Composite, Cull, Map, Maps, Projection, Scene, Shading, Surfel, Tail, Triangle, Triangles, gaussian,
};
use glam::{DVec3, Vec3};

fn backends() -> Option<[Backend; 2]> {
    Some([Backend::gpu(common::gpu()?), Backend::Reference])
}

fn broken(file: &str, from: &str, to: &str) -> Backend {
    let sources = Sources::default().replace(file, from, to).unwrap();
    Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources }
}

fn frame(scene: &Scene, camera: &Camera, options: &Settings, backend: &Backend) -> Frame {
    render(scene, camera, options, backend, &()).unwrap().0
}

/// A square of two triangles across the view of `front`, at a depth, whose corners run
/// counterclockwise as the camera sees them.
fn square(depth: f64, color: [f32; 4]) -> [Triangle; 2] {
    let corners = [[-50.0, -50.0, depth], [-50.0, 50.0, depth], [50.0, 50.0, depth], [50.0, -50.0, depth]];
    [[0, 1, 2], [0, 2, 3]].map(|of| Triangle {
        corners: of.map(|corner: usize| corners[corner]),
        normals: None,
        colors: [color; 3],
        texture: None,
    })
}

/// Disks that fill the view of `front` at these depths, with these alphas, each in another colour.
fn sheets(sheets: &[(f32, f32)]) -> Scene {
    let color = |(number, (_, alpha)): (usize, &(f32, f32))| {
        [[0.9, 0.1, 0.2], [0.1, 0.3, 0.8], [0.3, 0.9, 0.4]][number]
            .into_iter()
            .chain([*alpha])
            .collect::<Vec<f32>>()
            .try_into()
            .unwrap()
    };
    Scene {
        surfels: sheets.iter().map(|(z, _)| Surfel::disk(Vec3::new(0.0, 0.0, *z), Vec3::NEG_Z, 500.0)).collect(),
        colors: Colors::Linear(sheets.iter().enumerate().map(color).collect()),
        oriented: true,
        ..Scene::default()
    }
}

fn settings(composite: Composite) -> Settings {
    let maps = Maps::of(&[Map::Transmittance, Map::Layers, Map::Surfaces]);
    Settings { composite, shading: Shading::Unlit, kernel: "constant".parse().unwrap(), maps, ..Settings::default() }
}

/// The depth and the straight colour of a triangle, how it is composited with the sheets, the straight
/// colours of the layers from front to back, and a depth that one of them has.
type Case = (f64, [f32; 4], Composite, Vec<[f32; 4]>, f32);

/// An opaque triangle hides the sheets behind it and shows through those before it; a translucent
/// one shows what is behind it. It counts as one of the nearest layers.
#[test]
fn a_triangle_is_a_surface_like_all_others() {
    let Some(backends) = backends() else { return };
    const TRIANGLE: [f32; 4] = [0.6, 0.5, 0.1, 1.0];
    let before_and_behind = [(4.0, 0.5), (6.0, 0.25), (9.0, 0.5)];
    let over = |layers: &[[f32; 4]]| {
        let (mut sum, mut left) = ([0.0; 3], 1.0);
        for [r, g, b, alpha] in layers {
            [r, g, b].iter().zip(&mut sum).for_each(|(value, sum)| *sum += left * alpha * **value);
            left *= 1.0 - alpha;
        }
        (sum.map(|value| value / (1.0 - left)), 1.0 - left)
    };
    let glass = [0.6, 0.5, 0.1, 0.5];
    let Colors::Linear(colors) = sheets(&before_and_behind).colors else { unreachable!() };
    let [a, b, c] = [colors[0], colors[1], colors[2]];
    let all = Composite::Layers(ALL_LAYERS);
    let cases: [Case; 10] = [
        (7.0, TRIANGLE, all, vec![a, b, TRIANGLE], 7.0),
        (7.0, TRIANGLE, Composite::Sorted, vec![a, b, TRIANGLE], 7.0),
        (2.0, TRIANGLE, all, vec![TRIANGLE], 2.0),
        (2.0, TRIANGLE, Composite::Sorted, vec![TRIANGLE], 2.0),
        (20.0, TRIANGLE, all, vec![a, b, c, TRIANGLE], 20.0),
        (20.0, TRIANGLE, Composite::Sorted, vec![a, b, c, TRIANGLE], 20.0),
        (5.0, glass, all, vec![a, glass, b, c], 5.0),
        (5.0, glass, Composite::Sorted, vec![a, glass, b, c], 5.0),
        (5.0, glass, Composite::Layers(2), vec![a, glass], 5.0),
        (7.0, TRIANGLE, Composite::Layers(2), vec![a, b], f32::NAN),
    ];
    for (depth, color, composite, layers, third) in cases {
        // A corner's colour is premultiplied.
        let [r, g, b, alpha] = color;
        let premultiplied = [r * alpha, g * alpha, b * alpha, alpha];
        let scene = Scene { triangles: Triangles::new(&square(depth, premultiplied)), ..sheets(&before_and_behind) };
        let options = Settings { tail: Tail::None, ..settings(composite) };
        let (expected, alpha) = over(&layers);
        for backend in &backends {
            let shown = frame(&scene, &front(8), &options, backend);
            let surfaces = shown.map(Map::Surfaces).unwrap();
            for (pixel, color) in shown.color.iter().enumerate() {
                let near = |a: f32, b: f32| (a - b).abs() < 1e-5;
                let alike = color.iter().zip(expected).all(|(a, b)| near(*a, b)) && near(color[3], alpha);
                assert!(alike, "{composite:?} {depth}: {color:?} is not {expected:?} {alpha}");
                assert_eq!(shown.map(Map::Layers).unwrap()[pixel], layers.len() as f32);
                let depths = surfaces[16 * pixel..16 * (pixel + 1)].iter().step_by(2);
                assert!(third.is_nan() || depths.into_iter().any(|depth| near(*depth, third)), "{composite:?} {depth}");
            }
        }
    }
}

/// A tail holds what lies behind the last layer; a triangle before it is a layer, and a triangle
/// behind it shows through it.
#[test]
fn a_triangle_lies_before_or_behind_a_tail() {
    let Some(backends) = backends() else { return };
    let tailed = Settings { tail: Tail::Sum, ..settings(Composite::Layers(1)) };
    let blue = [0.1, 0.2, 0.9, 1.0];
    for (depth, layers) in [(2.0, 1.0), (5.0, 2.0), (20.0, 3.0)] {
        let scene =
            Scene { triangles: Triangles::new(&square(depth, blue)), ..sheets(&[(4.0, 0.5), (6.0, 0.25), (9.0, 0.5)]) };
        for backend in &backends {
            let shown = frame(&scene, &front(8), &tailed, backend);
            assert!(shown.color.iter().all(|color| (color[3] - 1.0).abs() < 1e-5), "{depth}: {:?}", shown.color[0]);
            assert!(shown.map(Map::Layers).unwrap().iter().all(|count| *count == layers), "{depth}");
        }
    }
}

/// A translucent sphere of splats with a rough body of triangles through it.
fn mixed(encoded: bool) -> (Scene, Camera) {
    let mut random = Random(3);
    let mut scene = sphere(900, 2.0);
    let color = |_| [0; 3].map(|_| random.unit() as f32);
    scene.colors = Colors::Linear((0..900).map(color).map(|[r, g, b]| [r, g, b, 0.3 + 0.4 * r]).collect());
    (scene.encoded, scene.oriented) = (encoded, !encoded);
    let mesh = meshes::sphere(3, false);
    let at = |vertex: u32| mesh.positions[vertex as usize].map(|x| 0.7 * x + 0.35);
    let triangle = |of: &[u32; 3]| {
        let corners = of.map(at);
        let shade = corners[0].map(|x| (0.5 + 0.4 * x) as f32);
        Triangle { corners, normals: None, colors: [[shade[0], shade[1], shade[2], 1.0]; 3], texture: None }
    };
    scene.triangles = Triangles::new(&mesh.triangles.iter().map(triangle).collect::<Vec<_>>());
    (scene, sphere_camera(64, Projection::Pinhole))
}

fn twin_of(scene: &Scene, camera: &Camera, options: &Settings) -> Frame {
    let with_decision = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
    frame(scene, camera, &with_decision, &Backend::Reference)
}

/// The number of pixels that no rounding decides and that differ from the twin's.
fn differ(truth: &Frame, shown: &Frame) -> usize {
    let decided = truth.map(Map::Decision).unwrap();
    let pixels = (0..decided.len()).filter(|pixel| decided[*pixel] > DECISION_MARGIN);
    let far = |pixel: &usize| shown.color[*pixel].iter().zip(truth.color[*pixel]).any(|(a, b)| (a - b).abs() > 5e-5);
    pixels.filter(far).count()
}

fn ways() -> [(bool, Settings); 6] {
    let lit = |composite| Settings { composite, ..Settings::default() };
    let gaussians = Settings {
        composite: Composite::Gaussians,
        shading: Shading::Unlit,
        kernel: gaussian::KERNEL,
        ..Settings::default()
    };
    [
        (false, lit(Composite::Layers(ALL_LAYERS))),
        (false, lit(Composite::Layers(1))),
        (false, Settings { tail: Tail::Sum, ..lit(Composite::Layers(1)) }),
        (false, lit(Composite::Sorted)),
        (false, Settings { samples: "4".parse().unwrap(), ..lit(Composite::Sorted) }),
        (true, gaussians),
    ]
}

/// Kernels agree with twins in each composite; broken kernels differ.
#[test]
fn kernels_and_twins_composite_alike() {
    let Some([gpu, _]) = backends() else { return };
    for (encoded, options) in ways() {
        let (scene, camera) = mixed(encoded);
        let truth = twin_of(&scene, &camera, &options);
        let shown = frame(&scene, &camera, &options, &gpu);
        assert_eq!(differ(&truth, &shown), 0, "{:?}", options.composite);
        let compared = truth.map(Map::Decision).unwrap().iter().filter(|decided| **decided > DECISION_MARGIN).count();
        assert!(compared > 2000, "{compared}");
        let without = Scene { triangles: Triangles::default(), ..scene.clone() };
        let least = if options.composite == Composite::Layers(1) && options.tail == Tail::None { 40 } else { 200 };
        assert!(differ(&truth, &frame(&without, &camera, &options, &gpu)) > least, "{:?}", options.composite);
        let nearest = broken("join_lists.wgsl", "+ 1u].w", "+ 1u].w * 0.7");
        assert!(differ(&truth, &frame(&scene, &camera, &options, &nearest)) > 40, "{:?}", options.composite);
    }
}

/// Order of surfels and triangles, and the driver's rounds for long lists, do not change a bit.
#[test]
fn no_bit_depends_on_the_order() {
    let Some([gpu, _]) = backends() else { return };
    for (encoded, options) in ways() {
        let (scene, camera) = mixed(encoded);
        let other = common::scenes::shuffled(&scene, 4);
        assert!(bits(&frame(&scene, &camera, &options, &gpu)) == bits(&frame(&other, &camera, &options, &gpu)));
    }
}

/// A triangle in the middle of lists that take several dispatches. Forgetting between dispatches
/// that it was composited shows.
#[test]
fn long_lists_have_one_triangle() {
    let Some([gpu, _]) = backends() else { return };
    let software = matches!(&gpu, Backend::Gpu { gpu, .. } if gpu.adapter.is_software());
    if !software {
        // Cards sort every list at once.
        return;
    }
    let mut random = Random(9);
    let mut disk = |_| {
        let [x, y] = [0; 2].map(|_| random.between(-2.0, 2.0) as f32);
        Surfel::disk(Vec3::new(x, y, random.between(5.0, 80.0) as f32), Vec3::NEG_Z, 8.0)
    };
    let surfels: Vec<Surfel> = (0..9_000).map(&mut disk).collect();
    let scene = Scene {
        surfels,
        colors: Colors::Constant([0.8, 0.2, 0.1, 0.0005]),
        triangles: Triangles::new(&square(8.0, [0.0, 0.0, 0.5, 0.5])),
        oriented: true,
        ..Scene::default()
    };
    for composite in [Composite::Layers(ALL_LAYERS), Composite::Sorted] {
        let epsilon = "abs:0.001".parse().unwrap();
        let options = Settings { epsilon, ..settings(composite) };
        let (first, report) = render(&scene, &front(8), &options, &gpu, &()).unwrap();
        assert!(report.needs.contains(&"long-lists"), "{:?}", report.needs);
        let twin = frame(&scene, &front(8), &options, &Backend::Reference);
        let apart = |frame: &Frame| {
            let pairs = frame.color.iter().flatten().zip(twin.color.iter().flatten());
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        assert!(apart(&first) < 1e-3, "{composite:?}: {}", apart(&first));
        let other = broken("long_lists.wgsl", "rounds_left = LOOKS;", "rounds_left = LOOKS - 300u;");
        assert!(bits(&frame(&scene, &front(8), &options, &other)) == bits(&first));
        let forgets = broken("long_lists.wgsl", "let joined = long_lists[at + 12u] != 0u;", "let joined = false;");
        assert!(apart(&frame(&scene, &front(8), &options, &forgets)) > 0.05, "{composite:?}");
    }
}

/// Triangles that face away are left out on demand: of a closed body the far side is then seen
/// from inside only. The twin does the same.
#[test]
fn triangles_that_face_away_are_left_out() {
    let Some(backends) = backends() else { return };
    let scene = Scene { triangles: mixed(false).0.triangles, ..Scene::default() };
    let both = Settings { maps: Maps::of(&[Map::Depth]), ..Settings::default() };
    let front_only = Settings { cull: Cull::Back, ..both.clone() };
    for projection in [Projection::Pinhole, Projection::Orthographic] {
        let outside = sphere_camera(64, projection);
        let forward = outside.ray(32.0, 32.0).normalize();
        let inside = Camera { eye: DVec3::splat(0.35) + 0.3 * forward, near: 1e-3, ..outside.clone() };
        for backend in &backends {
            let covered = |camera: &Camera, options: &Settings| {
                let shown = frame(&scene, camera, options, backend);
                shown.color.iter().filter(|color| color[3] > 0.0).count()
            };
            let [all, fronts] = [&both, &front_only].map(|options| frame(&scene, &outside, options, backend));
            assert!(bits(&all) == bits(&fronts) && covered(&outside, &both) > 200, "{projection:?}");
            assert!(covered(&inside, &both) > 200 && covered(&inside, &front_only) == 0, "{projection:?}");
        }
    }
}

/// Order-free sums cannot leave out what lies behind a triangle, and the sentence says what can.
#[test]
fn order_free_sums_refuse_triangles() {
    let (scene, _) = mixed(false);
    let options = Settings { composite: Composite::Moments, ..Settings::default() };
    let why = check::scene(&Facts::of(&scene), &options, false).unwrap_err().to_string();
    assert!(why.contains("--composite layers or sorted"), "{why}");
}
