//! Each kernel against its f64 twin, within the bounds of `src/hardcases/precision.rs`.
//!
//! Each comparison has a control: it must notice kernels that are broken slightly.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::UNIT;
use common::enclosure::{Interval, Pixel, enclose};
use common::scenes::{Case, cases, sphere, sphere_camera};
use epsplat::low_level::gpu::layout::{self, AWAY};
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::hardcases::precision::{E, Precision};
use epsplat::low_level::inspect::{Stages, stages};
use epsplat::low_level::passes::footprint::footprint;
use epsplat::low_level::passes::project::reference_all;
use epsplat::low_level::passes::splat::Splat;
use epsplat::low_level::passes::{accumulate, visibility};
use epsplat::low_level::plan::{Accumulator, COLOR_CHANNEL, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::options::HIGHLIGHT;
use epsplat::low_level::scene::{Epsilon, Kernel, Light, LowPass, Map, Maps, Projection, Shading, ShadingAt};
use glam::Vec3;

fn options(kernel: Kernel) -> Settings {
    Settings { kernel, epsilon: Epsilon::Relative(0.02), maps: Maps::ON_DEVICE, ..Default::default() }
}

const WEIGHT_CHANNEL: u32 = 0;

const DEFAULT_KERNEL: Kernel = Kernel::Ellipse { a: 6.0, n: 3.0, smooth: false };

fn run(case: &Case, options: &Settings, gpu: &Gpu, sources: &Sources) -> Stages {
    stages(&case.scene, &case.camera, options, gpu, sources).unwrap_or_else(|e| panic!("{}: {e}", case.name))
}

fn broken(file: &str, from: &str, to: &str) -> Sources {
    Sources::default().replace(file, from, to).unwrap()
}

/// Evaluates the device's record at (x, y) in f64; returns rho and depth in world units.
fn record_at(splat: &layout::Splat, projection: Projection, x: u32, y: u32, world: f64) -> Option<(f64, f64)> {
    let (dx, dy) = (f64::from(x) - f64::from(splat.anchor_x), f64::from(y) - f64::from(splat.anchor_y));
    let row = |r: [f32; 3]| f64::from(r[0]) * dx + f64::from(r[1]) * dy + f64::from(r[2]);
    let (a, b, c) = (row(splat.a) + row(splat.a_low), row(splat.b), row(splat.c));
    match projection {
        Projection::Pinhole => (c > 0.0).then(|| (a.hypot(b) / c, world / c)),
        Projection::Orthographic => Some((a.hypot(b), c * world)),
    }
}

/// The result of a comparison: the number of values compared, and those outside the bounds.
#[derive(Default)]
struct Findings {
    looked: usize,
    wrong: Vec<String>,
    /// The largest difference as a fraction of its bound.
    used: f64,
}

impl Findings {
    fn check(&mut self, difference: f64, bound: f64, what: impl FnOnce() -> String) {
        self.looked += 1;
        if bound.is_finite() {
            self.used = self.used.max(difference / bound);
        }
        if difference > bound || difference.is_nan() || bound.is_nan() {
            self.wrong.push(format!("{}: {difference:e} over {bound:e}", what()));
        }
    }

    fn fail(&mut self, what: String) {
        self.wrong.push(what);
    }

    fn expect_none(&self, name: &str, least: usize) {
        if self.used > 0.0 {
            eprintln!("{name}: {} differences, at most {:.2} of their bounds", self.looked, self.used);
        }
        assert!(self.looked >= least, "{name}: only {} looked at", self.looked);
        let some: Vec<_> = self.wrong.iter().take(8).collect();
        assert!(self.wrong.is_empty(), "{name}: {} wrong, the first are {some:#?}", self.wrong.len());
    }

    fn expect_noticed(&self, name: &str) {
        assert!(self.wrong.len() >= 20, "{name}: a broken kernel gave only {} differences", self.wrong.len());
    }
}

/// Stage 1: projected splats.
fn compare_splats(case: &Case, twins: &[Splat], device: &Stages) -> Findings {
    let mut findings = Findings::default();
    let world = f64::from(device.view.world);
    for twin in twins {
        let splat = &device.splats[twin.surfel as usize];
        let precision = Precision::of(twin, &case.scene, &case.camera);
        let shown = (splat.bounds_last & AWAY) != 0;
        let name = |what: &str| format!("{}, surfel {}, cosine {:e}, {what}", case.name, twin.surfel, precision.cosine);
        let first = [splat.bounds_first & 0xffff, splat.bounds_first >> 16];
        let last = [splat.bounds_last & 0xffff, (splat.bounds_last & !AWAY) >> 16];
        let empty = splat.bounds_first == u32::MAX;
        if !empty && shown != twin.away && !precision.side_is_open() {
            findings.fail(name("side"));
        }
        for y in twin.first[1]..=twin.last[1] {
            for x in twin.first[0]..=twin.last[0] {
                let Some((at, _)) = footprint(twin, &case.camera, LowPass::None, x, y) else { continue };
                let inside = !empty && (first[0]..=last[0]).contains(&x) && (first[1]..=last[1]).contains(&y);
                let bound = precision.record(twin, x, y, &at);
                if at.hit(&case.camera) && !inside && at.rho2.sqrt() + bound.rho < 1.0 {
                    findings
                        .fail(name(&format!("pixel {x} {y} is hit, but lies outside the bounds {first:?} {last:?}")));
                }
                // Records are not evaluated away from the disk, and the first-order bounds hold
                // only near it.
                if empty || at.rho2 > 4.0 || bound.depth > 0.1 {
                    continue;
                }
                let Some((rho, depth)) = record_at(splat, case.camera.projection, x, y, world) else {
                    findings.fail(name("behind the camera"));
                    continue;
                };
                findings.check((rho - at.rho2.sqrt()).abs(), bound.rho, || name(&format!("rho at {x} {y}")));
                findings.check((depth - at.depth).abs() / at.depth.abs(), bound.depth, || {
                    name(&format!("depth at {x} {y}"))
                });
            }
        }
    }
    findings
}

/// Stage 2: nearest depths.
fn compare_nearest(case: &Case, enclosure: &[Pixel], device: &Stages) -> Findings {
    let mut findings = Findings::default();
    for (index, pixel) in enclosure.iter().enumerate() {
        let depth = device.nearest_depth(index).unwrap();
        findings.looked += usize::from(pixel.count.1 > 0);
        if !pixel.nearest.holds(depth) {
            findings.fail(format!("{}, pixel {index}: {depth:e} outside {:?}", case.name, pixel.nearest));
        }
    }
    findings
}

/// Stage 3: weighted sums.
fn compare_sums(case: &Case, enclosure: &[Pixel], device: &Stages) -> Findings {
    let mut findings = Findings::default();
    for (index, pixel) in enclosure.iter().enumerate() {
        let sum = |channel: u32| device.sums.value(index, channel).unwrap();
        let layout = device.sums.pixel;
        let mut check = |what: &str, interval: &Interval, value: f64| {
            if !interval.holds(value) {
                findings.fail(format!("{}, pixel {index}, {what}: {value:e} outside {interval:?}", case.name));
            }
        };
        check("weight", &pixel.weight, sum(WEIGHT_CHANNEL));
        for k in 0..4 {
            check("color", &pixel.color[k], sum(COLOR_CHANNEL + k as u32));
        }
        for k in 0..3 {
            check("normal", &pixel.normal[k], sum(layout.normal_channel + k as u32));
        }
        let weight = sum(WEIGHT_CHANNEL);
        let front = device.nearest_depth(index).unwrap();
        if weight > 0.0 {
            let mean = sum(layout.depth_channel) / weight;
            let behind = common::depth_span(&device.view, front);
            let depth = front + mean * behind;
            let blur = f64::from(pixel.count.1) / weight * UNIT * behind + E * behind + 4.0 * E * front;
            let span = Interval { low: pixel.depth.low - blur, high: pixel.depth.high + blur };
            check("depth", &span, depth);
        }
        if (weight > 0.0) != front.is_finite() {
            findings.fail(format!("{}, pixel {index}: weight {weight:e}, but depth {front:e}", case.name));
        }
        let count = device.sums.count(index).unwrap() as u32;
        if !(pixel.count.0..=pixel.count.1).contains(&count) {
            findings.fail(format!("{}, pixel {index}: {count} fragments, not {:?}", case.name, pixel.count));
        }
        findings.looked += usize::from(pixel.count.1 > 0);
    }
    findings
}

/// Checks that the twins' values lie in the enclosures, and that the enclosures are tight.
///
/// Nearly all pixels must be decided. The intervals of depth and weight may be only a few digits
/// wider than f32 precision.
fn check_enclosure(case: &Case, options: &Settings, twins: &[Splat], enclosure: &[Pixel]) {
    let height = case.camera.height;
    let nearest = visibility::reference(twins.iter(), &case.camera, LowPass::None, 0, height);
    let sums = accumulate::reference(twins.iter(), &case.scene, &case.camera, options, 0, &nearest);
    let (mut depths, mut weights, mut open) = (Vec::new(), Vec::new(), 0);
    for ((pixel, depth), sum) in enclosure.iter().zip(&nearest).zip(&sums) {
        assert!(pixel.nearest.holds(depth.depth), "{}: {depth:?} outside {:?}", case.name, pixel.nearest);
        assert!(pixel.weight.holds(sum.weight), "{}: {} outside {:?}", case.name, sum.weight, pixel.weight);
        assert!((pixel.count.0..=pixel.count.1).contains(&sum.count));
        if pixel.count.1 > 0 {
            open += usize::from(!pixel.decided());
            depths.push(pixel.nearest.relative_width());
            weights.push(pixel.weight.relative_width());
        }
    }
    let covered = depths.len();
    assert!(covered > 3000, "{}: only {covered} pixels covered", case.name);
    let at = |widths: &mut Vec<f64>, share: f64| {
        widths.sort_by(f64::total_cmp);
        widths[((covered - 1) as f64 * share) as usize]
    };
    let widths = [&mut depths, &mut weights].map(|w| [at(w, 0.5), at(w, 0.9)]);
    let words = format!(
        "{:.1e} (depth), {:.1e} (weight); at 90 % {:.1e}, {:.1e}",
        widths[0][0], widths[1][0], widths[0][1], widths[1][1]
    );
    eprintln!("{}: {covered} pixels, {open} open; median width {words}", case.name);
    assert!(open < covered / 200, "{}: {open} of {covered} pixels are open", case.name);
    let [[depth, depth_most], [weight, weight_most]] = widths;
    assert!(depth < 5e-5 && depth_most < 5e-4, "{}: depths are known to {words} only", case.name);
    assert!(weight < 1e-3 && weight_most < 5e-3, "{}: weights are known to {words} only", case.name);
}

#[test]
fn scenes_hold_what_they_claim() {
    // Disks at all angles, down to edge-on ones, hit some pixels; otherwise the bounds would not be
    // exercised.
    let case = &cases()[0];
    let twins = reference_all(&case.scene, &case.camera, &Settings::default());
    let mut hit_below = [0usize; 6];
    for twin in &twins {
        let precision = Precision::of(twin, &case.scene, &case.camera);
        let pixels = (twin.first[1]..=twin.last[1]).flat_map(|y| (twin.first[0]..=twin.last[0]).map(move |x| (x, y)));
        let hit = pixels
            .filter_map(|(x, y)| footprint(twin, &case.camera, LowPass::None, x, y))
            .any(|(at, _)| at.hit(&case.camera));
        for (k, below) in [1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5].into_iter().enumerate() {
            hit_below[k] += usize::from(hit && precision.cosine < below);
        }
    }
    eprintln!("splats that hit a pixel, by cosine below 1, 1e-1, ... 1e-5: {hit_below:?}");
    assert!(hit_below.iter().all(|count| *count > 10), "{hit_below:?}");
}

#[test]
fn project_matches_its_twin() {
    let Some(gpu) = common::gpu() else { return };
    let options = options(DEFAULT_KERNEL);
    for case in cases() {
        let twins = reference_all(&case.scene, &case.camera, &Settings::default());
        let device = run(&case, &options, &gpu, &Sources::default());
        compare_splats(&case, &twins, &device).expect_none(case.name, 5000);
    }
}

#[test]
fn a_broken_projection_is_noticed() {
    let Some(gpu) = common::gpu() else { return };
    let options = options(DEFAULT_KERNEL);
    let all = cases();
    let noticed = |case: &Case, sources: Sources, name: &str| {
        let twins = reference_all(&case.scene, &case.camera, &Settings::default());
        compare_splats(case, &twins, &run(case, &options, &gpu, &sources)).expect_noticed(name);
    };
    let camera = "camera_pinhole.wgsl";
    let shift = broken(camera, "select(-dot2(a.xy, offset),", "select(-dot2(a.xy, offset + 1e-4),");
    noticed(&all[0], shift, "a row moved by 1e-4 pixels");
    noticed(&all[0], broken(camera, "1.0 / p.z - dot", "1.00001 / p.z - dot"), "depth longer by 1e-5");
    let plain =
        broken("rows.wgsl", "rows.a_low = (a - rows.a)", "rows.a_low = vec3<f32>(0.0); let unused = (a - rows.a)");
    noticed(&all[0], plain, "thin rows of 12 bits");
    noticed(
        &all[0],
        broken("project.wgsl", "last = min(floor(h.high + margin", "last = min(floor(h.high - 1.0"),
        "bounds",
    );
    noticed(&all[0], broken("center.wgsl", "d.low - held.eye_low[i]", "d.low * 0.0"), "eye of 24 bits");
    noticed(&all[0], broken("project.wgsl", "AWAY, h.away > 0.0", "AWAY, h.away < 0.0"), "the other side");
    let camera = "camera_orthographic.wgsl";
    noticed(&all[1], broken(camera, "p_z - dot2(c, offset)", "p_z * 1.00001 - dot2(c, offset)"), "orthographic depth");
    let case = &all[7];
    let near = broken("camera_pinhole.wgsl", "dot3(c * unscaled, d)", "dot3(c * unscaled, d) * 1.001");
    noticed(case, near, "depth of disks across the near depth");
}

#[test]
fn visibility_and_accumulate_match_their_twins() {
    let Some(gpu) = common::gpu() else { return };
    for (index, case) in cases().into_iter().enumerate() {
        // Each variant of the kernel's power is compiled separately.
        let n = [3.0, 2.0, 4.0, 1.7][index % 4];
        let options = options(Kernel::Ellipse { a: 6.0, n, smooth: false });
        let twins = reference_all(&case.scene, &case.camera, &Settings::default());
        let enclosure = enclose(&case.scene, &case.camera, &options, &twins);
        check_enclosure(&case, &options, &twins, &enclosure);
        let device = run(&case, &options, &gpu, &Sources::default());
        compare_nearest(&case, &enclosure, &device).expect_none(case.name, 3000);
        compare_sums(&case, &enclosure, &device).expect_none(case.name, 3000);
    }
}

#[test]
fn a_broken_footprint_or_sum_is_noticed() {
    let Some(gpu) = common::gpu() else { return };
    let options = options(DEFAULT_KERNEL);
    let case = &cases()[0];
    let twins = reference_all(&case.scene, &case.camera, &Settings::default());
    let enclosure = enclose(&case.scene, &case.camera, &options, &twins);
    let sums = |file, from, to| compare_sums(case, &enclosure, &run(case, &options, &gpu, &broken(file, from, to)));
    let depths =
        |file, from, to| compare_nearest(case, &enclosure, &run(case, &options, &gpu, &broken(file, from, to)));
    let file = "flat.wgsl";
    depths(file, "splat.c[1] * d.y + splat.c[2]", "splat.c[1] * d.y + splat.c[2] * 1.00001").expect_noticed("depth");
    depths("nearest_depth.wgsl", "kept_depth(bitcast", "NOTHING - kept_depth(bitcast").expect_noticed("farthest");
    sums(file, "d.y + splat.a[2]))\n", "d.y + splat.a[2] * 1.001))\n").expect_noticed("row a");
    sums(file, "splat.b[1] * d.y", "splat.b[1] * d.y * 1.001").expect_noticed("row b");
    sums("kernel_ellipse.wgsl", "-KERNEL_A", "-1.0001 * KERNEL_A").expect_noticed("kernel");
    sums("epsilon_depth.wgsl", "held.epsilon_relative", "held.epsilon_relative * 1.05").expect_noticed("epsilon");
    sums("normal_flat.wgsl", ") * 0.5 + 0.5;", ") * 0.5 + 0.50001;").expect_noticed("normal");
    sums("color_linear.wgsl", "color.rgb * color.a", "color.rgb * (color.a * 1.0001)").expect_noticed("premultiplied");
    sums(
        "depth.wgsl",
        "(depth - front) / (deepest_accepted(front) - front)",
        "0.05 + (depth - front) / (deepest_accepted(front) - front)",
    )
    .expect_noticed("depth");
}

#[test]
fn the_frame_of_the_device_is_the_frame_of_the_twins() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let aside = Light::Directional { toward: Vec3::new(0.6, 0.0, 0.8), intensity: 0.5 };
    let lights = vec![Light::Headlight { intensity: 0.5 }, aside];
    for projection in [Projection::Pinhole, Projection::Orthographic] {
        for (shading, shading_at) in [
            (Shading::Lambert, ShadingAt::Pixel),
            (Shading::Unlit, ShadingAt::Pixel),
            (Shading::Phong, ShadingAt::Pixel),
            (Shading::Lambert, ShadingAt::Splat),
            (Shading::Phong, ShadingAt::Splat),
        ] {
            let (scene, camera) = (sphere(3000, 1.5), sphere_camera(256, projection));
            let mut options = Settings { shading, shading_at, lights: lights.clone(), ..options(DEFAULT_KERNEL) };
            let (device, _) = render(&scene, &camera, &options, &backend, &()).unwrap();
            options.maps = options.maps.and(&[Map::Decision]);
            let (twin, _) = render(&scene, &camera, &options, &Backend::Reference, &()).unwrap();
            let (mut open, mut covered) = (0, 0);
            for pixel in 0..camera.pixels() {
                covered += usize::from(twin.map(Map::Weight).unwrap()[pixel] > 0.0);
                if twin.map(Map::Decision).unwrap()[pixel] < 1e-5 {
                    open += 1;
                    continue;
                }
                let difference =
                    (0..4).map(|k| (device.color[pixel][k] - twin.color[pixel][k]).abs()).fold(0.0, f32::max);
                // The documented bound of the sums, for ranges of 1 (colour) and 2 (normal), and a
                // few f32 units.
                let weight = twin.map(Map::Weight).unwrap()[pixel];
                let count = twin.map(Map::Count).unwrap()[pixel];
                let bound = Accumulator::Fixed.row().error_bound;
                let sums = bound(count.max(1.0).into(), weight.max(1e-3).into(), 24) as f32;
                let limit = 3.0 * sums + 1e-5;
                // The cosine of a highlight has four times the normal's error, and raising it to a
                // power multiplies that by the exponent.
                let highlight = if shading == Shading::Phong { 1.0 + 4.0 * options.shininess } else { 0.0 };
                let of_color = limit * (1.0 + HIGHLIGHT as f32 * highlight);
                assert!(
                    difference < of_color,
                    "colour {difference:e} over {of_color:e} at {pixel}, {shading:?} {shading_at:?} {projection:?}"
                );
                let (near, far) = (device.map(Map::Depth).unwrap()[pixel], twin.map(Map::Depth).unwrap()[pixel]);
                assert!(near == far || (near - far).abs() < 2e-6 * far, "depth {near} {far} at {pixel}");
                let (m, n) = (device.normals().unwrap()[pixel], twin.normals().unwrap()[pixel]);
                assert!((0..3).all(|k| (m[k] - n[k]).abs() < limit), "normal {m:?} {n:?} at {pixel}");
                assert_eq!(device.map(Map::Count).unwrap()[pixel], twin.map(Map::Count).unwrap()[pixel]);
            }
            assert!(covered > 20_000 && open < covered / 100, "{open} of {covered} pixels are open");
        }
    }
}
