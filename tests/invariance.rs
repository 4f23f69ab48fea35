//! What must hold exactly or analytically, whatever the order, the pages and the schedule.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::Random;
use common::scenes::{cases, sphere, sphere_camera, sphere_camera_with};
use epsplat::frame::Frame;
use epsplat::gpu::buffers::page_len;
use epsplat::gpu::layout::Splat;
use epsplat::gpu::{Gpu, Sources};
use epsplat::inspect::stages;
use epsplat::passes::accumulate::{ACCUMULATORS, PixelSums};
use epsplat::passes::resolve;
use epsplat::render::{Backend, render};
use epsplat::scene::camera::Lens;
use epsplat::scene::{Camera, Colors, Epsilon, Kernel, Maps, Projection, RenderOptions, Scene, Shading, Surfel, Up};
use glam::{DMat3, DVec3, Vec3};

const E: f64 = 1.0 / 16_777_216.0;

const ALL_MAPS: Maps = Maps { depth: true, normal: true, weight: true, count: true, decision: false };

fn options() -> RenderOptions {
    RenderOptions { maps: ALL_MAPS, epsilon: Epsilon::Relative(0.02), ..Default::default() }
}

fn frame(scene: &Scene, camera: &Camera, options: &RenderOptions, backend: &Backend) -> Frame {
    render(scene, camera, options, backend, &()).unwrap().0
}

/// The frame's bits: equality of floats would take -0 for 0 and no NaN for itself.
fn bits(frame: &Frame) -> Vec<u32> {
    let maps = [&frame.depth, &frame.weight, &frame.count].into_iter().flatten().flatten();
    let vectors = frame.color.iter().flatten().chain(frame.normal.iter().flatten().flatten());
    vectors.chain(maps).map(|value| value.to_bits()).collect()
}

fn shuffled(scene: &Scene, seed: u64) -> Scene {
    let mut order: Vec<usize> = (0..scene.surfels.len()).collect();
    Random(seed).shuffle(&mut order);
    let colors = match &scene.colors {
        Colors::Constant(color) => Colors::Constant(*color),
        Colors::Srgb8(codes) => Colors::Srgb8(order.iter().map(|&k| codes[k]).collect()),
        Colors::Linear(colors) => Colors::Linear(order.iter().map(|&k| colors[k]).collect()),
    };
    Scene { surfels: order.iter().map(|&k| scene.surfels[k]).collect(), colors, ..scene.clone() }
}

/// Scenes with many fragments on a pixel, in both kinds of colour.
fn crowded() -> Vec<(Scene, Camera)> {
    let mut all = vec![(sphere(4000, 4.0), sphere_camera(96, Projection::Pinhole))];
    all.extend(cases().into_iter().take(2).map(|case| (case.scene, case.camera)));
    all
}

#[test]
fn order_and_repetition_do_not_change_a_bit() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    for (scene, camera) in crowded() {
        let first = bits(&frame(&scene, &camera, &options(), &backend));
        assert!(bits(&frame(&scene, &camera, &options(), &backend)) == first, "a second run differs");
        for seed in [5, 6] {
            let other = frame(&shuffled(&scene, seed), &camera, &options(), &backend);
            assert!(bits(&other) == first, "order {seed} differs");
        }
        // The comparison sees one surfel moved by a unit in the last place.
        let mut moved = scene.clone();
        for surfel in &mut moved.surfels {
            surfel.center[0] = surfel.center[0].next_up();
        }
        assert!(bits(&frame(&moved, &camera, &options(), &backend)) != first);
    }
    // And a sum in which the last fragment wins.
    let Backend::Gpu { gpu, .. } = backend else { unreachable!() };
    let sources = Sources::default()
        .replace("accumulator_fixed.wgsl", "atomicAdd(&sums[word], value)", "atomicExchange(&sums[word], value)")
        .unwrap();
    let careless = Backend::Gpu { gpu, sources };
    let (scene, camera) = crowded().remove(0);
    let [one, other] = [&scene, &shuffled(&scene, 5)].map(|s| bits(&frame(s, &camera, &options(), &careless)));
    assert!(one != other, "a sum that depends on the order was not noticed");
}

#[test]
fn pages_and_bands_do_not_change_a_bit() {
    let Some(whole) = common::gpu() else { return };
    let whole = Backend::gpu(whole);
    // 160 pixels of 19 words are 12,160 bytes: a row of the image a band; and 203 surfels a page.
    for limit in [13_000, 40_000] {
        let Some(small) = common::gpu() else { return };
        let small = small.with_buffer_limit(limit);
        assert_eq!(small.buffer_limit(), limit);
        let (scene, camera) = crowded().remove(1);
        let refused = stages(&scene, &camera, &options(), &small, &Sources::default());
        assert!(refused.unwrap_err().to_string().contains("bands"));
        assert!(page_len(&small, size_of::<Splat>()) < scene.surfels.len() as u64 / 2);
        let small = Backend::gpu(small);
        for (scene, camera) in crowded() {
            let one = frame(&scene, &camera, &options(), &whole);
            let many = frame(&scene, &camera, &options(), &small);
            assert!(bits(&one) == bits(&many), "{limit} bytes a buffer give another image");
        }
    }
}

/// An orthographic camera that looks along +z from the origin, a unit a pixel.
fn front(size: u32) -> Camera {
    let half = f64::from(size) / 2.0;
    let lens = Lens::OrthographicScale([1.0, 1.0, half, half]);
    Camera::posed((size, size), lens, DVec3::ZERO, DMat3::IDENTITY, 1e-3).unwrap()
}

/// Disks on a grid in the plane z = `depth`, that cover `size` pixels and more.
fn plane(size: i32, depth: f32) -> Vec<Surfel> {
    let at = |k: i32| 1.7 * k as f32 + 0.123 - size as f32 / 2.0;
    let cells = (-2..size * 10 / 17 + 3).flat_map(|y| (-2..size * 10 / 17 + 3).map(move |x| (x, y)));
    cells.map(|(x, y)| Surfel::disk(Vec3::new(at(x), at(y), depth), Vec3::NEG_Z, 2.5)).collect()
}

#[test]
fn a_plane_of_one_colour_is_exactly_that_colour() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let camera = front(64);
    let surfels = plane(64, 5.0);
    let options = RenderOptions { shading: Shading::Unlit, ..options() };
    let color = [0.123_456_7, 7.654_321, 0.333_333_34, 1.0];
    let code = [200, 17, 99, 255];
    let decoded = Colors::Srgb8(vec![code]).linear(0);
    for (colors, expected) in [
        (Colors::Constant(color), color),
        (Colors::Linear(vec![color; surfels.len()]), color),
        (Colors::Srgb8(vec![code; surfels.len()]), decoded),
    ] {
        let scene = Scene { origin: DVec3::ZERO, surfels: surfels.clone(), colors, oriented: true, up: Up::Y };
        let frame = frame(&scene, &camera, &options, &backend);
        assert!(frame.color.iter().all(|pixel| *pixel == expected), "{:?} is not {expected:?}", frame.color[0]);
        assert!(frame.depth.unwrap().iter().all(|depth| (depth - 5.0).abs() <= 5.0 * 4.0 * E as f32));
        let normals = frame.normal.unwrap();
        let bound = 2.0 * (ACCUMULATORS[0].error_bound)(1.0, 0.1) as f32;
        assert!(normals.iter().all(|n| n[0].abs() < bound && n[1].abs() < bound && (n[2] + 1.0).abs() < bound));
    }
}

#[test]
fn one_of_two_colours_comes_out_within_the_stated_bound() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let camera = front(64);
    let mut surfels = plane(64, 5.0);
    let near = surfels.len();
    // Behind the first by far more than epsilon: it sets the range and is never seen.
    surfels.extend(plane(64, 50.0));
    let (seen, hidden) = ([0.25, 0.5, 0.625, 1.0], [4.0, -3.0, 0.0, 1.0]);
    let colors = (0..surfels.len()).map(|k| if k < near { seen } else { hidden }).collect();
    let scene = Scene { origin: DVec3::ZERO, surfels, colors: Colors::Linear(colors), oriented: true, up: Up::Y };
    let options = RenderOptions { shading: Shading::Unlit, ..options() };
    let frame = frame(&scene, &camera, &options, &backend);
    let (weights, counts) = (frame.weight.unwrap(), frame.count.unwrap());
    for (pixel, color) in frame.color.iter().enumerate() {
        for k in 0..4 {
            let range = f64::from((seen[k] - hidden[k]).abs());
            let bound = (ACCUMULATORS[0].error_bound)(counts[pixel].into(), weights[pixel].into());
            let difference = f64::from((color[k] - seen[k]).abs());
            assert!(difference <= bound * range, "{difference:e} over {:e} at {pixel}, channel {k}", bound * range);
        }
    }
}

/// `count` coincident disks over the whole image, with a kernel of weight 1 everywhere, of linear colour `value`; and
/// two out of sight that stretch the colours' range to [0, 1].
fn stack(count: usize, value: f32) -> (Scene, Camera, RenderOptions) {
    let mut surfels = vec![Surfel::disk(Vec3::new(0.2, 0.1, 5.0), Vec3::NEG_Z, 20.0); count];
    let mut colors = vec![[value, value, value, 1.0]; count];
    for end in [0.0, 1.0] {
        surfels.push(Surfel::disk(Vec3::new(0.0, 0.0, 90.0), Vec3::NEG_Z, 1.0));
        colors.push([end, end, end, 1.0]);
    }
    let scene = Scene { origin: DVec3::ZERO, surfels, colors: Colors::Linear(colors), oriented: true, up: Up::Y };
    (scene, front(8), RenderOptions { kernel: Kernel::Ellipse { a: 0.0, n: 3.0 }, ..options() })
}

#[test]
fn sums_past_32_bits_are_exact() {
    let Some(gpu) = common::gpu() else { return };
    // 5033.7 units of 2^-24 are rounded to 5034 each.
    let (scene, camera, options) = stack(1000, (5033.7 * E) as f32);
    let sums = |sources: &Sources| {
        let device = stages(&scene, &camera, &options, &gpu, sources).unwrap();
        let word = device.pixel.color_word;
        (0..camera.pixels()).map(|k| (device.sum(k, 0).unwrap(), device.sum(k, word).unwrap())).collect::<Vec<_>>()
    };
    let exact = vec![(1000 << 24, 1000 * 5034); camera.pixels()];
    assert_eq!(sums(&Sources::default()), exact);
    let broken = |from: &str, to: &str| sums(&Sources::default().replace("accumulator_fixed.wgsl", from, to).unwrap());
    let no_carry = broken("if (before + value < before)", "if (before + value < 0u)");
    assert!(
        no_carry.iter().all(|sums| sums.0 == (1000 << 24) % (1 << 32)),
        "the carry is not needed: {:?}",
        no_carry[0]
    );
    let truncated =
        broken("u32(round(f32(weight) * clamp(value, 0.0, 1.0)))", "u32(f32(weight) * clamp(value, 0.0, 1.0))");
    assert!(truncated.iter().all(|sums| sums.1 == 1000 * 5033), "the rounding is not needed: {:?}", truncated[0]);
}

#[test]
fn resolve_matches_its_twin_on_the_devices_own_sums() {
    let Some(gpu) = common::gpu() else { return };
    let differences = |sources: Sources, gpu: Gpu| {
        let backend = Backend::Gpu { gpu: Box::new(gpu), sources };
        let Backend::Gpu { gpu, .. } = &backend else { unreachable!() };
        let mut worst = [0f64; 4];
        for (index, (scene, camera)) in crowded().into_iter().enumerate() {
            let mut options = options();
            if index != 0 {
                options.background = [0.3, 0.2, 0.9, 0.5];
                options.lights.push("1,2,3:0.7".parse().unwrap());
            }
            let device = frame(&scene, &camera, &options, &backend);
            let sums = unmapped(&scene, &camera, &options, gpu);
            let mut twin = Frame::new(&camera, &ALL_MAPS);
            resolve::reference(&sums, &camera, &options, 0, &mut twin);
            // Of the largest colour; of one; of the depth; of the weight.
            let largest = scene.color_range().1.map(f64::from).into_iter().fold(1.0, f64::max);
            for (pixel, sum) in sums.iter().enumerate() {
                let mean = DVec3::from_array(sum.normal).length() / sum.weight.max(1e-9);
                let alpha = sum.color[3] / sum.weight.max(1e-9);
                if sum.weight > 0.0 && (mean < 0.05 || alpha < 0.05) {
                    // What nearly cancels, or is nearly transparent, magnifies rounding without bound.
                    continue;
                }
                let apart = |a: &[f32], b: &[f32]| {
                    a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max) * mean.clamp(0.05, 1.0)
                };
                let (near, far) = (device.depth.as_ref().unwrap()[pixel], twin.depth.as_ref().unwrap()[pixel]);
                let (light, heavy) = (device.weight.as_ref().unwrap()[pixel], twin.weight.as_ref().unwrap()[pixel]);
                let now = [
                    apart(&device.color[pixel], &twin.color[pixel]) / largest * alpha.clamp(0.05, 1.0),
                    apart(&device.normal.as_ref().unwrap()[pixel], &twin.normal.as_ref().unwrap()[pixel]),
                    if near == far { 0.0 } else { f64::from((near - far).abs() / far) },
                    if light == heavy { 0.0 } else { f64::from((light - heavy).abs() / heavy) },
                ];
                assert_eq!(device.count.as_ref().unwrap()[pixel], twin.count.as_ref().unwrap()[pixel]);
                for (worst, now) in worst.iter_mut().zip(now) {
                    *worst = if now.is_nan() { f64::INFINITY } else { worst.max(now) };
                }
            }
        }
        worst
    };
    let limits = [40.0 * E, 16.0 * E, 8.0 * E, 4.0 * E];
    let worst = differences(Sources::default(), gpu);
    eprintln!("colour, normal, depth, weight: {:.1?} units of 2^-24", worst.map(|w| w / E));
    assert!(worst.iter().zip(limits).all(|(worst, limit)| *worst <= limit), "{worst:?} over {limits:?}");
    for (file, from, to, which) in [
        ("normal.wgsl", "* 2.0 - 1.0", "* 2.0 - 0.9999", 1),
        ("shade_lambert.wgsl", "max(0.0, dot(normal, light.xyz))", "abs(dot(normal, light.xyz))", 0),
        ("resolve.wgsl", "back.a * (1.0 - front.a)", "back.a * (1.0001 - front.a)", 0),
        ("color_sums.wgsl", "view.color_low + view", "view.color_low * 1.0001 + view", 0),
        ("depth.wgsl", "* view.world", "* (view.world * 1.00001)", 2),
        ("weight_map.wgsl", "weight / ONE", "weight / (ONE - 100.0)", 3),
    ] {
        let Some(gpu) = common::gpu() else { return };
        let broken = differences(Sources::default().replace(file, from, to).unwrap(), gpu);
        assert!(broken[which] > 1.5 * limits[which], "a broken {file} was not noticed: {broken:?}");
    }
}

/// The twin's sums, from the device's.
fn unmapped(scene: &Scene, camera: &Camera, options: &RenderOptions, gpu: &Gpu) -> Vec<PixelSums> {
    let device = stages(scene, camera, options, gpu, &Sources::default()).unwrap();
    let (low, high) = scene.color_range();
    let (relative, absolute) = options.epsilon.parts();
    let channels = (device.pixel.normal_word - device.pixel.color_word) / 2;
    let of = |pixel: usize| {
        let sum = |word: u32| device.sum(pixel, word).unwrap() as f64 * E;
        let weight = sum(0);
        if weight == 0.0 {
            return PixelSums::ZERO;
        }
        let color = |k: u32| {
            let (low, high) = (f64::from(low[k as usize]), f64::from(high[k as usize]));
            weight * low + if k < channels { (high - low) * sum(device.pixel.color_word + 2 * k) } else { 0.0 }
        };
        let normal = |k: u32| 2.0 * sum(device.pixel.normal_word + 2 * k) - weight;
        let front = device.nearest_depth(pixel).unwrap();
        PixelSums {
            weight,
            color: [0, 1, 2, 3].map(color),
            normal: [0, 1, 2].map(normal),
            depth: weight * front + (front * relative + absolute) * sum(device.pixel.depth_word),
            count: device.count(pixel).unwrap(),
            decision: 0.0,
        }
    };
    (0..camera.pixels()).map(of).collect()
}

#[test]
fn a_spheres_depth_is_the_analytic_one_at_disk_centres() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    // Disks that do not overlap: at each centre there is one, tangent to the sphere. The lens is long, since a pixel's
    // centre may lie 0.7 pixels from the disk's, where the sphere falls away from its tangent plane by half the square.
    let scene = sphere(6000, 0.4);
    for lens in [Lens::Fov(20.0), Lens::OrthographicHeight(0.9)] {
        let camera = sphere_camera_with(512, lens);
        let pinhole = camera.projection == Projection::Pinhole;
        let depths = frame(&scene, &camera, &options(), &backend).depth.unwrap();
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
            // |start + z direction| = 1, the nearer solution.
            let (a, b, c) = (direction.length_squared(), start.dot(direction), start.length_squared() - 1.0);
            let analytic = (-b - (b * b - a * c).sqrt()) / a;
            let depth = f64::from(depths[y as usize * 512 + x as usize]);
            assert!((depth - analytic).abs() <= 1e-5 * analytic, "{depth} is not {analytic} at {x} {y}");
            seen += 1;
        }
        assert!(seen > 200, "only {seen} disks are seen");
    }
}
