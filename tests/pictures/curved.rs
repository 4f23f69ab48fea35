//! Surfels that curve out of their planes: kernels agree with their twins, caps survive PLY, and
//! caps reconstruct a curved surface.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use common::Random;
use common::scenes::{sphere, sphere_camera};
use epsplat::io::{self, Points};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::metrics::reconstruction;
use epsplat::low_level::plan::{Organisation, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Cap, Clip, Cull, Lens, LowPass, Map, Maps, Projection, Samples, Scene};
use epsplat::low_level::surfels::{FromPoints, Limits, build, build_within, from_points};
use epsplat::low_level::truth::{Surface, Truth};
use glam::Vec3;

use crate::common;

/// Caps of all shapes on a sphere, some of them thin, flat or clipped.
fn curved() -> Scene {
    let mut random = Random(7);
    let mut scene = sphere(1200, 1.7);
    for surfel in &mut scene.surfels {
        let thin = if random.between(0.0, 1.0) < 0.2 { 0.1 } else { random.between(0.4, 1.0) };
        surfel.t = surfel.t.map(|c| c * thin as f32);
    }
    let cap = |(k, surfel): (usize, &epsplat::low_level::scene::Surfel)| {
        let height = surfel.radius() * if k % 7 == 0 { 0.0 } else { 1.0 };
        let mut heights = || random.between(-0.4, 0.3) as f32 * height;
        Cap([heights(), 0.5 * heights(), heights()])
    };
    scene.caps = scene.surfels.iter().enumerate().map(cap).collect();
    let clip = |k: usize| if k.is_multiple_of(5) { Clip([[0.6, 0.8, 0.3], [0.0, 0.0, 1.0]]) } else { Clip::NONE };
    scene.clips = (0..scene.surfels.len()).map(clip).collect();
    scene
}

fn options(low_pass: LowPass, cull: Cull) -> Settings {
    Settings { low_pass, maps: Maps::ON_DEVICE, cull, ..Settings::default() }
}

/// Counts the pixels that differ from the `reference`, and the excused pixels.
///
/// A pixel is excused, and not compared, if its decision margin is below 1e-4.
fn compared(frame: &Frame, reference: &Frame) -> (usize, usize) {
    let decision = reference.map(Map::Decision).unwrap();
    let excused = decision.iter().filter(|decision| **decision < 1e-4).count();
    let maps = [Map::Weight, Map::Normal, Map::Depth].map(|map| (frame.map(map).unwrap(), reference.map(map).unwrap()));
    let differs = |pixel: usize| {
        let values = maps.iter().flat_map(|(ours, theirs)| {
            let each = ours.len() / decision.len();
            (pixel * each..(pixel + 1) * each).map(|k| (ours[k], theirs[k]))
        });
        let wrong =
            |(a, b): (f32, f32)| a != b && ((a - b).abs() > 2e-4 * b.abs().max(0.5) || a.is_nan() || b.is_nan());
        decision[pixel] >= 1e-4 && values.into_iter().any(wrong)
    };
    ((0..decision.len()).filter(|&pixel| differs(pixel)).count(), excused)
}

#[test]
fn kernels_and_twins_meet_the_same_caps() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let forms = [LowPass::None, LowPass::Max].into_iter().flat_map(|low_pass| {
        [(Cull::None, true), (Cull::None, false), (Cull::Back, true)].map(|(cull, oriented)| (low_pass, cull, oriented))
    });
    for (low_pass, cull, oriented) in forms {
        let scene = Scene { oriented, ..curved() };
        for projection in [Projection::Pinhole, Projection::Orthographic] {
            let camera = sphere_camera(160, projection);
            let options = options(low_pass, cull);
            let decided = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
            let (reference, _) = render(&scene, &camera, &decided, &Backend::Reference, &()).unwrap();
            let (frame, report) = render(&scene, &camera, &options, &backend, &()).unwrap();
            assert!(report.needs.contains(&"curved"));
            let (wrong, excused) = compared(&frame, &reference);
            assert!(wrong == 0 && excused < 1000, "{wrong} wrong, {excused} excused, {projection:?} {low_pass:?}");
            for organisation in [Organisation::Scatter, Organisation::Tile] {
                let other = Settings { organisation, ..options.clone() };
                let (other, _) = render(&scene, &camera, &other, &backend, &()).unwrap();
                assert!(common::bits(&other) == common::bits(&frame), "{organisation:?}");
            }
            let shuffled = common::scenes::shuffled(&scene, 3);
            let (shuffled, _) = render(&shuffled, &camera, &options, &backend, &()).unwrap();
            assert!(common::bits(&shuffled) == common::bits(&frame), "another order");
            // Control: flat disks give another picture.
            let flat = Scene { caps: Vec::new(), ..scene.clone() };
            let (flat, report) = render(&flat, &camera, &options, &backend, &()).unwrap();
            assert!(compared(&flat, &reference).0 > 1000 && !report.needs.contains(&"curved"));
        }
    }
}

#[test]
fn broken_caps_are_noticed() {
    let (scene, camera) = (curved(), sphere_camera(160, Projection::Pinhole));
    let options = options(LowPass::None, Cull::None);
    let decided = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
    let (reference, _) = render(&scene, &camera, &decided, &Backend::Reference, &()).unwrap();
    for (file, from, to) in [
        ("curved.wgsl", "heights.y * (a.x * b.y + a.y * b.x)", "heights.y * a.x * b.y"),
        ("curved.wgsl", "let nearer = other.hit && (!one.hit || other.depth < one.depth);", "let nearer = false;"),
        ("curved.wgsl", "splat.cap.depth + splat.cap.radius * sigma;\n    let hit", "splat.cap.depth;\n    let hit"),
        ("normal_curved.wgsl", "attributes.bend.v * spot.uv.y", "attributes.bend.u * spot.uv.y"),
        ("normal_curved.wgsl", "TURNS && spot.away", "TURNS && !spot.away"),
    ] {
        let Some(gpu) = common::gpu() else { return };
        let sources = Sources::default().replace(file, from, to).unwrap();
        let backend = Backend::Gpu { gpu: Box::new(gpu), sources };
        let (frame, _) = render(&scene, &camera, &options, &backend, &()).unwrap();
        assert!(compared(&frame, &reference).0 > 10, "{from}");
    }
}

#[test]
fn flat_caps_are_disks() {
    // If one cap is curved, the kernel for caps draws the flat ones too.
    let mut scene = sphere(1200, 1.7);
    let camera = sphere_camera(160, Projection::Pinhole);
    let options = Settings { maps: Maps::of(&[Map::Depth, Map::Normal]), ..Settings::default() };
    let of = |scene: &Scene| render(scene, &camera, &options, &Backend::Reference, &()).unwrap().0;
    let flat = of(&scene);
    scene.caps = vec![Cap::FLAT; scene.surfels.len()];
    scene.caps[0] = Cap([1e-12, 0.0, 0.0]);
    let nearly = of(&scene);
    for map in [Map::Depth, Map::Normal] {
        let pairs = flat.map(map).unwrap().iter().zip(nearly.map(map).unwrap());
        let off = pairs.filter(|(a, b)| a != b && (*a - *b).abs() > 1e-6).count();
        assert!(off <= 2, "{off} values differ");
    }
}

#[test]
fn caps_stay_in_ply() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("curved.ply");
    let axes = vec![[[0.5, 0.0, 0.0], [0.0, 0.25, 0.0]]; 2];
    let caps = vec![Cap([-0.1, 0.02, 0.05]), Cap::FLAT];
    let points = Points {
        positions: vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
        axes: Some(axes),
        caps: Some(caps.clone()),
        ..Points::default()
    };
    io::ply::write_points(&path, &points, &()).unwrap();
    let again = io::read(&path, &()).unwrap();
    assert_eq!(again.caps.as_ref().unwrap(), &caps);
    assert_eq!(build(vec![again], &()).unwrap().0.caps, caps);
    // A cap that is not finite becomes flat, a too high one is limited, and caps without half-axes
    // are dropped.
    let odd = vec![Cap([f32::NAN, 0.0, 0.0]), Cap([0.0, 0.0, 4.0])];
    let scene = build(vec![Points { caps: Some(odd), ..points.clone() }], &()).unwrap().0;
    assert_eq!(scene.caps, [Cap::FLAT, Cap([0.0, 0.0, 1.0])]);
    let radii = Some(vec![1.0; 2]);
    let normals = Some(vec![[0.0, 0.0, 1.0]; 2]);
    let round = Points { axes: None, radii, normals, ..points.clone() };
    assert!(build(vec![round], &()).unwrap().0.caps.is_empty());
    // If all caps are flat, none is written.
    io::ply::write_points(&path, &Points { caps: Some(vec![Cap::FLAT; 2]), ..points }, &()).unwrap();
    assert_eq!(io::read(&path, &()).unwrap().caps, None);
}

/// Points on an ellipsoid with half-axes 1, 0.7 and 0.5, with their normals.
fn ellipsoid(count: usize) -> Points {
    let half = Vec3::new(1.0, 0.7, 0.5);
    let points = sphere(count, 1.0).surfels.into_iter().map(|surfel| {
        let on_sphere = Vec3::from_array(surfel.center);
        (on_sphere * half, (on_sphere / half).normalize())
    });
    let (positions, normals): (Vec<Vec3>, Vec<Vec3>) = points.unzip();
    Points {
        positions: positions.iter().map(|p| p.as_dvec3().to_array()).collect(),
        normals: Some(normals.iter().map(Vec3::to_array).collect()),
        ..Points::default()
    }
}

#[test]
fn points_of_a_curved_surface_become_caps_of_it() {
    let points = ellipsoid(3000);
    let alone = Points { normals: None, ..points.clone() };
    // RMS distance of points on the rims from the ellipsoid, to first order.
    let off = |scene: &Scene| {
        let rim = |index: usize, k: u32| {
            let (sin, cos) = (f64::from(k) * 0.8).sin_cos();
            let surfel = &scene.surfels[index];
            let [s, t] = [surfel.s, surfel.t].map(|axis| Vec3::from_array(axis).as_dvec3());
            let height = scene.caps.get(index).map_or(0.0, |cap| cap.height(cos, sin));
            let at = scene.origin + scene.center(index) + s * cos + t * sin + s.cross(t).normalize() * height;
            let half = glam::DVec3::new(1.0, 0.7, 0.5);
            ((at / half).length() - 1.0) / (at / (half * half)).length()
        };
        let all = (0..scene.surfels.len()).flat_map(|index| (0..8).map(move |k| rim(index, k).powi(2)));
        let (sum, count) = all.fold((0.0, 0), |(sum, count), squared| (sum + squared, count + 1));
        (sum / f64::from(count)).sqrt()
    };
    for (points, better) in [(points, 10.0), (alone, 3.0)] {
        let flat = Limits { curved: false, ..Limits::default() };
        let of = |limits: &Limits| build_within(vec![points.clone()], vec![], limits, &()).unwrap().0;
        let (caps, disks) = (of(&Limits::default()), of(&flat));
        assert!(disks.caps.is_empty() && caps.caps.iter().filter(|cap| !cap.is_flat()).count() > 2990);
        assert!(better * off(&caps) < off(&disks), "{} {}", off(&caps), off(&disks));
        // The caps of `from_points` (the `surfels` command) are as good.
        let made = from_points(vec![points.clone()], &FromPoints::default(), &()).unwrap();
        let made = build(vec![made.points], &()).unwrap().0;
        assert!(better * off(&made) < off(&disks), "{} {}", off(&made), off(&disks));
        let made = from_points(vec![points.clone()], &FromPoints { limits: flat, ..FromPoints::default() }, &());
        assert!(made.unwrap().points.caps.is_none());
    }
}

#[test]
fn caps_do_not_depend_on_the_order_of_points_at_one_position() {
    let mut points = ellipsoid(400);
    let normals = points.normals.as_mut().unwrap();
    for k in 0..100 {
        points.positions.push(points.positions[k]);
        normals.push(if k % 2 == 0 { [0.0; 3] } else { normals[(k + 1) % 400] });
    }
    let count = points.positions.len();
    let reversed = Points {
        positions: points.positions.iter().rev().copied().collect(),
        normals: Some(points.normals.as_ref().unwrap().iter().rev().copied().collect()),
        ..Points::default()
    };
    let [one, mut other] = [points, reversed].map(|points| build(vec![points], &()).unwrap().0.caps);
    other.reverse();
    assert!(one == other && one.len() == count);
}

#[test]
fn the_outline_of_a_few_caps_is_that_of_their_sphere() {
    let of = |curved: bool| {
        let limits = Limits { curved, ..Limits::default() };
        let (positions, normals) =
            sphere(1000, 1.0).surfels.iter().map(|surfel| (surfel.center.map(f64::from), surfel.center)).unzip();
        let points = Points { positions, normals: Some(normals), ..Points::default() };
        build_within(vec![points], vec![], &limits, &()).unwrap().0
    };
    let surface = Surface::mesh(&common::meshes::sphere(6, true)).unwrap();
    let scene = of(true);
    let camera = Camera::framing((256, 256), Lens::Fov(30.0), &scene, 1e-3).unwrap();
    let samples: Samples = "16".parse().unwrap();
    let options = Settings { samples, maps: Maps::of(&[Map::Depth, Map::Normal]), ..Settings::default() };
    let truth = Truth::cast(&surface, &camera, &options, 8, &()).unwrap();
    let [caps, disks] = [scene, of(false)].map(|scene| {
        let (frame, _) = render(&scene, &camera, &options, &Backend::Reference, &()).unwrap();
        let error = reconstruction(&frame, &truth).unwrap();
        assert_eq!(error.hole_rate, Some(0.0));
        (1.0 - error.silhouette_iou.unwrap(), error.psnr_db.unwrap())
    });
    assert!(5.0 * caps.0 < disks.0 && caps.1 > disks.1 + 6.0, "{caps:?} {disks:?}");
}

/// Shape and normals of a cap each improve the picture. For the decibels with either alone, run
/// `cargo test --release --test pictures curved::what_normals -- --nocapture`.
#[test]
fn what_normals_across_a_splat_are_worth_alone() {
    let Some(gpu) = common::gpu() else { return };
    let surface = Surface::mesh(&common::meshes::sphere(6, true)).unwrap();
    let alone = |file, from, to| {
        let sources = Sources::default().replace(file, from, to).unwrap();
        Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources }
    };
    let backends = [
        Backend::gpu(gpu),
        alone("curved.wgsl", "let heights = world_heights(index) * (held.unit / r);", "let heights = vec3<f32>(0.0);"),
        alone("normal_curved.wgsl", "attributes.bend.u * spot.uv.x + attributes.bend.v * spot.uv.y", "vec3<f32>(0.0)"),
    ];
    for count in [300, 1000, 3000] {
        let on_sphere = sphere(count, 1.0).surfels;
        let (positions, normals) = on_sphere.iter().map(|surfel| (surfel.center.map(f64::from), surfel.center)).unzip();
        let points = Points { positions, normals: Some(normals), ..Points::default() };
        let scene = build_within(vec![points], vec![], &Limits::default(), &()).unwrap().0;
        let flat = Scene { caps: Vec::new(), ..scene.clone() };
        let camera = Camera::framing((256, 256), Lens::Fov(30.0), &scene, 1e-3).unwrap();
        let options = Settings {
            samples: "4".parse().unwrap(),
            maps: Maps::of(&[Map::Depth, Map::Normal]),
            ..Settings::default()
        };
        let truth = Truth::cast(&surface, &camera, &options, 8, &()).unwrap();
        let db = |scene: &Scene, backend: &Backend| {
            let (frame, _) = render(scene, &camera, &options, backend, &()).unwrap();
            reconstruction(&frame, &truth).unwrap().psnr_db.unwrap()
        };
        let [both, normals, shape] = backends.each_ref().map(|backend| db(&scene, backend));
        let neither = db(&flat, &backends[0]);
        println!(
            "{count} surfels: {both:.1} dB, normals alone {normals:.1}, shape alone {shape:.1}, neither {neither:.1}"
        );
        assert!(both > normals && both > shape && shape > neither, "{count}: {both} {normals} {shape} {neither}");
    }
}
