//! Disks clipped by lines in their planes: kernels agree with their twins, and surfels of a mesh
//! end at its edges.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use common::Random;
use common::scenes::{sphere, sphere_camera};
use epsplat::io::{self, Points};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::metrics::reconstruction;
use epsplat::low_level::plan::{BlendFormat, Organisation, Raster, RasterDepth, Settings, check};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{
    Camera, Clip, Colors, Cull, Facing, Lens, LowPass, Map, Maps, Outline, PointShape, Projection, Samples, Scene,
    Shading, Surfel,
};
use epsplat::low_level::surfels::build;
use epsplat::low_level::truth::{DiskTree, Surface, Truth};
use glam::{DVec3, Vec3};

use crate::common;

/// Disks of all shapes, some of them thin, each with two random clip lines.
fn clipped() -> Scene {
    let mut random = Random(7);
    let mut scene = sphere(1200, 1.7);
    for surfel in &mut scene.surfels {
        let thin = if random.between(0.0, 1.0) < 0.3 { 0.05 } else { random.between(0.4, 1.0) };
        surfel.t = surfel.t.map(|c| c * thin as f32);
    }
    let mut line = || {
        let angle = random.between(0.0, std::f64::consts::TAU);
        [angle.cos() as f32, angle.sin() as f32, random.between(-0.3, 0.8) as f32]
    };
    scene.clips = (0..scene.surfels.len()).map(|_| Clip([line(), line()])).collect();
    scene
}

fn options(low_pass: LowPass) -> Settings {
    Settings { low_pass, maps: Maps::ON_DEVICE, cull: Cull::None, ..Settings::default() }
}

/// Counts the pixels whose weight differs from the `reference`, and the excused pixels.
///
/// A pixel is excused, and not compared, if its decision margin is below 1e-4.
fn compared(frame: &Frame, reference: &Frame) -> (usize, usize) {
    let decision = reference.map(Map::Decision).unwrap();
    let (weights, expected) = (frame.map(Map::Weight).unwrap(), reference.map(Map::Weight).unwrap());
    let excused = decision.iter().filter(|decision| **decision < 1e-4).count();
    let differs = |pixel: usize| {
        decision[pixel] >= 1e-4 && (weights[pixel] - expected[pixel]).abs() > 1e-4 * expected[pixel].max(1e-3)
    };
    ((0..decision.len()).filter(|&pixel| differs(pixel)).count(), excused)
}

#[test]
fn kernels_and_twins_end_disks_at_the_same_lines() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, backend) = (clipped(), Backend::gpu(gpu));
    for projection in [Projection::Pinhole, Projection::Orthographic] {
        let camera = sphere_camera(160, projection);
        for low_pass in [LowPass::None, LowPass::Max, LowPass::Ewa] {
            let options = options(low_pass);
            let decided = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
            let (reference, _) = render(&scene, &camera, &decided, &Backend::Reference, &()).unwrap();
            let (frame, report) = render(&scene, &camera, &options, &backend, &()).unwrap();
            assert!(report.needs.contains(&"clips"));
            let (wrong, excused) = compared(&frame, &reference);
            assert!(wrong == 0 && excused < 400, "{wrong} wrong, {excused} excused, {projection:?} {low_pass:?}");
            for organisation in [Organisation::Scatter, Organisation::Tile] {
                let other = Settings { organisation, ..options.clone() };
                let (other, _) = render(&scene, &camera, &other, &backend, &()).unwrap();
                assert!(common::bits(&other) == common::bits(&frame), "{organisation:?}");
            }
            // The rasteriser draws the same fragments.
            let raster = Some(Raster { format: BlendFormat::Rgba16Float, depth: RasterDepth::Exact });
            let by_raster = Settings { raster, ..options.clone() };
            let (by_raster, _) = render(&scene, &camera, &by_raster, &backend, &()).unwrap();
            let [counted, expected] = [&by_raster, &frame].map(|frame| frame.map(Map::Count).unwrap());
            let decided = reference.map(Map::Decision).unwrap().iter().map(|decision| *decision >= 1e-4);
            let differ =
                decided.zip(counted.iter().zip(expected)).filter(|(decided, (a, b))| *decided && a != b).count();
            assert_eq!(differ, 0, "{projection:?} {low_pass:?}");
            // Control: whole disks give another picture.
            let whole = Scene { clips: Vec::new(), ..scene.clone() };
            let (whole, report) = render(&whole, &camera, &options, &backend, &()).unwrap();
            assert!(compared(&whole, &reference).0 > 1000 && !report.needs.contains(&"clips"));
        }
    }
}

#[test]
fn polygons_are_drawn_by_all_alike() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let whole = Scene { clips: Vec::new(), ..clipped() };
    for (scene, sides, projection) in
        [(&whole, 3, Projection::Pinhole), (&whole, 7, Projection::Orthographic), (&clipped(), 4, Projection::Pinhole)]
    {
        let camera = sphere_camera(160, projection);
        let options = Settings { outline: Some(Outline::of_sides(sides).unwrap()), ..options(LowPass::None) };
        let decided = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
        let (reference, _) = render(scene, &camera, &decided, &Backend::Reference, &()).unwrap();
        let (frame, report) = render(scene, &camera, &options, &backend, &()).unwrap();
        assert!(report.needs.contains(&"outline"));
        let (wrong, excused) = compared(&frame, &reference);
        assert!(wrong == 0 && excused < 400, "{wrong} wrong, {excused} excused, {sides} sides");
        for organisation in [Organisation::Scatter, Organisation::Tile] {
            let other = Settings { organisation, ..options.clone() };
            let (other, _) = render(scene, &camera, &other, &backend, &()).unwrap();
            assert!(common::bits(&other) == common::bits(&frame), "{organisation:?}");
        }
        let raster = Some(Raster { format: BlendFormat::Rgba16Float, depth: RasterDepth::Exact });
        let by_raster = Settings { raster, ..options.clone() };
        let (by_raster, _) = render(scene, &camera, &by_raster, &backend, &()).unwrap();
        let [counted, expected] = [&by_raster, &frame].map(|frame| frame.map(Map::Count).unwrap());
        let decided = reference.map(Map::Decision).unwrap().iter().map(|decision| *decision >= 1e-4);
        assert!(decided.zip(counted.iter().zip(expected)).all(|(decided, (a, b))| !decided || a == b));
        // Controls: disks, and polygons with one more side, give other pictures.
        for outline in [None, Outline::of_sides(sides + 1).ok()] {
            let other = Settings { outline, ..options.clone() };
            let (other, _) = render(scene, &camera, &other, &backend, &()).unwrap();
            assert!(compared(&other, &reference).0 > 500, "{outline:?}");
        }
    }
}

#[test]
fn a_polygon_has_the_area_of_its_sides() {
    let camera = {
        let lens = Lens::OrthographicHeight(2.5);
        Camera::look_at((500, 500), lens, DVec3::ZERO, DVec3::Z, Some(DVec3::NEG_Y), Scene::default().up, 0.1).unwrap()
    };
    let disk = Surfel::disk(Vec3::new(0.0, 0.0, 4.0), Vec3::NEG_Z, 1.0);
    let scene = Scene { surfels: vec![disk], colors: Colors::Constant([1.0; 4]), ..Scene::default() };
    for sides in [3, 5, 16] {
        let outline = Some(Outline::of_sides(sides).unwrap());
        let options = Settings { outline, maps: Maps::of(&[Map::Weight]), ..Settings::default() };
        let (frame, _) = render(&scene, &camera, &options, &Backend::Reference, &()).unwrap();
        let covered = frame.map(Map::Weight).unwrap().iter().filter(|weight| **weight > 0.0).count();
        let area = covered as f64 * (2.5f64 / 500.0).powi(2);
        let n = f64::from(sides);
        let expected = 0.5 * n * (std::f64::consts::TAU / n).sin();
        assert!((area / expected - 1.0).abs() < 0.002, "{area} {expected}");
    }
    for options in [
        Settings { low_pass: LowPass::Max, ..Settings::default() },
        Settings {
            facing: Some(Facing { shape: PointShape::Circle, pixels: Facing::LIMITS }),
            shading: Shading::Unlit,
            ..Settings::default()
        },
    ] {
        assert!(check::options(&options, false).is_ok());
        let outlined = Settings { outline: Outline::of_sides(3).ok(), ..options };
        let error = check::options(&outlined, true).unwrap_err().to_string();
        assert!(error.contains("--outline"), "{error}");
    }
}

#[test]
fn a_line_that_is_turned_the_wrong_way_is_noticed() {
    let (scene, camera, options) = (clipped(), sphere_camera(160, Projection::Pinhole), options(LowPass::None));
    let decided = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
    let (reference, _) = render(&scene, &camera, &decided, &Backend::Reference, &()).unwrap();
    for (from, to) in [
        ("line.x * turn.x + line.y * turn.y", "line.x * turn.x - line.y * turn.y"),
        ("dot3(clip.second, p) < 0.0", "dot3(clip.second, p) < 0.01"),
        ("vec3<f32>(first.w, second.xy)", "vec3<f32>(first.w, second.yx)"),
    ] {
        let Some(gpu) = common::gpu() else { return };
        let sources = Sources::default().replace("clip.wgsl", from, to).unwrap();
        let backend = Backend::Gpu { gpu: Box::new(gpu), sources };
        let (frame, _) = render(&scene, &camera, &options, &backend, &()).unwrap();
        assert!(compared(&frame, &reference).0 > 10, "{from}");
    }
}

#[test]
fn a_disk_is_cut_where_its_line_says() {
    let disk = Surfel::disk(Vec3::new(0.0, 0.0, 4.0), Vec3::NEG_Z, 1.0);
    let [s, t] = [disk.s, disk.t].map(Vec3::from_array);
    // The line x = 0.25 in the disk's own coordinates; the side x >= 0.25 remains.
    let scene = Scene {
        clips: vec![Clip([[s.x, t.x, -0.25], [0.0, 0.0, 1.0]])],
        surfels: vec![disk],
        colors: Colors::Constant([1.0; 4]),
        oriented: true,
        ..Scene::default()
    };
    let lens = Lens::OrthographicHeight(4.0);
    let camera = Camera::look_at((64, 64), lens, DVec3::ZERO, DVec3::Z, Some(DVec3::NEG_Y), scene.up, 0.1).unwrap();
    let maps = Maps::of(&[Map::Weight]);
    let (frame, _) =
        render(&scene, &camera, &Settings { maps, ..Settings::default() }, &Backend::Reference, &()).unwrap();
    for (pixel, weight) in frame.map(Map::Weight).unwrap().iter().enumerate() {
        let at = |k: usize| (k as f64 + 0.5) / 16.0 - 2.0;
        let ray = camera.ray_start(at(pixel % 64) * 16.0 + 32.0, at(pixel / 64) * 16.0 + 32.0);
        assert_eq!(*weight > 0.0, ray.x.hypot(ray.y) <= 1.0 && ray.x >= 0.25, "{ray}");
    }
    let tree = DiskTree::new(&scene);
    let covers = |x: f64| tree.covers(DVec3::new(x, 0.1, 4.0), DVec3::Z, 1.0);
    assert!(covers(0.26) && covers(0.9) && !covers(0.24) && !covers(-0.5));
}

/// The unit cube as OBJ, with outward faces, with or without its lid.
fn cube(lid: bool) -> String {
    let mut text = String::new();
    for k in 0..8 {
        text += &format!("v {} {} {}\n", k & 1, k >> 1 & 1, k >> 2 & 1);
    }
    for face in ["1 3 4 2", "1 2 6 5", "2 4 8 6", "4 3 7 8", "3 1 5 7"] {
        text += &format!("f {face}\n");
    }
    text + if lid { "f 5 6 8 7\n" } else { "" }
}

fn read(text: &str) -> Points {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cube.obj");
    std::fs::write(&path, text).unwrap();
    io::read(&path, &()).unwrap()
}

#[test]
fn a_cube_of_surfels_is_a_cube() {
    for lid in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cube.obj");
        std::fs::write(&path, cube(lid)).unwrap();
        let (scene, preparation) = build(vec![read(&cube(lid))], &()).unwrap();
        // Two triangles per side, one surfel each; the surfels overlap across the diagonal.
        assert_eq!([scene.surfels.len(), preparation.points as usize], [if lid { 12 } else { 10 }; 2]);
        assert_eq!((scene.closed, scene.oriented), (lid, true));
        // The view of whole disks is far enough for the thresholds below.
        let whole = Scene { clips: Vec::new(), ..scene.clone() };
        let camera = Camera::framing((240, 240), Lens::Fov(40.0), &whole, 1e-3).unwrap();
        let maps = Maps::of(&[Map::Depth, Map::Normal]);
        let samples: Samples = "16".parse().unwrap();
        let options = Settings { samples, maps, background: [1.0; 4], ..Settings::default() };
        let (frame, _) = render(&scene, &camera, &options, &Backend::Reference, &()).unwrap();
        let truth = Truth::cast(&Surface::read(&path, &()).unwrap(), &camera, &options, 8, &()).unwrap();
        let error = reconstruction(&frame, &truth).unwrap();
        assert_eq!(error.hole_rate, Some(0.0));
        // Disks reach 2 % of their radius past edges, which are a few hundred pixels long.
        assert!(error.silhouette_iou.unwrap() > 0.98 && error.psnr_db.unwrap() > 30.0, "{error:?}");
        // Control: the same disks without clip lines.
        let (frame, _) = render(&whole, &camera, &options, &Backend::Reference, &()).unwrap();
        assert!(reconstruction(&frame, &truth).unwrap().psnr_db.unwrap() < 22.0);
    }
}

#[test]
fn lines_stay_in_ply() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("clipped.ply");
    let axes = vec![[[0.5, 0.0, 0.0], [0.0, 0.25, 0.0]]; 2];
    let clips = vec![Clip([[1.0, -0.5, 0.25], [0.0, 1.0, 0.0]]), Clip::NONE];
    let points = Points {
        positions: vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
        axes: Some(axes),
        clips: Some(clips.clone()),
        closed: true,
        ..Points::default()
    };
    io::ply::write_points(&path, &points, &()).unwrap();
    let again = io::read(&path, &()).unwrap();
    assert!(again.closed);
    assert_eq!(again.clips.as_ref().unwrap(), &clips);
    assert_eq!(build(vec![again], &()).unwrap().0.clips, clips);
    // If no disk is clipped, no lines are written.
    let open = Points { clips: Some(vec![Clip::NONE; 2]), closed: false, ..points };
    io::ply::write_points(&path, &open, &()).unwrap();
    let again = io::read(&path, &()).unwrap();
    assert_eq!((again.clips, again.closed), (None, false));
}
