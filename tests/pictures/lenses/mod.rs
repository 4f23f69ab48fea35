//! Cameras whose lenses are no pinholes: points appear where the formulas of each model put them,
//! kernels draw what their twins draw, and nothing shows twice or breaks at a border.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod borders;
mod triangles;

use std::f64::consts::{PI, TAU};

use crate::common::{self, Random, bits};
use common::command::{Folder, epsplat, ply, succeeds, text};
use epsplat::Lens;
use epsplat::io::camera::Pose;
use epsplat::io::cameras;
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::inspect::stages;
use epsplat::low_level::passes::project::reference_all;
use epsplat::low_level::plan::{Organisation, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{
    Camera, Colors, Detail, Facing, Form, Kernel, Map, Maps, Optics, PointShape, Samples, Scene, Shading, Surfel,
    Triangle, Triangles,
};
use epsplat::low_level::surfels::hierarchy;
use glam::{DMat3, DVec2, DVec3, Vec3};

/// The models of COLMAP with parameters of real lenses, scaled up so that distortion matters: name
/// and parameters as in its files.
const MODELS: [(&str, &[f64]); 11] = [
    ("SIMPLE_PINHOLE", &[500.0, 321.0, 239.0]),
    ("PINHOLE", &[500.0, 510.0, 321.0, 239.0]),
    ("SIMPLE_RADIAL", &[500.0, 321.0, 239.0, -0.12]),
    ("RADIAL", &[500.0, 321.0, 239.0, -0.2, 0.06]),
    ("OPENCV", &[500.0, 510.0, 321.0, 239.0, -0.25, 0.09, 0.004, -0.003]),
    ("OPENCV_FISHEYE", &[300.0, 310.0, 321.0, 239.0, 0.03, -0.01, 0.004, -0.001]),
    ("FULL_OPENCV", &[500.0, 510.0, 321.0, 239.0, 0.3, -0.1, 0.002, -0.001, 0.02, 0.5, -0.05, 0.01]),
    ("FOV", &[400.0, 410.0, 321.0, 239.0, 0.9]),
    ("SIMPLE_RADIAL_FISHEYE", &[300.0, 321.0, 239.0, -0.04]),
    ("RADIAL_FISHEYE", &[300.0, 321.0, 239.0, 0.05, -0.02]),
    ("THIN_PRISM_FISHEYE", &[300.0, 310.0, 321.0, 239.0, 0.03, -0.01, 0.002, -0.003, 0.004, -0.001, 0.002, -0.004]),
];

/// Where a model of COLMAP shows the point (x, y, z) of camera space, by the formulas of its
/// documentation, written out for each model.
fn formula(name: &str, q: &[f64], [x, y, z]: [f64; 3]) -> [f64; 2] {
    let (u, v) = (x / z, y / z);
    let r2 = u * u + v * v;
    let one = |k: [f64; 2]| [q[0] * k[0] + q[1], q[0] * k[1] + q[2]];
    let two = |k: [f64; 2]| [q[0] * k[0] + q[2], q[1] * k[1] + q[3]];
    let theta = (x * x + y * y).sqrt().atan2(z);
    let at_angle = |scale: f64| {
        let r = (x * x + y * y).sqrt();
        [x / r * scale, y / r * scale]
    };
    match name {
        "SIMPLE_PINHOLE" => one([u, v]),
        "PINHOLE" => two([u, v]),
        "SIMPLE_RADIAL" => one([u * (1.0 + q[3] * r2), v * (1.0 + q[3] * r2)]),
        "RADIAL" => {
            let d = 1.0 + q[3] * r2 + q[4] * r2.powi(2);
            one([u * d, v * d])
        }
        "OPENCV" => {
            let d = 1.0 + q[4] * r2 + q[5] * r2.powi(2);
            two([
                u * d + 2.0 * q[6] * u * v + q[7] * (r2 + 2.0 * u * u),
                v * d + q[6] * (r2 + 2.0 * v * v) + 2.0 * q[7] * u * v,
            ])
        }
        "FULL_OPENCV" => {
            let d = (1.0 + q[4] * r2 + q[5] * r2.powi(2) + q[8] * r2.powi(3))
                / (1.0 + q[9] * r2 + q[10] * r2.powi(2) + q[11] * r2.powi(3));
            two([
                u * d + 2.0 * q[6] * u * v + q[7] * (r2 + 2.0 * u * u),
                v * d + q[6] * (r2 + 2.0 * v * v) + 2.0 * q[7] * u * v,
            ])
        }
        "FOV" => {
            let r = r2.sqrt();
            let d = (2.0 * r * (q[4] / 2.0).tan()).atan() / q[4] / r;
            two([u * d, v * d])
        }
        "OPENCV_FISHEYE" => {
            let t = theta;
            two(at_angle(t * (1.0 + q[4] * t.powi(2) + q[5] * t.powi(4) + q[6] * t.powi(6) + q[7] * t.powi(8))))
        }
        "SIMPLE_RADIAL_FISHEYE" => one(at_angle(theta * (1.0 + q[3] * theta.powi(2)))),
        "RADIAL_FISHEYE" => one(at_angle(theta * (1.0 + q[3] * theta.powi(2) + q[4] * theta.powi(4)))),
        _ => {
            let [u, v] = at_angle(theta);
            let r2 = u * u + v * v;
            let d = 1.0 + q[4] * r2 + q[5] * r2.powi(2) + q[8] * r2.powi(3) + q[9] * r2.powi(4);
            two([
                u * d + 2.0 * q[6] * u * v + q[7] * (r2 + 2.0 * u * u) + q[10] * r2,
                v * d + 2.0 * q[7] * u * v + q[6] * (r2 + 2.0 * v * v) + q[11] * r2,
            ])
        }
    }
}

const NEAR: f64 = 0.01;

fn posed(size: (u32, u32), lens: Lens) -> Camera {
    Camera::posed(size, lens, DVec3::ZERO, DMat3::IDENTITY, NEAR).unwrap()
}

/// The camera of a model at the origin, by the reader of COLMAP's files.
fn colmap(name: &str, parameters: &[f64]) -> Camera {
    let folder = Folder::new();
    let words: Vec<String> = parameters.iter().map(f64::to_string).collect();
    folder.file("cameras.txt", format!("1 {name} 640 480 {}\n", words.join(" ")));
    folder.file("images.txt", "1 1 0 0 0 0 0 0 1 a.png\n\n");
    let named = cameras::read(&folder.path(""), (9, 9)).unwrap().remove(0);
    let Pose::Rigid(rotation, eye) = named.camera.pose else { panic!("a pose is rigid") };
    assert_eq!((rotation, eye), (DMat3::IDENTITY, DVec3::ZERO));
    posed(named.camera.size.unwrap(), named.camera.lens)
}

/// Disks of a radius at random points within `most` radians of the axis.
fn disks(count: usize, radius: f64, most: f64, seed: u64) -> Scene {
    let mut random = Random(seed);
    let disk = |_| {
        let (angle, turn) = (most * random.between(0.0, 1.0).sqrt(), random.between(0.0, TAU));
        let (sine, cosine) = angle.sin_cos();
        let toward = DVec3::new(sine * turn.cos(), sine * turn.sin(), cosine);
        let aslant = DVec3::new(random.between(-0.5, 0.5), random.between(-0.5, 0.5), random.between(-0.5, 0.5));
        let place = toward * random.between(2.0, 5.0);
        Surfel::disk(place.as_vec3(), (aslant - toward).normalize().as_vec3(), radius as f32)
    };
    let surfels: Vec<Surfel> = (0..count).map(disk).collect();
    let color = |k: usize| [0.2 + 0.7 * (k % 7) as f32 / 7.0, 0.3 + 0.6 * (k % 5) as f32 / 5.0, 0.5, 1.0];
    Scene { colors: Colors::Linear((0..count).map(color).collect()), surfels, ..Scene::default() }
}

fn center(surfel: &Surfel) -> [f64; 3] {
    surfel.center.map(f64::from)
}

/// The image point at which u and v are 0, from the rows of a splat.
fn shown(anchor: [f64; 2], a: [f64; 3], b: [f64; 3]) -> DVec2 {
    let det = a[0] * b[1] - a[1] * b[0];
    let offset = DVec2::new(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2]) / det;
    DVec2::from_array(anchor) + 0.5 + offset
}

/// For each splat that the device and the twin draw: where they show its centre.
fn images(scene: &Scene, camera: &Camera) -> Option<Vec<(usize, DVec2, DVec2)>> {
    let gpu = common::gpu()?;
    let device = stages(scene, camera, &Settings::default(), &gpu, &Sources::default()).unwrap();
    let twins = reference_all(scene, camera, &Settings::default());
    let both = twins.iter().map(|twin| {
        let own = &device.splats[twin.surfel as usize];
        let [a, b] = [own.a, own.b].map(|row| row.map(f64::from));
        let a = std::array::from_fn(|k| a[k] + f64::from(own.a_low[k]));
        let of_device = shown([own.anchor_x, own.anchor_y].map(f64::from), a, b);
        let of_twin = shown(twin.anchor.map(|at| at as f64), twin.a.into(), twin.b.into());
        (twin.surfel as usize, of_device, of_twin)
    });
    Some(both.collect())
}

#[test]
fn points_of_distorted_colmap_cameras_appear_within_a_millionth_of_a_pixel() {
    for (name, parameters) in MODELS {
        let camera = colmap(name, parameters);
        // A perspective is tested within its image, a fisheye up to 80 degrees.
        let most = if name.ends_with("FISHEYE") { 1.4 } else { 0.6 };
        let scene = disks(600, 0.02, most, 5);
        let Some(images) = images(&scene, &camera) else { return };
        let (mut worst, mut worst_of_twin, mut moved) = (0.0f64, 0.0f64, 0.0f64);
        for (index, of_device, of_twin) in &images {
            let [x, y, z] = center(&scene.surfels[*index]);
            let expected = DVec2::from_array(formula(name, parameters, [x, y, z]));
            worst = worst.max((*of_device - expected).length());
            worst_of_twin = worst_of_twin.max((*of_twin - expected).length());
            let pinhole = DVec2::new(camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy);
            moved = moved.max((pinhole - expected).length());
        }
        eprintln!(
            "{name}: {} points, {worst:.1e} pixels, twin {worst_of_twin:.1e}, a pinhole {moved:.1}",
            images.len()
        );
        assert!(images.len() > 250 && worst < 1e-6 && worst_of_twin < 1e-10, "{name}: {worst} {worst_of_twin}");
        // The control: a pinhole would miss.
        assert_eq!(moved > 0.01, !name.ends_with("PINHOLE"), "{name}: {moved}");
    }
}

/// Where a lens shows a point of camera space, pixels.
type Formula<'a> = &'a dyn Fn([f64; 3]) -> DVec2;

#[test]
fn points_of_fisheyes_and_spheres_appear_where_their_angles_say() {
    let scene = disks(900, 0.02, 0.97 * PI, 6);
    let fisheye = posed((400, 400), Lens::Fisheye(340.0));
    let of_fisheye = |[x, y, z]: [f64; 3]| {
        let r = (x * x + y * y).sqrt();
        let scale = 400.0 / 340f64.to_radians() * (z / (r * r + z * z).sqrt()).acos() / r;
        DVec2::new(200.0 + scale * x, 200.0 + scale * y)
    };
    let sphere = posed((512, 256), Lens::Equirectangular);
    let of_sphere = |[x, y, z]: [f64; 3]| {
        let down = (y / (x * x + y * y + z * z).sqrt()).asin();
        DVec2::new(256.0 + 512.0 * x.atan2(z) / TAU, 128.0 + 256.0 * down / PI)
    };
    let cases: [(&str, Camera, Formula<'_>); 2] = [("fisheye", fisheye, &of_fisheye), ("sphere", sphere, &of_sphere)];
    for (name, camera, expected) in cases {
        let Some(images) = images(&scene, &camera) else { return };
        let mut worst = 0.0f64;
        for (index, of_device, of_twin) in &images {
            let at = expected(center(&scene.surfels[*index]));
            // A splat beyond the border of a sphere is away by the width of the image.
            let off = |image: DVec2| {
                (image - at)
                    .length()
                    .min((image - at + 512.0 * DVec2::X).length())
                    .min((image - at - 512.0 * DVec2::X).length())
            };
            worst = worst.max(off(*of_device)).max(off(*of_twin));
        }
        eprintln!("{name}: {} points, {worst:.1e} pixels", images.len());
        assert!(images.len() > 500 && worst < 1e-6, "{name}: {worst}");
    }
}

fn settings() -> Settings {
    Settings { maps: Maps::of(&[Map::Depth, Map::Normal]), shading: Shading::Lambert, ..Settings::default() }
}

/// One camera of each form, in which much is seen.
fn forms() -> [(&'static str, Camera); 3] {
    let bent = Optics::of(Form::Perspective).with_radial([-0.25, 0.09, 0.0, 0.0]).with_tangential([0.004, -0.003]);
    [
        ("perspective", posed((200, 150), Lens::Curved(bent, [120.0, 125.0, 101.0, 74.0]))),
        ("fisheye", posed((200, 200), Lens::Fisheye(220.0))),
        ("equirectangular", posed((256, 128), Lens::Equirectangular)),
    ]
}

fn drawn(scene: &Scene, camera: &Camera, settings: &Settings, backend: &Backend) -> Frame {
    render(scene, camera, settings, backend, &()).unwrap().0
}

/// The largest difference of a colour, and the number of pixels that differ by more than 1e-3.
fn difference(one: &Frame, other: &Frame) -> (f32, usize) {
    let of = |(a, b): (&[f32; 4], &[f32; 4])| (0..4).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
    let all: Vec<f32> = one.color.iter().zip(&other.color).map(of).collect();
    (all.iter().copied().fold(0.0, f32::max), all.iter().filter(|off| **off > 1e-3).count())
}

#[test]
fn kernels_draw_what_their_twins_draw() {
    let Some(gpu) = common::gpu() else { return };
    let scene = disks(6000, 0.08, 0.98 * PI, 7);
    for (name, camera) in forms() {
        let twin = drawn(&scene, &camera, &settings(), &Backend::Reference);
        let device = drawn(&scene, &camera, &settings(), &Backend::gpu(gpu.clone()));
        let covered = device.map(Map::Depth).unwrap().iter().filter(|depth| depth.is_finite()).count();
        let (most, off) = difference(&device, &twin);
        eprintln!("{name}: {covered} pixels, at most {most:.1e}, {off} pixels above 1e-3");
        // A pixel on the rim of a disk may be on either side of it.
        assert!(covered > 2000 && off <= 2, "{name}: {most} in {off} pixels of {covered}");
        let broken = match name {
            "perspective" => (
                "distortion.wgsl",
                "sight.across = slope.x * first.across",
                "sight.across = 0.8 * slope.x * first.across",
            ),
            "fisheye" => (
                "lens_fisheye.wgsl",
                "sight.x = product(x, turned);",
                "sight.x = product(x, single(turned.high * 1.001));",
            ),
            _ => ("lens_sphere.wgsl", "sight.axis = at / depth;", "sight.axis = vec3<f32>(0.0, 0.0, 1.0);"),
        };
        let sources = Sources::default().replace(broken.0, broken.1, broken.2).unwrap();
        let noticed = drawn(&scene, &camera, &settings(), &Backend::Gpu { gpu: Box::new(gpu.clone()), sources });
        let (most, off) = difference(&noticed, &twin);
        assert!(off > 20, "{name}: a broken kernel draws the same, but for {off} pixels, at most {most}");
    }
}

#[test]
fn a_lens_draws_the_same_bits_by_every_organisation() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let scene = disks(1500, 0.15, 0.98 * PI, 8);
    for (name, camera) in forms() {
        let by = |organisation, samples| {
            let settings = Settings { organisation, samples, ..settings() };
            bits(&drawn(&scene, &camera, &settings, &backend))
        };
        let four = Samples { across: 2, down: 2 };
        for samples in [Samples::ONE, four] {
            let scatter = by(Organisation::Scatter, samples);
            assert!(scatter == by(Organisation::Scatter, samples), "{name}: two runs differ");
            assert!(scatter == by(Organisation::Tile, samples), "{name}: tiles differ");
        }
        assert!(by(Organisation::Scatter, Samples::ONE) != by(Organisation::Scatter, four), "{name}: the control");
    }
}

/// The image of a whole sphere, turned by a quarter, is the same image moved by a quarter of its
/// width: nothing ends at the border.
#[test]
fn a_whole_sphere_has_no_seam() {
    let Some(gpu) = common::gpu() else { return };
    let scene = disks(2500, 0.3, 0.999 * PI, 9);
    let (width, quarter) = (256, 64);
    let camera = posed((width, width / 2), Lens::Equirectangular);
    let turned = DMat3::from_cols(DVec3::Z, DVec3::Y, -DVec3::X);
    let turned = Camera { rotation: turned, ..camera.clone() };
    let plain = Settings { shading: Shading::Unlit, ..Settings::default() };
    let off = |backend: &Backend| {
        let [one, other] = [&camera, &turned].map(|camera| drawn(&scene, camera, &plain, backend));
        let at = |frame: &Frame, x: u32, y: u32| frame.color[(y * width + x % width) as usize];
        let differs = |x: u32, y: u32, by: u32| {
            let (a, b) = (at(&one, x, y), at(&other, x + by, y));
            (0..4).any(|k| (a[k] - b[k]).abs() > 1e-3)
        };
        let count = |by: u32| {
            let all = (0..width / 2).flat_map(|y| (0..width).map(move |x| (x, y)));
            all.filter(|(x, y)| differs(*x, *y, by)).count()
        };
        count(quarter).min(count(width - quarter))
    };
    let sources = Sources::default().replace("around.wgsl", "(*h).anchor.x += turn;", "").unwrap();
    let sources = sources.replace("around.wgsl", "(*h).low.x += f32(turn);", "(*h).low.x = 1e9;").unwrap();
    let seams = off(&Backend::Gpu { gpu: Box::new(gpu.clone()), sources });
    let counts = [off(&Backend::gpu(gpu)), off(&Backend::Reference), seams];
    eprintln!("pixels that differ: device, twin, without the other side {counts:?}");
    assert!(counts[0] <= 10 && counts[1] <= 10 && counts[2] > 300, "{counts:?}");
}

/// Beyond the radius at which a polynomial stops growing it would show a point a second time.
#[test]
fn points_beyond_the_fold_of_a_distortion_are_dropped() {
    let Some(gpu) = common::gpu() else { return };
    let optics = Optics::of(Form::Perspective).with_radial([-0.5, 0.0, 0.0, 0.0]);
    // r (1 - r²/2) grows up to r² = 2/3.
    assert!((optics.limit() - (2.0f64 / 3.0).sqrt()).abs() < 1e-9, "{}", optics.limit());
    let camera = posed((200, 200), Lens::Curved(optics, [100.0, 100.0, 100.0, 100.0]));
    let one = |r: f32| {
        let disk = Surfel::disk(Vec3::new(r, 0.0, 1.0), Vec3::NEG_Z, 0.03);
        Scene { surfels: vec![disk], ..Scene::default() }
    };
    // The formula shows r = 1.2 at 0.336, inside the image.
    for (r, shows) in [(0.5, true), (0.7, true), (1.2, false), (2.0, false)] {
        for backend in [Backend::Reference, Backend::gpu(gpu.clone())] {
            let frame = drawn(&one(r), &camera, &settings(), &backend);
            let depths = frame.map(Map::Depth).unwrap();
            assert_eq!(depths.iter().any(|depth| depth.is_finite()), shows, "{r}");
        }
    }
}

/// At r pixels from its centre, the image of a splat errs by at most C r² / f pixels, with f the
/// focal length and the C of the guide. The formulas of C are those of the lenses' curvatures.
#[test]
fn images_of_disks_err_as_the_guide_says() {
    for (name, camera) in &forms() {
        let focal = DVec2::new(camera.fx, camera.fy);
        let size = DVec2::new(camera.width.into(), camera.height.into());
        // The largest C near the centre and at some pixels from it, in units of what the guide
        // says.
        let (mut near, mut far, mut random) = (0.0f64, 0.0f64, Random(10));
        for _ in 0..20_000 {
            let mut at = || random.between(-1.0, 1.0);
            let p = DVec3::new(at(), at(), at()).normalize();
            let Some((image, _)) = camera.image(p) else { continue };
            let sight = camera.sight(p).unwrap();
            let r = sight.plane.length();
            let stated = match *name {
                "perspective" => {
                    let ([k1, k2], lean, r) = ([-0.25f64, 0.09], 0.004f64.hypot(0.003), sight.radius);
                    let slope = (1.0 + 3.0 * k1 * r.powi(2) + 5.0 * k2 * r.powi(4) - 6.0 * lean * r).min(1.0);
                    (3.0 * k1.abs() * r + 10.0 * k2 * r.powi(3) + 3.0 * lean) / slope.powi(2)
                }
                "fisheye" => r / 3.0,
                _ => 0.5 * (1.0 / (1.0 - p.y * p.y) - 1.0).sqrt() + 0.05,
            };
            if image.cmplt(DVec2::ZERO).any()
                || image.cmpgt(size).any()
                || p.y.abs() > 0.98
                || r < 0.1
                || (*name == "fisheye" && r > 1.92)
            {
                continue;
            }
            let across = p.any_orthonormal_vector();
            let around = p.cross(across);
            for step in 0..16 {
                let (sine, cosine) = (TAU * f64::from(step) / 16.0).sin_cos();
                for (pixels, worst) in [(0.05, &mut near), (4.0, &mut far)] {
                    let v = (across * cosine + around * sine) * (pixels / camera.fx);
                    let Some((exact, _)) = camera.image(p + v) else { continue };
                    let moved = DVec2::new(sight.steps[0].dot(v), sight.steps[1].dot(v)) * focal;
                    let moved = moved / (sight.depth + sight.axis.dot(v));
                    // Across the border of a sphere both are right.
                    if (exact - image - moved).length() < 100.0 {
                        let c = (exact - image - moved).length() * camera.fx / moved.length_squared();
                        *worst = worst.max(c / stated);
                    }
                }
            }
        }
        eprintln!("{name}: C is at most {near:.3} times what the guide says, {far:.3} times at 4 pixels");
        assert!(near > 0.5 && near <= 1.0, "{name}: {near}");
        assert!(far <= 2.0, "{name}: {far}");
    }
}

/// A picture that a lens does not show is refused with a sentence; with a pinhole it is drawn.
#[test]
fn what_a_lens_does_not_show_is_refused() {
    let scene = disks(20, 0.1, 1.0, 11);
    let plain = posed((32, 32), Lens::Fov(90.0));
    let refusal = |scene: &Scene, lens: Lens, settings: &Settings| {
        let of = |camera: &Camera| {
            render(scene, camera, settings, &Backend::Reference, &()).err().map(|error| error.to_string())
        };
        assert_eq!(of(&plain), None);
        of(&posed((32, 32), lens)).unwrap_or_default()
    };
    let facing = Facing { shape: PointShape::Circle, pixels: Facing::LIMITS };
    let said = refusal(
        &scene,
        Lens::Fisheye(180.0),
        &Settings { facing: Some(facing), shading: Shading::Unlit, ..Settings::default() },
    );
    assert!(said.contains("leave --facing out with a lens"), "{said}");
    let leveled = hierarchy::build(scene.clone(), &()).unwrap().0;
    let settings = Settings { detail: Detail::Pixels(4.0), ..Settings::default() };
    let said = refusal(&leveled, Lens::Fisheye(180.0), &settings);
    assert!(said.contains("levels of detail are chosen by pinholes"), "{said}");
    let corners = [[0.0, 0.0, 3.0], [1.0, 0.0, 3.0], [0.0, 1.0, 3.0]];
    let triangle = Triangle { corners, normals: None, colors: [[1.0; 4]; 3], texture: None };
    let meshed = Scene { triangles: Triangles::new(&[triangle]), ..scene };
    let said = refusal(&meshed, Lens::Equirectangular, &Settings::default());
    assert!(said.contains("take --mesh surfels"), "{said}");
    assert_eq!(refusal(&meshed, Lens::Fisheye(180.0), &Settings::default()), "");
}

/// A wall of two triangles in a fisheye: each pixel's ray meets it where the depth says, because
/// the triangles are split; drawn whole, they are far off.
#[test]
fn large_triangles_bend_with_the_lens() {
    let wall = "v -2 -2 1\nv 2 -2 1\nv 2 2 1\nv -2 2 1\nf 1 3 2\nf 1 4 3\n";
    let folder = Folder::new();
    let mesh = folder.file("wall.obj", wall);
    let output = folder.path("wall.npy");
    let (width, fov) = (128u32, 140f64.to_radians());
    let line = ["render", text(&mesh), "-o", text(&output), "--projection", "fisheye", "--fov", "140"];
    let pose = ["--eye", "0,0,0", "--target", "0,0,1", "--up=-y", "--size", "128", "--aov", "depth", "--samples", "1"];
    for backend in ["reference", "gpu"] {
        if backend == "gpu" && common::gpu().is_none() {
            continue;
        }
        succeeds(&[&line[..], &pose, &["--backend", backend]].concat());
        let bytes = std::fs::read(&output).unwrap();
        let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let depths: Vec<f32> = bytes[start..].as_chunks().0.iter().map(|four| f32::from_le_bytes(*four)).collect();
        assert_eq!(depths.len(), (width * width) as usize);
        let (mut wrong, mut covered) = (0, 0);
        for (index, depth) in depths.iter().enumerate() {
            let at = DVec2::new((index as u32 % width) as f64 + 0.5, (index as u32 / width) as f64 + 0.5) - 64.0;
            let angle = at.length() * fov / f64::from(width);
            // Distance along the ray to the plane z = 1, inside the square of 4 units.
            let side = angle.tan() * (at / at.length()).abs().max_element();
            if angle > 1.5 || (side - 2.0).abs() < 0.1 {
                continue;
            }
            let expected = if side < 2.0 { 1.0 / angle.cos() } else { f64::INFINITY };
            let fits = (f64::from(*depth) - expected).abs() <= 0.01 * expected || f64::from(*depth) == expected;
            (wrong, covered) = (wrong + u32::from(!fits), covered + u32::from(expected.is_finite()));
        }
        assert!(wrong == 0 && covered > 3000, "{backend}: {wrong} of {covered}");
    }
}

/// A point that a pinhole would show beside the image, and the lens shows in it, is seen.
#[test]
fn visible_points_are_those_of_the_lens() {
    let folder = Folder::new();
    let cloud = folder.file("c.ply", ply("x y z nx ny nz radius", 2, "0 0 -1 0 0 1 0.05\n1.1 0 -1 0 0 1 0.05\n"));
    let lens = r#""w": 200, "h": 200, "fl_x": 100, "cx": 100, "cy": 100, "k1": -0.2"#;
    let pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    let cameras = format!(r#"{{{lens}, "frames": [{{"file_path": "a", "transform_matrix": {pose}}}]}}"#);
    let (cameras, seen) = (folder.file("t.json", cameras), folder.path("seen.ply"));
    let line = ["visible", text(&cloud), "--cameras", text(&cameras), "-o", text(&seen), "--backend", "reference"];
    for (more, count) in [(None, 2), (Some("--ignore-distortion"), 1)] {
        succeeds(&[&line[..], &more.into_iter().collect::<Vec<_>>()].concat());
        let head = String::from_utf8_lossy(&std::fs::read(&seen).unwrap()).into_owned();
        assert!(head.contains(&format!("element vertex {count}\n")), "{more:?}");
    }
}

/// A refusal says how to get a pinhole where there is a way, and comes before notes on the lens.
#[test]
fn refusals_name_the_option_that_gives_a_pinhole() {
    let folder = Folder::new();
    let rows = "1.5 0 -2 0 0 1 1.9\n".repeat(2);
    let cloud = folder.file("c.ply", ply("x y z nx ny nz radius", 2, &rows));
    let pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    let set = |lens: &str| {
        let frame = format!(r#"{{"file_path": "a", "transform_matrix": {pose}}}"#);
        folder.file("t.json", format!(r#"{{"w": 64, "h": 64, "fl_x": 40, {lens}, "frames": [{frame}]}}"#))
    };
    let camera = r#"{"model": "fisheye", "eye": [0,0,0], "target": [0,0,-1]}"#;
    let camera = folder.file("camera.json", camera);
    let (output, views) = (folder.path("a.png"), folder.path("views"));
    let refused = |line: &[&str], end: &str| {
        let all = ["render", text(&cloud), "--backend", "reference", "--facing", "circle", "--shading", "unlit"];
        let run = epsplat(&[&all[..], line].concat());
        let said = String::from_utf8(run.stderr).unwrap();
        let last = said.lines().last().unwrap_or_default();
        assert!(!run.status.success() && last.ends_with(end), "{said}");
        assert!(!said.contains("this lens bends"), "{said}");
    };
    let facing = "leave --facing out with a lens";
    let line = ["-o", text(&output), "--projection", "fisheye", "--eye", "0,0,0", "--target", "0,0,-1"];
    refused(&line, &format!("{facing}, or leave --projection out"));
    refused(
        &["-o", text(&output), "--camera", text(&camera)],
        &format!("{facing}, or take a camera file without a model"),
    );
    for (lens, end) in [(r#""k1": 0.1"#, ", or take --ignore-distortion"), (r#""camera_model": "EQUIRECTANGULAR""#, "")]
    {
        let set = set(lens);
        refused(&["-o", text(&views), "--cameras", text(&set)], &format!("{facing}{end}"));
    }
}
