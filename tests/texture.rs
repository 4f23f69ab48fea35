//! Surfels painted by a texture: the device against the twin, painted surfels against rays, and what cannot be painted.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::process::Command;

use common::bits;
use common::scenes::{shuffled, sphere, sphere_camera};
use epsplat::gpu::Sources;
use epsplat::io::{self, Points, Texture};
use epsplat::metrics::reconstruction;
use epsplat::passes::project::reference_all;
use epsplat::passes::{accumulate, visibility};
use epsplat::render::{Backend, render};
use epsplat::scene::{
    Camera, Colors, Lens, LowPass, Maps, Place, Projection, RenderOptions, Scene, Shading, Textured, Up,
};
use epsplat::surfels::sampling::{MeshSurface, Method, Priority, sample, voxels::Voxel};
use epsplat::surfels::{build, build_textured};
use epsplat::truth::{Surface, Truth};
use glam::{DVec3, Vec3};

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/data");

/// Waves of 8-bit colours, opaque or not. Neighbouring texels differ by less than [`STEEPEST`].
fn waves(opaque: bool) -> Texture {
    let (width, height) = (64u32, 32u32);
    let texel = |k: u32| {
        let (x, y) = (TAU * f64::from(k % width) / f64::from(width), TAU * f64::from(k / width) / f64::from(height));
        let code = |wave: f64| (140.0 + 100.0 * wave.sin()) as u8;
        [code(3.0 * x), code(2.0 * y), code(x + y), if opaque { 255 } else { code(x - y) }]
    };
    Texture::new(width, height, (0..width * height).map(texel).collect()).unwrap()
}

/// Linear light from texel to texel: 100 codes of a wave of 64 / 3 texels are 30 codes a texel, at most 0.0086 each.
const STEEPEST: f64 = 30.0 * 0.0086;

/// The belt of a sphere whose texture goes around it once, with a seam from end to end.
fn globe(count: usize, texture: Texture) -> Scene {
    let whole = sphere(count, 1.5);
    let centers = whole.surfels.iter().map(|surfel| Vec3::from_array(surfel.center));
    let belt: Vec<Vec3> = centers.filter(|center| center.y.abs() < 0.8).collect();
    let around = |p: &Vec3| [(0.5 + f64::from(p.z).atan2(p.x.into()) / TAU) as f32, 1.0 - p.y.acos() / PI as f32];
    let points = Points {
        positions: belt.iter().map(|center| center.as_dvec3().to_array()).collect(),
        normals: Some(belt.iter().map(Vec3::to_array).collect()),
        radii: Some(vec![whole.surfels[0].radius(); belt.len()]),
        texture: Some(belt.iter().map(around).collect()),
        ..Points::default()
    };
    build_textured(vec![points], texture, &()).unwrap().0
}

fn textured(scene: &Scene) -> &Textured {
    let Colors::Textured(textured) = &scene.colors else { panic!("it is not textured") };
    textured
}

/// Toward the seam, which the camera of [`sphere_camera`] does not see.
fn camera(size: u32, projection: Projection) -> Camera {
    let eye = DVec3::new(-2.6, 0.7, 0.9);
    let lens = sphere_camera(size, projection);
    let lens = match projection {
        Projection::Pinhole => Lens::Intrinsics([lens.fx, lens.fy, lens.cx, lens.cy]),
        Projection::Orthographic => Lens::OrthographicHeight(2.1),
    };
    Camera::look_at((size, size), lens, eye, DVec3::ZERO, None, Up::Y, 1e-5).unwrap()
}

/// Pixels at which the device's colour is farther from the twin's than the sums' bound, the texture's slope and the passage
/// between the texture and the blended colour allow; and how many were looked at, were undecided, and lie in the passage.
fn beyond_bounds(scene: &Scene, camera: &Camera, accumulator: &'static str, sources: &Sources) -> Option<[usize; 4]> {
    let gpu = common::gpu()?;
    let options = RenderOptions { accumulator, ..unlit() };
    let row = accumulate::accumulator(accumulator).unwrap();
    let fraction_bits = row.fraction_bits(scene.surfels.len() as u64);
    let backend = Backend::Gpu { gpu: Box::new(gpu), sources: sources.clone() };
    let (device, _) = render(scene, camera, &options, &backend, &()).unwrap();
    let exact = RenderOptions { maps: Maps { decision: true, normal: true, ..options.maps }, ..options };
    let (twin, _) = render(scene, camera, &exact, &Backend::Reference, &()).unwrap();
    let splats = reference_all(scene, camera, &exact);
    let nearest = visibility::reference(splats.iter(), camera, LowPass::None, 0, camera.height);
    let sums = accumulate::reference(splats.iter(), scene, camera, &exact, 0, &nearest);
    let range = textured(scene).range();
    let [width, height] = textured(scene).texture().size().map(f64::from);
    // Colour for a step in the texture, of one in u or in v.
    let slope = STEEPEST * width.hypot(height);
    let (mut found, mut worst) = ([0; 4], 0f64);
    for (pixel, sum) in sums.iter().enumerate().filter(|(_, sum)| sum.weight > 0.0) {
        found[1] += 1;
        if twin.decision.as_ref().unwrap()[pixel] < 1e-5 {
            found[2] += 1;
            continue;
        }
        let [u, v, squared, reach_2] = sum.place.map(|total| total / sum.weight);
        let variance = squared - u * u - v * v;
        // Of a mean as a fraction of its range; and what f32 makes of a fragment's weight and of its place on the disk.
        let mean = 3.0 * (row.error_bound)(sum.count.max(1).into(), sum.weight, fraction_bits);
        let fragment = 2e-6;
        let apart = variance.max(0.0).sqrt() + reach_2.sqrt();
        // A fragment's point errs by a few roundings of its distance, which is about 3, and along the surface by more the more
        // that is tilted; the coordinates gain less than 0.4 for a unit.
        let normal = Vec3::from_array(twin.normal.as_ref().unwrap()[pixel]).as_dvec3();
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
        let cosine = normal.dot(camera.ray(f64::from(x) + 0.5, f64::from(y) + 0.5).normalize()).abs();
        let of_point = 4.0 * (-24f64).exp2() * 3.0 * 0.4 / (cosine * cosine).max(1e-4);
        let of_lookup = slope * f64::from(range.span) * (mean + fragment * apart + of_point);
        // The variance is a difference of means of size 1/2 at most; where it is far from the passage the share is 0 or 1 for both.
        let of_ratio = 3.0 * mean / reach_2 + fragment * (1.0 + variance / reach_2);
        let ratio = variance / reach_2;
        let in_passage = ratio > 1.0 - of_ratio && ratio < 2.0 + of_ratio;
        found[3] += usize::from(in_passage);
        let alpha = f64::from(twin.color[pixel][3]).max(0.3);
        let limit = (mean + fragment + of_lookup + if in_passage { of_ratio } else { 0.0 }) / alpha;
        let differs = (0..4).map(|k| f64::from((device.color[pixel][k] - twin.color[pixel][k]).abs()));
        let difference = differs.fold(0.0, f64::max);
        worst = worst.max(difference / limit);
        found[0] += usize::from(difference > limit);
    }
    eprintln!("{accumulator}: {found:?}, at most {worst:.2} of the bounds");
    Some(found)
}

fn unlit() -> RenderOptions {
    RenderOptions { shading: Shading::Unlit, ..RenderOptions::default() }
}

#[test]
fn the_device_paints_as_its_twin_does() {
    let Some(gpu) = common::gpu() else { return };
    let globe = globe(3000, waves(true));
    for row in common::accumulators(&gpu) {
        let camera = camera(160, Projection::Pinhole);
        let Some(found) = beyond_bounds(&globe, &camera, row.name, &Sources::default()) else { return };
        let [wrong, covered, open, passing] = found;
        assert!(wrong == 0 && covered > 8000 && open < covered / 50 && passing > 0, "{}: {found:?}", row.name);
    }
    for (scene, projection) in
        [(&globe, Projection::Orthographic), (&self::globe(3000, waves(false)), Projection::Pinhole)]
    {
        let found = beyond_bounds(scene, &camera(160, projection), "fixed", &Sources::default()).unwrap();
        assert!(found[0] == 0 && found[1] > 8000, "{found:?}");
    }
    for (file, from, to) in [
        ("texture.wgsl", "fract(turns)", "fract(turns + 0.001)"),
        ("texture.wgsl", "clamp(2.0 -", "clamp(200.0 -"),
        ("texture.wgsl", "(point - place.position) * view.world", "(point - place.position) * (0.9 * view.world)"),
        ("texture.wgsl", "texel(column + 1, row + 1), share.x)", "texel(column + 1, row + 1), 0.99 * share.x)"),
        ("srgb.wgsl", "(code >> 8u) & 0xffu", "(code >> 9u) & 0xffu"),
        ("resolve.wgsl", "textured(pixel, weight, resolve_color(pixel, weight))", "resolve_color(pixel, weight)"),
    ] {
        let broken = Sources::default().replace(file, from, to).unwrap();
        let found = beyond_bounds(&globe, &camera(160, Projection::Pinhole), "fixed", &broken).unwrap();
        assert!(found[0] >= 20, "{from} became {to}, and {found:?}");
    }
}

#[test]
fn a_painted_image_does_not_depend_on_the_order_of_surfels() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera) = (globe(2000, waves(true)), camera(96, Projection::Pinhole));
    let backend = Backend::gpu(gpu);
    let drawn = |scene: &Scene| bits(&render(scene, &camera, &unlit(), &backend, &()).unwrap().0);
    let first = drawn(&scene);
    assert_eq!(first, drawn(&shuffled(&scene, 7)));
    // Another texture makes another image.
    assert_ne!(first, drawn(&globe(2000, waves(false))));
}

/// A scene with other places.
fn with_places(scene: &Scene, other: impl Fn(&Place) -> Place) -> Scene {
    let painted = textured(scene);
    let places = painted.places().iter().map(other).collect();
    let again = Textured::new(painted.texture().clone().into(), places, painted.colors().to_vec()).unwrap();
    Scene { colors: Colors::Textured(again), ..scene.clone() }
}

#[test]
fn a_texture_shows_what_is_finer_than_surfels() {
    let mut mesh = io::read_mesh(&Path::new(DATA).join("cube.obj"), &()).unwrap();
    let texture = Texture::read(&Path::new(DATA).join("cube.png")).unwrap();
    mesh.paint(texture.clone());
    let priority = |surface: &MeshSurface<'_>, voxels: &[Voxel]| Priority::Area.of(surface, voxels);
    let method = Method::Stratified { priority: &priority, depth: None };
    let (points, _) = sample(&mesh, 3000, &method, 0, &()).unwrap();
    let (painted, _) = build_textured(vec![points.clone()], texture, &()).unwrap();
    let (colored, _) = build(vec![points], &()).unwrap();
    // So near to a corner that no outline is seen: it is the surfels', whoever paints them.
    let (eye, corner) = (DVec3::new(3.1, 2.6, 4.2), DVec3::new(0.9, 0.9, 0.9));
    let camera = Camera::look_at((240, 240), Lens::Fov(14.0), eye, corner, None, Up::Y, 1e-3).unwrap();
    let options = RenderOptions { maps: Maps { depth: true, normal: true, ..Maps::default() }, ..unlit() };
    let truth = Truth::cast(&Surface::mesh(&mesh).unwrap(), &camera, &options, 4, &()).unwrap();
    let psnr = |scene: &Scene| {
        let (frame, _) = render(scene, &camera, &options, &Backend::Reference, &()).unwrap();
        reconstruction(&frame, &truth).unwrap().psnr_db.unwrap()
    };
    let by_texture = psnr(&painted);
    let by_color = psnr(&colored);
    // Of the paper's TexZ map: a splat has the coordinates of its centre.
    let of_centers = psnr(&with_places(&painted, |place| Place { slopes: [[0.0; 3]; 2], ..*place }));
    // Seams are not told from anything else.
    let across_seams = psnr(&with_places(&painted, |place| Place { reach: 10.0, ..*place }));
    eprintln!("{by_texture:.2} dB; by colour {by_color:.2}, centres {of_centers:.2}, across seams {across_seams:.2}");
    assert!(by_texture > by_color + 0.5 && by_texture > of_centers + 1.0 && by_texture > across_seams + 0.5);
}

fn refused(arguments: &[&str]) -> (i32, String) {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.png");
    let run = Command::new(env!("CARGO_BIN_EXE_epsplat")).arg("render").args(arguments).arg("-o").arg(&output).output();
    let run = run.unwrap();
    assert!(!output.exists());
    (run.status.code().unwrap(), String::from_utf8(run.stderr).unwrap())
}

#[test]
fn what_cannot_be_painted_is_told() {
    let (bunny, cube) = (&format!("{DATA}/bunny.obj"), &format!("{DATA}/cube.png"));
    let reference = ["--backend", "reference"];
    for (arguments, code, words) in [
        ([&[bunny, "--texture", cube][..], &reference].concat(), 1, ["bunny.obj", "no texture coordinates"]),
        ([&[bunny, "--texture", bunny][..], &reference].concat(), 1, ["bunny.obj", "PNG"]),
        ([&[bunny, "--texture", "none.png"][..], &reference].concat(), 1, ["none.png", "No such file"]),
        (vec![bunny, "--texture", cube, "--backend", "raster"], 2, ["raster", "--texture"]),
        (vec![bunny, "--texture", cube, "--organisation", "tile"], 2, ["tile", "--texture"]),
        (vec![bunny, "--shininess", "5"], 2, ["--shininess", "phong"]),
        (vec![bunny, "--shading", "phong", "--shininess", "0"], 2, ["--shininess", "1000"]),
    ] {
        let (status, told) = refused(&arguments);
        assert!(status == code && words.iter().all(|word| told.contains(word)), "{arguments:?}: {status} {told}");
    }
    let bare = Points { positions: vec![[0.0; 3]; 3], ..Points::default() };
    assert!(build_textured(vec![bare], waves(true), &()).unwrap_err().to_string().contains("texture coordinates"));
}

#[test]
fn places_that_are_no_numbers_are_counted() {
    let points = Points {
        positions: (0..25).map(|k| [f64::from(k % 5), f64::from(k / 5), 0.0]).collect(),
        texture: Some((0..25).map(|k| [0.1 * (k % 5) as f32, if k == 12 { f32::NAN } else { 0.5 }]).collect()),
        ..Points::default()
    };
    let (scene, preparation) = build_textured(vec![points], waves(true), &()).unwrap();
    assert_eq!(preparation.replaced_places, 1);
    assert!(preparation.notes().iter().any(|note| note.contains("1 points had texture coordinates")));
    assert_eq!(textured(&scene).places()[12].center, [0.0; 2]);
    // Along x the coordinate gains 0.1 a unit.
    let [u_slope, v_slope] = textured(&scene).places()[6].slopes.map(Vec3::from_array);
    assert!(u_slope.distance(0.1 * Vec3::X) < 1e-6 && v_slope.length() < 1e-6, "{u_slope} {v_slope}");
}
