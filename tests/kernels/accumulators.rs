//! Tests every accumulator, with every kernel and form of epsilon, against the f64 reference.
//!
//! A pixel may differ by at most the stated bound of the sums plus the derived uncertainty of the
//! fragments' weights. Also tests overflowing sums.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use common::enclosure::{Pixel, enclose};
use common::scenes::{sphere, sphere_camera, stack};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::layout::View;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::hardcases::precision::E;
use epsplat::low_level::passes::project::reference_all;
use epsplat::low_level::plan::{Accumulator, AccumulatorRow, Facts, Organisation, Settings};
use epsplat::low_level::render::{Backend, Renderer, render};
use epsplat::low_level::scene::{Camera, Colors, Epsilon, Kernel, Map, Maps, Projection, Scene, Shading, Surfel};
use glam::{DVec3, Vec3};

const KERNELS: [&str; 7] =
    ["gaussian", "ellipse:6,3", "ellipse:6,3,smooth", "hat", "constant", "ellipse:20,3", "cone:1.5"];
const EPSILONS: [Epsilon; 4] =
    [Epsilon::Relative(0.02), Epsilon::Absolute(0.05), Epsilon::Radius(0.4), Epsilon::Ray(0.05)];

/// A scene with the reference frame and the bounds that a device's frame is compared with.
struct Case {
    name: String,
    scene: Scene,
    camera: Camera,
    options: Settings,
    reference: Frame,
    enclosure: Vec<Pixel>,
    view: View,
}

/// A sphere of overlapping disks behind three tilted disks that fill the image. One invocation
/// draws each small disk, a workgroup each large one.
fn case(kernel: &str, epsilon: Epsilon, projection: Projection) -> Case {
    let mut scene = sphere(2500, 2.0);
    let camera = sphere_camera(96, projection);
    let Colors::Srgb8(codes) = &mut scene.colors else { unreachable!() };
    for k in 0..3u8 {
        let back = -camera.rotation.row(2).as_vec3();
        let tilt = Vec3::new(0.2, 0.1 * f32::from(k), -0.1);
        scene.surfels.push(Surfel::disk(back * (-1.3 - 0.02 * f32::from(k)), back + tilt, 4.0));
        codes.push([90 * k, 255 - 100 * k, 30, 255]);
    }
    let options = Settings {
        epsilon,
        kernel: kernel.parse().unwrap(),
        shading: Shading::Unlit,
        maps: Maps::ON_DEVICE,
        ..Default::default()
    };
    let (reference, _) = render(&scene, &camera, &options, &Backend::Reference, &()).unwrap();
    let enclosure = enclose(&scene, &camera, &options, &reference_all(&scene, &camera, &options));
    let view = View::new(&Facts::of(&scene), &camera, &options);
    Case { name: format!("{kernel}, {epsilon:?}, {projection:?}"), scene, camera, options, reference, enclosure, view }
}

fn cases() -> Vec<Case> {
    let mut all = Vec::new();
    for (k, kernel) in KERNELS.into_iter().enumerate() {
        for (e, epsilon) in EPSILONS.into_iter().enumerate() {
            let projection = [Projection::Pinhole, Projection::Orthographic][(k + e) % 2];
            all.push(case(kernel, epsilon, projection));
        }
    }
    all
}

/// Counts of compared pixels, and violations of the bounds.
#[derive(Default)]
struct Findings {
    covered: usize,
    open: usize,
    wrong: Vec<String>,
    /// The largest difference as a fraction of its bound, for colour, depth, normal and weight.
    used: [f64; 4],
}

fn compare(case: &Case, row: &AccumulatorRow, device: &Frame) -> Findings {
    let mut findings = Findings::default();
    let (low, high) = case.scene.color_range();
    let fraction_bits = row.fraction_bits(case.scene.surfels.len() as u64);
    let map = |map: Option<&[f32]>, pixel: usize| f64::from(map.as_ref().unwrap()[pixel]);
    for (pixel, known) in case.enclosure.iter().enumerate() {
        let twin = &case.reference;
        let (n, weight) = (map(twin.map(Map::Count), pixel), map(twin.map(Map::Weight), pixel));
        if !known.decided() {
            findings.open += 1;
            continue;
        }
        if (map(device.map(Map::Count), pixel), n) != (f64::from(known.count.0), f64::from(known.count.0)) {
            findings.wrong.push(format!("count {} not {n} at {pixel}", map(device.map(Map::Count), pixel)));
        }
        if n == 0.0 {
            if device.color[pixel] != [0.0; 4] || map(device.map(Map::Weight), pixel) != 0.0 {
                findings.wrong.push(format!("{:?} where nothing is, at {pixel}", device.color[pixel]));
            }
            continue;
        }
        findings.covered += 1;
        let mut check = |which: usize, difference: f64, bound: f64| {
            findings.used[which] = findings.used[which].max(difference / bound);
            if difference > bound || difference.is_nan() {
                let map = ["colour", "depth", "normal", "weight"][which];
                findings.wrong.push(format!("{map}: {difference:e} over {bound:e} at {pixel}"));
            }
        };
        let sums = (row.error_bound)(n, weight, fraction_bits);
        // The relative uncertainty of the weights bounds the change of the means. Attributes are
        // mapped to [0, 1] in f32, which adds 8 E.
        let weights = (known.weight.high - known.weight.low) / weight;
        let mean = sums + weights + 8.0 * E;
        for k in 0..4 {
            // A colour is rounded twice more, relative to its own magnitude.
            let range = f64::from(high[k]) - f64::from(low[k]);
            let (a, b) = (f64::from(device.color[pixel][k]), f64::from(twin.color[pixel][k]));
            check(0, (a - b).abs(), range * mean + 4.0 * E * b);
        }
        let front = known.nearest.low;
        let depth = (map(device.map(Map::Depth), pixel), map(twin.map(Map::Depth), pixel));
        let behind = common::depth_span(&case.view, front);
        check(1, (depth.0 - depth.1).abs(), behind * mean + depth.1 * (known.depth_error + 4.0 * E));
        let normals = [device, twin].map(|f| Vec3::from_array(f.normals().unwrap()[pixel]).as_dvec3());
        // Components have a range of 2. The mean is normalised, so a short mean magnifies its
        // error.
        if known.normal.iter().any(|sum| (2.0 * sum.low / known.weight.high - 1.0).abs() > 0.6) {
            check(2, (normals[0] - normals[1]).length(), 2.0 * 3f64.sqrt() * mean / 0.6 + 4.0 * E);
        }
        let width = known.weight.high - known.weight.low;
        check(3, (map(device.map(Map::Weight), pixel) - weight).abs(), width + weight * sums);
    }
    findings
}

/// Renders with the accumulator `row`, and fails if the frame fell back to another one.
fn run(case: &Case, row: &AccumulatorRow, backend: &Backend) -> Findings {
    let options = Settings { accumulator: row.of, ..case.options.clone() };
    let (frame, report) = render(&case.scene, &case.camera, &options, backend, &()).unwrap();
    assert_eq!((report.accumulator, report.overflows), (row.name, 0), "{}", case.name);
    compare(case, row, &frame)
}

#[test]
fn every_accumulator_kernel_and_epsilon_matches_the_reference() {
    let Some(gpu) = common::gpu() else { return };
    let all = common::accumulators(&gpu);
    let backend = Backend::gpu(gpu);
    let cases = cases();
    for (number, row) in all.into_iter().enumerate() {
        let mut used = [0f64; 4];
        let is_taken = |k: usize| row.of == Accumulator::Fixed || common::takes(number + k, 4);
        for (_, case) in cases.iter().enumerate().filter(|(k, _)| is_taken(*k)) {
            let findings = run(case, row, &backend);
            let some: Vec<_> = findings.wrong.iter().take(5).collect();
            assert!(some.is_empty(), "{}, {}: {} wrong: {some:#?}", row.name, case.name, findings.wrong.len());
            assert!(findings.covered > 9000, "{}: {} covered", case.name, findings.covered);
            assert!(findings.open < 90, "{}: {} open", case.name, findings.open);
            used = std::array::from_fn(|k| used[k].max(findings.used[k]));
        }
        eprintln!("{}: at most {used:.2?} of the bounds of colour, depth, normal, weight", row.name);
    }
}

fn broken(file: &str, from: &str, to: &str, gpu: Gpu) -> Backend {
    Backend::Gpu { gpu: Box::new(gpu), sources: Sources::default().replace(file, from, to).unwrap() }
}

#[test]
fn a_broken_accumulator_kernel_or_epsilon_is_noticed() {
    let Some(gpu) = common::gpu() else { return };
    let noticed = |case: &Case, row: &AccumulatorRow, file: &str, from: &str, to: &str| {
        // On an adapter with optional features, `fixed` may consist of other WGSL files.
        let gpu = if row.of == Accumulator::Fixed { common::gpu_for(file) } else { common::gpu() };
        let Some(gpu) = gpu else { return };
        let findings = run(case, row, &broken(file, from, to, gpu));
        assert!(findings.wrong.len() >= 20, "{file} with {to}: only {} differences", findings.wrong.len());
    };
    let plain = case("ellipse:6,3", EPSILONS[0], Projection::Pinhole);
    for row in common::accumulators(&gpu) {
        let terms = match row.of {
            Accumulator::Fixed => "terms.wgsl",
            Accumulator::Fixed64 => "terms_wide.wgsl",
            _ => row.file,
        };
        noticed(&plain, row, terms, "clamp(value, 0.0, 1.0)", "clamp(value * 1.0005, 0.0, 1.0)");
        noticed(&plain, row, row.file, "sum_at(pixel, WEIGHT_CHANNEL)", "1.0005 * sum_at(pixel, WEIGHT_CHANNEL)");
    }
    let row = Accumulator::Fixed.row();
    for (kernel, file, from, to) in [
        ("gaussian", "kernel_gaussian.wgsl", "-KERNEL_FALL", "-1.0005 * KERNEL_FALL"),
        ("ellipse:6,3,smooth", "kernel_ellipse.wgsl", "power) - KERNEL_STEP", "power)"),
        ("ellipse:6,3,smooth", "blend.wgsl", ", KERNEL_FLOOR, 1.0)", ", 0.0, 1.0)"),
        ("hat", "kernel_cone.wgsl", "sqrt(rho2)", "1.0005 * sqrt(rho2)"),
        ("cone:1.5", "kernel_cone.wgsl", "height * sqrt(height)", "height * height"),
        ("ellipse:20,3", "kernel_ellipse.wgsl", "rho2 * sqrt(rho2)", "rho2 * rho2"),
        ("constant", "kernel_constant.wgsl", "return 1.0", "return 0.9995"),
    ] {
        noticed(&case(kernel, EPSILONS[0], Projection::Pinhole), row, file, from, to);
    }
    let radius = case("hat", EPSILONS[2], Projection::Pinhole);
    let file = "epsilon_radius.wgsl";
    noticed(&radius, row, file, "min(norm3(s), norm3(t))", "1.05 * max(norm3(s), norm3(t))");
    noticed(&radius, row, file, "held.epsilon_radius * radius", "held.epsilon_deepest");
    let ray = case("hat", EPSILONS[3], Projection::Pinhole);
    noticed(&ray, row, "epsilon_ray.wgsl", " * along_axis(image)", "");
    let absolute = case("hat", EPSILONS[1], Projection::Pinhole);
    noticed(&absolute, row, "epsilon_depth.wgsl", "held.epsilon_absolute", "1.05 * held.epsilon_absolute");
}

#[test]
fn sums_that_do_not_fit_are_noticed_and_made_again() {
    let Some(gpu) = common::gpu() else { return };
    let all = common::accumulators(&gpu);
    let backend = Backend::gpu(gpu);
    let with =
        |accumulator| Settings { kernel: Kernel::Constant, maps: Maps::ON_DEVICE, accumulator, ..Default::default() };
    let exact = Accumulator::Fixed;
    // 255 full weights of 2^24 units fit in 32 bits, 256 do not.
    for (disks, fits) in [(200, true), (255, true), (256, false), (300, false), (100_000, false)] {
        let (scene, camera) = stack(disks, 0.3);
        let (expected, report) = render(&scene, &camera, &with(exact), &backend, &()).unwrap();
        assert_eq!((report.accumulator, report.overflows), (exact.name(), 0));
        assert!(expected.map(Map::Count).unwrap().iter().all(|count| *count == disks as f32));
        assert!(expected.map(Map::Weight).unwrap().iter().all(|weight| *weight == disks as f32));
        for row in &all {
            let (frame, report) = render(&scene, &camera, &with(row.of), &backend, &()).unwrap();
            let name = format!("{}, {disks} disks", row.name);
            if ["fixed32", "packed64"].contains(&row.name) && !fits {
                assert!(report.overflows > 0, "{name}: no overflow");
                assert_eq!(report.accumulator, exact.name(), "{name}");
                assert!(bits(&frame) == bits(&expected), "{name}: not what {exact} gives");
                let Some(gpu) = common::gpu() else { return };
                let counting =
                    if row.name == "fixed32" { "atomicAdd(&sums[0], 1u);" } else { "atomicAdd(&sums[0], 1lu);" };
                let blind = broken(row.file, counting, "", gpu);
                let (frame, report) = render(&scene, &camera, &with(row.of), &blind, &()).unwrap();
                assert_eq!((report.accumulator, report.overflows), (row.name, 0), "{name}");
                assert!(bits(&frame) != bits(&expected), "{name}: an overflow is not noticed");
            } else {
                assert_eq!((report.accumulator, report.overflows), (row.name, 0), "{name}");
                assert!(
                    frame.map(Map::Count) == expected.map(Map::Count)
                        && frame.map(Map::Weight) == expected.map(Map::Weight),
                    "{name}"
                );
                let n = disks as f64;
                // All terms are equal and the weights of `float` are exact, so the only error is
                // that of one colour sum.
                let bound = (row.error_bound)(n, n, row.fraction_bits(scene.surfels.len() as u64)) + 2.0 * E;
                let color = |frame: &Frame| f64::from(frame.color[9][0]);
                let apart = (color(&frame) - color(&expected)).abs();
                let own = (Accumulator::Fixed.row().error_bound)(n, n, 24);
                assert!(apart <= bound + own, "{name}: {apart:e} over {bound:e}");
            }
        }
    }
}

/// An overflow in one view does not affect the accumulator of the next.
#[test]
fn a_view_whose_sums_fit_is_rendered_as_asked_after_one_whose_do_not() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let (scene, camera) = stack(300, 0.3);
    let options = Settings {
        kernel: Kernel::Constant,
        maps: Maps::ON_DEVICE,
        accumulator: Accumulator::Fixed32,
        ..Settings::default()
    };
    let aside = Camera { eye: DVec3::new(15.0, 0.0, 0.0), near: 10.0, ..camera.clone() };
    let (alone, _) = render(&scene, &aside, &options, &backend, &()).unwrap();
    let mut renderer = Renderer::new(&scene, &options, &backend).unwrap();
    let views = [&camera, &aside, &camera, &aside].map(|view| renderer.frame(view, &()).unwrap());
    let told = views.each_ref().map(|(_, report)| (report.accumulator, report.overflows > 0));
    assert_eq!(told, [("fixed", true), ("fixed32", false), ("fixed", true), ("fixed32", false)]);
    assert!(bits(&views[1].0) == bits(&alone) && bits(&views[3].0) == bits(&alone));
    assert!(bits(&views[0].0) == bits(&views[2].0));
}

#[test]
fn a_scene_without_surfels_is_its_background() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let (full, camera) = stack(1, 0.3);
    let empty = Scene { surfels: vec![], colors: Colors::Constant([1.0; 4]), ..full };
    for organisation in [Organisation::Auto, Organisation::Scatter, Organisation::Tile] {
        let options = Settings { organisation, background: [0.1, 0.2, 0.3, 1.0], ..Settings::default() };
        let (frame, report) = render(&empty, &camera, &options, &backend, &()).unwrap();
        assert!(frame.color.iter().all(|color| *color == options.background), "{organisation:?}");
        assert_eq!((report.surfels, report.splats_drawn), (0, 0));
    }
}
