//! Large splats drawn by tiles, by workgroups or one by one: no threshold between these changes a
//! bit.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use common::scenes::{cases, crowded, front, painted, sphere, stack};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::plan::{Optimisation, Organisation, Settings};
use epsplat::low_level::render::{Backend, Renderer, Report, render};
use epsplat::low_level::scene::{
    Camera, Colors, Epsilon, Kernel, LowPass, Map, Maps, Projection, Samples, Scene, Shading, Surfel, Up,
};
use glam::{DVec3, Vec3};

/// Kernels that treat splats of more than `pixels` pixels as large.
fn large_from(pixels: u32) -> Sources {
    Sources::default().replace("footprint.wgsl", "size.y > LARGE", &format!("size.y > {pixels}u")).unwrap()
}

fn on(gpu: Gpu, sources: Sources) -> Backend {
    Backend::Gpu { gpu: Box::new(gpu), sources }
}

fn frame(scene: &Scene, camera: &Camera, options: &Settings, backend: &Backend) -> (Frame, Report) {
    let (frame, report) = render(scene, camera, options, backend, &()).unwrap();
    assert!(report.needs.contains(&"tiles"));
    (frame, report)
}

/// Scenes with splats of all sizes, and options that cover each variant of the kernels.
pub(super) fn drawn() -> Vec<(&'static str, Scene, Camera, Settings)> {
    let plain = Settings { maps: Maps::ON_DEVICE, epsilon: Epsilon::Relative(0.02), ..Default::default() };
    let mut all = Vec::new();
    let (scene, camera) = crowded().swap_remove(1);
    all.push(("crowded", scene, camera, plain.clone()));
    let camera = common::scenes::sphere_camera(71, Projection::Pinhole);
    let globe = sphere(900, 2.5);
    let mut unlit = plain.clone();
    (unlit.shading, unlit.maps) = (Shading::Unlit, Maps::NONE);
    all.push(("unlit", globe.clone(), camera.clone(), unlit.clone()));
    let constant = Scene { colors: Colors::Constant([0.2, 0.4, 0.6, 1.0]), ..globe.clone() };
    all.push(("constant", constant, camera.clone(), unlit));
    all.push(("max", globe.clone(), camera.clone(), Settings { low_pass: LowPass::Max, ..plain.clone() }));
    all.push(("ewa", globe.clone(), camera.clone(), Settings { low_pass: LowPass::Ewa, ..plain.clone() }));
    let of_radius = Settings { epsilon: Epsilon::Radius(0.5), ..plain.clone() };
    all.push(("radius", globe.clone(), camera.clone(), of_radius));
    // A narrow Gaussian has tiny weights, which require wide sums.
    let wide = Settings { kernel: Kernel::Gaussian { sigma: 0.2 }, ..plain.clone() };
    all.push(("wide", globe, camera.clone(), wide));
    let placed = Settings { maps: plain.maps.and(&[Map::TexZ]), ..plain.clone() };
    all.push(("painted", painted(1), camera.clone(), placed.clone()));
    all.push(("pictures", painted(2), camera, placed));
    for case in cases().into_iter().filter(|case| case.name.contains("near depth")) {
        all.push((case.name, case.scene, case.camera, plain.clone()));
    }
    all
}

/// Asserts that the scenes called `names` give the same frame by scatter and by tiles, for each of
/// `thresholds`.
fn compare(names: &[&str], thresholds: &[u32], adapt: impl Fn(&mut Gpu)) {
    let backend = |pixels| {
        let mut gpu = common::gpu()?;
        adapt(&mut gpu);
        Some(on(gpu, large_from(pixels)))
    };
    let Some(scatter) = backend(u32::MAX) else { return };
    let others: Vec<_> = thresholds.iter().filter_map(|&pixels| Some((pixels, backend(pixels)?))).collect();
    for (name, scene, camera, options) in drawn().into_iter().filter(|(name, ..)| names.contains(name)) {
        let by_scatter = Settings { organisation: Organisation::Scatter, ..options.clone() };
        let (expected, report) = render(&scene, &camera, &by_scatter, &scatter, &()).unwrap();
        assert!(!report.needs.contains(&"tiles"));
        for (pixels, backend) in &others {
            let (tiled, _) = frame(&scene, &camera, &options, backend);
            assert!(bits(&tiled) == bits(&expected), "{name}: tiles from {pixels} pixels upward change bits");
            let all = Settings { organisation: Organisation::Tile, ..options.clone() };
            let (gathered, report) = frame(&scene, &camera, &all, backend);
            assert!(report.needs.contains(&"gather"));
            assert!(bits(&gathered) == bits(&expected), "{name}: gathering from {pixels} pixels on changes bits");
        }
    }
}

#[test]
fn no_threshold_between_scatter_and_tiles_shows() {
    compare(&["crowded"], &[0, 40, 1000], |_| {});
}

#[test]
fn every_form_of_the_kernels_draws_the_same_by_tiles() {
    let names: Vec<_> = drawn().iter().map(|(name, ..)| *name).collect();
    assert!(names.len() >= 11);
    compare(&names, &[0], |_| {});
}

#[test]
fn adapters_without_64_bit_atomics_and_subgroups_draw_the_same_by_tiles() {
    compare(&["unlit", "wide", "max", "pictures"], &[0], |gpu| {
        (gpu.adapter.atomics_u64, gpu.adapter.subgroups) = (false, false);
    });
}

/// A device that draws tiles as a graphics card does, with an invocation for each pixel. The f32
/// twin interprets their kernels, which llvmpipe takes minutes to compile.
fn card() -> Gpu {
    let mut gpu = Gpu::open(Some("twin")).unwrap();
    gpu.adapter.kind = "discrete";
    gpu
}

#[test]
fn cards_draw_the_same_by_tiles() {
    let of_each_form = ["unlit", "wide", "max", "pictures"];
    for (name, scene, camera, options) in drawn().into_iter().filter(|(name, ..)| of_each_form.contains(name)) {
        let own = |backend: &Backend, organisation| {
            let options = Settings { organisation, ..options.clone() };
            render(&scene, &camera, &options, backend, &()).unwrap()
        };
        let (expected, _) = own(&on(card(), large_from(u32::MAX)), Organisation::Scatter);
        let organisation = if name == "max" { Organisation::Auto } else { Organisation::Tile };
        let (frame, report) = own(&on(card(), large_from(40)), organisation);
        assert!(report.needs.contains(&"tiles"));
        assert!(bits(&frame) == bits(&expected), "{name}: {organisation:?} changes bits");
    }
    // Samples, an image whose sides are no multiples of a tile's, and stored sums of several pages.
    let (scene, camera) = (sphere(900, 2.5), common::scenes::sphere_camera(21, Projection::Pinhole));
    let in_form = |organisation, sources: Sources, most| {
        let samples = Samples { across: 2, down: 4 };
        let options = Settings { organisation, samples, maps: Maps::NONE, ..Default::default() };
        let gpu = if most == 0 { card() } else { card().with_buffer_limit(most) };
        let (frame, report) = render(&scene, &camera, &options, &on(gpu, sources), &()).unwrap();
        (bits(&frame), report.needs.contains(&"gather"))
    };
    let (expected, _) = in_form(Organisation::Scatter, large_from(u32::MAX), 0);
    assert!(in_form(Organisation::Tile, large_from(40), 0) == (expected.clone(), true));
    assert!(in_form(Organisation::Tile, large_from(40), 30_000) == (expected.clone(), false));
    let wrong = large_from(40).replace("staged_samples.wgsl", "j * SIDE + i", "i * SIDE + j").unwrap();
    assert!(in_form(Organisation::Tile, wrong, 0) != (expected.clone(), true), "swapped samples are not noticed");
    let wrong = large_from(40).replace("staged_sums.wgsl", "channel += 2u", "channel += 4u").unwrap();
    assert!(in_form(Organisation::Tile, wrong, 30_000) != (expected, false), "lost sums are not noticed");
}

#[test]
fn bands_and_pages_of_tiles_do_not_show() {
    let Some(whole) = common::gpu() else { return };
    let whole = on(whole, large_from(30));
    let in_pieces = |bytes, sources| on(common::gpu().unwrap().with_buffer_limit(bytes), sources);
    let (name, scene, camera, options) = drawn().swap_remove(1);
    let one = frame(&scene, &camera, &options, &whole);
    // Each band skips batches by its own rows.
    let hidden = |options: &Settings, bytes| {
        let many = frame(&scene, &camera, options, &in_pieces(bytes, large_from(30)));
        assert!(bits(&one.0) == bits(&many.0), "{name}: buffers of {bytes} bytes, {options:?}");
        assert!(one.1.needs.contains(&"cull") && many.1.needs.contains(&"cull"), "{name}: {:?}", many.1.needs);
        many.1.needs.contains(&"gather")
    };
    assert!(!hidden(&options, 40_000), "tiles must not gather several pages");
    let tiles = Settings { organisation: Organisation::Tile, ..options.clone() };
    assert!(hidden(&tiles, 70_000), "tiles must gather in every band");
    // The control: a band that skips what is visible in its first rows is noticed.
    let above = large_from(30).replace("cull.wgsl", "vec2<f32>(0.0, top));", "vec2<f32>(0.0, top + 40.0));").unwrap();
    let (cut, _) = frame(&scene, &camera, &options, &in_pieces(70_000, above));
    assert!(bits(&cut) != bits(&one.0), "{name}: missing first rows are not noticed");
}

/// The control: each way to draw a tile wrongly is noticed.
#[test]
fn a_wrong_tile_is_noticed() {
    let (name, scene, camera, mut options) = drawn().swap_remove(1);
    options.organisation = Organisation::Tile;
    // These changes break tiles that gather all splats, large and small. Those in `stored` break
    // tiles that add large splats to stored sums, in several pages.
    let gathered = [
        ("bin.wgsl", "atomicStore(&lists[at], slot)", "atomicStore(&lists[at], 0u)"),
        ("bin.wgsl", "tile_size(), 0u, 1u, true)", "tile_size(), 1u, 1u, true)"),
        ("bin.wgsl", "LISTED_AT_ONCE + local.y", "LISTED_AT_ONCE"),
        ("tile.wgsl", "b = nearer(b, splat, filter_, column.x, column.y + 4u);", ""),
        ("tile.wgsl", "d = nearer(d, splat, filter_, column.x, column.y + 12u);", ""),
        ("tile.wgsl", "deepest_accepted(farthest_of(a, b))", "farthest_of(a, b)"),
        ("tile.wgsl", "gather_eight(8u, next", "gather_eight(0u, next"),
        ("tile_reach.wgsl", "length + half_width(s)", "0.9 * length + 0.5 * half_width(s)"),
        ("column.wgsl", "select(Term(0), weight_of(fragment), accepted)", "weight_of(fragment)"),
        ("tile_small.wgsl", "small_lists[end]) +", "small_lists[end - 1u]) +"),
        ("tile_sums.wgsl", "high + select(0u, 1u, sum < low)", "high"),
        ("tile_sums.wgsl", "if (slot == 5u)", "if (slot == 55u)"),
        ("occlusion.wgsl", "farthest_in(at, 0u) != 0u)", "farthest_in(at, 0u) != 0u && inner.y % 2u == 0u)"),
        ("covered.wgsl", "place < visible[covered_start()]", "place + 1u < visible[covered_start()]"),
        ("splat_shared.wgsl", "(lane & 24u) | from_", "(lane & 24u) | (from_ ^ 1u)"),
    ];
    // An error of one unit (2^-32) in a sum would be invisible; one of 2^28 units (2^-4) is not.
    let stored = [
        ("tile.wgsl", "deposit(column.pixel + k * held.width)", "deposit(column.pixel)"),
        ("tile_deposit_pairs.wgsl", "vec2<u32>(carried, 0u)", "vec2<u32>(carried << 28u, 0u)"),
    ];
    let of_cards = [
        ("staged.wgsl", "(place + local < listed)", "(place + local + 1u < listed)"),
        ("staged.wgsl", "min(count - first, STAGED)", "min(count - first, STAGED - 1u)"),
        ("staged.wgsl", "front = min(front, fragment.depth)", "front = max(front, fragment.depth)"),
        ("staged.wgsl", "deepest_accepted(farthest_of_all(front, local))", "farthest_of_all(0.5 * front, local)"),
        ("staged.wgsl", "SIDE, deepest)) {", "SIDE / 2u, deepest)) {"),
        ("staged_sums.wgsl", "high + select(0u, 1u, sum < low)", "high"),
        ("occlusion.wgsl", "at.y / size.y * tiles_across()", "at.y * tiles_across()"),
    ];
    let all = [(&gathered[..], true, false), (&stored[..], false, false), (&of_cards[..], true, true)];
    for (wrong, gathers, on_card) in all {
        let image = |sources: Sources| {
            if on_card {
                return Some(bits(&frame(&scene, &camera, &options, &on(card(), sources)).0));
            }
            let gpu = common::gpu()?;
            if !(gpu.adapter.atomics_u64 && gpu.adapter.subgroups) {
                eprintln!("skipped: no 64-bit atomics or no subgroups");
                return None;
            }
            let gpu = if gathers { gpu } else { gpu.with_buffer_limit(70_000) };
            let without = if gathers { Vec::new() } else { vec![Optimisation::Gathering] };
            let options = Settings { without, ..options.clone() };
            let (frame, report) = frame(&scene, &camera, &options, &on(gpu, sources));
            assert_eq!(report.needs.contains(&"gather"), gathers);
            Some(bits(&frame))
        };
        let Some(expected) = image(large_from(40)) else { return };
        for &(file, from, to) in wrong {
            let sources = large_from(40).replace(file, from, to).unwrap();
            assert!(image(sources) != Some(expected.clone()), "{name}: {from} in {file} may be {to:?}");
        }
    }
}

/// The first frame's lists are too short for the second, which is rendered again with larger
/// buffers.
#[test]
fn a_view_that_needs_more_room_gets_it() {
    let Some(gpu) = common::gpu() else { return };
    let backend = on(gpu, large_from(30));
    let scene = sphere(900, 2.5);
    let near = common::scenes::sphere_camera(160, Projection::Pinhole);
    // Another lens keeps the image size, so the renderer reuses its buffers.
    let far = common::scenes::sphere_camera_with(160, epsplat::low_level::scene::Lens::Fov(170.0));
    // `Auto` scatters the far view, whose splats are tiny, so the two ways of summing alternate.
    for organisation in [Organisation::Tile, Organisation::Auto] {
        let options = Settings { organisation, ..Settings::default() };
        let mut renderer = Renderer::new(&scene, &options, &backend).unwrap();
        renderer.frame(&far, &()).unwrap();
        let small = renderer.device_bytes().pixels;
        // The last render is the far view again: larger buffers do not change a bit either.
        for view in [&near, &far] {
            let (kept, _) = renderer.frame(view, &()).unwrap();
            let grew = renderer.device_bytes().pixels > small;
            let must = organisation == Organisation::Tile && view == &near;
            assert!(grew || !must, "no buffer had to grow, so this tests nothing");
            let (fresh, _) = render(&scene, view, &options, &backend, &()).unwrap();
            assert!(bits(&kept) == bits(&fresh), "{organisation:?}");
        }
    }
}

/// Each band has its own splats and may need far longer lists than the next band, so the lengths of
/// lists are recorded per band.
#[test]
fn bands_that_need_different_room_get_it() {
    let Some(gpu) = common::gpu() else { return };
    let backend = on(gpu.with_buffer_limit(120_000), large_from(30));
    let scene = sphere(900, 2.5);
    let far = common::scenes::sphere_camera_with(160, epsplat::low_level::scene::Lens::Fov(170.0));
    let near = common::scenes::sphere_camera(160, Projection::Pinhole);
    // Three views: the sphere is in the first band, in the last band, and all but a sliver is out
    // of view.
    let [up, down, sliver] = [-60.0, 60.0, 140.0].map(|moved| Camera { cy: near.cy + moved, ..near.clone() });
    for organisation in [Organisation::Auto, Organisation::Tile] {
        let options = Settings { organisation, ..Settings::default() };
        let mut renderer = Renderer::new(&scene, &options, &backend).unwrap();
        for view in [&far, &up, &down, &sliver, &far, &near, &up, &sliver, &down] {
            let (kept, report) = renderer.frame(view, &()).unwrap();
            let (fresh, _) = render(&scene, view, &options, &backend, &()).unwrap();
            assert!(bits(&kept) == bits(&fresh), "{organisation:?}, {}", view.cy);
            assert!(report.needs.contains(&"gather") || organisation == Organisation::Auto);
        }
    }
}

/// Draws the longest lists that tiles accept, of large and of small splats, in both halves of a
/// tile.
#[test]
fn the_longest_lists_are_drawn_to_their_end() {
    const LONGEST: usize = 8_000;
    for subgroups in [true, false] {
        let Some(mut gpu) = common::gpu() else { return };
        gpu.adapter.subgroups &= subgroups;
        let backend = on(gpu, large_from(100));
        let disk = |radius: f32| Surfel::disk(Vec3::new(0.0, 0.0, 5.0), Vec3::NEG_Z, radius);
        // A radius of 4 pixels, and one that covers the whole image.
        let surfels = [4.0, 20.0].iter().flat_map(|&radius| vec![disk(radius); LONGEST]).collect();
        let colors = Colors::Constant([1.0; 4]);
        let scene =
            Scene { origin: DVec3::ZERO, surfels, low: vec![], colors, oriented: true, up: Up::Y, ..Scene::default() };
        let options = Settings {
            kernel: Kernel::Constant,
            shading: Shading::Unlit,
            maps: Maps::ON_DEVICE,
            organisation: Organisation::Tile,
            ..Default::default()
        };
        let camera = front(16);
        let (frame, report) = frame(&scene, &camera, &options, &backend);
        let counts = frame.map(Map::Count).unwrap();
        assert!(report.needs.contains(&"gather"));
        let (middle, corner) = (counts[7 * 16 + 7] as usize, counts[0] as usize);
        assert_eq!((middle, corner), (2 * LONGEST, LONGEST), "subgroups: {subgroups}");
        assert_eq!(counts[8 * 16 + 8] as usize, 2 * LONGEST);
    }
}

/// Lists that exceed a driver's loop limit are left to scatter and workgroups.
#[test]
fn long_lists_are_drawn_to_their_end() {
    let Some(gpu) = common::gpu() else { return };
    let backend = on(gpu, large_from(0));
    let (scene, _) = stack(30_000, 1.0);
    let camera = front(4);
    let options = Settings {
        kernel: Kernel::Constant,
        shading: Shading::Unlit,
        maps: Maps::ON_DEVICE,
        epsilon: Epsilon::Absolute(1.0),
        // All surfels are equal, and would otherwise be drawn once.
        without: vec![Optimisation::Copies],
        ..Default::default()
    };
    for organisation in [Organisation::Auto, Organisation::Tile] {
        let options = Settings { organisation, ..options.clone() };
        let (frame, report) = frame(&scene, &camera, &options, &backend);
        assert!(!report.needs.contains(&"gather"));
        let counts = frame.map(Map::Count).unwrap();
        assert!(counts.iter().all(|&count| count == 30_000.0), "{counts:?}");
    }
}
