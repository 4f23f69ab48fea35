//! Cuts of levels of detail on a device equal the twin's cut bit by bit, however the tree is split
//! into buffers.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::evaluated::{evaluated, file};
use common::levels::{cut, frame, levels, tree};
use common::scenes::{shuffled, sphere, sphere_camera};
use common::{Random, bits};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::plan::{Optimisation, Raster, RasterDepth, Settings};
use epsplat::low_level::render::{Backend, Renderer, render};
use epsplat::low_level::scene::{
    Camera, Cap, Clip, Colors, Composite, Cull, Detail, DetailMeasure, Epsilon, Lens, Map, Maps, Projection, Samples,
    Scene, Surfel, Up,
};
use glam::{DVec3, Vec3};

/// An adapter with buffers of 70,000 bytes (about 1,900 surfels), so that a tree is split into
/// several branches.
fn small() -> Gpu {
    common::gpu().unwrap().with_buffer_limit(70_000)
}

const MAPS: Maps = Maps::of(&[Map::Depth, Map::Normal, Map::Weight, Map::Count]);

fn at(pixels: f64) -> Settings {
    Settings { detail: Detail::Pixels(pixels), cull: Cull::None, maps: MAPS, ..Settings::default() }
}

/// The same options with fading cuts.
fn fading(options: &Settings) -> Settings {
    Settings { detail_fades: true, ..options.clone() }
}

/// Spheres with every kind of surfel attribute, and one with a distant part.
fn all() -> Vec<(&'static str, Scene)> {
    let plain = sphere(6000, 1.7);
    let number = |k: usize, step: usize| (k * step % 97) as f32 / 97.0;
    let count = plain.surfels.len();
    let linear = Colors::Linear((0..count).map(|k| [number(k, 5), 3.0 * number(k, 7), 0.5, 1.0]).collect());
    let clipped =
        (0..count).map(|k| if k % 3 == 0 { Clip([[0.0; 3], [1.0, 0.2, 0.1 * number(k, 3)]]) } else { Clip::NONE });
    let normals = plain.surfels.iter().map(|s| (s.normal().normalize() + 0.1).normalize().to_array()).collect();
    let mut far = plain.clone();
    far.low = vec![[0.0; 3]; count];
    for index in 0..40 {
        far.surfels[index].center[0] += 3e6;
    }
    let unsided = Scene { oriented: false, colors: linear, ..plain.clone() };
    vec![
        ("plain", plain.clone()),
        (
            "one colour, rough",
            common::scenes::roughened(Scene { colors: Colors::Constant([0.3, 0.5, 0.9, 1.0]), ..plain.clone() }),
        ),
        ("linear, without sides", unsided),
        ("clipped, normals", Scene { clips: clipped.collect(), normals, ..plain.clone() }),
        ("doubled", far),
    ]
}

/// The frame of a cut that the device selects equals that of the twin's cut, bit by bit.
#[test]
fn a_device_makes_the_cut_of_its_twin() {
    let Some(gpu) = common::gpu() else { return };
    let own = [("gpu", gpu), ("branches", small())];
    let others = [("core", common::core_gpu().unwrap())].into_iter().chain(common::opengl().map(|gpu| ("opengl", gpu)));
    let backends: Vec<_> = own.into_iter().chain(others).map(|(name, gpu)| (name, Backend::gpu(gpu))).collect();
    for (name, scene) in all() {
        let scene = levels(scene);
        let options = [
            (Projection::Pinhole, at(250.0)),
            (Projection::Pinhole, Settings { detail_measure: DetailMeasure::Area, ..at(100.0) }),
            (Projection::Orthographic, at(400.0)),
            (
                Projection::Pinhole,
                Settings {
                    detail: Detail::Share(0.02),
                    detail_measure: DetailMeasure::Square,
                    maps: Maps::NONE,
                    samples: Samples { across: 2, down: 1 },
                    ..at(0.0)
                },
            ),
        ];
        // The first scene is drawn with all options, the others only with the first.
        let (ways, adapters) = if name == "plain" { (4, 4) } else { (1, 2) };
        let options = options.into_iter().take(ways);
        let fading = options.clone().map(|(projection, options)| (projection, fading(&options)));
        for (step, (projection, options)) in options.chain(fading).enumerate() {
            let camera = sphere_camera(100, projection);
            let (twins, flat) = cut(&scene, &camera, &options);
            let (drawn, all) = (twins.scene.surfels.len(), scene.surfels.len());
            assert!(drawn > 50 && drawn < all, "{name}: {drawn} {options:?}");
            assert_eq!(twins.scene.fades.len(), if options.detail_fades { drawn } else { 0 }, "{name} {options:?}");
            // As compiling kernels takes seconds, only the first adapter draws the first scene with
            // all options; the others draw a third each.
            let draws = |on: usize| name != "plain" || on == 0 || (on + step).is_multiple_of(3);
            for (_, (on, backend)) in backends.iter().take(adapters).enumerate().filter(|(on, _)| draws(*on)) {
                let (shown, report) = render(&scene, &camera, &options, backend, &()).unwrap();
                assert_eq!(report.cut, Some(drawn as u64), "{name} {on} {options:?}");
                assert!(bits(&shown) == bits(&frame(&twins, &camera, &flat, backend)), "{name} {on} {options:?}");
            }
            let (reference, report) = render(&scene, &camera, &options, &Backend::Reference, &()).unwrap();
            assert_eq!(report.cut, Some(drawn as u64), "{name}");
            assert!(bits(&reference) == bits(&frame(&twins, &camera, &flat, &Backend::Reference)), "{name}");
        }
    }
}

/// A sphere of surfels that curve as it does.
fn curved_sphere() -> Scene {
    let flat = sphere(6000, 1.7);
    let squared = |axis: [f32; 3]| axis.iter().map(|c| c * c).sum::<f32>();
    let caps = flat.surfels.iter().map(|surfel| Cap([-squared(surfel.s), 0.0, -squared(surfel.t)])).collect();
    Scene { caps, ..flat }
}

/// Nodes that face away are culled by their normal cones, and surfels that face away by their own
/// normals, from outside, from inside and off-centre.
#[test]
fn a_device_leaves_out_what_its_twin_does() {
    let Some(gpu) = common::gpu() else { return };
    let backends = [Backend::gpu(gpu), Backend::gpu(small())];
    let scenes = [levels(sphere(6000, 1.7)), levels(curved_sphere())];
    let look = |eye: [f64; 3], target: [f64; 3], lens| {
        Camera::look_at((100, 80), lens, eye.into(), target.into(), None, Up::Y, 0.05).unwrap()
    };
    let views = [
        look([1.2, 0.7, 2.4], [0.0; 3], Lens::Fov(45.0)),
        look([0.3, 0.1, 0.2], [0.9, 0.0, 0.0], Lens::Fov(60.0)),
        look([0.0, 0.2, 1.1], [0.5, 0.0, 0.0], Lens::Fov(70.0)),
        look([0.0, 1.0, 3.0], [0.7, 0.5, 0.0], Lens::OrthographicHeight(1.0)),
    ];
    let mut left_out = [0; 3];
    for (camera, scene) in views.iter().flat_map(|view| scenes.iter().map(move |scene| (view, scene))) {
        for detail in [Detail::Pixels(1e-6), Detail::Pixels(300.0)] {
            for (way, cull) in [Cull::Back, Cull::Cones, Cull::None].into_iter().enumerate() {
                let options = Settings { detail, cull, ..at(0.0) };
                let (twins, flat) = cut(scene, camera, &options);
                left_out[way] += 6000 - twins.scene.surfels.len().min(6000);
                for backend in &backends {
                    let (shown, report) = render(scene, camera, &options, backend, &()).unwrap();
                    assert_eq!(report.cut, Some(twins.scene.surfels.len() as u64), "{camera:?} {options:?}");
                    let alike = || bits(&shown) == bits(&frame(&twins, camera, &flat, backend));
                    assert!(twins.scene.surfels.is_empty() || alike(), "{camera:?} {options:?}");
                }
            }
        }
    }
    // Cones leave out most of what faces away, and single surfels the rest.
    let [backs, cones, none] = left_out;
    assert!(backs > cones + 300 && cones > none + 3000, "{left_out:?}");
}

/// Cuts are composited in all modes and drawn by the rasteriser. Ties in fragment lists follow the
/// order of the cut.
#[test]
fn cuts_are_composited_and_rasterised() {
    let Some(gpu) = common::gpu() else { return };
    let (own, small) = (Backend::gpu(gpu), Backend::gpu(small()));
    let scene = levels(sphere(4000, 1.7));
    let camera = sphere_camera(64, Projection::Pinhole);
    for composite in [Composite::Layers(2), Composite::Sorted, Composite::Weighted, Composite::Moments] {
        let options = Settings { composite, opacity: 0.5, maps: Maps::NONE, ..at(100.0) };
        let expected = bits(&frame(&scene, &camera, &options, &own));
        assert!(expected == bits(&frame(&scene, &camera, &options, &small)), "{composite:?}");
        let (twins, flat) = cut(&scene, &camera, &options);
        // A scene that consists of the cut has another order of ties and another least depth, so
        // only the frame of `layers` equals it bit by bit.
        let alike = || expected == bits(&frame(&twins, &camera, &flat, &own));
        assert!(!matches!(composite, Composite::Layers(_)) || alike(), "{composite:?}");
        let reference = frame(&scene, &camera, &options, &Backend::Reference);
        let wrong = differ(&frame(&scene, &camera, &options, &own), &reference);
        // Device and reference may sort fragments of almost equal depth differently. `alone` counts
        // such pixels for a scene that consists of the cut.
        let alone = differ(&frame(&twins, &camera, &flat, &own), &frame(&twins, &camera, &flat, &Backend::Reference));
        assert!(wrong < 5 + alone && alone < 10, "{composite:?}: {wrong} {alone}");
    }
    let raster = Settings { raster: Some(Default::default()), maps: Maps::of(&[Map::Depth]), ..at(100.0) };
    // The rasteriser draws flat disks.
    let disks = Settings { raster: None, detail_caps: false, ..raster.clone() };
    let reference = frame(&scene, &camera, &disks, &Backend::Reference);
    assert!(differ(&frame(&scene, &camera, &raster, &own), &reference) < 5);
    // With depths offset by each surfel's radius, the rasteriser draws the cut like a scene that
    // consists of the cut.
    let moved = Raster { depth: RasterDepth::Offset, ..Raster::default() };
    let moved = Settings { raster: Some(moved), epsilon: Epsilon::Radius(1.0), ..at(100.0) };
    let (twins, flat) = cut(&scene, &camera, &moved);
    let alone = frame(&twins, &camera, &flat, &own);
    let by_slots = Sources::default().replace("raster_offset.wgsl", "surfel_of(index)", "index").unwrap();
    let by_slots = Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources: by_slots };
    let [right, wrong] = [&own, &by_slots].map(|backend| differ(&frame(&scene, &camera, &moved, backend), &alone));
    assert!(right < 5 && wrong > 10, "{right} {wrong}");
}

/// The number of pixels whose colours differ by 0.01 or more.
fn differ(shown: &Frame, truth: &Frame) -> usize {
    let near = |(a, b): (&[f32; 4], &[f32; 4])| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.01);
    shown.color.iter().zip(&truth.color).filter(|pair| !near(*pair)).count()
}

/// A cut gives the same bits for any order of the surfels, any number of threads, and any sequence
/// of views, whether or not buffers must grow.
#[test]
fn a_cut_depends_on_tree_and_camera_alone() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let (flat, camera) = (sphere(6000, 1.7), sphere_camera(100, Projection::Pinhole));
    let options = at(250.0);
    let scene = levels(flat.clone());
    let expected = bits(&frame(&scene, &camera, &options, &backend));
    assert!(expected == bits(&frame(&levels(shuffled(&flat, 3)), &camera, &options, &backend)));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(expected == one.install(|| bits(&frame(&levels(flat.clone()), &camera, &options, &backend))));
    // Far views draw little; near ones need more than the buffers hold; then the buffers are too
    // large.
    let view = |distance: f64| {
        let eye = DVec3::new(1.2, 0.7, 2.4) * distance;
        Camera::look_at((100, 100), Lens::Fov(45.0), eye, DVec3::ZERO, None, Up::Y, 1e-5).unwrap()
    };
    for backend in [&backend, &Backend::gpu(small())] {
        let mut renderer = Renderer::new(&scene, &options, backend).unwrap();
        for distance in [9.0, 1.0, 40.0, 0.8, 2000.0, 1.0] {
            let (shown, report) = renderer.frame(&view(distance), &()).unwrap();
            let (twins, flat) = cut(&scene, &view(distance), &options);
            assert_eq!(report.cut, Some(twins.scene.surfels.len() as u64), "{distance}");
            assert!(bits(&shown) == bits(&frame(&twins, &view(distance), &flat, backend)), "{distance}");
        }
    }
}

/// Draws a leaf that has more surfels than one invocation copies or one buffer holds.
#[test]
fn crowded_leaves_are_drawn_whole() {
    let Some(gpu) = common::gpu() else { return };
    let mut scene = sphere(2000, 1.7);
    let (surfel, color) = (scene.surfels[77], [200, 10, 10, 255]);
    scene.surfels.extend([surfel; 40_000]);
    if let Colors::Srgb8(codes) = &mut scene.colors {
        codes.extend([color; 40_000]);
    }
    let scene = levels(scene);
    assert!(tree(&scene).nodes.iter().any(|node| node.leaf && node.count > 40_000));
    let camera = sphere_camera(90, Projection::Pinhole);
    // Otherwise the copies would be drawn as one surfel.
    let options = Settings { without: vec![Optimisation::Copies], ..at(1e-6) };
    let (twins, flat) = cut(&scene, &camera, &options);
    assert_eq!(twins.scene.surfels.len(), 42_000);
    for backend in [Backend::gpu(gpu), Backend::gpu(common::gpu().unwrap().with_buffer_limit(200_000))] {
        let (shown, report) = render(&scene, &camera, &options, &backend, &()).unwrap();
        assert_eq!(report.cut, Some(42_000));
        assert!(bits(&shown) == bits(&frame(&twins, &camera, &flat, &backend)));
        // Some of the fading cuts divide the leaf and others do not.
        let both =
            (7..12).map(|k| fading(&Settings { detail: Detail::Pixels(f64::from(k).exp2()), ..options.clone() }));
        for options in both {
            let (twins, flat) = cut(&scene, &camera, &options);
            let (shown, report) = render(&scene, &camera, &options, &backend, &()).unwrap();
            assert_eq!(report.cut, Some(twins.scene.surfels.len() as u64), "{options:?}");
            assert!(bits(&shown) == bits(&frame(&twins, &camera, &flat, &backend)), "{options:?}");
        }
        let coarse = Settings { detail: Detail::Pixels(1e7), ..options.clone() };
        let few = cut(&scene, &camera, &coarse).0.scene.surfels.len() as u64;
        assert_eq!(render(&scene, &camera, &coarse, &backend, &()).unwrap().1.cut, Some(few));
        // With nodes as large as the sphere, the leaf is drawn as one node.
        assert!(few < 100, "{few}");
    }
}

/// Draws several leaves of 33,000 coincident surfels each, at different depths of the tree. A loop
/// over them in one invocation would exceed llvmpipe's iteration limit.
#[test]
fn crowds_at_several_depths_are_drawn_whole() {
    const COPIES: usize = 33_000;
    let Some(gpu) = common::gpu() else { return };
    // The tree splits nodes at the mean position, so the farthest crowd is separated first.
    let crowd = |k: i32| vec![Surfel::disk(Vec3::X * 2f32.powi(-2 * k), Vec3::Z, 0.05); COPIES];
    let surfels: Vec<Surfel> = (0..4).flat_map(crowd).collect();
    let colors = Colors::Srgb8((0..surfels.len()).map(|k| [(k / COPIES * 60) as u8, 90, 20, 255]).collect());
    let scene = levels(Scene { surfels, colors, ..Scene::default() });
    let (lens, eye) = (Lens::OrthographicHeight(2.2), DVec3::new(0.4, 0.0, 3.0));
    let camera = Camera::look_at((60, 60), lens, eye, DVec3::X * 0.4, None, Up::Y, 1e-3).unwrap();
    let options = Settings { without: vec![Optimisation::Copies], ..at(1e-6) };
    let (twins, flat) = cut(&scene, &camera, &options);
    let backend = Backend::gpu(gpu);
    let (shown, report) = render(&scene, &camera, &options, &backend, &()).unwrap();
    assert_eq!(report.cut, Some(4 * COPIES as u64));
    assert!(bits(&shown) == bits(&frame(&twins, &camera, &flat, &backend)));
}

/// Unusual views have the cut of the twin: the camera plane crosses the scene, pixels have several
/// samples, the camera is far from the origin, or the number of splats is fixed.
#[test]
fn odd_views_have_the_cut_of_the_twin() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let plain = sphere(6000, 1.7);
    let mut far = plain.clone();
    far.low = vec![[0.0; 3]; 6000];
    // Two spheres; the visible one is so far away that f32 cannot hold its coordinates.
    for (index, surfel) in far.surfels.iter_mut().enumerate().skip(3000) {
        let x = f64::from(surfel.center[0]) + 3e7;
        surfel.center[0] = x as f32;
        far.low[index][0] = (x - f64::from(surfel.center[0])) as f32;
    }
    let scenes = [levels(plain), levels(far)];
    let look = |eye: [f64; 3], target: [f64; 3], lens| {
        Camera::look_at((120, 80), lens, eye.into(), target.into(), None, Up::Y, 1e-3).unwrap()
    };
    let within = look([0.3, 0.1, 0.2], [0.9, 0.0, 0.0], Lens::Fov(30.0));
    let beside = look([1.2, 0.7, 2.4], [0.6, 0.3, 0.0], Lens::Fov(20.0));
    let there = look([3e7 + 1.2, 0.7, 2.4], [3e7, 0.0, -0.5], Lens::Fov(50.0));
    let flat = look([0.4, 0.1, 0.3], [0.9, 0.0, 0.1], Lens::OrthographicHeight(0.5));
    let samples = Samples { across: 2, down: 4 };
    // A plain run takes every other combination.
    let mut taken = 0;
    for (scene, camera, most) in [(0, &within, 600), (0, &beside, 3000), (1, &there, 3500), (0, &flat, 600)] {
        let scene = &scenes[scene];
        for cull in [Cull::None, Cull::Back] {
            for detail in [Detail::Pixels(1e-6), Detail::Pixels(500.0), Detail::Splats(200)] {
                taken += 1;
                if !common::takes(taken, 2) {
                    continue;
                }
                let options = Settings { detail, cull, samples, maps: Maps::NONE, ..at(0.0) };
                let (shown, report) = render(scene, camera, &options, &backend, &()).unwrap();
                let (reference, of_twin) = render(scene, camera, &options, &Backend::Reference, &()).unwrap();
                assert_eq!(report.cut, of_twin.cut, "{camera:?} {options:?}");
                let drawn = report.cut.unwrap();
                // From inside a sphere all surfels face away.
                let least = if cull == Cull::None { 50 } else { 0 };
                assert!(drawn < most, "{drawn} {options:?}");
                assert!(detail != Detail::Splats(200) || (least..=200).contains(&drawn), "{drawn} {options:?}");
                assert!(differ(&shown, &reference) < 3, "{camera:?} {options:?}");
                // Culled surfels do not change the picture.
                let whole = Settings { detail: Detail::FINEST, ..options.clone() };
                let all = frame(scene, camera, &whole, &backend);
                assert!(detail != Detail::Pixels(1e-6) || differ(&shown, &all) == 0, "{camera:?} {cull:?}");
            }
        }
    }
}

/// Batches of a cut that are hidden are left out, and no bit changes.
#[test]
fn hidden_batches_of_a_cut_do_not_show() {
    if common::gpu().is_none() {
        return;
    }
    let scene = levels(sphere(20_000, 1.7));
    let camera = sphere_camera(50, Projection::Pinhole);
    let balls = ("balls_cut.wgsl", "vec4<f32>(0.5 * (low + high)");
    let misplaced = Sources::default().replace(balls.0, balls.1, "vec4<f32>(-3.0 * (low + high)").unwrap();
    let gpus: [fn() -> Gpu; 2] = [|| common::gpu().unwrap(), small];
    for (gpu, options) in gpus.iter().flat_map(|gpu| [at(1e-6), at(1.5), fading(&at(1.5))].map(|own| (gpu, own))) {
        let every = Settings { without: vec![Optimisation::Culling], ..options.clone() };
        let [(culled, few), (whole, all)] =
            [&options, &every].map(|own| render(&scene, &camera, own, &Backend::gpu(gpu()), &()).unwrap());
        assert!(few.needs.contains(&"cull") && !all.needs.contains(&"cull"), "{:?}", few.needs);
        assert_eq!(few.cut, all.cut);
        // In several bands a splat counts in each.
        assert!(few.splats_drawn < all.splats_drawn || gpu().adapter.page_len(4) < 100_000, "{few:?} {all:?}");
        assert!(bits(&culled) == bits(&whole), "{options:?}");
        // The control: balls that lie behind the sphere are taken for hidden.
        let backend = Backend::Gpu { gpu: Box::new(gpu()), sources: misplaced.clone() };
        let (wrong, _) = render(&scene, &camera, &options, &backend, &()).unwrap();
        assert!(bits(&wrong) != bits(&whole), "{options:?}");
    }
}

/// The control: each way to break a kernel of the selection is noticed.
#[test]
fn broken_kernels_are_noticed() {
    let Some(gpu) = common::gpu() else { return };
    let scene = levels(sphere(6000, 1.7));
    let camera = sphere_camera(50, Projection::Pinhole);
    // The second case runs on the small adapter and has several branches and pages.
    let ways = [Settings { cull: Cull::None, ..at(60.0) }, Settings { cull: Cull::Back, ..at(1e-6) }];
    let whole = [Backend::gpu(gpu), Backend::gpu(small())];
    let right = [0, 1].map(|way| {
        let (shown, report) = render(&scene, &camera, &ways[way], &whole[way], &()).unwrap();
        (bits(&shown), report.cut)
    });
    for (file, from, to) in [
        ("select_fades_absent.wgsl", "size < held.levels.x", "size < 1.2 * held.levels.x"),
        ("judge.wgsl", "if (away.x > away.y) {", "if (away.x > away.y - 0.5) {"),
        (
            "judge.wgsl",
            "seen_disk(center.z, node.radius * held.unit);",
            "seen_disk(center.z, 1.01 * node.radius * held.unit);",
        ),
        ("judge.wgsl", "> SINE_SLACK * (norm3(s)", "> -0.2 * (norm3(s)"),
        (
            "judge.wgsl",
            "lean_of_surfel(record, ray, s, t, norm3(relative));",
            "vec2<f32>(-0.2 * norm3(s) * norm3(t), 0.0);",
        ),
        ("judge.wgsl", "if (shows_back(node.first + k)) {", "if (true) {"),
        ("select.wgsl", " - countOneBits(backs_of(fate));", ";"),
        ("select.wgsl", "return before;", "return before + counts;"),
        ("select.wgsl", "vec2<u32>(here, end);", "vec2<u32>(0u, end);"),
        ("select.wgsl", "reached[node.first] = cuts;", "reached[node.first] = 0u;"),
        ("select.wgsl", "return drawn_at(place) < attributes", "return drawn_at(place) + 99u < attributes"),
        ("select.wgsl", "return page.first + select(run", "return select(run"),
        ("select.wgsl", "return page.surfels;", "return page.surfels - 1u;"),
        ("select.wgsl", "[runs_start() + run] = before;", "[runs_start() + run] = vec2<u32>(0u);"),
        ("select.wgsl", "counts += left_by", "counts = left_by"),
        ("judge.wgsl", "cuts_that_divide(seen_disk(nearest, radius)) == 0u", "true"),
        ("select.wgsl", "node.first + select(0u, branch.surfels, kind_of(node) == INNER);", "node.first;"),
    ] {
        let sources = Sources::default().replace(file, from, to).unwrap();
        let noticed =
            [common::gpu().unwrap(), small()].into_iter().zip(&ways).zip(&right).any(|((gpu, way), right)| {
                let backend = Backend::Gpu { gpu: Box::new(gpu), sources: sources.clone() };
                let broken = render(&scene, &camera, way, &backend, &());
                broken.is_ok_and(|(shown, report)| (bits(&shown), report.cut) != *right)
            });
        assert!(noticed, "{file}: {to}");
    }
}

/// Tests levels of so many nodes that each invocation sums several counts. One workgroup handles
/// the first, small levels.
#[test]
fn large_levels_are_summed() {
    let Some(gpu) = common::gpu() else { return };
    let scene = levels(sphere(400_000, 1.7));
    let camera = sphere_camera(90, Projection::Pinhole);
    // With the area measure every node is tested.
    let options = Settings { detail_measure: DetailMeasure::Area, maps: Maps::NONE, ..at(1e-3) };
    let (twins, _) = cut(&scene, &camera, &options);
    let right = Some(twins.scene.surfels.len() as u64);
    let of = |backend: &Backend| {
        let (shown, report) = render(&scene, &camera, &options, backend, &()).unwrap();
        (bits(&shown), report.cut)
    };
    let whole = of(&Backend::gpu(gpu.clone()));
    assert_eq!(whole.1, right);
    // Branches have smaller levels, but some still exceed what one workgroup handles.
    let branches = Backend::gpu(gpu.clone().with_buffer_limit(2_000_000));
    assert!(of(&branches) == whole);
    // With fading, not every cut reaches every node.
    let fading = fading(&at(4.0));
    let right = Some(cut(&scene, &camera, &fading).0.scene.surfels.len() as u64);
    let [one, other] = [Backend::gpu(gpu.clone()), branches].map(|backend| {
        let (shown, report) = render(&scene, &camera, &fading, &backend, &()).unwrap();
        assert_eq!(report.cut, right);
        bits(&shown)
    });
    assert!(one == other);
    for (from, to) in [
        ("start += counts;", "start = counts;"),
        ("start += eights[k];", "start = eights[k];"),
        ("level < branch.small_levels", "level < 1u"),
        ("local * each; group < stop; group++) {\n        own", "0u; group < stop; group++) {\n        own"),
    ] {
        let sources = Sources::default().replace("select.wgsl", from, to).unwrap();
        assert!(of(&Backend::Gpu { gpu: Box::new(gpu.clone()), sources }) != whole, "{to}");
    }
}

/// A node's children may be drawn together, without a test of each: these are exactly the children
/// that would pass the test, wherever nodes lie in the image and relative to the camera. Each
/// condition of this shortcut is necessary.
#[test]
fn children_are_drawn_together_where_each_would_be() {
    const TOGETHER: &str = "MEASURES_EXTENT && !CULL_CONES && draws_children(node, ball)";
    const WITHIN: &str = "let within = !is_beside(ball.center, -ball.radius, 0.0);";
    let Some(gpu) = common::gpu() else { return };
    let backend = |from: &str, to: &str| {
        let sources = Sources::default().replace("judge.wgsl", from, to).unwrap();
        Backend::Gpu { gpu: Box::new(gpu.clone()), sources }
    };
    let (together, alone) = (Backend::gpu(gpu.clone()), backend(TOGETHER, "false"));
    let broken = [backend(WITHIN, "let within = true;"), backend("past && within", "within")];
    let mut noticed = [false; 2];
    let some = |name: &str| name == "clipped, normals" || name == "doubled";
    for scene in all().into_iter().filter_map(|(name, scene)| some(name).then_some(scene)) {
        let scene = levels(scene);
        for (eye, lens, near) in [
            (DVec3::new(0.3, 0.8, 3.0), Lens::Fov(50.0), 2.4),
            (DVec3::new(0.3, 0.2, 1.2), Lens::Fov(120.0), 1e-3),
            (DVec3::new(0.1, 0.0, 0.3), Lens::Fov(150.0), 1e-3),
            (DVec3::new(0.3, 0.8, 3.0), Lens::OrthographicHeight(1.2), 1e-3),
        ] {
            let camera = Camera::look_at((200, 140), lens, eye, DVec3::ZERO, None, Up::Y, near).unwrap();
            for options in [at(900.0), at(200.0), fading(&at(1800.0))] {
                let of = |backend: &Backend| {
                    let (shown, report) = render(&scene, &camera, &options, backend, &()).unwrap();
                    (bits(&shown), report.cut)
                };
                let right = of(&alone);
                assert!(of(&together) == right, "{eye}, {options:?}");
                let unnoticed = noticed.iter_mut().zip(&broken).filter(|(noticed, _)| !**noticed);
                unnoticed.for_each(|(noticed, broken)| *noticed = of(broken) != right);
            }
        }
    }
    assert_eq!(noticed, [true; 2]);
}

/// Runs the function `drawn_at` of `text`, a version of select.wgsl, for each (runs, stride, place,
/// first).
fn dealt(gpu: &Gpu, text: &str, inputs: &[[u32; 4]]) -> Vec<u32> {
    let start = text.find("fn drawn_at").unwrap();
    let function = text[start..].split_inclusive("\n}\n").next().unwrap().replace("page.", "own.");
    let parts = ["const RUN: u32 = 512u; var<private> own: Page;", &function];
    let statements = "own = Page(x.w, 0u, x.x, x.y, 0u, 0u, 0u, 0u); outputs[index] = drawn_at(x.z);";
    evaluated(gpu, ["vec4<u32>", "u32"], &parts, statements, (inputs, inputs.len()))
}

/// Remainders computed in f32 and corrected equal integer remainders, up to the largest number of
/// runs of a page.
#[test]
fn places_are_dealt_out_exactly() {
    let Some(gpu) = common::gpu() else { return };
    let mut random = Random(5);
    let inputs: Vec<[u32; 4]> = (0..200_000u32)
        .map(|k| {
            let mut below = |most: u64| (random.bits() % most.max(1)) as u32;
            let runs = if k % 3 == 0 { 65_535 - below(9) } else { below(1 << (1 + k % 16)) };
            let stride = if k % 2 == 0 { below(runs.into()) } else { (f64::from(runs) * 0.618_033_988_75) as u32 };
            // Includes places in the incomplete last run.
            [runs, stride, 512 * below(u64::from(runs) + 1) + below(512), below(1000)]
        })
        .collect();
    let text = file("select.wgsl");
    let expected = |[runs, stride, place, first]: [u32; 4]| {
        let run = u64::from(place / 512);
        let whole = run < u64::from(runs);
        let turn = if whole { run * u64::from(stride) % u64::from(runs) } else { run };
        first + turn as u32 * 512 + place % 512
    };
    let wrong = |text: &str| {
        let all = dealt(&gpu, text, &inputs);
        all.iter().zip(&inputs).filter(|(found, input)| **found != expected(**input)).count()
    };
    assert_eq!(wrong(text), 0);
    for correction in ["select(0, i32(runs), rest < 0)", "select(0, i32(runs), rest >= i32(runs))"] {
        assert!(text.contains(correction) && wrong(&text.replace(correction, "0")) > 0, "{correction}");
    }
}
