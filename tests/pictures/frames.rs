//! Hashes of all bits of frames: renders of every kind must give the hashes of earlier runs.
//!
//! The hashes of the f64 reference are in `tests/golden/frames.txt`, and those of all adapters in
//! `tests/golden/devices.txt`: every adapter draws the same bits. Both must not change. The
//! rasteriser's frames are left out, because the bits that it interpolates differ between adapters.
//! `EPSPLAT_TEST_ADAPTER` chooses the adapter. All hashes of a run are written to the file that
//! `EPSPLAT_FRAMES` names:
//!
//! ```text
//! EPSPLAT_FRAMES=now.txt cargo test --release --test pictures frames::
//! ```
//!
//! OpenGL and the f32 twin draw a part of the rows, or all if `EPSPLAT_EVERY_ROW` is set.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::fmt::Write;
use std::sync::Arc;

use common::bits;
use common::scenes::{Case, cases, crowded, painted, sphere, sphere_camera};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Gpu;
use epsplat::low_level::plan::{Accumulator, Features, Optimisation, Organisation, Settings};
use epsplat::low_level::render::{Backend, Renderer, render};
use epsplat::low_level::scene::{
    Camera, Colors, Composite, Epsilon, Light, LowPass, MAPS, Map, Maps, Projection, Scene, Shading, Surfel,
};
use glam::{DVec3, Vec3};

/// A scene and a view of it.
type View = (Scene, Camera);

/// One render of the list.
struct Row<'a> {
    name: String,
    view: &'a View,
    options: Settings,
    /// The largest buffer, in bytes: a small limit makes pages and bands.
    buffer_limit: Option<u64>,
}

/// The scenes of the list, by name.
struct Scenes {
    sphere: View,
    orthographic: View,
    dense: View,
    large: View,
    mixed: View,
    mixed_orthographic: View,
    near: View,
    far: View,
    copies: View,
    textured: View,
    plain: View,
}

fn scenes() -> Scenes {
    let case = |name: &str| {
        let Case { scene, camera, .. } = cases().into_iter().find(|case| case.name == name).unwrap();
        (scene, camera)
    };
    let plain = Scene { colors: Colors::Constant([0.25, 0.5, 0.75, 1.0]), oriented: false, ..sphere(700, 1.5) };
    Scenes {
        sphere: (sphere(3000, 1.7), sphere_camera(72, Projection::Pinhole)),
        orthographic: (sphere(3000, 1.7), sphere_camera(72, Projection::Orthographic)),
        dense: (sphere(20_000, 1.2), sphere_camera(64, Projection::Pinhole)),
        large: (sphere(60, 2.0), sphere_camera(96, Projection::Pinhole)),
        mixed: crowded().remove(1),
        mixed_orthographic: crowded().remove(2),
        near: case("pinhole, across the near depth"),
        far: doubled(),
        copies: (copies(), sphere_camera(72, Projection::Pinhole)),
        textured: (painted(1), sphere_camera(72, Projection::Pinhole)),
        plain: (plain, sphere_camera(72, Projection::Orthographic)),
    }
}

/// A sphere whose centres have more digits than f32 holds.
fn doubled() -> View {
    let scene = sphere(2000, 1.7);
    let far = |surfel: &Surfel| Vec3::from_array(surfel.center).as_dvec3() + DVec3::new(3e6, -7e5, 1e6);
    let surfels: Vec<_> =
        scene.surfels.iter().map(|surfel| Surfel { center: far(surfel).as_vec3().to_array(), ..*surfel }).collect();
    let low = |(surfel, stored): (&Surfel, &Surfel)| {
        (far(surfel) - Vec3::from_array(stored.center).as_dvec3()).as_vec3().to_array()
    };
    let low = scene.surfels.iter().zip(&surfels).map(low).collect();
    let origin = DVec3::new(-3e6, 7e5, -1e6);
    (Scene { origin, surfels, low, ..scene }, sphere_camera(72, Projection::Pinhole))
}

/// A sphere and many copies of one disk.
fn copies() -> Scene {
    let mut scene = sphere(800, 1.7);
    let Colors::Srgb8(codes) = &mut scene.colors else { unreachable!() };
    let disk = Surfel::disk(Vec3::new(0.5, 0.2, 1.0), Vec3::new(0.3, 0.1, 1.0), 0.4);
    scene.surfels.extend(vec![disk; 2000]);
    codes.extend(vec![[200, 30, 40, 255]; 2000]);
    scene
}

fn unlit() -> Settings {
    Settings { shading: Shading::Unlit, ..Settings::default() }
}

fn with_maps() -> Settings {
    Settings { maps: Maps::ON_DEVICE, ..Settings::default() }
}

/// Lists all renders: kernels, epsilons, low-passes, shadings, maps, accumulators, organisations,
/// omitted optimisations, pages, bands, and the rasteriser.
fn list(scenes: &Scenes) -> Vec<Row<'_>> {
    let mut rows = Vec::new();
    let mut add = |name: String, view, options| rows.push(Row { name, view, options, buffer_limit: None });
    let views = [
        ("sphere", &scenes.sphere),
        ("orthographic", &scenes.orthographic),
        ("dense", &scenes.dense),
        ("large", &scenes.large),
        ("mixed", &scenes.mixed),
        ("mixed orthographic", &scenes.mixed_orthographic),
        ("near", &scenes.near),
        ("far", &scenes.far),
        ("copies", &scenes.copies),
        ("textured", &scenes.textured),
        ("plain", &scenes.plain),
    ];
    for (name, view) in views {
        add(format!("{name}, default"), view, Settings::default());
        for low_pass in [LowPass::Max, LowPass::Ewa] {
            add(format!("{name}, {low_pass:?}, maps"), view, Settings { low_pass, ..with_maps() });
        }
        add(format!("{name}, scatter, maps"), view, Settings { organisation: Organisation::Scatter, ..with_maps() });
    }
    for kernel in ["gaussian", "gaussian:0.5", "ellipse:4,2,smooth", "hat", "constant"] {
        for (name, view) in [("sphere", &scenes.sphere), ("mixed", &scenes.mixed)] {
            add(format!("{name}, {kernel}"), view, Settings { kernel: kernel.parse().unwrap(), ..unlit() });
        }
    }
    for epsilon in [Epsilon::Relative(0.0), Epsilon::Absolute(0.05), Epsilon::Radius(1.5)] {
        add(format!("mixed, {epsilon:?}"), &scenes.mixed, Settings { epsilon, ..with_maps() });
    }
    let lights = vec![
        Light::Headlight { intensity: 0.5 },
        Light::Directional { toward: Vec3::new(0.6, 0.0, 0.8), intensity: 0.7 },
    ];
    for (name, view) in [("sphere", &scenes.sphere), ("plain", &scenes.plain), ("textured", &scenes.textured)] {
        let background = [0.1, 0.2, 0.3, 0.5];
        let phong = Settings { shading: Shading::Phong, lights: lights.clone(), background, ..with_maps() };
        add(format!("{name}, Phong, two lights, background"), view, phong);
    }
    for accumulator in [Accumulator::Fixed32, Accumulator::Fixed64, Accumulator::Packed64] {
        for (name, view) in [("sphere", &scenes.sphere), ("mixed", &scenes.mixed)] {
            add(format!("{name}, {accumulator}"), view, Settings { accumulator, ..with_maps() });
        }
    }
    for organisation in [Organisation::Scatter, Organisation::Tile] {
        for (name, view) in [("sphere", &scenes.sphere), ("dense", &scenes.dense), ("large", &scenes.large)] {
            add(format!("{name}, {organisation:?}"), view, Settings { organisation, ..unlit() });
        }
    }
    for (optimisation, name) in Optimisation::ALL {
        let without = vec![optimisation];
        add(format!("dense, without {name}"), &scenes.dense, Settings { without, ..Settings::default() });
    }
    for depth in ["exact", "offset"] {
        for format in ["rgba16float", "rgba32float"] {
            let raster =
                epsplat::low_level::plan::Raster { format: format.parse().unwrap(), depth: depth.parse().unwrap() };
            let options = Settings { raster: Some(raster), ..with_maps() };
            add(format!("sphere, raster {depth} {format}"), &scenes.sphere, options);
        }
    }
    for (name, view) in [("sphere", &scenes.sphere), ("mixed", &scenes.mixed), ("large", &scenes.large)] {
        for limit in [40_000, 120_000] {
            let options = Settings { low_pass: LowPass::Max, ..with_maps() };
            let name = format!("{name}, buffers of {limit} bytes");
            rows.push(Row { name, view, options, buffer_limit: Some(limit) });
        }
    }
    rows
}

/// The 64-bit FNV-1a hash (Fowler, Noll, Vo) of all bits of a frame.
fn hash(frame: &Frame) -> u64 {
    bits(frame)
        .into_iter()
        .flat_map(u32::to_le_bytes)
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// Renders two frames, which must be equal, and returns their hash.
fn rendered(row: &Row<'_>, backend: &Backend) -> u64 {
    let (scene, camera) = row.view;
    let mut renderer = Renderer::new(scene, &row.options, backend).unwrap();
    let [first, second] = [0, 1].map(|_| hash(&renderer.frame(camera, &()).unwrap().0));
    assert_eq!(first, second, "{}: the second frame differs", row.name);
    first
}

/// Returns whether the f64 reference uses all options of the row. If not, another row covers its
/// frame.
fn differs_in_f64(row: &Row<'_>) -> bool {
    let options = &row.options;
    let own =
        Settings { raster: None, organisation: Organisation::Auto, accumulator: Accumulator::Fixed, ..options.clone() };
    row.buffer_limit.is_none() && own == *options && options.without.is_empty()
}

#[test]
fn frames_of_the_reference_are_what_they_were() {
    let scenes = scenes();
    let mut made = String::new();
    for row in list(&scenes).iter().filter(|row| differs_in_f64(row)) {
        writeln!(made, "{:016x} {}", rendered(row, &Backend::Reference), row.name).unwrap();
    }
    let kept = include_str!("../golden/frames.txt");
    let pairs = made.lines().zip(kept.lines().filter(|line| !line.starts_with('#')));
    let other: Vec<_> = pairs.clone().filter(|(made, kept)| made != kept).collect();
    assert!(other.is_empty() && pairs.count() == made.lines().count(), "now:\n{made}\nother than before: {other:#?}");
    // Control: one surfel moved by 1e-6 changes the hash.
    let mut moved = scenes.sphere.clone();
    moved.0.surfels[200].center[2] += 1e-6;
    let row = |view| Row { name: String::new(), view, options: with_maps(), buffer_limit: None };
    assert!(rendered(&row(&moved), &Backend::Reference) != rendered(&row(&scenes.sphere), &Backend::Reference));
}

/// Compares hashes of frames with those that all adapters have. Each line is a hash and a name.
fn compare_with_kept(made: &[String]) {
    let kept = include_str!("../golden/devices.txt");
    let kept: Vec<&str> = kept.lines().filter(|line| !line.starts_with('#')).collect();
    let other: Vec<_> = made.iter().filter(|line| !kept.contains(&line.as_str())).collect();
    assert!(other.is_empty(), "now:\n{}\nother than before: {other:#?}", made.join("\n"));
}

/// One row of this many is drawn, or every row if that is asked for.
fn one_of(rows: usize) -> usize {
    if std::env::var("EPSPLAT_EVERY_ROW").is_ok() { 1 } else { rows }
}

/// OpenGL, without the processor's own division, draws the same bits.
#[test]
fn frames_have_the_same_bits_by_opengl() {
    let Some(gpu) = common::opengl() else { return };
    let scenes = scenes();
    let backend = Backend::gpu(gpu.clone());
    let fits =
        |row: &&Row<'_>| row.options.raster.is_none() && row.buffer_limit.is_none() && refused(row, &gpu).is_none();
    let all = list(&scenes);
    // A third of the rows, because compilers take seconds for each.
    let made = all.iter().filter(fits).step_by(one_of(3)).map(|row| {
        let without = [row.options.without.as_slice(), &[Optimisation::Division]].concat();
        let own = Row { name: row.name.clone(), options: Settings { without, ..row.options.clone() }, ..*row };
        format!("{:016x} {}", rendered(&own, &backend), row.name)
    });
    let made: Vec<String> = made.collect();
    assert!(made.len() >= 24, "{}", made.len());
    compare_with_kept(&made);
}

/// The f32 twin, which needs no driver, draws the same bits. It is slow, so it draws a row of ten.
#[test]
fn frames_have_the_same_bits_by_the_f32_twin() {
    let gpu = Gpu::open(Some("twin")).unwrap();
    let scenes = scenes();
    let backend = Backend::gpu(gpu.clone());
    let fits =
        |row: &&Row<'_>| row.options.raster.is_none() && row.buffer_limit.is_none() && refused(row, &gpu).is_none();
    let made: Vec<String> = list(&scenes)
        .iter()
        .filter(fits)
        .step_by(one_of(10))
        .map(|row| format!("{:016x} {}", rendered(row, &backend), row.name))
        .collect();
    assert!(made.len() >= 7, "{}", made.len());
    compare_with_kept(&made);
}

/// A second render of each frame has the same bits, and so has a render by a core WebGPU device,
/// and an earlier one by any adapter.
/// A core device, as in a browser or on a phone, has eight storage buffers, bindings of 128 MiB,
/// and no optional feature.
#[test]
fn frames_repeat_and_core_webgpu_makes_the_same_ones() {
    let (Some(gpu), Some(core)) = (common::gpu(), common::core_gpu()) else { return };
    let scenes = scenes();
    let all = list(&scenes);
    assert!(all.len() >= 90, "{}", all.len());
    // Each line is written at once, because some drivers crash before the end.
    let file = std::env::var("EPSPLAT_FRAMES").ok().map(|path| std::fs::File::create(path).unwrap());
    let write =
        |line: &str| file.iter().for_each(|mut file| std::io::Write::write_all(&mut file, line.as_bytes()).unwrap());
    write(&format!("# {}\n", gpu.adapter.name));
    let (backend, core_backend) = (Backend::gpu(gpu.clone()), Backend::gpu(core.clone()));
    let (mut compared, mut all_adapters) = (0, Vec::new());
    for (number, row) in all.iter().enumerate() {
        let limited = |limit| common::gpu().map(|gpu| Backend::gpu(Gpu::with_buffer_limit(gpu, limit))).unwrap();
        let own = row.buffer_limit.map(limited);
        if let Some(why) = refused(row, &gpu) {
            write(&format!("{why:16} {}\n", row.name));
            continue;
        }
        let made = rendered(row, own.as_ref().unwrap_or(&backend));
        write(&format!("{made:016x} {}\n", row.name));
        if row.options.raster.is_none() {
            all_adapters.push(format!("{made:016x} {}", row.name));
        }
        if row.buffer_limit.is_none() && refused(row, &core).is_none() && common::takes(number, 2) {
            let (scene, camera) = row.view;
            let (frame, _) = render(scene, camera, &row.options, &core_backend, &()).unwrap();
            assert_eq!(hash(&frame), made, "{}", row.name);
            compared += 1;
        }
    }
    assert!(compared >= 35, "{compared}");
    compare_with_kept(&all_adapters);
}

/// A renderer that owns its scene has no lifetimes, so it can move to another thread.
#[test]
fn a_renderer_can_own_its_scene() {
    let Some(gpu) = common::gpu() else { return };
    let (scenes, backend) = (scenes(), Arc::new(Backend::gpu(gpu)));
    let (scene, camera) = scenes.sphere;
    let (expected, _) = render(&scene, &camera, &with_maps(), &backend, &()).unwrap();
    let mut renderer = Renderer::new(Arc::new(scene), &with_maps(), backend).unwrap();
    let frame = std::thread::spawn(move || renderer.frame(&camera, &()).unwrap().0).join().unwrap();
    assert_eq!(hash(&frame), hash(&expected));
}

/// The feature that the adapter lacks for a row, or `None` if it can render the row.
fn refused(row: &Row<'_>, gpu: &Gpu) -> Option<&'static str> {
    let (wants_u64, raster) = (row.options.accumulator.row().features == Features::AtomicsU64, row.options.raster);
    let lacks = [
        (wants_u64 && !gpu.adapter.atomics_u64, "no 64-bit atomics"),
        (
            raster.is_some_and(|raster| raster.format.name() == "rgba32float") && !gpu.adapter.blends_f32,
            "no f32 blending",
        ),
        (raster.is_some_and(|raster| raster.depth.name() != "exact") && gpu.adapter.api == "gl", "no fine depths"),
    ];
    lacks.into_iter().find(|(lacks, _)| *lacks).map(|(_, why)| why)
}

/// Pixels without a splat have the value that each map defines for nothing. Kernels may skip blocks
/// of pixels without a splat, which then keep their cleared values.
#[test]
fn maps_are_right_where_nothing_is() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let painted = painted(1);
    let camera = sphere_camera(8, Projection::Pinhole);
    // The sphere is in the upper left of an image ten times as wide.
    let camera = Camera { width: 80, height: 48, ..camera };
    let plain = Scene { colors: Colors::Constant([0.5, 0.4, 0.3, 1.0]), ..painted.clone() };
    for row in MAPS.iter().filter(|row| row.image_word.is_some()) {
        let scene = if row.map == Map::TexZ { &painted } else { &plain };
        let composite = if row.composited { Composite::Layers(2) } else { Composite::Opaque };
        let lists = [(composite, Organisation::Auto), (composite, Organisation::Scatter)];
        let tiles = !matches!(row.map, Map::Tail | Map::Surfaces | Map::Index);
        let tiles = tiles.then_some((Composite::Opaque, Organisation::Tile));
        for (composite, organisation) in lists.into_iter().chain(tiles) {
            let maps = Maps::of(&[row.map]);
            let options = Settings { maps, composite, organisation, ..Settings::default() };
            let (frame, _) = render(scene, &camera, &options, &backend, &()).unwrap();
            let (reference, _) = render(scene, &camera, &options, &Backend::Reference, &()).unwrap();
            let words = |frame: &Frame| frame.map(row.map).unwrap().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            let (device, truth) = (words(&frame), words(&reference));
            let of_nothing = |k: usize| match row.nothing.len() {
                0 if row.numbers => u32::MAX,
                0 => 0,
                n => row.nothing[k % n].to_bits(),
            };
            // The pixels outside the upper left 16 x 16, two blocks each way.
            let width = row.map.width();
            let empty = (0..device.len()).filter(|k| k / width % 80 >= 16 || k / width / 80 >= 16);
            for k in empty {
                let expected = (of_nothing(k % width), of_nothing(k % width));
                assert_eq!((device[k], truth[k]), expected, "{}, {composite:?}, {organisation:?}, at {k}", row.name);
            }
        }
    }
}
