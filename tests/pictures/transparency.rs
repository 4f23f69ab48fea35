//! Translucent surfaces: closed forms, the f64 twins, and changes that must not alter a bit.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use common::scenes::{cases, crowded, front, shuffled, sphere, sphere_camera, stack};
use epsplat::io;
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::metrics::{DECISION_MARGIN, compare};
use epsplat::low_level::passes::layers::{Parting, part};
use epsplat::low_level::passes::{Strip, fragments, project};
use epsplat::low_level::plan::{BlendFormat, Facts, Organisation, Raster, RasterDepth, Settings};
use epsplat::low_level::render::{Backend, Renderer, Report, render};
use epsplat::low_level::scene::composite::ALL_LAYERS;
use epsplat::low_level::scene::{
    Camera, Colors, Composite, Epsilon, Kernel, Lens, Map, Maps, Projection, Samples, Scene, Shading, Surfel, Tail,
};
use epsplat::low_level::surfels::build;
use glam::Vec3;

/// The maps that every composite supports.
const BOTH_MAPS: Maps = Maps::of(&[Map::Transmittance, Map::Layers]);

const ALL: Composite = Composite::Layers(ALL_LAYERS);

fn gpu() -> Option<Backend> {
    common::gpu().map(Backend::gpu)
}

fn options(composite: Composite) -> Settings {
    Settings { composite, epsilon: Epsilon::Relative(0.02), ..Settings::default() }
}

fn unlit(composite: Composite, opacity: f32) -> Settings {
    Settings { opacity, shading: Shading::Unlit, maps: BOTH_MAPS, ..options(composite) }
}

fn frame(scene: &Scene, camera: &Camera, options: &Settings, backend: &Backend) -> Frame {
    render(scene, camera, options, backend, &()).unwrap().0
}

/// All bits of a frame, with those of the maps of all surfaces.
fn all_bits(frame: &Frame) -> Vec<u32> {
    let of = |map| frame.map(map).into_iter().flatten().map(|value| value.to_bits());
    bits(frame).into_iter().chain(of(Map::Transmittance)).chain(of(Map::Layers)).collect()
}

/// Which pixels are decided: in the reference, no fragment lies within rounding of a decision.
fn decided(scene: &Scene, camera: &Camera, options: &Settings) -> Vec<bool> {
    let options = Settings { maps: Maps::of(&[Map::Decision]), ..options.clone() };
    let reference = frame(scene, camera, &options, &Backend::Reference);
    reference.map(Map::Decision).unwrap().iter().map(|margin| *margin > DECISION_MARGIN).collect()
}

/// Concentric spheres of `surfels` surfels each, with radii from 1 down in steps of 0.06.
fn shells(count: usize, surfels: usize) -> Scene {
    let one = sphere(surfels, 1.5);
    let scaled = |shell: usize| {
        let scale = 1.0 - 0.06 * shell as f32;
        let by = move |v: [f32; 3]| v.map(|x| x * scale);
        one.surfels.iter().map(move |surfel| Surfel { center: by(surfel.center), s: by(surfel.s), t: by(surfel.t) })
    };
    let surfels = (0..count).flat_map(scaled).collect();
    Scene { surfels, colors: Colors::Constant([0.2, 0.5, 0.8, 1.0]), ..one }
}

/// The background shows through k shells of opacity a as (1 - a)^2k, however they are sampled.
#[test]
fn shells_let_through_what_their_alphas_say() {
    let Some(backend) = gpu() else { return };
    for crossings in [2, 4, 10, 20] {
        let scene = shells(crossings / 2, 6000);
        let camera = sphere_camera(64, Projection::Pinhole);
        let of = Settings { background: [1.0; 4], ..unlit(Composite::Layers(crossings as u32), 0.3) };
        let of = Settings { tail: Tail::None, epsilon: Epsilon::Absolute(0.02), ..of };
        let expected = 0.7f64.powi(crossings as i32);
        let through = frame(&scene, &camera, &of, &backend);
        let (decided, layers) = (decided(&scene, &camera, &of), through.map(Map::Layers).unwrap());
        let mut whole = 0;
        for (pixel, transmittance) in through.map(Map::Transmittance).unwrap().iter().enumerate() {
            if decided[pixel] && layers[pixel] as usize == crossings {
                whole += 1;
                assert!((f64::from(*transmittance) - expected).abs() < 1e-5, "{crossings}: {transmittance}");
                // The shells have one colour, which fills the rest of the pixel.
                let shown = f64::from(through.color[pixel][0]);
                assert!((shown - (0.2 + 0.8 * expected)).abs() < 1e-5, "{crossings}: {shown}");
            }
        }
        // All shells are crossed where the innermost sphere covers the pixel.
        assert!(whole > 200, "{crossings}: {whole}");
    }
}

/// Planes of one surfel each let through (1 - a)^k too, composited fragment by fragment.
#[test]
fn sorted_planes_let_through_what_their_alphas_say() {
    let Some(backend) = gpu() else { return };
    for crossings in [2, 4, 10, 20, 100] {
        let (mut scene, camera) = stack(crossings, 0.25);
        for (number, surfel) in scene.surfels.iter_mut().take(crossings).enumerate() {
            surfel.center[2] += 0.25 * number as f32;
        }
        // The surfels that extend the range of colours are moved out of sight.
        scene.surfels.iter_mut().skip(crossings).for_each(|surfel| surfel.center[0] = 1000.0);
        let of = Settings { kernel: Kernel::Constant, ..unlit(Composite::Sorted, 0.1) };
        let shown = frame(&scene, &camera, &of, &backend);
        let expected = 0.9f64.powi(crossings as i32);
        for (transmittance, color) in shown.map(Map::Transmittance).unwrap().iter().zip(&shown.color) {
            assert!((f64::from(*transmittance) - expected).abs() < 1e-5, "{crossings}: {transmittance}");
            assert!((color[0] - 0.25).abs() < 1e-5 && (f64::from(color[3]) - (1.0 - expected)).abs() < 1e-5);
        }
    }
}

/// Device and twin agree at pixels that no rounding decides; broken kernels do not.
#[test]
fn kernels_and_twins_composite_alike() {
    let Some(backend) = gpu() else { return };
    let broken = |file: &str, from: &str, to: &str| {
        let sources = Sources::default().replace(file, from, to).unwrap();
        common::gpu().map(|gpu| Backend::Gpu { gpu: Box::new(gpu), sources }).unwrap()
    };
    let mut all: Vec<(Scene, Camera)> = crowded();
    all.extend(cases().into_iter().skip(2).map(|case| (case.scene, case.camera)));
    let wrong = [
        broken("layers.wgsl", "= max(so_far.farthest, ", "= min(so_far.farthest, "),
        broken("layers.wgsl", "if (side_at(so_far.key) != side) {", "if (false) {"),
        broken("fragments_network.wgsl", "b.x < a.x", "a.x < b.x"),
        broken("fragments_sort.wgsl", "child + 1u < count && precedes(", "child + 1u < count && !precedes("),
        broken("sorted.wgsl", "color.a * listed_weight(record)", "color.a"),
        broken("resolve_lists.wgsl", "shown.transmittance * (1.0 - straight.a)", "shown.transmittance - straight.a"),
        broken("resolve.wgsl", "alpha * OPACITY", "alpha"),
    ];
    let mut noticed = [0; 7];
    let mut compared = 0;
    for (number, (scene, camera)) in all.iter().enumerate() {
        for composite in [ALL, Composite::Layers(2), Composite::Sorted] {
            let own = Settings { opacity: 0.7, maps: BOTH_MAPS, ..options(composite) };
            let shading = if number % 2 == 0 { Shading::Lambert } else { Shading::Unlit };
            let own = Settings { shading, ..own };
            let decided = decided(scene, camera, &own);
            let truth = frame(scene, camera, &own, &Backend::Reference);
            // The number of pixels that differ by more than f32 rounding.
            let differ = |other: &Frame| {
                let far = |pixel: usize| {
                    let [a, b] = [&truth, other].map(|frame| frame.color[pixel]);
                    let alpha = a[3].max(1e-3);
                    let colors = a.iter().zip(b).any(|(a, b)| (a - b).abs() > 2e-4 * (1.0 + a.abs()) / alpha);
                    let [a, b] = [&truth, other].map(|frame| frame.map(Map::Layers).unwrap()[pixel]);
                    colors || a != b
                };
                (0..decided.len()).filter(|pixel| decided[*pixel] && far(*pixel)).count()
            };
            compared += decided.iter().filter(|decided| **decided).count();
            let own_frame = frame(scene, camera, &own, &backend);
            let wrong_pixels = differ(&own_frame);
            assert!(
                wrong_pixels <= decided.len() / 1000,
                "{number} {composite:?}: {wrong_pixels} of {}",
                decided.len()
            );
            if number < 2 {
                for (wrong, noticed) in wrong.iter().zip(&mut noticed) {
                    *noticed += usize::from(differ(&frame(scene, camera, &own, wrong)) > decided.len() / 100);
                }
            }
        }
    }
    assert!(compared > 100_000, "{compared}");
    assert!(noticed.iter().all(|noticed| *noticed > 0), "{noticed:?}");
}

/// The order of surfels, buffer limits and 64-bit integers do not show.
#[test]
fn lists_do_not_show_how_they_came_to_be() {
    let Some(backend) = gpu() else { return };
    let small = |bytes| Backend::gpu(Gpu::with_buffer_limit(common::gpu().unwrap(), bytes));
    // Buffer limits that split the first scene, and scenes with many fragments per pixel, into
    // bands.
    let (narrow, wide) = (small(1_200_000), small(6_000_000));
    let core = common::core_gpu().map(Backend::gpu).unwrap();
    // Many surfels at one place; their content decides their order.
    let (mut dense, camera) = stack(40, 0.5);
    if let Colors::Linear(colors) = &mut dense.colors {
        for (number, color) in colors.iter_mut().enumerate() {
            *color = [number as f32 / 50.0, 0.5, 1.0 - number as f32 / 50.0, 0.1 + number as f32 / 60.0];
        }
    }
    let mut all = crowded();
    all.push((dense, camera));
    for (number, (scene, camera)) in all.iter().enumerate() {
        for (way, composite) in [ALL, Composite::Layers(2), Composite::Sorted].into_iter().enumerate() {
            for samples in [Samples::ONE, "4".parse().unwrap()] {
                if samples != Samples::ONE && !common::takes(number + way, 3) {
                    continue;
                }
                let own = Settings { samples, opacity: 0.6, maps: BOTH_MAPS, ..options(composite) };
                let first = all_bits(&frame(scene, camera, &own, &backend));
                let name = format!("{number} {composite:?} {samples:?}");
                let other = shuffled(scene, 3);
                assert!(all_bits(&frame(&other, camera, &own, &backend)) == first, "{name}: another order");
                for (other, what) in [(if number == 0 { &narrow } else { &wide }, "bands"), (&core, "core features")] {
                    assert!(all_bits(&frame(scene, camera, &own, other)) == first, "{name}: {what}");
                }
                let scattered = Settings { organisation: Organisation::Scatter, ..own.clone() };
                assert!(all_bits(&frame(scene, camera, &scattered, &backend)) == first, "{name}: scattered");
                let mut moved = scene.clone();
                moved.surfels.iter_mut().for_each(|surfel| surfel.center[0] = surfel.center[0].next_up());
                assert!(number == 3 || all_bits(&frame(&moved, camera, &own, &backend)) != first, "{name}");
            }
        }
    }
}

/// Opaque surfaces cost nothing in layers and keep the bits of the opaque picture. If one surfel is
/// translucent, pixels whose nearest layer has alpha 1 keep these bits too.
#[test]
fn opaque_layers_have_the_bits_of_the_opaque_picture() {
    let Some(backend) = gpu() else { return };
    let (scene, camera) = (sphere(4000, 2.0), sphere_camera(96, Projection::Pinhole));
    let plain = frame(&scene, &camera, &options(Composite::Opaque), &backend);
    let (layered, report): (Frame, Report) = render(&scene, &camera, &options(ALL), &backend, &()).unwrap();
    assert!(!report.needs.contains(&"lists-layers"));
    assert_eq!(bits(&layered), bits(&plain));
    // One surfel in sight is translucent.
    let mut one = scene.clone();
    let Colors::Srgb8(codes) = &mut one.colors else { unreachable!() };
    let seen =
        one.surfels.iter().position(|surfel| Vec3::from_array(surfel.center).dot(Vec3::new(1.2, 0.7, 2.4)) > 2.5);
    codes[seen.unwrap()][3] = 128;
    let plain = frame(&one, &camera, &options(Composite::Opaque), &backend);
    let (layered, report): (Frame, Report) = render(&one, &camera, &options(ALL), &backend, &()).unwrap();
    assert!(report.needs.contains(&"lists-layers"));
    let (mut same, mut others) = (0, 0);
    for (a, b) in plain.color.iter().zip(&layered.color) {
        if a[3] == 1.0 {
            assert_eq!(a.map(f32::to_bits), b.map(f32::to_bits));
            same += 1;
        } else if a[3] > 0.0 {
            assert!(b[3] >= 1.0 - 1e-6, "the back shows through: {b:?}");
            others += 1;
        }
    }
    assert!(same > 2000 && others > 10, "{same} {others}");
}

/// In layers, a solid of alpha 0.5 has that opacity at any sampling density. Sorted it does not,
/// because its fragments add up.
#[test]
fn the_density_of_a_cloud_does_not_show_in_layers() {
    let Some(backend) = gpu() else { return };
    let camera = sphere_camera(64, Projection::Pinhole);
    let mean = |count: usize, composite: Composite| {
        let of = Settings { epsilon: Epsilon::Absolute(0.05), ..unlit(composite, 0.5) };
        let shown = frame(&sphere(count, 1.5 * (count as f64 / 2000.0).sqrt()), &camera, &of, &backend);
        // The middle of the image, away from the outline.
        let middle = (24..40).flat_map(|y| (24..40).map(move |x| y * 64 + x));
        middle.map(|pixel| f64::from(shown.color[pixel][3])).sum::<f64>() / 256.0
    };
    let layered = [2000, 4000, 8000].map(|count| mean(count, ALL));
    assert!(layered.iter().all(|alpha| (alpha - 0.75).abs() < 0.01), "{layered:?}");
    let sorted = [2000, 4000, 8000].map(|count| mean(count, Composite::Sorted));
    assert!(sorted[2] - sorted[0] > 0.05, "{sorted:?}");
}

/// A tail makes one more layer of all remaining fragments; without a tail they are dropped.
#[test]
fn a_tail_is_one_more_layer() {
    let Some(backend) = gpu() else { return };
    let camera = front(4);
    let colors = Colors::Linear((0..5).map(|k| [0.2 * k as f32, 0.0, 1.0 - 0.2 * k as f32, 1.0]).collect());
    let disk = |k: usize| Surfel::disk(Vec3::new(0.2, 0.1, 5.0 + k as f32), Vec3::NEG_Z, 20.0);
    let scene = Scene { surfels: (0..5).map(disk).collect(), colors, oriented: true, ..Scene::default() };
    let shown = |composite, tail| {
        let of = Settings { kernel: Kernel::Constant, tail, ..unlit(composite, 0.5) };
        let frame = frame(&scene, &camera, &of, &backend);
        (frame.color[5], frame.map(Map::Layers).unwrap()[5])
    };
    let close = |(color, layers): ([f32; 4], f32), premultiplied: f32, alpha: f32, expected: f32| {
        assert!((color[0] * color[3] - premultiplied).abs() < 1e-6 && (color[3] - alpha).abs() < 1e-6, "{color:?}");
        assert_eq!(layers, expected);
    };
    // Half of 0, a quarter of 0.2, an eighth of 0.4, and so on.
    close(shown(ALL, Tail::Sum), 0.25 * 0.2 + 0.125 * 0.4 + 0.0625 * 0.6 + 0.03125 * 0.8, 1.0 - 0.03125, 5.0);
    close(shown(Composite::Layers(2), Tail::None), 0.25 * 0.2, 0.75, 2.0);
    close(shown(Composite::Layers(2), Tail::Sum), 0.25 * 0.2 + 0.125 * 0.6, 0.875, 3.0);
    close(shown(Composite::Layers(1), Tail::Sum), 0.25 * 0.5, 0.75, 2.0);
}

/// A renderer that keeps its buffers from frame to frame draws what a new one does. Its lists grow
/// and shrink, and its buffers hold the bands of an earlier view.
#[test]
fn a_kept_renderer_draws_what_a_fresh_one_does() {
    let Some(all) = gpu() else { return };
    let small = Backend::gpu(Gpu::with_buffer_limit(common::gpu().unwrap(), 900_000));
    let scene = sphere(4000, 4.0);
    let far = |factor: f64| {
        let camera = sphere_camera(96, Projection::Pinhole);
        Camera { fx: camera.fx * factor, fy: camera.fy * factor, ..camera }
    };
    let views = [far(0.3), far(1.0), far(0.3), far(0.6)];
    for composite in [ALL, Composite::Sorted] {
        let own = Settings { opacity: 0.6, maps: Maps::of(&[Map::Depth, Map::Layers]), ..options(composite) };
        for backend in [&all, &small] {
            let mut kept = Renderer::new(&scene, &own, backend).unwrap();
            for view in &views {
                let fresh = all_bits(&frame(&scene, view, &own, &all));
                assert!(all_bits(&kept.frame(view, &()).unwrap().0) == fresh, "{composite:?}");
            }
        }
    }
}

/// Each copy of a surfel is a fragment, on the device and in the twin.
#[test]
fn copies_are_fragments_each() {
    let Some(backend) = gpu() else { return };
    let (mut scene, camera) = stack(1500, 0.5);
    scene.surfels.iter_mut().skip(1500).for_each(|surfel| surfel.center[0] = 1000.0);
    let of = Settings { kernel: Kernel::Constant, ..unlit(Composite::Sorted, 0.001) };
    let expected = 1.0 - 0.999f64.powi(1500);
    for backend in [&backend, &Backend::Reference] {
        let shown = frame(&scene, &camera, &of, backend);
        assert!((f64::from(shown.color[5][3]) - expected).abs() < 1e-4, "{:?}", shown.color[5]);
        assert_eq!(shown.map(Map::Layers).unwrap()[5], 1500.0);
    }
}

/// Depth, normal and similar maps equal those of the opaque picture. They do so beside maps of all
/// surfaces, and with any number of samples.
#[test]
fn maps_of_the_nearest_surface_stay() {
    let Some(backend) = gpu() else { return };
    let (solid, mixed) = (crowded().remove(0), crowded().remove(1));
    let several: Samples = "4".parse().unwrap();
    for ((scene, camera), samples, most) in
        [(&solid, Samples::ONE, 2.0), (&solid, several, 2.0), (&mixed, Samples::ONE, 3.0), (&mixed, several, 3.0)]
    {
        let plain = Settings { samples, maps: Maps::ON_DEVICE, ..options(Composite::Opaque) };
        let layered = Settings {
            opacity: 0.5,
            composite: ALL,
            maps: Maps::ON_DEVICE.and(&[Map::Transmittance, Map::Layers]),
            ..plain.clone()
        };
        let [plain, layered] = [&plain, &layered].map(|options| frame(scene, camera, options, &backend));
        for map in Maps::ON_DEVICE.iter() {
            assert_eq!(plain.map(map), layered.map(map), "{map:?}");
        }
        let (through, layers) = (layered.map(Map::Transmittance).unwrap(), layered.map(Map::Layers).unwrap());
        assert!(through.iter().zip(layers).all(|(through, layers)| (*through == 1.0) == (*layers == 0.0)));
        assert!(layers.iter().any(|layers| *layers >= most) && (most > 2.0 || layers[0] == 0.0), "{layers:?}");
    }
}

/// The number of layers of each pixel's fragments.
fn parted(scene: &Scene, camera: &Camera, options: &Settings, parting: Parting) -> Vec<usize> {
    let splats = project::reference_all(scene, camera, options);
    let (splats, rows) = (splats.iter().collect(), camera.height);
    let strip = Strip { splats, rows, ..Strip::of((scene, &Facts::of(scene)), camera, options) };
    let count = |(pixel, list): (usize, &fragments::List)| {
        let along = camera.along_axis(pixel as u32 % camera.width, pixel as u32 / camera.width);
        part(&list.fragments, (ALL_LAYERS, Tail::None), parting, (options, along)).0.len()
    };
    fragments::reference(&strip).iter().enumerate().map(count).collect()
}

/// Where epsilon depends on the sizes of surfels, each fragment's own epsilon decides which layer
/// is peeled: the rasteriser agrees with its twin.
#[test]
fn layers_of_surfels_of_many_sizes_are_peeled_as_their_twin_has_them() {
    let Some(gpu) = common::gpu().filter(|gpu| gpu.adapter.vertex_storage) else { return };
    let backend = Backend::gpu(gpu);
    let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/data/bunny.obj"));
    let scene = build(vec![io::read(path, &()).unwrap()], &()).unwrap().0;
    let lens = Lens::Fov(45.0);
    let camera = Camera::framing((160, 160), lens, &scene, Camera::default_near(&scene)).unwrap();
    let raster = Some(Raster { format: BlendFormat::Rgba32Float, depth: RasterDepth::Exact });
    let sources = Sources::default();
    let wrong =
        sources.replace("raster_peeled.wgsl", "bitcast<f32>(front), radius", "bitcast<f32>(front), 0.5 * radius");
    let wrong = Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources: wrong.unwrap() };
    for layers in [2, 4] {
        let of = Settings {
            composite: Composite::Layers(layers),
            opacity: 0.5,
            tail: Tail::None,
            raster,
            ..Settings::default()
        };
        let told = Settings { maps: Maps::of(&[Map::Decision]), ..of.clone() };
        let twin = frame(&scene, &camera, &told, &Backend::Reference);
        let error =
            |backend: &Backend| compare(&frame(&scene, &camera, &of, backend), &twin).unwrap().rmse_decided.unwrap();
        let [own, wrong] = [&backend, &wrong].map(error);
        assert!(own < 1e-6 && wrong > 1e-4, "{layers}: {own} {wrong}");
    }
}

/// Depth peeling by the rasteriser shows the layers of the lists, except where fragments without a
/// gap reach farther than one epsilon. A rasteriser that peels nothing, or too much, differs.
#[test]
fn the_rasteriser_peels_what_lists_part() {
    let Some(gpu) = common::gpu() else { return };
    if !gpu.adapter.vertex_storage {
        return;
    }
    let backend = Backend::gpu(gpu);
    let raster = Some(Raster { format: BlendFormat::Rgba32Float, depth: RasterDepth::Exact });
    let broken = |from: &str, to: &str| {
        let sources = Sources::default().replace("raster_peeled.wgsl", from, to).unwrap();
        common::gpu().map(|gpu| Backend::Gpu { gpu: Box::new(gpu), sources }).unwrap()
    };
    let wrong = [broken("front != 0u && ", "false && "), broken("+ side]", "]")];
    let (scene, camera) = (shells(3, 4000), sphere_camera(96, Projection::Pinhole));
    let mut noticed = [0; 2];
    for (layers, oriented) in [(1, true), (2, true), (4, false), (6, true), (9, false)] {
        let scene = Scene { oriented, ..scene.clone() };
        let of = Settings { opacity: 0.6, tail: Tail::None, ..options(Composite::Layers(layers)) };
        let [runs, windows] = [Parting::Runs, Parting::Window].map(|parting| parted(&scene, &camera, &of, parting));
        let alike = runs.iter().zip(windows).map(|(runs, windows)| *runs == windows);
        let decided: Vec<bool> =
            decided(&scene, &camera, &of).into_iter().zip(alike).map(|(decided, alike)| decided && alike).collect();
        let compared = decided.iter().filter(|decided| **decided).count();
        assert!(compared > 5000, "{layers}: {compared}");
        let listed = frame(&scene, &camera, &of, &backend);
        let differ = |backend: &Backend| {
            let peeled = frame(&scene, &camera, &Settings { raster, ..of.clone() }, backend);
            let far = |pixel: &usize| {
                peeled.color[*pixel]
                    .iter()
                    .zip(listed.color[*pixel])
                    .any(|(a, b)| (a - b).abs() > 2e-5 * (1.0 + b.abs()))
            };
            (0..decided.len()).filter(|pixel| decided[*pixel]).filter(far).count()
        };
        let own = differ(&backend);
        assert!(own <= compared / 500, "{layers}: {own} of {compared}");
        for (wrong, noticed) in wrong.iter().zip(&mut noticed) {
            *noticed += usize::from(differ(wrong) > decided.len() / 10);
        }
    }
    assert!(noticed.iter().all(|noticed| *noticed > 0), "{noticed:?}");
    let refused = |options: Settings| {
        let options = Settings { raster, ..options };
        render(&scene, &camera, &options, &backend, &()).unwrap_err().to_string()
    };
    assert!(refused(options(ALL)).contains("1 to 64 layers"));
    assert!(refused(options(Composite::Layers(2))).contains("take --tail none"));
    assert!(refused(options(Composite::Sorted)).contains("sorts no fragments"));
}

/// Maps of each surface's depth and alpha, and of the tail's share of a pixel: by hand, and as in
/// the twins.
#[test]
fn maps_tell_of_each_surface_and_of_the_tail() {
    let Some(backend) = gpu() else { return };
    let (mut scene, camera) = stack(3, 0.5);
    scene.surfels.iter_mut().skip(3).for_each(|surfel| surfel.center[0] = 1000.0);
    for (surfel, depth) in scene.surfels.iter_mut().zip([5.0, 7.0, 11.0]) {
        surfel.center[2] = depth;
    }
    let of =
        |composite, maps: &[Map]| Settings { kernel: Kernel::Constant, maps: Maps::of(maps), ..unlit(composite, 0.25) };
    let near = |found: &[f32], expected: &[f32]| {
        let same = |(a, b): (&f32, &f32)| a == b || (a - b).abs() < 1e-5;
        found.len() == expected.len() && found.iter().zip(expected).all(same)
    };
    let none = [f32::INFINITY, 0.0];
    for (composite, surfaces, tail) in [
        (ALL, vec![[5.0, 0.25], [7.0, 0.25], [11.0, 0.25]], None),
        (Composite::Sorted, vec![[5.0, 0.25], [7.0, 0.25], [11.0, 0.25]], None),
        (Composite::Layers(1), vec![[5.0, 0.25], [7.0, 0.25]], Some(0.75 * 0.25)),
        (Composite::Layers(3), vec![[5.0, 0.25], [7.0, 0.25], [11.0, 0.25]], Some(0.0)),
    ] {
        let maps = if tail.is_some() { &[Map::Surfaces, Map::Tail][..] } else { &[Map::Surfaces] };
        for backend in [&backend, &Backend::Reference] {
            let (shown, report) = render(&scene, &camera, &of(composite, maps), backend, &()).unwrap();
            let expected: Vec<_> = surfaces.iter().copied().chain(std::iter::repeat(none)).take(8).flatten().collect();
            for pixel in shown.map(Map::Surfaces).unwrap().chunks(16) {
                assert!(near(pixel, &expected), "{composite:?}: {pixel:?}");
            }
            assert_eq!(report.tail.is_some(), tail.is_some());
            if let (Some(expected), Some(found)) = (tail, report.tail) {
                assert!(near(shown.map(Map::Tail).unwrap(), &[expected; 16]), "{composite:?}");
                assert!((found.mean - f64::from(expected)).abs() < 1e-6 && found.largest - found.mean < 1e-6);
            }
        }
    }
    // Opaque surfaces are in the map too, and pixels without a surface have none.
    let (scene, camera) = (sphere(4000, 2.0), sphere_camera(96, Projection::Pinhole));
    let own = Settings { opacity: 1.0, ..of(ALL, &[Map::Surfaces]) };
    let [device, twin] = [&backend, &Backend::Reference].map(|backend| frame(&scene, &camera, &own, backend));
    let decided = decided(&scene, &camera, &own);
    let (mut seen, mut none_seen) = (0, 0);
    let pixels = |frame: &Frame| frame.map(Map::Surfaces).unwrap().chunks(16).map(<[f32]>::to_vec).collect::<Vec<_>>();
    for ((device, twin), decided) in pixels(&device).iter().zip(pixels(&twin)).zip(decided) {
        assert!(!decided || near(device, &twin), "{device:?} {twin:?}");
        seen += usize::from(device[1] == 1.0 && device[3] == 0.0);
        none_seen += usize::from(device[..2] == none);
    }
    assert!(seen > 3000 && none_seen > 1000, "{seen} {none_seen}");
    // Control: a kernel that writes wrong depths is noticed.
    let wrong = Sources::default().replace("maps.wgsl", "2u * number, depth", "2u * number, 1.001 * depth");
    let wrong = Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources: wrong.unwrap() };
    assert!(pixels(&frame(&scene, &camera, &own, &wrong)) != pixels(&device));
    let refused = |of: Settings| match render(&scene, &camera, &of, &backend, &()) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("{of:?} is not refused"),
    };
    assert!(refused(of(ALL, &[Map::Tail])).contains("layers:L"));
    assert!(refused(of(Composite::Opaque, &[Map::Surfaces])).contains("surfaces behind each other"));
    assert!(refused(of(Composite::Moments, &[Map::Surfaces])).contains("surfaces behind each other"));
}
