//! Seeded scenes of surfels of many kinds, generated in camera space so that each kind looks as its
//! name says.

use epsplat::io::{Points, Texture};
use epsplat::low_level::scene::Lens;
use epsplat::low_level::scene::{Camera, Colors, Projection, Scene, Surfel, Up};
use epsplat::low_level::surfels::analytic::{Sample, Shape, generate};
use epsplat::low_level::surfels::{build, build_textured};
use glam::{DMat3, DVec2, DVec3, Vec3};

use super::Random;

/// How a surfel looks from the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Radius under two pixels.
    Small,
    /// Radius of a few pixels.
    Medium,
    /// Covers much of the image.
    Large,
    /// The cosine between view ray and normal is 1e-2 to 1e-1.
    Tilted,
    /// The cosine between view ray and normal is 1e-6 to 1e-1, and the centre projects to a pixel.
    EdgeOn,
    /// Ratio of half-axes up to 1000:1.
    Anisotropic,
    /// Behind the camera.
    Behind,
    /// The centre is up to several image sizes outside the image.
    OffScreen,
    /// Crosses the near depth.
    Crossing,
}

/// A scene and the camera that sees it.
pub struct Case {
    pub name: &'static str,
    pub scene: Scene,
    pub camera: Camera,
}

pub const SIZE: (u32, u32) = (160, 120);

/// A camera that sees a region of a few `length` about `origin`, with an off-centre principal point
/// and different focal lengths in x and y.
fn camera(projection: Projection, origin: DVec3, length: f64, near: f64) -> Camera {
    let lens = match projection {
        Projection::Pinhole => Lens::Intrinsics([150.0, 140.0, 52.3, 71.9]),
        Projection::Orthographic => Lens::OrthographicScale([40.0 / length, 37.0 / length, 83.1, 55.7]),
    };
    let eye = origin + DVec3::new(0.31, -1.7, 0.9) * length;
    let target = origin + DVec3::new(-0.2, 0.4, 0.1) * length;
    Camera::look_at(SIZE, lens, eye, target, None, Up::Z, near * length).unwrap()
}

/// A surfel of `kind` in camera space: centre, s, t, in units of `length`.
fn surfel(kind: Kind, camera: &Camera, length: f64, near: f64, random: &mut Random) -> [DVec3; 3] {
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let mut pixel = DVec2::new(random.between(-5.0, width + 5.0), random.between(-5.0, height + 5.0));
    let mut z = random.between(1.0, 3.0);
    let (radius, cosine, aspect) = match kind {
        Kind::Small => (random.scale(0.2, 2.0), random.between(0.3, 1.0), random.between(1.0, 1.5)),
        Kind::Medium => (random.scale(2.0, 15.0), random.between(0.3, 1.0), random.between(1.0, 2.0)),
        Kind::Large => (random.scale(30.0, 150.0), random.between(0.3, 1.0), random.between(1.0, 2.0)),
        Kind::Tilted => (random.scale(3.0, 20.0), random.scale(1e-2, 1e-1), 1.0),
        Kind::EdgeOn => (random.scale(3.0, 40.0), random.scale(1e-6, 1e-1), random.between(1.0, 2.0)),
        Kind::Anisotropic => (random.scale(5.0, 60.0), random.between(0.3, 1.0), random.scale(1.0, 1000.0)),
        Kind::Behind => (random.scale(1.0, 40.0), random.between(0.3, 1.0), 1.0),
        Kind::OffScreen => (random.scale(20.0, 600.0), random.between(0.05, 1.0), 1.0),
        Kind::Crossing => (random.scale(5.0, 100.0), random.scale(1e-2, 1.0), random.between(1.0, 3.0)),
    };
    match kind {
        Kind::EdgeOn => pixel = pixel.floor() + 0.5,
        Kind::Behind => z = -z,
        Kind::OffScreen => pixel = (pixel - 80.0) * 8.0,
        Kind::Crossing => z = near * random.between(0.6, 1.4),
        _ => {}
    }
    let (fx, fy) = (camera.fx, camera.fy);
    let (center, ray, per_pixel) = match camera.projection {
        Projection::Pinhole => {
            let d = DVec3::new((pixel.x - camera.cx) / fx, (pixel.y - camera.cy) / fy, 1.0);
            (d * z, d.normalize(), z.abs() / fx)
        }
        Projection::Orthographic => {
            let xy = DVec2::new((pixel.x - camera.cx) / fx, (pixel.y - camera.cy) / fy) / length;
            (xy.extend(z), DVec3::Z, 1.0 / (fx * length))
        }
    };
    let radius = radius * per_pixel;
    // A frame about the view ray: turned by a random angle, tilted, and turned in its own plane.
    let side = ray.any_orthonormal_vector();
    let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
    let along = side * cos + ray.cross(side) * sin;
    let across = ray.cross(along);
    let sign = if random.unit() < 0.5 { 1.0 } else { -1.0 };
    let tilted = along * cosine + ray * (1.0 - cosine * cosine).sqrt();
    let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
    let s = (tilted * cos + across * sin) * radius;
    let t = (across * cos - tilted * sin) * (radius / aspect * sign);
    [center, s, t]
}

fn scene(kinds: &[(Kind, usize)], camera: &Camera, origin: DVec3, length: f64, near: f64, seed: u64) -> Scene {
    let mut random = Random(seed);
    let to_world = camera.rotation.transpose();
    let mut surfels = Vec::new();
    for &(kind, count) in kinds {
        for _ in 0..count {
            let [center, s, t] = surfel(kind, camera, length, near, &mut random).map(|v| to_world * (v * length));
            let center = center + (camera.eye - origin);
            surfels.push(Surfel {
                center: center.as_vec3().to_array(),
                s: s.as_vec3().to_array(),
                t: t.as_vec3().to_array(),
            });
        }
    }
    random.shuffle(&mut surfels);
    // Colours exceed [0, 1] and differ in alpha: the most general case.
    let mut channel = |low, high| random.between(low, high) as f32;
    let colors =
        surfels.iter().map(|_| [channel(-0.5, 3.0), channel(0.0, 1.0), channel(0.2, 0.9), channel(0.1, 1.0)]).collect();
    Scene {
        origin,
        surfels,
        low: vec![],
        colors: Colors::Linear(colors),
        oriented: seed.is_multiple_of(2),
        up: Up::Z,
        ..Scene::default()
    }
}

const MIXED: &[(Kind, usize)] = &[
    (Kind::Small, 300),
    (Kind::Medium, 250),
    (Kind::Large, 12),
    (Kind::Tilted, 200),
    (Kind::EdgeOn, 400),
    (Kind::Anisotropic, 200),
    (Kind::Behind, 100),
    (Kind::OffScreen, 100),
];

/// All test cases.
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let mut add = |name, kinds: &[_], projection, origin, length, near, seed| {
        let camera = camera(projection, origin, length, near);
        let scene = scene(kinds, &camera, origin, length, near, seed);
        cases.push(Case { name, scene, camera });
    };
    let (pinhole, orthographic) = (Projection::Pinhole, Projection::Orthographic);
    let far = DVec3::new(450_000.123, 6_000_000.456, 300.789);
    add("pinhole", MIXED, pinhole, DVec3::ZERO, 1.0, 1e-3, 1);
    add("orthographic", MIXED, orthographic, DVec3::ZERO, 1.0, 1e-3, 2);
    add("pinhole, far origin, 5 m", MIXED, pinhole, far, 5.0, 1e-3, 3);
    add("orthographic, far origin, 5 mm", MIXED, orthographic, far, 0.005, 1e-3, 4);
    add("pinhole, scale 1e-6", MIXED, pinhole, DVec3::ZERO, 1e-6, 1e-3, 5);
    add("pinhole, scale 1e12", MIXED, pinhole, DVec3::ZERO, 1e12, 1e-3, 6);
    add("orthographic, scale 1e12", MIXED, orthographic, DVec3::ZERO, 1e12, 1e-3, 7);
    let crossing = &[(Kind::Crossing, 150), (Kind::Behind, 50), (Kind::Medium, 300)];
    add("pinhole, across the near depth", crossing, pinhole, DVec3::ZERO, 1.0, 0.5, 8);
    add("orthographic, across the near depth", crossing, orthographic, DVec3::ZERO, 1.0, 0.5, 9);
    cases
}

/// A closed unit sphere of `count` disks with 8-bit colours; `radius` is in units of their spacing.
pub fn sphere(count: usize, radius: f64) -> Scene {
    let spacing = (4.0 * std::f64::consts::PI / count as f64).sqrt();
    let golden = 0.618_033_988_749_895_f64;
    let points: Vec<DVec3> = (0..count)
        .map(|k| {
            let z = 1.0 - (2.0 * k as f64 + 1.0) / count as f64;
            let angle = (k as f64 * golden).fract() * std::f64::consts::TAU;
            ((1.0 - z * z).sqrt() * DVec2::from_angle(angle)).extend(z)
        })
        .collect();
    let code = |x: f64| (127.0 + 127.0 * (9.0 * x).sin()) as u8;
    Scene {
        origin: DVec3::ZERO,
        surfels: points.iter().map(|p| Surfel::disk(p.as_vec3(), p.as_vec3(), (radius * spacing) as f32)).collect(),
        low: vec![],
        colors: Colors::Srgb8(points.iter().map(|p| [code(p.x), code(p.y), code(p.z), 255]).collect()),
        oriented: true,
        up: Up::Y,
        ..Scene::default()
    }
}

/// A view in which [`sphere`] fills the image.
pub fn sphere_camera(size: u32, projection: Projection) -> Camera {
    sphere_camera_with(
        size,
        match projection {
            Projection::Pinhole => Lens::Fov(45.0),
            Projection::Orthographic => Lens::OrthographicHeight(2.1),
        },
    )
}

/// The view of [`sphere_camera`] through another lens.
pub fn sphere_camera_with(size: u32, lens: Lens) -> Camera {
    Camera::look_at((size, size), lens, DVec3::new(1.2, 0.7, 2.4), DVec3::ZERO, None, Up::Y, 1e-5).unwrap()
}

/// The same scene with its surfels in random order.
pub fn shuffled(scene: &Scene, seed: u64) -> Scene {
    let mut order: Vec<usize> = (0..scene.surfels.len()).collect();
    Random(seed).shuffle(&mut order);
    let colors = match &scene.colors {
        Colors::Constant(color) => Colors::Constant(*color),
        Colors::Srgb8(codes) => Colors::Srgb8(order.iter().map(|&k| codes[k]).collect()),
        Colors::Linear(colors) => Colors::Linear(order.iter().map(|&k| colors[k]).collect()),
        Colors::Textured(textured) => Colors::Textured(textured.taken(&order)),
        Colors::Harmonics(harmonics) => Colors::Harmonics(harmonics.taken(&order)),
    };
    let low = order.iter().filter_map(|&k| scene.low.get(k).copied()).collect();
    let clips = order.iter().filter_map(|&k| scene.clips.get(k).copied()).collect();
    let caps = order.iter().filter_map(|&k| scene.caps.get(k).copied()).collect();
    let thirds = order.iter().filter_map(|&k| scene.thirds.get(k).copied()).collect();
    let normals = order.iter().filter_map(|&k| scene.normals.get(k).copied()).collect();
    let surfels = order.iter().map(|&k| scene.surfels[k]).collect();
    Scene { surfels, low, clips, caps, thirds, normals, colors, ..scene.clone() }
}

/// Scenes with many fragments on a pixel, with 8-bit and with f32 colours.
pub fn crowded() -> Vec<(Scene, Camera)> {
    let mut all = vec![(sphere(4000, 4.0), sphere_camera(96, Projection::Pinhole))];
    all.extend(cases().into_iter().take(2).map(|case| (case.scene, case.camera)));
    all
}

/// An orthographic camera at the origin that looks along +z, with one pixel per world unit.
pub fn front(size: u32) -> Camera {
    let half = f64::from(size) / 2.0;
    let lens = Lens::OrthographicScale([1.0, 1.0, half, half]);
    Camera::posed((size, size), lens, DVec3::ZERO, DMat3::IDENTITY, 1e-3).unwrap()
}

/// `count` coincident disks of linear colour `value` that cover the image, and two hidden disks
/// that stretch the colour range to [0, 1]. Draw them with a kernel of weight 1.
pub fn stack(count: usize, value: f32) -> (Scene, Camera) {
    let mut surfels = vec![Surfel::disk(Vec3::new(0.2, 0.1, 5.0), Vec3::NEG_Z, 20.0); count];
    let mut colors = vec![[value, value, value, 1.0]; count];
    for end in [0.0, 1.0] {
        surfels.push(Surfel::disk(Vec3::new(0.0, 0.0, 90.0), Vec3::NEG_Z, 1.0));
        colors.push([end, end, end, 1.0]);
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
    (scene, front(4))
}

/// The generated surfels of a shape for which `keep` returns true, without colours.
pub fn generated(shape: Shape, count: u64, keep: impl Fn(&Sample) -> bool) -> Scene {
    let samples: Vec<Sample> = generate(shape, count).filter(keep).collect();
    let points = Points {
        positions: samples.iter().map(|sample| sample.position).collect(),
        normals: Some(samples.iter().map(|sample| sample.normal).collect()),
        radii: Some(samples.iter().map(|sample| sample.radius).collect()),
        ..Points::default()
    };
    build(vec![points], &()).unwrap().0
}

/// A sphere with `pictures` textures, of which the second is transparent.
pub fn painted(pictures: u32) -> Scene {
    let scene = sphere(2000, 1.7);
    let centers: Vec<[f32; 3]> = scene.surfels.iter().map(|surfel| surfel.center).collect();
    let code = |k: u32, step: u32| (40 + k * step % 200) as u8;
    let picture = |number: u32| {
        let texel =
            |k: u32| [code(k, 7 + number), code(k, 13), code(k / 32, 29), if number == 1 { code(k, 3) } else { 255 }];
        Texture::new(32, 16, (0..32 * 16).map(texel).collect()).unwrap()
    };
    let points = Points {
        positions: centers.iter().map(|center| center.map(f64::from)).collect(),
        normals: Some(centers.clone()),
        radii: Some(vec![scene.surfels[0].radius(); centers.len()]),
        texture: Some(centers.iter().map(|[x, y, _]| [0.5 + 0.4 * x, 0.5 + 0.4 * y]).collect()),
        texture_numbers: Some(centers.iter().map(|[.., z]| ((z.abs() * 7.0) as u32) % pictures).collect()),
        ..Points::default()
    };
    build_textured(vec![points], (0..pictures).map(picture).collect(), &()).unwrap().0
}

/// The scene with each surfel scaled toward or away from its centre, so that nodes of levels of
/// detail lie off their children and count as larger.
pub fn roughened(mut scene: Scene) -> Scene {
    for (k, surfel) in scene.surfels.iter_mut().enumerate() {
        surfel.center = surfel.center.map(|c| c * (0.95 + 0.1 * (k * 37 % 97) as f32 / 97.0));
    }
    scene
}
