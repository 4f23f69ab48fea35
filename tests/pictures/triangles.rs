//! Triangles beside splats: no cracks, hard triangles, joins and textures, judged by rays and f64
//! twins.
//!
//! Also tests that order, organisation and adapter do not change a bit.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::scenes::{front, sphere, sphere_camera};
use common::{Random, bits, meshes};
use std::sync::Arc;

use epsplat::io::{Mesh, Texture};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::metrics::DECISION_MARGIN;
use epsplat::low_level::plan::{BlendFormat, Organisation, Raster, RasterDepth, Settings};
use epsplat::low_level::render::{Backend, Renderer, render};
use epsplat::low_level::scene::{
    Camera, Epsilon, Join, Lens, Map, Maps, Projection, Samples, Scene, Shading, Triangle, Triangles, Up,
};
use epsplat::low_level::surfels::with_triangles;
use epsplat::low_level::truth::Surface;
use glam::{DVec3, Vec3};

fn gpu() -> Option<Backend> {
    common::gpu().map(Backend::gpu)
}

fn broken(file: &str, from: &str, to: &str) -> Backend {
    let sources = Sources::default().replace(file, from, to).unwrap();
    Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources }
}

fn unlit() -> Settings {
    Settings { shading: Shading::Unlit, maps: Maps::of(&[Map::Depth]), ..Settings::default() }
}

fn frame(scene: &Scene, camera: &Camera, options: &Settings, backend: &Backend) -> Frame {
    render(scene, camera, options, backend, &()).unwrap().0
}

/// A closed surface with bumps and dents, whose coordinates are exact in f32.
fn rough() -> Mesh {
    let mut mesh = meshes::sphere(4, false);
    let mut random = Random(7);
    for position in &mut mesh.positions {
        let scale = random.between(0.75, 1.0);
        *position = position.map(|x| f64::from((x * scale) as f32));
    }
    mesh
}

fn scene_of(mesh: &Mesh) -> Scene {
    with_triangles(None, std::slice::from_ref(mesh)).unwrap().0
}

/// A random camera around `rough`, or inside it.
fn pose(random: &mut Random, size: u32) -> Camera {
    let direction = |random: &mut Random| {
        DVec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(-1.0, 1.0)).normalize()
    };
    let eye = direction(random) * random.scale(0.02, 30.0);
    let target = direction(random) * random.between(0.0, 0.5);
    let lens = Lens::Fov(random.between(5.0, 100.0) / (1.0 + 0.2 * eye.length()));
    Camera::look_at((size, size), lens, eye, target, Some(direction(random)), Up::Y, 1e-4).unwrap()
}

/// Counts the pixels whose depth is not that of the ray through their centre.
///
/// A pixel is excused if a ray a thousandth of a pixel beside its centre meets the surface
/// elsewhere.
fn cracks(shown: &Frame, camera: &Camera, surface: &Surface) -> usize {
    let depths = shown.map(Map::Depth).unwrap();
    let ray = |pixel: usize, dx: f64, dy: f64| {
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
        let (x, y) = (f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy);
        // The ray's direction has depth 1, so distances along it are depths.
        let hit = surface.first_hit(camera.ray_start(x, y), camera.ray(x, y), camera.near);
        hit.map_or(f64::INFINITY, |hit| hit.distance)
    };
    let same = |a: f64, b: f64, within: f64| a == b || (a / b - 1.0).abs() < within;
    let is_wrong = |&pixel: &usize| {
        let truth = ray(pixel, 0.0, 0.0);
        let beside = [(-1e-3, 0.0), (1e-3, 0.0), (0.0, -1e-3), (0.0, 1e-3)];
        !same(depths[pixel].into(), truth, 1e-5) && beside.iter().all(|&(x, y)| same(ray(pixel, x, y), truth, 1e-2))
    };
    (0..depths.len()).filter(is_wrong).count()
}

/// A closed mesh shows what rays see at a thousand poses. In the controls edges belong to no
/// triangle, or lie elsewhere for one of their triangles, and cracks show.
#[test]
fn no_crack_shows_at_any_pose() {
    let Some(backend) = gpu() else { return };
    let mesh = rough();
    let (scene, surface) = (scene_of(&mesh), Surface::mesh(&mesh).unwrap());
    let of = |backend: &Backend, poses: u64| {
        let mut renderer = Renderer::new(&scene, &unlit(), backend).unwrap();
        let camera = |seed| pose(&mut Random(seed), 64);
        let wrong = |seed| cracks(&renderer.frame(&camera(seed), &()).unwrap().0, &camera(seed), &surface);
        (0..poses).map(wrong).sum::<usize>()
    };
    assert_eq!(of(&backend, 1000), 0);
    let inset =
        broken("triangles.wgsl", "return side_by(area, from_.y", "return side_by(area - 0.05 * sign(area), from_.y");
    let skewed = broken("triangles.wgsl", "(corner.x.high - p.x) + corner.x.low", "corner.x.high - p.x + 2e-2 * p.y");
    for control in [inset, skewed] {
        assert!(of(&control, 20) > 100);
    }
}

/// Pixel centres exactly on edges and corners (in f32) belong to one triangle each.
#[test]
fn what_lies_on_an_edge_belongs_to_one_triangle() {
    let Some(backend) = gpu() else { return };
    // A plane of squares, split along either diagonal, whose corners are pixel centres.
    let mut all = Vec::new();
    let corner = |i: i32, j: i32| [f64::from(i) * 4.0 - 15.5, f64::from(j) * 4.0 - 15.5, 8.0];
    for (i, j) in (0..7).flat_map(|i| (0..7).map(move |j| (i, j))) {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        let halves = if (i + j) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
        for corners in halves {
            let shade = (all.len() + 1) as f32 / 128.0;
            all.push(Triangle { corners, normals: None, colors: [[shade, shade, shade, 1.0]; 3], texture: None });
        }
    }
    let scene = Scene { triangles: Triangles::new(&all), ..Scene::default() };
    let camera = front(32);
    let shown = frame(&scene, &camera, &unlit(), &backend);
    assert_eq!(bits(&shown), bits(&frame(&scene, &camera, &unlit(), &Backend::Reference)));
    // The plane includes its left and upper edges, but not its right and lower ones.
    let covered = shown.color.iter().filter(|color| color[3] > 0.0).count();
    assert_eq!(covered, 28 * 28);
    // A triangle is half of a square of 16 pixels, and either half may own the diagonal.
    for triangle in &all {
        let of = shown.color.iter().filter(|color| color[3] > 0.0 && color[0] == triangle.colors[0][0]).count();
        assert!((6..=10).contains(&of), "{of}");
    }
    let without = broken("triangles.wgsl", "select(below, right, right != 0.0)", "0.0");
    let left = frame(&scene, &camera, &unlit(), &without).color.iter().filter(|color| color[3] > 0.0).count();
    assert!(left < 28 * 28 / 2, "{left}");
}

/// A triangle with a red, a green and a blue corner: a pixel's colour is its barycentric
/// coordinates.
fn painted(corners: [[f64; 3]; 3]) -> Triangle {
    let colors = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]];
    Triangle {
        corners: corners.map(|corner| corner.map(|x| f64::from(x as f32))),
        normals: None,
        colors,
        texture: None,
    }
}

/// Named triangles that are hard to draw; the camera is at the origin, x right, y down, z forward.
fn hard() -> Vec<(&'static str, Vec<Triangle>)> {
    let mut random = Random(11);
    let mut at = |z: [f64; 2]| [random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(z[0], z[1])];
    let mut many =
        |z: [f64; 2], count: usize| -> Vec<Triangle> { (0..count).map(|_| painted([at(z), at(z), at(z)])).collect() };
    let mut all = vec![
        ("any", many([1.0, 3.0], 60)),
        ("through the camera's plane", many([-2.0, 2.0], 30)),
        ("behind", many([-3.0, -1.0], 30)),
        ("at the near depth", many([0.009, 0.011], 30)),
    ];
    all.push(("a plane through the eye", vec![painted([[-9.0, 0.0, -9.0], [9.0, 0.0, -9.0], [0.0, 0.0, 30.0]])]));
    all.push(("a floor", vec![painted([[-900.0, 0.3, -900.0], [900.0, 0.3, -900.0], [0.0, 0.3, 3000.0]])]));
    all.push(("a million pixels", vec![painted([[-5e3, -4e3, 2.0], [7e3, -3e3, 2.5], [1e3, 8e3, 3.0]])]));
    all.push(("a million pixels long", vec![painted([[-5e3, -0.2, 2.0], [7e3, 0.1, 3.0], [7e3, 0.4, 3.0]])]));
    let slivers = |width: f64| {
        let sliver = |k: usize| {
            let (s, c) = (0.7 * k as f64).sin_cos();
            painted([[-c, -s, 1.5], [c, s, 2.5], [c - width * s, s + width * c, 2.5]])
        };
        (0..40).map(sliver).collect::<Vec<_>>()
    };
    all.push(("slivers", slivers(0.01)));
    all.push(("slivers of 1e-7 pixels", slivers(2e-9)));
    // All at one depth, and no wider than the rounding of their corners.
    let flat = |k: usize| {
        let (s, c) = (0.3 + 0.1 * k as f64).sin_cos();
        painted([[-c, -s, 2.0], [c, s, 2.0], [0.3 * c + 4e-8, 0.3 * s, 2.0]])
    };
    all.push(("slivers at one depth", (0..60).map(flat).collect()));
    all.push((
        "a corner each",
        (0..9).map(|k| painted([[0.1 * k as f64; 3], [0.1 * k as f64; 3], [1.0; 3]])).collect(),
    ));
    let small: Vec<Triangle> = many([2.0, 2.1], 1000)
        .iter()
        .map(|large| {
            let [a, b, c] = large.corners.map(|corner| Vec3::from_array(corner.map(|x| x as f32)));
            let corners = [a, a + (b - a) * 4e-3, a + (c - a) * 4e-3];
            Triangle { corners: corners.map(|corner| corner.to_array().map(f64::from)), ..*large }
        })
        .collect();
    all.push(("a part of a pixel", small));
    all
}

/// Device and twin agree at pixels that no rounding decides: barycentric coordinates (as colours)
/// to 1e-6, depths to 1e-6 of their value.
///
/// Triangles without an area or behind the camera do not show.
#[test]
fn kernels_and_twins_see_hard_triangles_alike() {
    let Some(backend) = gpu() else { return };
    let looking = |projection| {
        let lens = match projection {
            Projection::Pinhole => Lens::Fov(60.0),
            Projection::Orthographic => Lens::OrthographicHeight(2.4),
        };
        Camera::look_at((160, 120), lens, DVec3::ZERO, DVec3::Z, Some(DVec3::NEG_Y), Up::Y, 0.01).unwrap()
    };
    for projection in [Projection::Pinhole, Projection::Orthographic] {
        let camera = looking(projection);
        for (name, triangles) in hard() {
            let scene = Scene { triangles: Triangles::new(&triangles), ..Scene::default() };
            let with_decision = Settings { maps: Maps::of(&[Map::Depth, Map::Decision]), ..unlit() };
            let truth = frame(&scene, &camera, &with_decision, &Backend::Reference);
            let shown = frame(&scene, &camera, &unlit(), &backend);
            let [depth, true_depth] = [&shown, &truth].map(|frame| frame.map(Map::Depth).unwrap());
            let decided = truth.map(Map::Decision).unwrap();
            assert!(shown.color.iter().flatten().all(|value| value.is_finite()), "{projection:?} {name}");
            let mut compared = 0;
            for pixel in (0..depth.len()).filter(|pixel| decided[*pixel] > DECISION_MARGIN) {
                let [a, b] = [&shown, &truth].map(|frame| frame.color[pixel].map(f64::from));
                let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                let [z, true_z] = [depth[pixel], true_depth[pixel]].map(f64::from);
                let of_depth = if z == true_z { 0.0 } else { (z / true_z - 1.0).abs() };
                assert!(apart <= 1e-6 && of_depth <= 1e-6, "{projection:?} {name} {pixel}: {a:?} {b:?}, {z} {true_z}");
                compared += usize::from(z.is_finite());
            }
            let least = match name {
                "behind" | "a corner each" | "a plane through the eye" | "slivers of 1e-7 pixels" => 0,
                "slivers at one depth" => 0,
                "a part of a pixel" => 5,
                // In parallel projection few triangles near the camera's plane are in sight.
                _ if projection == Projection::Orthographic => 0,
                _ => 100,
            };
            assert!(compared >= least, "{projection:?} {name}: {compared}");
            assert!(name != "behind" || compared == 0);
        }
    }
}

/// A sphere of splats, cut by a plane and by a rough closed body of triangles.
fn joined() -> (Scene, Camera) {
    let mut all: Vec<Triangle> = Vec::new();
    let plane = [[-1.3, 0.2, -1.3], [1.3, 0.3, -1.3], [1.3, -0.2, 1.3], [-1.3, -0.3, 1.3]];
    all.extend([[0, 1, 2], [0, 2, 3]].map(|of| painted(of.map(|k| plane[k]))));
    let mesh = rough();
    let at = |vertex: u32| mesh.positions[vertex as usize].map(|x| 0.9 * x + 0.35);
    all.extend(mesh.triangles.iter().map(|triangle| painted(triangle.map(at))));
    let scene = Scene { triangles: Triangles::new(&all), ..sphere(3000, 2.0) };
    (scene, sphere_camera(96, Projection::Pinhole))
}

/// Kernels agree with twins for each join; another join or a broken kernel differs.
#[test]
fn kernels_and_twins_join_alike() {
    let Some(backend) = gpu() else { return };
    let (scene, camera) = joined();
    let maps = Maps::of(&[Map::Depth, Map::Normal, Map::Weight, Map::Count, Map::Transmittance]);
    let of = |join| Settings { join, maps, ..Settings::default() };
    let differ = |join, shown: &Frame| {
        let with_decision = Settings { maps: maps.and(&[Map::Decision]), ..of(join) };
        let truth = frame(&scene, &camera, &with_decision, &Backend::Reference);
        let decided = truth.map(Map::Decision).unwrap();
        let near =
            |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| a == b || (a - b).abs() <= 2e-5 * (1.0 + b.abs()));
        let alike = |pixel: usize| {
            maps.iter().all(|map| {
                let of =
                    |frame: &Frame| frame.map(map).unwrap()[pixel * map.width()..(pixel + 1) * map.width()].to_vec();
                near(&of(shown), &of(&truth))
            }) && near(&shown.color[pixel], &truth.color[pixel])
        };
        (0..decided.len()).filter(|pixel| decided[*pixel] > 1e-5 && !alike(*pixel)).count()
    };
    let joins = [Join::Corrected, Join::Nearest, Join::Blended];
    for join in joins {
        let shown = frame(&scene, &camera, &of(join), &backend);
        assert_eq!(differ(join, &shown), 0, "{join:?}");
        // Both triangles (weight 1) and splats show.
        let weights = shown.map(Map::Weight).unwrap();
        let ones = weights.iter().filter(|weight| **weight == 1.0).count();
        assert!(ones > 500 && weights.iter().filter(|weight| **weight > 0.0).count() > ones + 500);
        for other in joins.into_iter().filter(|other| *other != join) {
            assert!(differ(other, &shown) > 10, "{join:?} {other:?}");
        }
    }
    // An epsilon along the ray, which is shorter along the axis that the blend uses, and one that
    // reaches beyond the scene.
    for epsilon in [Epsilon::Ray(0.2), Epsilon::Absolute(1e3), Epsilon::Relative(0.1)] {
        let own = Settings { epsilon, ..of(Join::Blended) };
        let with_decision = Settings { maps: maps.and(&[Map::Decision]), ..own.clone() };
        let (shown, truth) =
            (frame(&scene, &camera, &own, &backend), frame(&scene, &camera, &with_decision, &Backend::Reference));
        let decided = truth.map(Map::Decision).unwrap();
        let far =
            |pixel: &usize| shown.color[*pixel].iter().zip(truth.color[*pixel]).any(|(a, b)| (a - b).abs() > 1e-4);
        let wrong = (0..decided.len()).filter(|pixel| decided[*pixel] > 1e-5).filter(far).count();
        assert_eq!(wrong, 0, "{epsilon:?}");
    }
    for (join, file, from, to) in [
        (Join::Corrected, "join_corrected.wgsl", "splats.depth < triangle", "splats.depth * 1.01 < triangle"),
        (Join::Nearest, "join_nearest.wgsl", "front < triangle", "front > triangle"),
        (Join::Blended, "join_blended.wgsl", "2.0 * epsilon", "epsilon"),
        (Join::Blended, "join.wgsl", "triangle.normal * rest + splats.normal * share", "triangle.normal"),
        (Join::Corrected, "triangles_once.wgsl", "atomicMax", "atomicMin"),
        (Join::Corrected, "triangles_attributes.wgsl", "parts[corner] *", "0.3333333 *"),
        (Join::Corrected, "triangles.wgsl", "quotient(a.area, homogeneous_depth(triangle.a))", "a.area"),
    ] {
        let shown = frame(&scene, &camera, &of(join), &broken(file, from, to));
        assert!(differ(join, &shown) > 10, "{file}");
    }
}

/// The rasteriser snaps corners to fractions of a pixel, so it differs at edges and nowhere else.
#[test]
fn the_rasteriser_draws_the_same_but_for_edges() {
    let Some(backend) = gpu() else { return };
    let Backend::Gpu { gpu, .. } = &backend else { return };
    let format = if gpu.adapter.blends_f32 { BlendFormat::Rgba32Float } else { BlendFormat::Rgba16Float };
    let (joined, camera) = joined();
    let alone = Scene { triangles: joined.triangles.clone(), ..scene_of(&rough()) };
    let parallel = sphere_camera(96, Projection::Orthographic);
    for (scene, camera) in [(&joined, &camera), (&alone, &camera), (&alone, &parallel)] {
        let computed = frame(scene, camera, &unlit(), &backend);
        let raster = Some(Raster { format, depth: RasterDepth::Exact });
        let options = Settings { raster, ..unlit() };
        let shown = frame(scene, camera, &options, &backend);
        let depths = |frame: &Frame| frame.map(Map::Depth).unwrap().to_vec();
        let (a, b) = (depths(&computed), depths(&shown));
        let off =
            |(a, b): (&f32, &f32)| a.is_finite() != b.is_finite() || (a.is_finite() && (a - b).abs() > 1e-3 * (a + b));
        let apart = a.iter().zip(&b).filter(|pair| off(*pair)).count();
        let covered = a.iter().filter(|depth| depth.is_finite()).count();
        assert!(apart * 50 < covered && covered > 2000, "{apart} of {covered}");
        // Control: another mesh differs.
        let other = frame(&scene_of(&rough()), camera, &options, &backend);
        let others = depths(&other);
        assert!(a.iter().zip(&others).filter(|pair| off(*pair)).count() * 5 > covered);
    }
    let offset = Some(Raster { format, depth: RasterDepth::Offset });
    let error = render(&joined, &camera, &Settings { raster: offset, ..unlit() }, &backend, &()).unwrap_err();
    assert!(error.to_string().contains("--raster-depth"), "{error}");
}

/// The order of triangles and surfels, bands, organisations and device features change no bit.
#[test]
fn the_same_bits_however_it_is_drawn() {
    let Some(backend) = gpu() else { return };
    let small = Backend::gpu(Gpu::with_buffer_limit(common::gpu().unwrap(), 200_000));
    let core = common::core_gpu().map(Backend::gpu).unwrap();
    let gl = common::opengl().map(Backend::gpu);
    let (scene, camera) = joined();
    let mut shuffled = common::scenes::shuffled(&scene, 5);
    let mut all: Vec<Triangle> = (0..scene.triangles.len())
        .map(|number| {
            let corners =
                scene.triangles.corners()[number].map(|vertex| scene.triangles.place(vertex as usize).to_array());
            Triangle { corners, normals: None, colors: scene.triangles.colors()[number], texture: None }
        })
        .collect();
    Random(3).shuffle(&mut all);
    shuffled.triangles = Triangles::new(&all);
    // Two triangles at each place, which differ in colour alone.
    all.extend(all.clone().iter().map(|given| Triangle { colors: [[0.5, 0.5, 0.5, 1.0]; 3], ..*given }));
    let doubled = Scene { triangles: Triangles::new(&all), ..scene.clone() };
    all.reverse();
    let other = Scene { triangles: Triangles::new(&all), ..scene.clone() };
    for join in [Join::Corrected, Join::Nearest, Join::Blended] {
        for samples in [Samples::ONE, "4".parse().unwrap()] {
            let own = Settings { join, samples, maps: Maps::of(&[Map::Depth]), ..Settings::default() };
            let first = bits(&frame(&scene, &camera, &own, &backend));
            for organisation in [Organisation::Scatter, Organisation::Tile] {
                let by = Settings { organisation, ..own.clone() };
                assert!(bits(&frame(&scene, &camera, &by, &backend)) == first, "{join:?} {organisation:?}");
            }
            for other in [&small, &core] {
                assert!(bits(&frame(&scene, &camera, &own, other)) == first, "{join:?}");
            }
            assert!(bits(&frame(&shuffled, &camera, &own, &backend)) == first, "{join:?}");
            assert!(bits(&frame(&doubled, &camera, &own, &backend)) == bits(&frame(&other, &camera, &own, &core)));
        }
    }
    // OpenGL's own compiler rounds differently.
    if let Some(gl) = gl {
        let plain = Settings { maps: Maps::of(&[Map::Depth]), ..Settings::default() };
        let shown = frame(&scene, &camera, &plain, &gl);
        let rmse =
            epsplat::low_level::metrics::compare(&shown, &frame(&scene, &camera, &plain, &backend)).unwrap().rmse;
        assert!(rmse < 1e-6, "{rmse}");
    }
}

/// Kernels paint textures as their twins do, near and far; broken lookups differ. Far away a
/// checkerboard is grey, without a pattern.
#[test]
fn kernels_and_twins_paint_alike() {
    let Some(backend) = gpu() else { return };
    let checker =
        (0..64 * 48).map(|k| if (k % 64 + k / 64) % 2 == 0 { [255, 240, 20, 255] } else { [0, 10, 200, 255] });
    let texture = Arc::new(Texture::new(64, 48, checker.collect()).unwrap());
    let other = Arc::new(Texture::new(1, 1, vec![[255, 0, 0, 128]]).unwrap());
    let corners = [[-9.0, 0.4, 0.2], [9.0, 0.5, 0.2], [0.0, 0.3, 60.0]];
    let painted = |corners, texture| Triangle { corners, normals: None, colors: [[1.0; 4]; 3], texture };
    let places = [[-2.0, 0.0], [2.0, 0.0], [0.5, 7.0]];
    let all = [
        painted(corners, Some((0, places))),
        painted([[-1.0, -0.8, 2.0], [0.1, -0.9, 2.5], [-0.2, 0.0, 2.2]], Some((1, places))),
        painted([[0.0, -0.8, 2.0], [1.1, -0.9, 2.5], [0.8, 0.0, 2.2]], None),
        // The near depth cuts this one.
        painted([[0.9, -0.9, -1.0], [1.0, 0.2, 3.0], [1.4, -0.5, 3.0]], Some((0, places))),
    ];
    let scene = Scene { triangles: Triangles::textured(&all, &[texture, other]), ..Scene::default() };
    let differ = |camera: &Camera, backend: &Backend| {
        let with_decision = Settings { maps: Maps::of(&[Map::Decision]), ..unlit() };
        let truth = frame(&scene, camera, &with_decision, &Backend::Reference);
        let shown = frame(&scene, camera, &unlit(), backend);
        let decided = truth.map(Map::Decision).unwrap();
        let far = |pixel: &usize| {
            let pairs = shown.color[*pixel].iter().zip(truth.color[*pixel]);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) > 2e-4
        };
        let wrong = (0..decided.len()).filter(|pixel| decided[*pixel] > DECISION_MARGIN).filter(far).count();
        (wrong, shown)
    };
    let wrong = [
        broken("textures.wgsl", "0.5 * log2(max(texels, 1.0))", "0.6 * log2(max(texels, 1.0))"),
        broken("textures.wgsl", "1.0 - place.y", "place.y"),
        broken("triangles_texture.wgsl", "number == 0u", "number != 0u"),
        broken("corner_perspective.wgsl", "a * b * c / of_depth", "a * b / of_depth"),
    ];
    for (number, lens) in [Lens::Fov(60.0), Lens::OrthographicHeight(2.4)].into_iter().enumerate() {
        let camera = Camera::look_at((160, 120), lens, DVec3::ZERO, DVec3::Z, Some(DVec3::NEG_Y), Up::Y, 0.01).unwrap();
        assert_eq!(differ(&camera, &backend).0, 0, "{lens:?}");
        if number == 0 {
            for (which, wrong) in wrong.iter().enumerate() {
                assert!(differ(&camera, wrong).0 > 50, "{which}");
            }
            // At the horizon neighbouring pixels differ far less than the checkerboard's two
            // colours.
            let shown = differ(&camera, &backend).1;
            let row =
                |y: usize| shown.color[y * 160 + 70..y * 160 + 90].iter().map(|color| color[0]).collect::<Vec<_>>();
            let spread =
                |row: Vec<f32>| row.iter().copied().fold(0.0, f32::max) - row.iter().copied().fold(1.0, f32::min);
            let horizon = (0..120).find(|y| row(*y).iter().all(|red| *red > 0.0)).unwrap();
            assert!(spread(row(horizon + 1)) < 0.2, "{}", spread(row(horizon + 1)));
        }
    }
}

/// The default view includes triangles whose few corners lie far outside a dense sphere of surfels.
#[test]
fn a_floor_of_four_corners_is_framed() {
    let corner = |x: f64, z: f64| [x, -1.0, z];
    let [a, b, c, d] = [corner(-3.0, -3.0), corner(-3.0, 3.0), corner(3.0, 3.0), corner(3.0, -3.0)];
    let of = |corners| Triangle { corners, normals: None, colors: [[1.0; 4]; 3], texture: None };
    let scene = Scene { triangles: Triangles::new(&[of([a, b, c]), of([a, c, d])]), ..sphere(20_000, 1.0) };
    let (framed, strays) = scene.framed();
    assert_eq!((framed.min.x, framed.max.z, strays), (-3.0, 3.0, 0));
    let alone = Scene { triangles: Triangles::default(), ..scene };
    assert!(alone.framed().0.max.x <= 1.0);
}
