//! Results known exactly or in closed form, for every accumulator: colours, sums, resolve and
//! depths.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::UNIT;
use common::scenes::{crowded, front, sphere, sphere_camera_with, stack};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::layout::ONE;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::inspect::stages;
use epsplat::low_level::passes::accumulate::PixelSums;
use epsplat::low_level::passes::join::Beside;
use epsplat::low_level::passes::resolve;
use epsplat::low_level::plan::{AccumulatorRow, COLOR_CHANNEL, Optimisation, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::Lens;
use epsplat::low_level::scene::options::HIGHLIGHT;
use epsplat::low_level::scene::{Camera, Colors, Epsilon, Kernel, Map, Maps, Projection, Scene, Shading, Surfel, Up};
use glam::{DVec3, Vec3};

const E: f64 = 1.0 / 16_777_216.0;

fn options() -> Settings {
    Settings { maps: Maps::ON_DEVICE, epsilon: Epsilon::Relative(0.02), ..Default::default() }
}

fn frame(scene: &Scene, camera: &Camera, options: &Settings, backend: &Backend) -> Frame {
    render(scene, camera, options, backend, &()).unwrap().0
}

/// Disks on a grid in the plane z = `depth` that cover at least `size` x `size` pixels.
fn plane(size: i32, depth: f32) -> Vec<Surfel> {
    let at = |k: i32| 1.7 * k as f32 + 0.123 - size as f32 / 2.0;
    let cells = (-2..size * 10 / 17 + 3).flat_map(|y| (-2..size * 10 / 17 + 3).map(move |x| (x, y)));
    cells.map(|(x, y)| Surfel::disk(Vec3::new(at(x), at(y), depth), Vec3::NEG_Z, 2.5)).collect()
}

#[test]
fn a_plane_of_one_colour_is_exactly_that_colour() {
    let Some(gpu) = common::gpu() else { return };
    let all = common::accumulators(&gpu);
    let backend = Backend::gpu(gpu);
    for row in all {
        check_plane(row, &backend);
    }
}

fn check_plane(row: &AccumulatorRow, backend: &Backend) {
    let camera = front(64);
    let surfels = plane(64, 5.0);
    let options = Settings { shading: Shading::Unlit, accumulator: row.of, ..options() };
    let color = [0.123_456_7, 7.654_321, 0.333_333_34, 1.0];
    let code = [200, 17, 99, 255];
    let decoded = Colors::Srgb8(vec![code]).linear(0);
    for (colors, expected) in [
        (Colors::Constant(color), color),
        (Colors::Linear(vec![color; surfels.len()]), color),
        (Colors::Srgb8(vec![code; surfels.len()]), decoded),
    ] {
        let scene = Scene {
            origin: DVec3::ZERO,
            surfels: surfels.clone(),
            low: vec![],
            colors,
            oriented: true,
            up: Up::Y,
            ..Scene::default()
        };
        let frame = frame(&scene, &camera, &options, backend);
        let name = row.name;
        assert!(frame.color.iter().all(|pixel| *pixel == expected), "{name}: {:?} is not {expected:?}", frame.color[0]);
        assert!(
            frame.map(Map::Depth).unwrap().iter().all(|depth| (depth - 5.0).abs() <= 5.0 * 4.0 * E as f32),
            "{name}"
        );
        let (counts, weights) = (frame.map(Map::Count).unwrap(), frame.map(Map::Weight).unwrap());
        for (pixel, n) in frame.normals().unwrap().iter().enumerate() {
            let bits = row.fraction_bits(scene.surfels.len() as u64);
            let bound = 2.0 * (row.error_bound)(counts[pixel].into(), weights[pixel].into(), bits) as f32;
            assert!(n[0].abs() < bound && n[1].abs() < bound && (n[2] + 1.0).abs() < bound, "{name}: {n:?} at {pixel}");
        }
    }
}

#[test]
fn one_of_two_colours_comes_out_within_the_stated_bound() {
    let Some(gpu) = common::gpu() else { return };
    let all = common::accumulators(&gpu);
    let backend = Backend::gpu(gpu);
    for row in all {
        check_two_colours(row, &backend);
    }
}

fn check_two_colours(row: &AccumulatorRow, backend: &Backend) {
    let camera = front(64);
    let mut surfels = plane(64, 5.0);
    let near = surfels.len();
    // A second plane far behind, by much more than epsilon: it sets the colour range and stays
    // hidden.
    surfels.extend(plane(64, 50.0));
    let (seen, hidden) = ([0.25, 0.5, 0.625, 1.0], [4.0, -3.0, 0.0, 1.0]);
    let colors = (0..surfels.len()).map(|k| if k < near { seen } else { hidden }).collect();
    let scene = Scene {
        origin: DVec3::ZERO,
        surfels,
        low: vec![],
        colors: Colors::Linear(colors),
        oriented: true,
        up: Up::Y,
        ..Scene::default()
    };
    let options = Settings { shading: Shading::Unlit, accumulator: row.of, ..options() };
    let fraction_bits = row.fraction_bits(scene.surfels.len() as u64);
    let frame = frame(&scene, &camera, &options, backend);
    let (weights, counts) = (frame.map(Map::Weight).unwrap(), frame.map(Map::Count).unwrap());
    for (pixel, color) in frame.color.iter().enumerate() {
        for k in 0..4 {
            let range = f64::from((seen[k] - hidden[k]).abs());
            let bound = (row.error_bound)(counts[pixel].into(), weights[pixel].into(), fraction_bits);
            let difference = f64::from((color[k] - seen[k]).abs());
            let limit = bound * range;
            assert!(difference <= limit, "{}: {difference:e} over {limit:e} at {pixel}, channel {k}", row.name);
        }
    }
}

#[test]
fn sums_past_32_bits_are_exact() {
    let Some(gpu) = common::gpu() else { return };
    // Each weight of 5033.7 units is rounded to 5034.
    let (scene, camera) = stack(1001, (5033.7 * UNIT) as f32);
    // Without 64-bit pairs, so these are the kernels that every adapter supports.
    let without = vec![Optimisation::Pairs];
    let options = Settings { kernel: Kernel::Ellipse { a: 0.0, n: 3.0, smooth: false }, without, ..options() };
    let sums = |sources: &Sources| {
        let device = stages(&scene, &camera, &options, &gpu, sources).unwrap();
        let sum = |pixel, channel| device.sums.sum(pixel, channel).unwrap();
        (0..camera.pixels())
            .map(|k| (sum(k, 0), sum(k, COLOR_CHANNEL), device.sums.count(k).unwrap()))
            .collect::<Vec<_>>()
    };
    let one = u64::from(ONE);
    assert_eq!(sums(&Sources::default()), vec![(1001 * one, 1001 * 5034, 1001); camera.pixels()]);
    let broken = |file: &str, from: &str, to: &str| sums(&Sources::default().replace(file, from, to).unwrap());
    let no_carry = broken("accumulator_fixed.wgsl", "before + value < before)", "before + value < 0u)");
    assert!(
        no_carry.iter().all(|sums| sums.0 == (1001 * one) % (1 << 32)),
        "the carry is not needed: {:?}",
        no_carry[0]
    );
    let rounded = "u32(round(f32(weight) * clamp(value, 0.0, 1.0)))";
    let truncated = broken("terms.wgsl", rounded, "u32(f32(weight) * clamp(value, 0.0, 1.0))");
    assert!(truncated.iter().all(|sums| sums.1 == 1001 * 5033), "the rounding is not needed: {:?}", truncated[0]);
}

#[test]
fn resolve_matches_its_twin_on_the_devices_own_sums() {
    let differences = |sources: Sources, gpu: Gpu, shading: Shading| {
        let backend = Backend::Gpu { gpu: Box::new(gpu), sources };
        let Backend::Gpu { gpu, .. } = &backend else { unreachable!() };
        let mut worst = [0f64; 4];
        for (index, (scene, camera)) in crowded().into_iter().enumerate() {
            let mut options = Settings { shading, ..options() };
            if index != 0 {
                options.background = [0.3, 0.2, 0.9, 0.5];
                options.lights.push("1,2,3:0.7".parse().unwrap());
            }
            let device = frame(&scene, &camera, &options, &backend);
            let sums = unmapped(&scene, &camera, &options, gpu);
            let mut twin = Frame::new(&camera, Maps::ON_DEVICE);
            let surfaces = resolve::surfaces(&sums, &[], (&scene, &camera, &options), 0);
            resolve::reference(&surfaces, &Beside::default(), &options, &mut twin);
            // Errors relative to the largest colour, to 1, to the depth, and to the weight.
            let largest = scene.color_range().1.map(f64::from).into_iter().fold(1.0, f64::max);
            for (pixel, sum) in sums.iter().enumerate() {
                let mean = DVec3::from_array(sum.normal).length() / sum.weight.max(1e-9);
                let alpha = sum.color[3] / sum.weight.max(1e-9);
                if sum.weight > 0.0 && (mean < 0.05 || alpha < 0.05) {
                    // A normal that nearly cancels, or a colour that is nearly transparent,
                    // magnifies rounding without bound.
                    continue;
                }
                let apart = |a: &[f32], b: &[f32]| {
                    a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max) * mean.clamp(0.05, 1.0)
                };
                let (near, far) = (device.map(Map::Depth).unwrap()[pixel], twin.map(Map::Depth).unwrap()[pixel]);
                let (light, heavy) = (device.map(Map::Weight).unwrap()[pixel], twin.map(Map::Weight).unwrap()[pixel]);
                let now = [
                    apart(&device.color[pixel], &twin.color[pixel]) / largest * alpha.clamp(0.05, 1.0),
                    apart(&device.normals().unwrap()[pixel], &twin.normals().unwrap()[pixel]),
                    if near == far { 0.0 } else { f64::from((near - far).abs() / far) },
                    if light == heavy { 0.0 } else { f64::from((light - heavy).abs() / heavy) },
                ];
                assert_eq!(device.map(Map::Count).unwrap()[pixel], twin.map(Map::Count).unwrap()[pixel]);
                for (worst, now) in worst.iter_mut().zip(now) {
                    *worst = if now.is_nan() { f64::INFINITY } else { worst.max(now) };
                }
            }
        }
        worst
    };
    let limits = [40.0 * E, 16.0 * E, 8.0 * E, 4.0 * E];
    // The cosine of a mirrored light errs by four times the normal's error plus its own rounding.
    // The highlight's power multiplies this error by the exponent, and there are two lights.
    let of_cosine = 4.0 * limits[1] + 8.0 * E;
    let of_highlights = 2.0 * HIGHLIGHT * f64::from(Settings::default().shininess) * of_cosine;
    let phong = [limits[0] + of_highlights, limits[1], limits[2], limits[3]];
    for (shading, limits) in [(Shading::Lambert, limits), (Shading::Phong, phong)] {
        let Some(gpu) = common::gpu() else { return };
        let worst = differences(Sources::default(), gpu, shading);
        eprintln!("{shading:?}: colour, normal, depth, weight: {:.1?} units of 2^-24", worst.map(|w| w / E));
        assert!(worst.iter().zip(limits).all(|(worst, limit)| *worst <= limit), "{worst:?} over {limits:?}");
    }
    for (file, from, to, which) in [
        ("shade_phong.wgsl", "2.0 * facing * facing_eye", "2.001 * facing * facing_eye", 0),
        ("shade_phong.wgsl", "mirrored), SHININESS)", "mirrored), 1.01 * SHININESS)", 0),
        ("shade_phong.wgsl", "max(0.0, facing), abs(facing)", "abs(facing), abs(facing)", 0),
        ("normal.wgsl", "* 2.0 - 1.0", "* 2.0 - 0.9999", 1),
        ("shade_lambert.wgsl", "select(max(0.0, facing), abs", "select(abs(facing), abs", 0),
        ("resolve.wgsl", "back.a * (1.0 - front.a)", "back.a * (1.0001 - front.a)", 0),
        ("color_sums.wgsl", "held.color_low + held", "held.color_low * 1.0001 + held", 0),
        ("maps.wgsl", "DEPTH_IMAGE, 0u, depth", "DEPTH_IMAGE, 0u, 1.00001 * depth", 2),
        ("accumulator_fixed.wgsl", "WEIGHT_CHANNEL) / ONE", "WEIGHT_CHANNEL) / (ONE - 6400.0)", 3),
    ] {
        let Some(gpu) = common::gpu_for(file) else { return };
        let of_phong = file == "shade_phong.wgsl";
        let shading = if of_phong { Shading::Phong } else { Shading::Lambert };
        let limits = if of_phong { phong } else { limits };
        let broken = differences(Sources::default().replace(file, from, to).unwrap(), gpu, shading);
        assert!(broken[which] > 1.5 * limits[which], "a broken {file} was not noticed: {broken:?}");
    }
}

/// Converts the device's fixed-point sums into the sums of the f64 twin.
fn unmapped(scene: &Scene, camera: &Camera, options: &Settings, gpu: &Gpu) -> Vec<PixelSums> {
    let device = stages(scene, camera, options, gpu, &Sources::default()).unwrap();
    let (low, high) = scene.color_range();
    // An opaque scene has no sum of alpha.
    let channels = if low[3] == high[3] { 3 } else { 4 };
    let of = |pixel: usize| {
        let sum = |channel: u32| device.sums.value(pixel, channel).unwrap();
        let weight = sum(0);
        if weight == 0.0 {
            return PixelSums::ZERO;
        }
        let color = |k: u32| {
            let (low, high) = (f64::from(low[k as usize]), f64::from(high[k as usize]));
            weight * low + if k < channels { (high - low) * sum(COLOR_CHANNEL + k) } else { 0.0 }
        };
        let normal = |k: u32| 2.0 * sum(device.sums.pixel.normal_channel + k) - weight;
        let front = device.nearest_depth(pixel).unwrap();
        PixelSums {
            weight,
            color: [0, 1, 2, 3].map(color),
            // The last bit of the nearest depth is 1 for a back face. The buffer stores the bits of
            // +inf minus those of the depth, and the last bit of +inf is 0, so the last bit stays.
            back: scene.oriented && device.sums.nearest[pixel] % 2 == 1,
            normal: [0, 1, 2].map(normal),
            place: [0.0; 5],
            depth: weight * front + common::depth_span(&device.view, front) * sum(device.sums.pixel.depth_channel),
            depth_weight: weight,
            count: device.sums.count(pixel).unwrap() as u32,
            decision: 0.0,
            ..PixelSums::ZERO
        }
    };
    (0..camera.pixels()).map(of).collect()
}

#[test]
fn a_spheres_depth_is_the_analytic_one_at_disk_centres() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    // Disks that do not overlap, so that one disk, tangent to the sphere, covers each centre. The
    // lens is long: a pixel centre may lie 0.7 pixels from the disk's centre, where the sphere is
    // half the square of that below its tangent plane.
    let scene = sphere(6000, 0.4);
    for lens in [Lens::Fov(20.0), Lens::OrthographicHeight(0.9)] {
        let camera = sphere_camera_with(512, lens);
        let pinhole = camera.projection == Projection::Pinhole;
        let depths = frame(&scene, &camera, &options(), &backend).map(Map::Depth).unwrap().to_vec();
        let mut seen = 0;
        for surfel in &scene.surfels {
            let center = Vec3::from_array(surfel.center).as_dvec3();
            let p = camera.to_camera(center);
            let scale = if pinhole { p.z } else { 1.0 };
            let (x, y) = ((camera.fx * p.x / scale + camera.cx).floor(), (camera.fy * p.y / scale + camera.cy).floor());
            // The ray through the pixel's centre, from its point at depth 0.
            let direction = camera.ray(x + 0.5, y + 0.5);
            let inside = (0.0..512.0).contains(&x) && (0.0..512.0).contains(&y);
            if !inside || -direction.normalize().dot(center) < 0.5 {
                continue;
            }
            let across = DVec3::new((x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy, 0.0);
            let start = camera.eye + camera.rotation.transpose() * if pinhole { DVec3::ZERO } else { across };
            // The nearer solution of |start + z direction| = 1.
            let (a, b, c) = (direction.length_squared(), start.dot(direction), start.length_squared() - 1.0);
            let analytic = (-b - (b * b - a * c).sqrt()) / a;
            let depth = f64::from(depths[y as usize * 512 + x as usize]);
            assert!((depth - analytic).abs() <= 1e-5 * analytic, "{depth} is not {analytic} at {x} {y}");
            seen += 1;
        }
        assert!(seen > 200, "only {seen} disks are seen");
    }
}
