//! Random small scenes and views, by seed.

use std::sync::Arc;

use epsplat::io::{Material, Mesh, Texture};
use epsplat::low_level::scene::{Camera, Cap, Clip, Colors, Harmonics, Lens, Scene, Surfel, Up};
use epsplat::low_level::surfels::with_triangles;
use glam::{DMat3, DVec3, Vec3};

use super::scenes::{cases, painted, sphere};
use super::{Random, meshes};

/// A scene, a view of it, and the names of its features.
pub struct Sampled {
    pub scene: Scene,
    pub camera: Camera,
    pub about: Vec<&'static str>,
}

/// A scene without caps, colours and the like, a view of it, and the centre and size of a mesh
/// beside it.
struct Base {
    scene: Scene,
    camera: Camera,
    mesh: (DVec3, f64),
    name: &'static str,
}

/// Draws a random scene and a view of it.
pub fn sampled(random: &mut Random) -> Sampled {
    let Base { mut scene, camera, mesh, name } = match random.below(8) {
        0 => strange(random),
        1 | 2 => cloud(random),
        3 => paintings(random),
        _ => ball(random),
    };
    let mut about = vec![name];
    if !matches!(scene.colors, Colors::Textured(_)) {
        about.push(colour(&mut scene, random));
    }
    if random.one_in(3) {
        about.push("caps");
        scene.caps = scene.surfels.iter().map(|surfel| cap(surfel, random)).collect();
    }
    if random.one_in(4) {
        about.push("clips");
        scene.clips = scene.surfels.iter().map(|_| clip(random)).collect();
    }
    if random.one_in(6) {
        about.push("own normals");
        scene.normals = scene.surfels.iter().map(|surfel| tilted(surfel, random)).collect();
    }
    if random.one_in(8) {
        about.push("low digits");
        let size = f64::from(scene.largest_radius()) * 1e-7;
        let mut digit = || random.between(-size, size) as f32;
        scene.low = scene.surfels.iter().map(|_| [digit(), digit(), digit()]).collect();
    }
    scene.oriented = random.one_in(2);
    scene.closed = name == "ball" && scene.oriented && random.one_in(2);
    if random.one_in(8) {
        about.push("copies");
        let copies = (scene.surfels.len() / 2).max(1);
        let indices: Vec<usize> = (0..copies).flat_map(|k| vec![k; 1 + random.below(3)]).collect();
        scene = taken(&scene, &indices);
    }
    if random.one_in(4) && scene.surfels.len() > 3 {
        about.push("inputs");
        let second = 1 + random.below(scene.surfels.len() - 2) as u64;
        [0, second].into_iter().for_each(|first| scene.provenance.push(first, Vec::new(), None));
    }
    if random.one_in(4) {
        // A mesh may be too small or too large to be accepted.
        if let Ok((both, _)) = with_triangles(Some(scene.clone()), &[triangles(mesh, random)]) {
            about.push("triangles");
            scene = both;
        }
    }
    Sampled { scene, camera, about }
}

/// The surfels at `indices` with all their attributes; triangles and the rest stay.
pub fn taken(scene: &Scene, indices: &[usize]) -> Scene {
    fn of<T: Copy>(all: &[T], indices: &[usize]) -> Vec<T> {
        indices.iter().filter_map(|&k| all.get(k).copied()).collect()
    }
    let colors = match &scene.colors {
        Colors::Constant(color) => Colors::Constant(*color),
        Colors::Srgb8(codes) => Colors::Srgb8(of(codes, indices)),
        Colors::Linear(colors) => Colors::Linear(of(colors, indices)),
        Colors::Textured(textured) => Colors::Textured(textured.taken(indices)),
        Colors::Harmonics(harmonics) => Colors::Harmonics(harmonics.taken(indices)),
    };
    Scene {
        surfels: of(&scene.surfels, indices),
        low: of(&scene.low, indices),
        clips: of(&scene.clips, indices),
        caps: of(&scene.caps, indices),
        thirds: of(&scene.thirds, indices),
        normals: of(&scene.normals, indices),
        colors,
        ..scene.clone()
    }
}

/// The same scene with the surfels of each input in another order.
pub fn shuffled(scene: &Scene, random: &mut Random) -> Scene {
    let ranges = scene.provenance.ranges(scene.surfels.len() as u64);
    let mut indices = Vec::new();
    for range in ranges {
        let mut own: Vec<usize> = (range.start as usize..range.end as usize).collect();
        random.shuffle(&mut own);
        indices.extend(own);
    }
    taken(scene, &indices)
}

fn direction(random: &mut Random) -> DVec3 {
    loop {
        let v = DVec3::from_array([0, 1, 2].map(|_| random.between(-1.0, 1.0)));
        if v.length() > 0.1 && v.length() <= 1.0 {
            return v.normalize();
        }
    }
}

/// A view of the unit ball around `origin`, from outside, from close by or from inside.
fn view(origin: DVec3, random: &mut Random) -> Camera {
    let size = [9 + random.below(56) as u32, 9 + random.below(40) as u32];
    let distance = match random.below(6) {
        0 => random.between(0.0, 0.9),
        1 => random.between(1.02, 1.5),
        _ => random.between(2.0, 5.0),
    };
    let side = f64::from(size[0].max(size[1]));
    let lens = match random.below(5) {
        0 => Lens::OrthographicHeight(random.between(0.4, 2.5)),
        1 => {
            let scale = side * random.between(0.3, 1.2);
            Lens::OrthographicScale([scale, scale * random.between(0.8, 1.2), 0.4 * side, 0.35 * side])
        }
        2 => {
            let focal = side * random.between(0.6, 3.0);
            Lens::Intrinsics([focal, focal * random.between(0.8, 1.2), 0.55 * side, 0.3 * side])
        }
        _ => Lens::Fov(random.between(15.0, 100.0)),
    };
    let eye = origin + direction(random) * distance;
    let target = origin + direction(random) * random.between(0.0, 0.4) - DVec3::splat(0.01);
    let near = if random.one_in(4) { random.between(0.1, 0.8) } else { 1e-3 };
    Camera::look_at((size[0], size[1]), lens, eye, target, None, Up::Y, near).unwrap()
}

fn origin(random: &mut Random) -> DVec3 {
    if random.one_in(6) { DVec3::new(450_000.123, 6_000_000.456, 300.789) } else { DVec3::ZERO }
}

/// A unit sphere, with noise in half of the cases.
fn ball(random: &mut Random) -> Base {
    let origin = origin(random);
    let mut scene = sphere(40 + random.below(460), random.between(1.0, 2.8));
    let noise = if random.one_in(2) { 0.0 } else { 0.03 };
    let thin = random.one_in(3);
    for surfel in &mut scene.surfels {
        surfel.center = surfel.center.map(|c| c * random.between(1.0 - noise, 1.0 + noise) as f32);
        let ratio = if thin { random.scale(0.02, 1.0) as f32 } else { 1.0 };
        surfel.t = surfel.t.map(|c| c * ratio);
    }
    scene.origin = origin;
    let camera = view(origin, random);
    let mesh = (origin + direction(random) * random.between(0.0, 0.8), random.between(0.3, 1.1));
    Base { scene, camera, mesh, name: "ball" }
}

/// Disks of many sizes, aspects and orientations in the unit ball.
fn cloud(random: &mut Random) -> Base {
    let origin = origin(random);
    let surfel = |random: &mut Random| {
        let center = direction(random) * random.unit().cbrt();
        let (s, radius) = (direction(random), random.scale(0.005, 0.5));
        let t = s.any_orthonormal_vector() * radius * random.scale(0.05, 1.0);
        let [center, s, t] = [center, s * radius, t].map(|v| v.as_vec3().to_array());
        Surfel { center, s, t }
    };
    let surfels = (0..1 + random.below(300)).map(|_| surfel(random)).collect();
    let camera = view(origin, random);
    let mesh = (origin + direction(random) * random.between(0.0, 0.8), random.between(0.2, 0.9));
    Base { scene: Scene { origin, surfels, ..Scene::default() }, camera, mesh, name: "cloud" }
}

/// A third of a scene of edge-on, thin or huge surfels, in a smaller image.
fn strange(random: &mut Random) -> Base {
    let case = cases().swap_remove(random.below(9));
    let (scene, mut camera) = (case.scene, case.camera);
    let shrink = 0.35;
    for value in [&mut camera.fx, &mut camera.fy, &mut camera.cx, &mut camera.cy] {
        *value *= shrink;
    }
    (camera.width, camera.height) = (56, 42);
    let kept: Vec<usize> = (0..scene.surfels.len()).filter(|_| random.one_in(3)).collect();
    let depth = camera.to_camera(scene.origin + scene.center(0)).z.abs();
    let mesh = (camera.eye + camera.rotation.row(2) * depth, 0.3 * depth);
    Base { scene: taken(&scene, &kept), camera, mesh, name: "strange" }
}

/// A fifth of a textured sphere, with surfels twice as large.
fn paintings(random: &mut Random) -> Base {
    let scene = painted(1 + random.below(2) as u32);
    let kept: Vec<usize> = (0..scene.surfels.len()).filter(|_| random.one_in(5)).collect();
    let mut scene = taken(&scene, &kept);
    for axis in scene.surfels.iter_mut().flat_map(|surfel| [&mut surfel.s, &mut surfel.t]) {
        *axis = axis.map(|c| 2.0 * c);
    }
    if let Colors::Textured(textured) = &mut scene.colors {
        *textured = textured.enlarged(2.0);
    }
    let camera = view(DVec3::ZERO, random);
    let mesh = (direction(random) * random.between(0.0, 0.8), random.between(0.3, 1.1));
    Base { scene, camera, mesh, name: "painted" }
}

/// Gives the scene random colours and returns the name of their kind.
fn colour(scene: &mut Scene, random: &mut Random) -> &'static str {
    let count = scene.surfels.len();
    let code = |random: &mut Random| random.below(256) as u8;
    let unit = |random: &mut Random| random.unit() as f32;
    let linear = |random: &mut Random, alpha: f64| {
        [random.between(-0.5, 3.0), random.unit(), random.between(0.2, 0.9), alpha].map(|c| c as f32)
    };
    let (colors, encoded, name) = match random.below(8) {
        0 => (Colors::Constant([unit(random), unit(random), unit(random), 1.0]), false, "one colour"),
        1 => (Colors::Constant([unit(random), unit(random), unit(random), 0.6]), false, "one colour that lets through"),
        2 => {
            let color = |random: &mut Random| [code(random), code(random), code(random), code(random)];
            (Colors::Srgb8((0..count).map(|_| color(random)).collect()), false, "codes with alpha")
        }
        3 => (Colors::Linear((0..count).map(|_| linear(random, 1.0)).collect()), false, "linear"),
        4 => {
            let color = |random: &mut Random| {
                let alpha = random.between(0.05, 1.0);
                linear(random, alpha)
            };
            (Colors::Linear((0..count).map(|_| color(random)).collect()), false, "linear with alpha")
        }
        5 => {
            let degree = 1 + random.below(3) as u32;
            let colors =
                (0..count).map(|_| [unit(random), unit(random), unit(random), unit(random).max(0.02)]).collect();
            let terms = count * 3 * ((degree as usize + 1).pow(2) - 1);
            let terms = (0..terms).map(|_| random.between(-0.2, 0.2) as f32).collect();
            let harmonics = Harmonics::new(colors, degree, terms).unwrap();
            (Colors::Harmonics(harmonics), true, "Gaussians")
        }
        _ => {
            let color = |random: &mut Random| [code(random), code(random), code(random), 255];
            (Colors::Srgb8((0..count).map(|_| color(random)).collect()), false, "codes")
        }
    };
    (scene.colors, scene.encoded) = (colors, encoded);
    name
}

fn cap(surfel: &Surfel, random: &mut Random) -> Cap {
    if random.one_in(7) {
        return Cap::FLAT;
    }
    let mut height = || random.between(-0.4, 0.3) as f32 * surfel.radius();
    Cap([height(), 0.5 * height(), height()]).usable(surfel.radius().into())
}

fn clip(random: &mut Random) -> Clip {
    let line = |random: &mut Random| {
        let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
        [cos, sin, random.between(-0.3, 1.0)].map(|c| c as f32)
    };
    match random.below(4) {
        0 => Clip::NONE,
        1 => Clip([line(random), [0.0, 0.0, 1.0]]).usable(),
        _ => Clip([line(random), line(random)]).usable(),
    }
}

/// A unit normal near the surfel's own.
fn tilted(surfel: &Surfel, random: &mut Random) -> [f32; 3] {
    let [s, t] = [surfel.s, surfel.t].map(|v| Vec3::from_array(v).as_dvec3());
    let normal = s.normalize_or_zero().cross(t.normalize_or_zero()).normalize_or(DVec3::Z);
    (normal + direction(random) * 0.4).normalize().as_vec3().to_array()
}

/// A sphere of triangles around `center`, with or without normals, colours and a texture.
fn triangles((center, size): (DVec3, f64), random: &mut Random) -> Mesh {
    let mut mesh = meshes::sphere(random.below(3) as u32, random.one_in(2));
    let turn = DMat3::from_axis_angle(direction(random), random.between(0.0, 3.0));
    for place in &mut mesh.positions {
        *place = (center + turn * DVec3::from_array(*place) * size).to_array();
    }
    if random.one_in(2) {
        let color = |random: &mut Random| [random.unit(), random.unit(), random.unit(), random.between(0.5, 1.0)];
        mesh.colors = Some(Colors::Linear(mesh.positions.iter().map(|_| color(random).map(|c| c as f32)).collect()));
    }
    if random.one_in(3) {
        let mut texels: Vec<_> = (0..64).map(|_| [random.below(256) as u8, random.below(256) as u8, 90, 255]).collect();
        // Half of the images have holes.
        let has_holes = texels[0][1] < 128;
        texels.iter_mut().filter(|texel| has_holes && texel[0] < 80).for_each(|texel| texel[3] = 0);
        let texture = Some(Arc::new(Texture::new(8, 8, texels).unwrap()));
        mesh.materials = vec![Material { name: "m".into(), diffuse: [1.0; 4], texture, image: None }];
        mesh.material = Some(vec![0; mesh.triangles.len()]);
        let mut corner = || [random.unit() as f32, random.unit() as f32];
        mesh.texture = Some(mesh.triangles.iter().map(|_| [corner(), corner(), corner()]).collect());
    }
    mesh
}
