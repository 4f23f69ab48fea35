//! The order of surfels, the schedule, pages and bands do not change a bit of the frame with
//! accumulators that promise this. With others the frame may change within their error bounds.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::scenes::{crowded, front, shuffled, sphere};
use common::{Random, bits};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::gpu::layout::Splat;
use epsplat::low_level::hardcases::cases;
use epsplat::low_level::inspect::stages;
use epsplat::low_level::plan::{Accumulator, AccumulatorRow, Optimisation, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{
    Camera, Colors, Epsilon, Kernel, Lens, LowPass, Map, Maps, Scene, Shading, Surfel, Up,
};
use glam::{DVec3, Vec3};

/// Half a unit in the last place of 1 in f32.
const E: f64 = 1.0 / 16_777_216.0;

fn options(accumulator: Accumulator) -> Settings {
    Settings { maps: Maps::ON_DEVICE, epsilon: Epsilon::Relative(0.02), accumulator, ..Default::default() }
}

/// All scenes for `fixed`; for other accumulators the first (8-bit colours) and the last (f32
/// colours, large splats).
fn scenes(row: &AccumulatorRow) -> Vec<(Scene, Camera)> {
    let mut all = crowded();
    if row.of != Accumulator::Fixed {
        all.remove(1);
    }
    all
}

/// Renders, and fails if the frame fell back to another accumulator.
fn frame(scene: &Scene, camera: &Camera, options: &Settings, backend: &Backend) -> Frame {
    let (frame, report) = render(scene, camera, options, backend, &()).unwrap();
    assert_eq!((report.accumulator, report.overflows), (options.accumulator.name(), 0));
    frame
}

/// Kernels that draw each batch from its last surfel to its first. (Shuffling the scene hardly
/// changes the order, as the renderer sorts surfels.)
fn reversed(sources: Sources) -> Sources {
    let (own, reversed) = ("workgroup.x * WORKGROUP + local", "(BATCH - 1u - (workgroup.x * WORKGROUP + local))");
    sources.replace("cull.wgsl", own, reversed).unwrap()
}

#[test]
fn order_and_repetition_do_not_change_a_bit() {
    let Some(gpu) = common::gpu() else { return };
    let all = common::accumulators(&gpu);
    let backend = Backend::gpu(gpu);
    let Some(gpu) = common::gpu() else { return };
    let backwards = Backend::Gpu { gpu: Box::new(gpu), sources: reversed(Sources::default()) };
    for row in all.into_iter().filter(|row| row.deterministic) {
        let (name, options) = (row.name, options(row.of));
        for (scene, camera) in scenes(row) {
            let first = bits(&frame(&scene, &camera, &options, &backend));
            assert!(bits(&frame(&scene, &camera, &options, &backend)) == first, "{name}: a second run differs");
            // Without `Order` the device stores surfels in the scene's order; otherwise it sorts
            // them.
            let given = Settings { without: vec![Optimisation::Order], ..options.clone() };
            for (seed, options) in [(5, &given), (6, &given), (7, &options)] {
                let other = frame(&shuffled(&scene, seed), &camera, options, &backend);
                assert!(bits(&other) == first, "{name}: order {seed} differs");
            }
            assert!(bits(&frame(&scene, &camera, &options, &backwards)) == first, "{name}: backwards differs");
            // The control: every surfel moved by one ulp is noticed.
            let mut moved = scene.clone();
            for surfel in &mut moved.surfels {
                surfel.center[0] = surfel.center[0].next_up();
            }
            assert!(bits(&frame(&moved, &camera, &options, &backend)) != first, "{name}");
        }
        // The control: a sum that keeps only the last fragment is noticed.
        let Some(gpu) = common::gpu_for(row.file) else { return };
        let sources = Sources::default();
        let sources = [
            "atomicAdd(&sums[2u * (pixel * CHANNELS + channel)], value)",
            ADD_TO_CHANNEL,
            "atomicAdd(&sums[HEAD + pixel * CHANNELS + channel], value)",
            "atomicAdd(&sums[pixel * CHANNELS + channel], u64(value))",
            "atomicAdd(&sums[pair], (u64",
        ]
        .into_iter()
        .find_map(|add| sources.clone().replace(row.file, add, &add.replace("atomicAdd", "atomicExchange")).ok())
        .unwrap_or_else(|| panic!("{} adds in another way than this test knows", row.file));
        let careless = Backend::Gpu { gpu: Box::new(gpu), sources: sources.clone() };
        let Some(gpu) = common::gpu_for(row.file) else { return };
        let careless_backwards = Backend::Gpu { gpu: Box::new(gpu), sources: reversed(sources) };
        let (scene, camera) = crowded().remove(0);
        let [one, other] = [careless, careless_backwards].map(|careless| {
            let (frame, report) = render(&scene, &camera, &options, &careless, &()).unwrap();
            assert_eq!(report.accumulator, name);
            bits(&frame)
        });
        assert!(one != other, "{name}: a sum that depends on the order was not noticed");
    }
}

/// `fixed` computes the same sums with 64-bit atomics as without. A plain run draws every third
/// hard case.
#[test]
fn an_adapters_64_bit_atomics_do_not_change_a_bit() {
    let Some(with) = common::gpu() else { return };
    if !with.adapter.atomics_u64 {
        eprintln!("skipped: no 64-bit atomics");
        return;
    }
    let with = Backend::gpu(with);
    let Some(mut without) = common::gpu() else { return };
    without.adapter.atomics_u64 = false;
    let without = Backend::gpu(without);
    let own = options(Accumulator::Fixed);
    let crowded = crowded().into_iter().map(|(scene, camera)| ("crowded".to_owned(), scene, camera, own.clone()));
    let hard = cases().unwrap().into_iter().map(|case| {
        let options = Settings { maps: case.maps(), ..case.options };
        (case.name, case.scene, case.camera, options)
    });
    let mut seen = [false; 2];
    let broken = [("high - from_low", "high"), ("from_low + from_high", "from_low")].map(|(from, to)| {
        let sources = Sources::default().replace("accumulator_fixed_pairs.wgsl", from, to).unwrap();
        common::gpu().map(|gpu| Backend::Gpu { gpu: Box::new(gpu), sources }).unwrap()
    });
    let mut noticed = [false; 2];
    for (number, (name, scene, camera, options)) in crowded.chain(hard).enumerate() {
        let all_noticed = seen == [true; 2] && noticed == [true; 2];
        if all_noticed && !common::takes(number, 6) {
            continue;
        }
        let options = Settings { accumulator: own.accumulator, ..options };
        let [(one, report), (other, plain)] =
            [&with, &without].map(|backend| render(&scene, &camera, &options, backend, &()).unwrap());
        assert!(report.needs.contains(&"atomics-u64") && !plain.needs.contains(&"atomics-u64"));
        seen[usize::from(report.needs.contains(&"wide-sums"))] = true;
        assert!(bits(&one) == bits(&other), "{name}: other bits without 64-bit atomics");
        // Most of a case's time goes to compiling kernels, so each control runs only until it is
        // noticed.
        for (backend, noticed) in broken.iter().zip(&mut noticed).filter(|(_, noticed)| !**noticed) {
            let (frame, _) = render(&scene, &camera, &options, backend, &()).unwrap();
            *noticed = bits(&frame) != bits(&other);
        }
    }
    assert_eq!(seen, [true; 2], "both widths of terms");
    assert_eq!(noticed, [true; 2], "wrong carries are not noticed");
}

/// A control must be noticed by more cases than this.
const ENOUGH: u32 = 3;

/// Skipping hidden splats does not change a bit; skipping too many does. A plain run draws every
/// third hard case.
#[test]
fn hidden_splats_do_not_change_a_bit() {
    let Some(own) = common::gpu().map(Backend::gpu) else { return };
    let with = |to: &str| {
        let sources = Sources::default().replace("occlusion.wgsl", "reached > farthest_accepted(", to).unwrap();
        common::gpu().map(|gpu| Backend::Gpu { gpu: Box::new(gpu), sources }).unwrap()
    };
    let none = with("1e-9 * reached > farthest_accepted(");
    let too_many = with("1.05 * reached > farthest_accepted(");
    let crowded =
        crowded().into_iter().map(|(scene, camera)| ("crowded".to_owned(), scene, camera, options(Accumulator::Fixed)));
    let taken = cases().unwrap().into_iter().enumerate().filter(|(k, _)| common::takes(*k, 5));
    let hard = taken.map(|(_, case)| (case.name, case.scene, case.camera, case.options));
    let mut noticed = 0;
    for (name, scene, camera, options) in crowded.chain(hard) {
        let shown = |backend| bits(&render(&scene, &camera, &options, backend, &()).unwrap().0);
        let all = shown(&none);
        assert!(shown(&own) == all, "{name}: skipping hidden splats changes bits");
        // Most of a case's time goes to compiling kernels, so the control runs only until it is
        // noticed often enough.
        noticed += u32::from(noticed <= ENOUGH && shown(&too_many) != all);
    }
    assert!(noticed > ENOUGH, "{noticed}");
}

/// Skipping batches that are hidden or out of view does not change a bit; skipping too many does.
#[test]
fn batches_left_out_do_not_change_a_bit() {
    let Some(gpu) = common::gpu() else { return };
    // Several pages but one band: the sums of 128 x 128 pixels need 1.5 MB.
    let Some(small) = common::gpu() else { return };
    let runs = [
        (gpu, vec![LowPass::None, LowPass::Max, LowPass::Ewa]),
        (small.with_buffer_limit(1_600_000), vec![LowPass::None]),
    ];
    let replaced = |from, to| Sources::default().replace("cull.wgsl", from, to).unwrap();
    let shown = |sources: &Sources| sources.clone().replace("cull.wgsl", "return true;", "return false;").unwrap();
    let every = replaced("!near && any(pixels.first > pixels.last)", "false");
    let wrong = replaced("!(reached > deepest_accepted(", "!(1.5 * reached > deepest_accepted(");
    let scene = sphere(200_000, 1.5);
    // The control needs fragments at the back of the sphere: its epsilon is deep enough for them,
    // and this scene shows both sides of its surfels.
    let without_sides = Scene { oriented: false, ..scene.clone() };
    let look = |eye: DVec3, lens| Camera::look_at((128, 128), lens, eye, DVec3::ZERO, None, Up::Y, 1e-3).unwrap();
    let outside = DVec3::new(1.0, 0.7, 3.0);
    let views = [
        ("outside", look(outside, Lens::Fov(45.0)), 0.85),
        ("parallel", look(outside, Lens::OrthographicHeight(2.2)), 0.95),
        ("close", look(outside * 0.4, Lens::Fov(30.0)), 0.6),
        ("inside", look(DVec3::new(0.1, 0.2, 0.6), Lens::Fov(60.0)), 0.6),
    ];
    for (gpu, low_passes) in runs {
        let mut backend = Backend::gpu(gpu);
        let mut frame = |sources: Sources, scene: &Scene, camera: &Camera, options: &Settings| {
            if let Backend::Gpu { sources: kept, .. } = &mut backend {
                *kept = sources;
            }
            render(scene, camera, options, &backend, &()).unwrap()
        };
        for low_pass in low_passes {
            for (name, camera, most) in &views {
                let options = Settings { low_pass, ..options(Accumulator::Fixed) };
                let (own, report) = frame(Sources::default(), &scene, camera, &options);
                let (all, of_all) = frame(shown(&every), &scene, camera, &options);
                assert!(bits(&own) == bits(&all), "{name}: skipping batches changes bits");
                assert!(report.needs.contains(&"cull"));
                let drawn = [report, of_all].map(|report| report.splats_drawn);
                let share = drawn[0] as f64 / scene.surfels.len() as f64;
                assert!(share <= *most, "{name}: {share} of the surfels are drawn");
                assert!(drawn[0] <= drawn[1], "{name}: {drawn:?}");
            }
            let (_, camera, _) = &views[0];
            let options = Settings { low_pass, epsilon: Epsilon::Absolute(1.9), ..options(Accumulator::Fixed) };
            let (own, _) = frame(Sources::default(), &without_sides, camera, &options);
            let (less, _) = frame(wrong.clone(), &without_sides, camera, &options);
            assert!(bits(&own) != bits(&less), "wrongly skipped batches are not noticed");
        }
    }
}

const ADD_TO_CHANNEL: &str = "atomicAdd(&sums[pixel * CHANNELS + channel], value)";

#[test]
fn pages_and_bands_do_not_change_a_bit() {
    let Some(whole) = common::gpu() else { return };
    let all = common::accumulators(&whole);
    let whole = Backend::gpu(whole);
    for row in all.into_iter().filter(|row| row.deterministic) {
        let (name, options) = (row.name, options(row.of));
        // Buffers of `one_row` bytes hold a band of one row (160 pixels of 12 sums or 10 image
        // words) and pages of about 200 surfels.
        let one_row = 160 * 4 * u64::from(12 * row.words).max(10) + 700;
        for limit in [one_row, 40_000] {
            let Some(small) = common::gpu() else { return };
            let small = small.with_buffer_limit(limit);
            assert_eq!(small.buffer_limit(), limit);
            let (scene, camera) = crowded().remove(1);
            if row.of == Accumulator::Fixed {
                let refused = stages(&scene, &camera, &options, &small, &Sources::default());
                assert!(refused.unwrap_err().to_string().contains("bands"));
            }
            assert!(small.adapter.page_len(size_of::<Splat>()) < scene.surfels.len() as u64 / 2);
            let small = Backend::gpu(small);
            for (scene, camera) in scenes(row) {
                let one = frame(&scene, &camera, &options, &whole);
                let many = frame(&scene, &camera, &options, &small);
                assert!(bits(&one) == bits(&many), "{name}: {limit} bytes a buffer give another image");
            }
        }
    }
}

/// Overlapping disks of many sizes, tilts and colours, with thousands of fragments on a pixel.
fn pile() -> (Scene, Camera) {
    let mut random = Random(21);
    let mut surfels = Vec::new();
    let mut colors = Vec::new();
    for _ in 0..3000 {
        let mut at = |reach: f64| random.between(-reach, reach) as f32;
        let center = Vec3::new(at(8.0), at(8.0), 50.0 + at(1.0));
        let normal = Vec3::new(at(0.3), at(0.3), -1.0);
        surfels.push(Surfel::disk(center, normal, 18.0 + at(8.0)));
        colors.push([0.5 + at(0.5), 0.5 + at(0.5), 0.5 + at(0.5), 1.0]);
    }
    let scene = Scene {
        origin: DVec3::ZERO,
        surfels,
        low: vec![],
        colors: Colors::Linear(colors),
        oriented: true,
        up: Up::Y,
        ..Scene::default()
    };
    (scene, front(16))
}

/// Frames of order-dependent accumulators may differ from run to run; their means stay within the
/// stated bounds.
#[test]
fn sums_that_show_the_order_stay_within_their_bounds() {
    let Some(gpu) = common::gpu() else { return };
    let all = common::accumulators(&gpu);
    let backend = Backend::gpu(gpu);
    let (scene, camera) = pile();
    let with = |accumulator| Settings {
        shading: Shading::Unlit,
        epsilon: Epsilon::Absolute(100.0),
        kernel: Kernel::Gaussian { sigma: 0.5 },
        ..options(accumulator)
    };
    let exact = frame(&scene, &camera, &with(Accumulator::Fixed), &backend);
    let (counts, weights) = (exact.map(Map::Count).unwrap(), exact.map(Map::Weight).unwrap());
    let fewest = counts.iter().copied().fold(f32::INFINITY, f32::min);
    assert!(fewest > 1000.0, "only {fewest} fragments on a pixel");
    for row in all.into_iter().filter(|row| !row.deterministic) {
        let runs: Vec<Frame> =
            (0..6).map(|seed| frame(&shuffled(&scene, 40 + seed / 2), &camera, &with(row.of), &backend)).collect();
        let repeated = runs.chunks_exact(2).any(|pair| bits(&pair[0]) != bits(&pair[1]));
        let reordered = runs.iter().any(|run| bits(run) != bits(&runs[0]));
        let words = |differ| if differ { "differ" } else { "happen not to differ" };
        eprintln!("{}: repeated runs {}, reordered ones {}", row.name, words(repeated), words(reordered));
        let mut used = 0f64;
        for run in &runs {
            assert_eq!(run.map(Map::Count), exact.map(Map::Count), "{}", row.name);
            for pixel in 0..camera.pixels() {
                let (n, w) = (counts[pixel].into(), weights[pixel].into());
                // Both frames have errors. Both are mapped from [0, 1] in f32, to ranges of at most
                // 1.
                let bound = (row.error_bound)(n, w, 24) + (Accumulator::Fixed.row().error_bound)(n, w, 24);
                for k in 0..3 {
                    let difference = f64::from((run.color[pixel][k] - exact.color[pixel][k]).abs());
                    used = used.max(difference / bound);
                    assert!(difference <= bound, "{}: {difference:e} over {bound:e} at {pixel}", row.name);
                }
                let weight = f64::from((run.map(Map::Weight).unwrap()[pixel] - weights[pixel]).abs());
                assert!(weight <= w * (n + 2.0) * E, "{}: weight at {pixel}", row.name);
            }
        }
        eprintln!("{}: at most {used:.3} of the bound, {fewest} fragments and more on a pixel", row.name);
    }
}
