//! `--separate` inputs: they do not blend with each other, kernels agree with twins, and drawing
//! order changes no bit.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::f64::consts::PI;

use common::scenes::sphere_camera;
use common::{Random, bits, meshes};
use epsplat::io::{Mesh, Points};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::plan::{Accumulator, Facts, Optimisation, Organisation, Settings};
use epsplat::low_level::render::{Backend, Renderer, render};
use epsplat::low_level::scene::{
    Blend, Camera, Colors, Composite, Epsilon, Join, Kernel, LowPass, Map, Maps, Projection, Samples, Scene, Shading,
    Triangles,
};
use epsplat::low_level::surfels::{build, with_triangles};
use glam::DVec3;

/// A sphere of `count` disks around `center`, at radii that vary by 0.2 %, in shades of `color`.
fn ball(center: DVec3, radius: f64, count: usize, color: [u8; 3]) -> Points {
    let mut random = Random(count as u64);
    let mut points = Points { normals: Some(Vec::new()), radii: Some(Vec::new()), ..Points::default() };
    let mut colors = Vec::new();
    for k in 0..count {
        let z = 1.0 - (2.0 * k as f64 + 1.0) / count as f64;
        let (sine, cosine) = (k as f64 * PI * (3.0 - 5f64.sqrt())).sin_cos();
        let normal = DVec3::new(cosine, sine, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
        points.positions.push((center + normal * radius * random.between(0.998, 1.002)).to_array());
        points.normals.as_mut().unwrap().push(normal.as_vec3().to_array());
        points.radii.as_mut().unwrap().push((radius * random.between(1.5, 2.5) / (count as f64).sqrt() * 2.0) as f32);
        let shade = random.between(0.5, 1.0);
        let [r, g, b] = color.map(|c| (f64::from(c) * shade) as u8);
        colors.push([r, g, b, 255]);
    }
    points.colors = Some(Colors::Srgb8(colors));
    points
}

/// A skin, a shirt half an epsilon above it, and a ball that intersects both.
fn inputs() -> Vec<Points> {
    vec![
        ball(DVec3::ZERO, 1.0, 1500, [255, 0, 0]),
        ball(DVec3::ZERO, 1.005, 1100, [0, 255, 0]),
        ball(DVec3::new(0.7, 0.4, 0.3), 0.6, 900, [0, 0, 255]),
    ]
}

fn scene() -> Scene {
    build(inputs(), &()).unwrap().0
}

fn camera() -> Camera {
    sphere_camera(96, Projection::Pinhole)
}

/// A mesh that intersects all inputs.
fn body() -> Mesh {
    let mut mesh = meshes::sphere(2, false);
    for [x, y, z] in &mut mesh.positions {
        (*x, *y, *z) = (0.7 * *x + 0.3, 0.7 * *y - 0.1, 0.7 * *z + 0.5);
    }
    mesh
}

const MAPS: Maps = Maps::of(&[Map::Depth, Map::Normal, Map::Weight, Map::Count, Map::Transmittance]);

fn apart() -> Settings {
    Settings { separate: true, shading: Shading::Unlit, maps: MAPS, ..Settings::default() }
}

fn gpu() -> Option<Backend> {
    common::gpu().map(Backend::gpu)
}

fn broken(file: &str, from: &str, to: &str) -> Backend {
    let sources = Sources::default().replace(file, from, to).unwrap();
    Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources }
}

fn frame(scene: &Scene, options: &Settings, backend: &Backend) -> Frame {
    render(scene, &camera(), options, backend, &()).unwrap().0
}

/// The number of pixels whose colour mixes more than one input.
fn mixed(frame: &Frame) -> usize {
    frame.color.iter().filter(|[r, g, b, _]| [r, g, b].iter().filter(|c| ***c > 1e-4).count() > 1).count()
}

/// The number of pixels that no rounding decides and whose colour or maps differ.
fn differ(shown: &Frame, truth: &Frame) -> usize {
    let decided = truth.map(Map::Decision).unwrap();
    let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| a == b || (a - b).abs() <= 2e-5 * (1.0 + b.abs()));
    let alike = |pixel: usize| {
        shown.maps().iter().all(|map| {
            let of = |frame: &Frame| frame.map(map).unwrap()[pixel * map.width()..(pixel + 1) * map.width()].to_vec();
            near(&of(shown), &of(truth))
        }) && near(&shown.color[pixel], &truth.color[pixel])
    };
    (0..decided.len()).filter(|pixel| decided[*pixel] > 1e-5 && !alike(*pixel)).count()
}

fn truth(scene: &Scene, options: &Settings) -> Frame {
    let with_decision = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
    frame(scene, &with_decision, &Backend::Reference)
}

#[test]
fn inputs_do_not_blend_and_kernels_agree_with_twins() {
    let Some(backend) = gpu() else { return };
    let scene = scene();
    let together = Settings { separate: false, ..apart() };
    for organisation in [Organisation::Scatter, Organisation::Tile] {
        for samples in [Samples::ONE, Samples { across: 2, down: 2 }] {
            let of = |options: Settings| {
                let maps = if samples == Samples::ONE { MAPS } else { Maps::NONE };
                Settings { organisation, samples, maps, ..options }
            };
            let shown = frame(&scene, &of(apart()), &backend);
            let all = truth(&scene, &of(Settings { organisation: Organisation::Auto, ..apart() }));
            assert_eq!(differ(&shown, &all), 0, "{organisation:?}, {samples:?}");
            if samples == Samples::ONE {
                assert_eq!(mixed(&shown), 0);
                // The shirt hides the skin, but for gaps between edges.
                let of_skin = shown.color.iter().filter(|[r, ..]| *r > 0.0).count();
                let covered = shown.color.iter().filter(|color| color[3] > 0.0).count();
                assert!(of_skin * 50 < covered && covered > 3000, "{of_skin} of {covered}");
                // Control: without `separate` the inputs blend.
                let blended = frame(&scene, &of(together.clone()), &backend);
                assert!(mixed(&blended) * 2 > covered && differ(&blended, &all) * 2 > covered);
            }
        }
    }
    // Lit, with other accumulators, epsilons and low-passes, and over a background.
    for options in [
        Settings { shading: Shading::Phong, ..apart() },
        Settings { accumulator: Accumulator::Fixed32, ..apart() },
        Settings { accumulator: Accumulator::Cas, ..apart() },
        Settings { accumulator: Accumulator::Fixed32, kernel: Kernel::Constant, ..apart() },
        Settings { epsilon: Epsilon::Ray(0.02), ..apart() },
        Settings { low_pass: LowPass::Max, ..apart() },
        Settings { background: [0.2, 0.4, 0.6, 0.5], ..apart() },
    ] {
        let shown = frame(&scene, &options, &backend);
        assert_eq!(differ(&shown, &truth(&scene, &options)), 0, "{options:?}");
    }
}

#[test]
fn a_wrong_kernel_is_noticed() {
    let Some(backend) = gpu() else { return };
    let scene = scene();
    let all = truth(&scene, &apart());
    let scattered = Settings { organisation: Organisation::Scatter, ..apart() };
    assert_eq!(differ(&frame(&scene, &scattered, &backend), &all), 0);
    for (file, from, to) in [
        ("individuals.wgsl", "(a.depth < b.depth)", "(a.depth > b.depth)"),
        ("individuals.wgsl", "kept.weight = summed.y;", "kept.weight = summed.x;"),
        ("individuals.wgsl", "a.exists && (!b.exists || is_before)", "a.exists"),
        ("individuals.wgsl", "any_shows = any_shows ||", "any_shows = any_shows &&"),
        ("depth_middles.wgsl", "max(part_of(weight), LEAST_MIDDLE)", "1.0"),
    ] {
        let shown = frame(&scene, &scattered, &broken(file, from, to));
        assert!(differ(&shown, &all) > 10, "{file}: {from}");
    }
    let tiles = Settings { organisation: Organisation::Tile, ..apart() };
    let shown = frame(&scene, &tiles, &broken("tile_individuals.wgsl", "keep_nearest_of(k,", "keep_nearest_of(0u,"));
    assert!(differ(&shown, &all) > 10);
}

#[test]
fn the_same_bits_however_they_are_drawn() {
    let Some(backend) = gpu() else { return };
    let scenes = [scene(), with_triangles(Some(scene()), &[body()]).unwrap().0];
    for scene in scenes {
        let one = bits(&frame(&scene, &apart(), &backend));
        let same = |name: &str, scene: &Scene, options: &Settings, backend: &Backend| {
            assert!(bits(&frame(scene, options, backend)) == one, "{name}");
        };
        let organised = |organisation| Settings { organisation, ..apart() };
        same("scatter", &scene, &organised(Organisation::Scatter), &backend);
        same("tile", &scene, &organised(Organisation::Tile), &backend);
        let small = Backend::gpu(Gpu::with_buffer_limit(common::gpu().unwrap(), 60_000));
        same("bands and pages", &scene, &apart(), &small);
        let banded = Backend::gpu(Gpu::with_buffer_limit(common::gpu().unwrap(), 330_000));
        same("bands of tiles", &scene, &organised(Organisation::Tile), &banded);
        let mut renderer = Renderer::new(&scene, &apart(), &backend).unwrap();
        for _ in 0..3 {
            assert!(bits(&renderer.frame(&camera(), &()).unwrap().0) == one, "one frame after another");
        }
        same("bands and pages, scattered", &scene, &organised(Organisation::Scatter), &small);
        same("a core adapter", &scene, &apart(), &Backend::gpu(common::core_gpu().unwrap()));
        for optimisation in Optimisation::ALL {
            let (left_out, name) = optimisation;
            let without = Settings { without: vec![left_out], ..apart() };
            same(name, &scene, &without, &backend);
        }
        // In another order of the inputs, and of the surfels in each.
        let mut turned = inputs();
        turned.rotate_left(1);
        for points in &mut turned {
            let mut order: Vec<usize> = (0..points.positions.len()).collect();
            Random(9).shuffle(&mut order);
            points.positions = order.iter().map(|&k| points.positions[k]).collect();
            points.normals = points.normals.take().map(|all| order.iter().map(|&k| all[k]).collect());
            points.radii = points.radii.take().map(|all| order.iter().map(|&k| all[k]).collect());
            let Some(Colors::Srgb8(codes)) = points.colors.take() else { panic!() };
            points.colors = Some(Colors::Srgb8(order.iter().map(|&k| codes[k]).collect()));
        }
        let shuffled = Scene { triangles: scene.triangles.clone(), ..build(turned, &()).unwrap().0 };
        same("shuffled", &shuffled, &apart(), &backend);
    }
}

/// Squares of two colours in one plane: both inputs are equally near at every pixel.
#[test]
fn of_equal_depths_the_order_of_inputs_does_not_show() {
    let Some(backend) = gpu() else { return };
    let square = |color: [u8; 4]| {
        let at = |k: i32| f64::from(k) / 10.0 - 1.0;
        let positions: Vec<_> = (0..441).map(|k| [at(k % 21), at(k / 21), 0.0]).collect();
        let many = positions.len();
        Points {
            normals: Some(vec![[0.0, 0.0, 1.0]; many]),
            radii: Some(vec![0.15; many]),
            colors: Some(Colors::Srgb8(vec![color; many])),
            positions,
            ..Points::default()
        }
    };
    let (first, second) = (square([200, 10, 10, 255]), square([10, 200, 10, 255]));
    let both = [vec![first.clone(), second.clone()], vec![second, first]];
    let camera = sphere_camera(64, Projection::Orthographic);
    let frames = both.map(|inputs| {
        let scene = build(inputs, &()).unwrap().0;
        render(&scene, &camera, &apart(), &backend, &()).unwrap().0
    });
    assert!(bits(&frames[0]) == bits(&frames[1]));
    // One input shows everywhere, unmixed.
    let shown: Vec<_> = frames[0].color.iter().filter(|color| color[3] > 0.0).collect();
    assert!(shown.len() > 500 && shown.iter().all(|color| color[0] > color[1]));
}

/// Triangles are joined to the surface of the nearest input.
#[test]
fn triangles_are_joined_to_the_nearest_input() {
    let Some(backend) = gpu() else { return };
    let (scene, _) = with_triangles(Some(scene()), &[body()]).unwrap();
    assert!(scene.triangles != Triangles::default());
    assert_eq!(Facts::of(&scene).individuals, [1500, 1100, 900]);
    for join in [Join::Corrected, Join::Nearest, Join::Blended] {
        let options = Settings { join, ..apart() };
        let shown = frame(&scene, &options, &backend);
        assert_eq!(differ(&shown, &truth(&scene, &options)), 0, "{join:?}");
        let weights = shown.map(Map::Weight).unwrap();
        let ones = weights.iter().filter(|weight| **weight == 1.0).count();
        assert!(ones > 50 && weights.iter().filter(|weight| **weight > 0.0).count() > ones + 500, "{join:?}: {ones}");
    }
}

#[test]
fn one_input_costs_nothing() {
    let Some(backend) = gpu() else { return };
    let scene = build(inputs().into_iter().take(1).collect(), &()).unwrap().0;
    let (_, report) = render(&scene, &camera(), &apart(), &backend, &()).unwrap();
    assert!(!report.needs.contains(&"separate"), "{:?}", report.needs);
    let (_, report) = render(&self::scene(), &camera(), &apart(), &backend, &()).unwrap();
    assert!(report.needs.contains(&"separate"), "{:?}", report.needs);
}

#[test]
fn what_does_not_go_with_it_is_refused() {
    let scene = scene();
    let refused = |options: Settings| {
        let error = render(&scene, &camera(), &options, &Backend::Reference, &()).unwrap_err().to_string();
        assert!(error.contains("--separate"), "{error}");
    };
    refused(Settings { blend: Blend::Nearest, maps: Maps::NONE, ..apart() });
    refused(Settings { composite: Composite::Sorted, ..apart() });
    refused(Settings { maps: Maps::of(&[Map::Index]), ..apart() });
}
