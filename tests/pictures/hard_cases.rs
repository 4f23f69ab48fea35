//! Cases that renderers often draw wrong: the GPU against the f64 reference.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::collections::BTreeMap;

use common::judged::judge;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::hardcases::{self, HardCase, Verdict};
use epsplat::low_level::plan::{Accumulator, AccumulatorRow, Optimisation, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Colors, Lens, Scene, Surfel, Up};
use glam::{DVec3, Vec3};

/// Judges a picture of `surfels` against the reference; `covered` is the expected share of covered
/// pixels, within 0.02. Each disk has its own colour, so that every attribute is summed.
fn check(name: &str, surfels: Vec<Surfel>, camera: &Camera, covered: f64) {
    let Some(gpu) = common::gpu() else { return };
    let colors = Colors::Srgb8((0..surfels.len()).map(|i| [40 * (i as u8 % 6), 90, 200, 255]).collect());
    let scene =
        Scene { origin: DVec3::ZERO, surfels, low: vec![], colors, oriented: true, up: Up::Y, ..Scene::default() };
    judge(name, (&scene, camera), Settings::default(), (covered - 0.02, covered + 0.02), &Backend::gpu(gpu));
}

fn pinhole(size: (u32, u32)) -> Camera {
    Camera::look_at(size, Lens::Fov(60.0), DVec3::ZERO, DVec3::Z, Some(DVec3::NEG_Y), Up::Y, 1e-3).unwrap()
}

fn orthographic(size: (u32, u32)) -> Camera {
    let lens = Lens::OrthographicHeight(4.0);
    Camera::look_at(size, lens, DVec3::ZERO, DVec3::Z, Some(DVec3::NEG_Y), Up::Y, 1e-3).unwrap()
}

#[test]
fn one_disk_of_a_million_pixels_is_drawn_to_its_last_row() {
    // Each disk covers more than 65,535 pixels: llvmpipe ends a loop after that many iterations.
    let disks = vec![Surfel::disk(Vec3::new(0.1, 0.2, 3.0), Vec3::new(0.1, 0.2, -1.0), 30.0); 2];
    check("pinhole", disks.clone(), &pinhole((1100, 1000)), 1.0);
    check("orthographic", disks, &orthographic((1100, 1000)), 1.0);
}

#[test]
fn a_disk_whose_centre_is_millions_of_pixels_away_still_covers_the_image() {
    let disk = |x: f32, radius: f32| Surfel::disk(Vec3::new(x, 0.0, 5.0), Vec3::new(0.0, 0.0, -1.0), radius);
    check("pinhole", vec![disk(6e5, 1e6)], &pinhole((64, 48)), 1.0);
    check("orthographic", vec![disk(6e5, 1e6)], &orthographic((64, 48)), 1.0);
}

#[test]
fn disks_through_and_around_the_camera_show_their_part_in_front() {
    // The floor under the camera fills the lower half.
    let floor = Surfel::disk(Vec3::new(0.0, 1.0, 0.0), Vec3::NEG_Y, 1000.0);
    check("floor", vec![floor], &pinhole((160, 120)), 0.5);
    let behind = Surfel::disk(Vec3::new(0.0, 1.0, -5.0), Vec3::NEG_Y, 20.0);
    check("centre behind", vec![floor, behind], &pinhole((160, 120)), 0.5);
    // The camera lies in this disk's plane and inside its rim: exactly edge-on, so nothing shows.
    let around = Surfel::disk(Vec3::ZERO, Vec3::Y, 10.0);
    check("camera inside", vec![around, floor], &pinhole((160, 120)), 0.5);
    check("nothing", vec![Surfel::disk(Vec3::new(0.0, 0.0, -2.0), Vec3::Z, 1.0)], &pinhole((16, 16)), 0.0);
}

#[test]
fn odd_image_sizes_work() {
    let disks = vec![Surfel::disk(Vec3::new(0.0, 0.0, 3.0), Vec3::new(1e-4, 2e-4, -1.0), 30_000.0); 3];
    for size in [(1, 1), (17, 3), (4097, 1), (1, 300)] {
        check("pinhole", disks.clone(), &pinhole(size), 1.0);
        check("orthographic", disks.clone(), &orthographic(size), 1.0);
    }
}

/// Whether an accumulator's sums have the same bits in every order.
fn sums_integers(accumulator: &str) -> bool {
    ["fixed", "fixed32", "fixed64", "packed64"].contains(&accumulator)
}

/// One line of `tests/golden/hardcases.txt`.
fn told(case: &str, accumulator: &str, bits: &BTreeMap<&'static str, String>) -> String {
    let hashes: Vec<_> = bits.iter().map(|(map, hash)| format!("{map} {hash}")).collect();
    format!("{case}, {accumulator}: {}", hashes.join(" "))
}

/// Compares the bits of pictures with those that all adapters have. The file that `EPSPLAT_CASES`
/// names gets the lines.
fn compare_with_kept(made: &[String]) {
    if let Ok(path) = std::env::var("EPSPLAT_CASES") {
        std::fs::write(path, made.join("\n") + "\n").unwrap();
    }
    let kept: Vec<&str> = include_str!("../golden/hardcases.txt").lines().collect();
    let other: Vec<_> = made.iter().filter(|line| !kept.contains(&line.as_str())).collect();
    assert!(!made.is_empty() && other.is_empty(), "{} of {} differ: {other:#?}", other.len(), made.len());
}

/// Draws some cases on an adapter, and compares the bits with those of all adapters.
fn drawn(gpu: Gpu, without: &[Optimisation], chosen: impl Fn(usize, &HardCase) -> bool) {
    let backend = Backend::gpu(gpu);
    let cases = hardcases::cases().unwrap();
    let chosen = cases.iter().enumerate().filter(|(k, case)| chosen(*k, case));
    let made = chosen.map(|(_, case)| {
        let without = [&case.options.without, without].concat();
        let options = Settings { maps: case.maps(), without, ..case.options.clone() };
        let (frame, _) = render(&case.scene, &case.camera, &options, &backend, &()).unwrap();
        told(&case.name, options.accumulator.name(), &frame.hashes())
    });
    compare_with_kept(&made.collect::<Vec<_>>());
}

/// Compilers of OpenGL take seconds for a case, so it draws a case of ten.
#[test]
fn hard_cases_have_the_same_bits_by_opengl() {
    let Some(gpu) = common::opengl() else { return };
    drawn(gpu, &[Optimisation::Division], |k, _| k % 10 == 0);
}

/// The f32 twin is slow, so it draws small pictures of few surfels.
#[test]
fn hard_cases_have_the_same_bits_by_the_f32_twin() {
    let light = |case: &HardCase| case.camera.pixels() <= 4096 && case.scene.surfels.len() <= 1000;
    drawn(Gpu::open(Some("twin")).unwrap(), &[], |k, case| k % 4 == 0 && light(case));
}

/// Draws every case with the accumulator `fixed`, with those that it excuses, and with one of the
/// others in turn; a thorough run draws it with every accumulator that the adapter supports.
#[test]
fn every_hard_case_passes_or_fails_as_expected() {
    let Some(backend) = common::gpu().map(Backend::gpu) else { return };
    let cases = hardcases::cases().unwrap();
    let all = hardcases::supported(&backend);
    let of_case = |(number, case): (usize, &HardCase)| {
        let is_taken = |(k, row): &(usize, &&'static AccumulatorRow)| {
            let excused = case.expected.iter().any(|excused| excused.accumulator == row.of);
            row.of == Accumulator::Fixed || excused || common::takes(number + k, all.len() - 1)
        };
        let taken: Vec<_> = all.iter().enumerate().filter(is_taken).map(|(_, row)| *row).collect();
        hardcases::run(std::slice::from_ref(case), &taken, &backend, &()).unwrap()
    };
    let rows: Vec<_> = cases.iter().enumerate().flat_map(of_case).collect();
    let drawn: std::collections::BTreeSet<_> = rows.iter().map(|row| row.accumulator).collect();
    assert_eq!(drawn.len(), all.len());
    for row in &rows {
        assert!(!row.failed(), "{} with {}: {row:#?}", row.case, row.accumulator);
        if ["fixed", "fixed64"].contains(&row.accumulator) {
            assert_eq!(row.verdict, Verdict::Pass, "{row:#?}");
        }
        assert!(row.over_float.is_none(), "{row:#?}");
    }
    let made = rows.iter().filter(|row| sums_integers(row.accumulator));
    compare_with_kept(&made.map(|row| told(&row.case, row.accumulator, &row.bits)).collect::<Vec<_>>());
    // An expected failure that does not occur must be deleted from its case.
    for case in &cases {
        for excused in &case.expected {
            let row = rows.iter().find(|row| row.case == case.name && row.accumulator == excused.accumulator.name());
            let needs = row.is_none_or(|row| matches!(row.verdict, Verdict::ExpectedFailure(_)));
            assert!(needs, "{} keeps the bound of {:?} and has an excuse", excused.accumulator, case.name);
        }
    }
}

/// Controls: a kernel broken in one place must fail the case that was made for that place.
#[test]
fn a_broken_kernel_fails_a_hard_case() {
    let cases = hardcases::cases().unwrap();
    let broken = [
        (
            "accumulator_fixed.wgsl",
            "atomicAdd(&sums[2u * (pixel * CHANNELS + channel) + 1u], 1u);",
            "",
            "a million disks on a pixel",
        ),
        ("terms.wgsl", "= FIXED_ONE;", "= 1048576.0;", "intersecting sheets"),
        (
            "terms_wide.wgsl",
            "weight * clamp(value, 0.0, 1.0)",
            "65536.0 * floor(weight * value / 65536.0)",
            "only the kernel's tail, smooth",
        ),
        ("accumulator_fixed_wide.wgsl", "select(0u, 1u, before + term.x < before)", "0u", "alpha of 1/255"),
        ("accumulator_fixed_pairs.wgsl", "from_low + from_high", "from_low", "a million disks on a pixel"),
        ("double.wgsl", "(a - (sum - part)) + (b - part)", "0.0", "1/100 pixel"),
        ("rows.wgsl", "(a - rows.a) + vec3<f32>(", "(a - a) + 0.0 * vec3<f32>(", "anisotropy 1000:1"),
        ("perspective.wgsl", "vec2<f32>(min(extent.x, k), max(extent.y, k))", "extent", "across the near depth"),
        ("perspective.wgsl", "chord_1) + blur)", "chord_1) - 0.5)", "across the near depth"),
        ("center.wgsl", "d.low - held.eye_low[i]", "d.low", "UTM, a kilometre off"),
        ("center.wgsl", "surfel.center[i] * held.unit", "surfel.center[i]", "coordinates of 1e12"),
        ("nearest_depth.wgsl", "kept_depth(bitcast", "NOTHING - kept_depth(bitcast", "intersecting sheets"),
        (
            "side.wgsl",
            "fragment.depth <= farthest",
            "fragment.depth * 1.000004 <= farthest",
            "sheets 3e-6 about epsilon",
        ),
        ("epsilon_ray.wgsl", " * along_axis(image)", "", "epsilon along the ray"),
        ("side.wgsl", "&& same_side", "", "fronts and backs that cross"),
        ("side.wgsl", "select(0u, SIDE_BIT,", "select(SIDE_BIT, 0u,", "fronts and backs that cross"),
        ("side.wgsl", "~SIDE_BIT", "~(64u * SIDE_BIT)", "fronts and backs that cross"),
        (
            "blend.wgsl",
            "clamp(kernel_weight(fragment.rho2), KERNEL_FLOOR, 1.0)",
            "kernel_weight(fragment.rho2)",
            "only the kernel's tail, smooth",
        ),
        ("kernel_ellipse.wgsl", "pow(rho2, 0.5 * KERNEL_N)", "pow(rho2, 0.501 * KERNEL_N)", "a kernel of exp(-50)"),
        ("kernel_cone.wgsl", "height * sqrt(height)", "height * height", "a cone's rim"),
        ("color_sums.wgsl", "held.color_low + held.color_span", "held.color_span", "negative colours"),
        ("project.wgsl", "floor(h.high + margin - 0.5)", "floor(h.high + margin - 1.5)", "image edges and corners"),
        ("clip.wgsl", "line.x * turn.x + line.y * turn.y", "line.x * turn.x - line.y * turn.y", "disks cut by lines"),
        ("clip.wgsl", "dot3(clip.second, p) < 0.0", "dot3(clip.second, p) < 0.01", "disks cut by lines"),
        ("clip.wgsl", "dot3(clip.first, p) < 0.0", "dot3(clip.first, p) < -0.01", "two halves of a disk"),
        ("clip.wgsl", "second.zw", "second.wz", "triangles cut by lines"),
        ("outline.wgsl", "farthest > OUTLINE_COS", "farthest > 1.001 * OUTLINE_COS", "triangles cut by lines"),
        (
            "outline.wgsl",
            "2.0 * OUTLINE_COS * OUTLINE_SIN",
            "2.002 * OUTLINE_COS * OUTLINE_SIN",
            "caps of sixteen sides",
        ),
        (
            "facing.wgsl",
            "rise(select(rho2, dot2(beside, beside), SQUARE)) * radius_across",
            "0.9999 * rise(select(rho2, dot2(beside, beside), SQUARE)) * radius_across",
            "cones through each other",
        ),
        ("facing.wgsl", "1.0 && depth >= held.near", "1.0", "spheres at the near depth"),
        (
            "facing.wgsl",
            "min(dot2(beside, beside), largest2(own))",
            "dot2(beside, beside)",
            "points of 0 and 50 pixels",
        ),
        ("axes_facing.wgsl", "MOST_RADIUS * row", "1.0001 * MOST_RADIUS * row", "points of 0 and 50 pixels"),
        ("resolve_samples.wgsl", "f32(SAMPLES_ACROSS * SAMPLES_DOWN)", "16.001", "16 samples, thin parts"),
        ("resolve.wgsl", "straight.rgb * straight.a", "straight.rgb", "16 samples, thin parts"),
        ("layers.wgsl", "= max(so_far.farthest, ", "= min(so_far.farthest, ", "layers closer than epsilon"),
        ("layers.wgsl", "if (is_last) {", "if (is_last && false) {", "a tail of most of the weight"),
        (
            "fragments_sort.wgsl",
            "child + 1u < count && precedes(",
            "child + 1u < count && !precedes(",
            "a hundred layers",
        ),
        (
            "fragments_ranked.wgsl",
            "rank_at(a.y) < rank_at(b.y)",
            "rank_at(b.y) < rank_at(a.y)",
            "many at one place, one by one",
        ),
        ("resolve_lists.wgsl", "(1.0 - straight.a)", "(1.0 - 1.001 * straight.a)", "sheets behind one another"),
        ("resolve_lists.wgsl", "straight.rgb, 1.0", "straight.rgb, 1.00001", "alphas of nothing and nearly all"),
        ("camera_orthographic.wgsl", "h.away == 0.0", "abs(h.away) < 1e-3", "edge-on, askew, orthographic"),
    ];
    let mut unnoticed = Vec::new();
    for (file, from, to, name) in broken {
        let sources = Sources::default().replace(file, from, to).unwrap();
        let Some(gpu) = common::gpu_for(file) else { return };
        if file == "accumulator_fixed_pairs.wgsl" && !gpu.adapter.atomics_u64 {
            eprintln!("skipped: no 64-bit atomics for {file}");
            continue;
        }
        let backend = Backend::Gpu { gpu: Box::new(gpu), sources };
        let case = cases.iter().find(|case| case.name == name).unwrap();
        let truth = case.truth().unwrap();
        let row = case.judge(&truth, Accumulator::Fixed.row(), &backend).unwrap();
        if !row.failed() {
            unnoticed.push(format!("{name}: {file}, {from:?}"));
        }
    }
    assert!(unnoticed.is_empty(), "{unnoticed:#?}");
}

#[test]
fn the_list_is_complete_and_its_names_are_its_own() {
    let cases = hardcases::cases().unwrap();
    let mut names: Vec<_> = cases.iter().map(|case| case.name.as_str()).collect();
    assert!(names.len() >= 60);
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), cases.len());
    assert!(cases.iter().all(|case| !case.about.is_empty() && !case.bound.is_empty()));
    let million = cases.iter().find(|case| case.name == "a million disks on a pixel").unwrap();
    assert_eq!(million.scene.surfels.len(), 1_000_000);
}
