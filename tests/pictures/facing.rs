//! Points that face the camera: kernels agree with their twins, and shapes divide the image as in
//! Schuetz and Wimmer 2015.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use common::Random;
use common::scenes::{sphere, sphere_camera};
use epsplat::io::Points;
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Replacement, Sources};
use epsplat::low_level::plan::{BlendFormat, Optimisation, Organisation, Raster, RasterDepth, Settings, check};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::facing::POINT_SHAPES;
use epsplat::low_level::scene::{
    Camera, Colors, Cull, Epsilon, Facing, Kernel, Lens, LowPass, Map, Maps, PointShape, PointSize, Projection,
    Samples, Scene, Shading, Surfel, Up,
};
use epsplat::low_level::surfels::analytic::{Shape, generate};
use epsplat::low_level::surfels::{Limits, build_facing};
use epsplat::low_level::truth::{DEFAULT_GRID, Surface, Truth};
use glam::{DVec2, DVec3, Vec3};

use crate::common;

/// Points of many sizes on a sphere, made from surfels of aspect 1:0.3.
fn points() -> Scene {
    let mut random = Random(5);
    let mut scene = sphere(1500, 1.0);
    for surfel in &mut scene.surfels {
        let factor = 10f64.powf(random.between(-2.0, 0.6)) as f32;
        surfel.s = surfel.s.map(|c| c * factor);
        surfel.t = surfel.t.map(|c| c * factor * 0.3);
    }
    scene
}

fn options(shape: PointShape) -> Settings {
    Settings {
        facing: Some(Facing { shape, pixels: [1.0, 12.0] }),
        shading: Shading::Unlit,
        maps: Maps::of(&[Map::Depth, Map::Weight, Map::Count]),
        ..Settings::default()
    }
}

/// With a zero epsilon and a constant kernel, a pixel shows the nearest point, or the mean of
/// equally near points.
fn nearest(shape: PointShape) -> Settings {
    Settings { epsilon: Epsilon::Absolute(0.0), kernel: Kernel::Constant, ..options(shape) }
}

/// The number of decided pixels where a colour or map differs by more than `tolerance` times the
/// larger of the reference's value and 0.5.
fn differing(frame: &Frame, reference: &Frame, tolerance: f32) -> usize {
    let decision = reference.map(Map::Decision).unwrap();
    let maps = [Map::Weight, Map::Depth, Map::Count].map(|map| (frame.map(map).unwrap(), reference.map(map).unwrap()));
    let far = |a: f32, b: f32| a != b && ((a - b).abs() > tolerance * b.abs().max(0.5) || a.is_nan() || b.is_nan());
    let differs = |pixel: usize| {
        let colors = frame.color[pixel].into_iter().zip(reference.color[pixel]);
        let values = maps.iter().map(|(ours, theirs)| (ours[pixel], theirs[pixel]));
        decision[pixel] >= 1e-4 && colors.chain(values).any(|(a, b)| far(a, b))
    };
    (0..decision.len()).filter(|&pixel| differs(pixel)).count()
}

#[test]
fn kernels_and_twins_draw_the_same_points() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, backend) = (points(), Backend::gpu(gpu));
    for (projection, (name, shape)) in
        [Projection::Pinhole, Projection::Orthographic].into_iter().flat_map(|p| POINT_SHAPES.map(|shape| (p, shape)))
    {
        let camera = sphere_camera(160, projection);
        let options = options(shape);
        let decided = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
        let (reference, _) = render(&scene, &camera, &decided, &Backend::Reference, &()).unwrap();
        let decision = reference.map(Map::Decision).unwrap();
        let undecided = decision.iter().filter(|decision| **decision < 1e-4).count();
        let (frame, report) = render(&scene, &camera, &options, &backend, &()).unwrap();
        assert!(report.needs.contains(&"facing") && !report.needs.contains(&"cull-back"));
        let wrong = differing(&frame, &reference, 1e-5);
        assert!(wrong == 0 && undecided < 800, "{wrong} wrong, {undecided} undecided, {projection:?} {name}");
        for organisation in [Organisation::Scatter, Organisation::Tile] {
            let other = Settings { organisation, ..options.clone() };
            let (other, _) = render(&scene, &camera, &other, &backend, &()).unwrap();
            assert!(common::bits(&other) == common::bits(&frame), "{organisation:?} {name}");
        }
        let (shuffled, _) = render(&common::scenes::shuffled(&scene, 3), &camera, &options, &backend, &()).unwrap();
        assert!(common::bits(&shuffled) == common::bits(&frame), "another order, {name}");
        // Control: disks in their own planes give another picture.
        let (own, _) = render(&scene, &camera, &Settings { facing: None, ..options }, &backend, &()).unwrap();
        assert!(differing(&own, &reference, 1e-5) > 1000);
    }
}

#[test]
fn broken_points_are_noticed() {
    let (scene, camera) = (points(), sphere_camera(160, Projection::Pinhole));
    for (shape, file, from, to) in [
        (PointShape::Circle, "facing.wgsl", "min(dot2(beside, beside), largest2(own))", "dot2(beside, beside)"),
        (PointShape::Square, "facing.wgsl", "largest2(beside), SQUARE", "dot2(beside, beside), SQUARE"),
        (PointShape::Sphere, "facing.wgsl", "SQUARE)) * radius_across", "SQUARE)) * 0.99 * radius_across"),
        (PointShape::Cone, "shape_cone.wgsl", "1.0 - sqrt(rho2)", "1.0 - rho2"),
        (PointShape::Circle, "axes_facing.wgsl", "LEAST_RADIUS * row", "0.9 * LEAST_RADIUS * row"),
        (PointShape::Circle, "axes_facing.wgsl", "MOST_RADIUS * row", "1.1 * MOST_RADIUS * row"),
    ] {
        let Some(gpu) = common::gpu() else { return };
        // A point smaller than a pixel covers its pixel anyway, so a wrong least radius would not
        // show below one pixel.
        let least = if from.starts_with("LEAST") { 3.0 } else { 1.0 };
        let facing = Some(Facing { shape, pixels: [least, 12.0] });
        let options = Settings { facing, ..options(shape) };
        let decided = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
        let (reference, _) = render(&scene, &camera, &decided, &Backend::Reference, &()).unwrap();
        let sources = Sources::default().replace(file, from, to).unwrap();
        let backend = Backend::Gpu { gpu: Box::new(gpu), sources };
        let (frame, _) = render(&scene, &camera, &options, &backend, &()).unwrap();
        assert!(differing(&frame, &reference, 1e-5) > 10, "{from}");
    }
}

/// Points of one radius, each with its own colour.
fn sites(count: usize, radius: f32, depth: impl Fn(&mut Random) -> f64) -> Scene {
    let mut random = Random(11);
    let mut colors = Vec::new();
    let surfels = (0..count).map(|k| {
        let center = DVec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), depth(&mut random));
        colors.push([k as f32 / count as f32, 1.0 - k as f32 / count as f32, (k % 7) as f32 / 7.0, 1.0]);
        Surfel::disk(center.as_vec3(), Vec3::new(0.3, -0.4, 0.5), radius)
    });
    let surfels: Vec<Surfel> = surfels.collect();
    Scene { surfels, colors: Colors::Linear(colors), ..Scene::default() }
}

/// An orthographic camera that looks down the z axis.
fn frontal(size: u32) -> Camera {
    let lens = Lens::OrthographicHeight(2.0);
    Camera::look_at((size, size), lens, DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, None, Up::Y, 1e-3).unwrap()
}

/// Counts wrong pixels and decided pixels.
///
/// A site is a surfel whose footprint covers the pixel; its cost is `cost` of squared distance in
/// the image and of height z. A pixel is decided if it has a site and is off the rims of all its
/// sites by 1e-5. The second least cost must also exceed the least by 1e-5. A decided pixel is
/// wrong if its colour is not that of the site of least cost.
fn wrong_sites(frame: &Frame, scene: &Scene, size: u32, cost: impl Fn(f64, f64) -> f64) -> (usize, usize) {
    let Colors::Linear(colors) = &scene.colors else { panic!("colours") };
    let (mut wrong, mut decided) = (0, 0);
    for (pixel, color) in frame.color.iter().enumerate() {
        let [x, y] =
            [pixel as u32 % size, pixel as u32 / size].map(|k| (f64::from(k) + 0.5) / f64::from(size) * 2.0 - 1.0);
        let at = DVec2::new(x, -y);
        let of = |(k, surfel): (usize, &Surfel)| {
            let [x, y, z] = surfel.center.map(f64::from);
            let (squared, radius) = (at.distance_squared(DVec2::new(x, y)), f64::from(surfel.radius()));
            (squared <= radius * radius).then(|| (cost(squared, z), k, (squared.sqrt() - radius).abs()))
        };
        let mut costs: Vec<_> = scene.surfels.iter().enumerate().filter_map(of).collect();
        costs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (Some(first), second) = (costs.first(), costs.get(1)) else { continue };
        if second.is_some_and(|second| second.0 - first.0 < 1e-5) || costs.iter().any(|cost| cost.2 < 1e-5) {
            continue;
        }
        decided += 1;
        wrong += usize::from(colors[first.1].iter().zip(color).any(|(a, b)| (a - b).abs() > 1e-4));
    }
    (wrong, decided)
}

#[test]
fn paraboloids_give_the_power_diagram_and_points_of_a_plane_the_voronoi_diagram() {
    let Some(gpu) = common::gpu() else { return };
    let (backend, size, radius) = (Backend::gpu(gpu), 192, 0.3f32);
    let r = f64::from(radius);
    let wide = |options: Settings| {
        let facing = options.facing.map(|facing| Facing { pixels: [1.0, 500.0], ..facing });
        Settings { facing, ..options }
    };
    // Paraboloids have depth z_i + d_i^2 / R, hence the paper's straight borders (a power diagram).
    let scene = sites(300, radius, |random| random.between(-0.2, 0.2));
    for backend in [&backend, &Backend::Reference] {
        let (frame, _) = render(&scene, &frontal(size), &wide(nearest(PointShape::Paraboloid)), backend, &()).unwrap();
        let (wrong, decided) = wrong_sites(&frame, &scene, size, |squared, z| -z + squared / r);
        assert!(wrong == 0 && decided > 30_000, "{wrong} of {decided}");
        // Control: the Voronoi diagram of the axes differs from the power diagram.
        assert!(wrong_sites(&frame, &scene, size, |squared, _| squared).0 > 5000);
        let plane = sites(300, radius, |_| 0.125);
        for shape in [PointShape::Sphere, PointShape::Cone, PointShape::Paraboloid] {
            let (frame, _) = render(&plane, &frontal(size), &wide(nearest(shape)), backend, &()).unwrap();
            let (wrong, decided) = wrong_sites(&frame, &plane, size, |squared, _| squared);
            assert!(wrong == 0 && decided > 30_000, "{wrong} of {decided} {shape:?}");
        }
        // Control: flat circles in one plane are one surface, whose points are blended.
        let (frame, _) = render(&plane, &frontal(size), &wide(nearest(PointShape::Circle)), backend, &()).unwrap();
        assert!(wrong_sites(&frame, &plane, size, |squared, _| squared).0 > 5000);
    }
}

#[test]
fn a_point_shows_at_its_own_pixel_and_is_no_larger_than_its_limit() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, backend) = (points(), Backend::gpu(gpu));
    for projection in [Projection::Pinhole, Projection::Orthographic] {
        let camera = sphere_camera(160, projection);
        let at = |surfel: &Surfel| {
            let p = camera.rotation * (Vec3::from_array(surfel.center).as_dvec3() - camera.eye);
            let scale = if projection == Projection::Pinhole { p.z } else { 1.0 };
            [p.x / scale * camera.fx + camera.cx, p.y / scale * camera.fy + camera.cy]
        };
        for (name, shape) in POINT_SHAPES {
            let facing = |least: f64, most: f64| Some(Facing { shape, pixels: [least, most] });
            let of = |facing| Settings { epsilon: Epsilon::Absolute(1e3), ..Settings { facing, ..options(shape) } };
            let count = |facing| {
                let (frame, _) = render(&scene, &camera, &of(facing), &backend, &()).unwrap();
                frame.map(Map::Count).unwrap().to_vec()
            };
            // At one pixel wide, each point covers the pixel it lies in; points near a pixel edge
            // are excused.
            let counts = count(facing(0.0, 1.0));
            let mut expected = vec![0f32; counts.len()];
            let mut near = vec![false; counts.len()];
            for image in scene.surfels.iter().map(at) {
                let [x, y] = image.map(|x| x.floor() as usize);
                expected[y * 160 + x] += 1.0;
                let edge = image.iter().any(|x| (x - x.round()).abs() < 1e-3);
                for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)].into_iter().filter(|_| edge) {
                    near[(y + dy) * 160 + x + dx] = true;
                    near[(y - dy) * 160 + x - dx] = true;
                }
            }
            let wrong = (0..counts.len()).filter(|&k| !near[k] && counts[k] != expected[k]).count();
            assert!(wrong == 0 && near.iter().filter(|near| **near).count() < 200, "{wrong} {name} {projection:?}");
            // At fifty pixels wide, a point covers the area of its footprint.
            let area = if shape == PointShape::Square { 50.0 * 50.0 } else { std::f32::consts::PI * 25.0 * 25.0 };
            let alone = sites(1, 1.0, |_| 0.0);
            let alone = Scene { surfels: vec![Surfel { center: [0.0; 3], ..alone.surfels[0] }], ..alone };
            let (frame, _) = render(&alone, &camera, &of(facing(50.0, 50.0)), &backend, &()).unwrap();
            let held = frame.map(Map::Count).unwrap().iter().sum::<f32>();
            assert!((held - area).abs() < 60.0, "{held} {area} {name}");
        }
    }
}

/// The depth of each pixel is the plane's less the shape's height times the radius: 1 at the axis
/// and 0 at the rim; shapes on squares fall further, to -1 or 1 - sqrt(2) at the corners.
#[test]
fn shapes_have_the_heights_of_the_paper() {
    let Some(gpu) = common::gpu() else { return };
    let (size, radius, depth) = (161, 0.8, 4.0);
    let lens = Lens::Fov(45.0);
    let camera = Camera::look_at((size, size), lens, DVec3::Z * depth, DVec3::ZERO, None, Up::Y, 1e-3).unwrap();
    let alone = Scene { surfels: vec![Surfel::disk(Vec3::ZERO, Vec3::X, radius as f32)], ..sites(1, 1.0, |_| 0.0) };
    let study = |name: &str| {
        let path = format!("{}/benches/{name}.wgsl", env!("CARGO_MANIFEST_DIR"));
        Sources::default().with(&[Replacement::new("shape_flat.wgsl", std::fs::read_to_string(path).unwrap())])
    };
    type Height = fn(f64) -> f64;
    type Row<'a> = (&'a str, PointShape, Option<&'a str>, Height, [f64; 3]);
    let cone: Height = |rho2| 1.0 - rho2.sqrt();
    let bowl: Height = |rho2| 1.0 - rho2;
    let rows: [Row<'_>; 5] = [
        ("sphere", PointShape::Sphere, None, |rho2| (1.0 - rho2).sqrt(), [1.0, 0.0, f64::NAN]),
        ("cone", PointShape::Cone, None, cone, [1.0, 0.0, f64::NAN]),
        ("paraboloid", PointShape::Paraboloid, None, bowl, [1.0, 0.0, f64::NAN]),
        ("cone on a square", PointShape::Square, Some("square-cone"), cone, [1.0, 0.0, 1.0 - 2f64.sqrt()]),
        ("paraboloid on a square", PointShape::Square, Some("square-paraboloid"), bowl, [1.0, 0.0, -1.0]),
    ];
    for (name, shape, file, height, ends) in rows {
        assert_eq!([height(0.0), height(1.0)], [ends[0], ends[1]], "{name}");
        let sources = file.map_or_else(|| Ok(Sources::default()), study).unwrap();
        let backend = Backend::Gpu { gpu: Box::new(gpu.clone()), sources };
        let facing = Some(Facing { shape, pixels: [1.0, 500.0] });
        let (frame, _) = render(&alone, &camera, &Settings { facing, ..nearest(shape) }, &backend, &()).unwrap();
        let depths = frame.map(Map::Depth).unwrap();
        let (mut covered, mut lowest, mut highest) = (0, f64::INFINITY, f64::NEG_INFINITY);
        for (pixel, found) in depths.iter().map(|depth| f64::from(*depth)).enumerate().filter(|(_, z)| z.is_finite()) {
            let at = DVec2::new((pixel as u32 % size).into(), (pixel as u32 / size).into()) + 0.5;
            let beside = (at - DVec2::new(camera.cx, camera.cy)) * depth / (camera.fx * radius);
            let rise = (depth - found) / radius;
            assert!((rise - height(beside.length_squared().min(2.0))).abs() < 2e-3, "{name} {beside} {rise}");
            (covered, lowest, highest) = (covered + 1, rise.min(lowest), rise.max(highest));
        }
        // The last pixel centre lies within a pixel of the rim or of the corner.
        let last = if ends[2].is_nan() { ends[1] } else { ends[2] };
        let pixel = depth / (camera.fx * radius);
        assert!(covered > 4000 && (highest - ends[0]).abs() < 1e-3, "{name} {covered} {highest}");
        assert!(
            (lowest - last).abs() < (4.0 * pixel).max((4.0 * pixel).sqrt() * f64::from(u8::from(name == "sphere")))
        );
        // Control: the flat shape has no height.
        let flat = if file.is_some() { PointShape::Square } else { PointShape::Circle };
        let flat = Settings { facing: Some(Facing { shape: flat, pixels: [1.0, 500.0] }), ..nearest(flat) };
        let (flat, _) = render(&alone, &camera, &flat, &Backend::gpu(gpu.clone()), &()).unwrap();
        let off = |z: &f32| z.is_finite() && (f64::from(*z) - depth).abs() > 1e-5;
        assert!(!flat.map(Map::Depth).unwrap().iter().any(off), "{name}");
    }
}

#[test]
fn a_shape_that_crosses_the_near_depth_ends_there() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let scene = sites(40, 0.5, |random| random.between(-0.3, 0.3));
    for shape in [PointShape::Sphere, PointShape::Cone, PointShape::Paraboloid] {
        let facing = Some(Facing { shape, pixels: [1.0, 500.0] });
        let options = Settings { facing, ..options(shape) };
        let decided = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
        for near in [3.5, 3.9, 4.1] {
            let camera = Camera { near, ..frontal(128) };
            let (reference, _) = render(&scene, &camera, &decided, &Backend::Reference, &()).unwrap();
            let (frame, _) = render(&scene, &camera, &options, &backend, &()).unwrap();
            assert_eq!(differing(&frame, &reference, 1e-5), 0, "{shape:?} {near}");
            let least = frame.map(Map::Depth).unwrap().iter().copied().fold(f32::INFINITY, f32::min);
            assert!(f64::from(least) >= near, "{least} {near}");
        }
    }
}

#[test]
fn the_rasteriser_draws_the_same_points() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, backend) = (points(), Backend::gpu(gpu));
    let camera = sphere_camera(160, Projection::Pinhole);
    for (name, shape) in POINT_SHAPES {
        let options = options(shape);
        let raster = Some(Raster { format: BlendFormat::Rgba16Float, depth: RasterDepth::Exact });
        let (frame, _) = render(&scene, &camera, &options, &backend, &()).unwrap();
        let (rastered, _) = render(&scene, &camera, &Settings { raster, ..options }, &backend, &()).unwrap();
        let [ours, theirs] = [&frame, &rastered].map(|frame| frame.map(Map::Count).unwrap());
        assert!(ours == theirs && ours.iter().sum::<f32>() > 1e4, "{name}");
    }
}

#[test]
fn what_is_left_out_of_points_changes_no_bit() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, backend) = (sphere(30_000, 1.0), Backend::gpu(gpu));
    for (projection, (name, shape)) in
        [Projection::Pinhole, Projection::Orthographic].into_iter().flat_map(|p| POINT_SHAPES.map(|shape| (p, shape)))
    {
        let camera = sphere_camera(96, projection);
        // Points of about two pixels, and points enlarged to twenty pixels.
        for pixels in [[1.0, 50.0], [20.0, 50.0]] {
            let options = Settings { facing: Some(Facing { shape, pixels }), ..options(shape) };
            let plain = Settings { without: vec![Optimisation::Culling, Optimisation::Hiding], ..options.clone() };
            let (frame, report) = render(&scene, &camera, &options, &backend, &()).unwrap();
            let (whole, _) = render(&scene, &camera, &plain, &backend, &()).unwrap();
            assert!(common::bits(&frame) == common::bits(&whole), "{name} {pixels:?}");
            // Enlarged points reach in front of the sphere's nearer half, so culling may find none.
            let some = report.splats_drawn < 27_500 || pixels[0] > 1.0;
            assert!(report.needs.contains(&"cull") && some, "{} {name} {pixels:?}", report.splats_drawn);
        }
    }
}

#[test]
fn samples_of_a_pixel_see_points_as_large_as_one_does() {
    let (scene, camera) = (points(), sphere_camera(120, Projection::Pinhole));
    for text in ["4", "8"] {
        let samples: Samples = text.parse().unwrap();
        let options = Settings { maps: Maps::default(), ..options(PointShape::Circle) };
        let (one, _) = render(&scene, &camera, &options, &Backend::Reference, &()).unwrap();
        let several = Settings { samples, ..options };
        let (several, _) = render(&scene, &camera, &several, &Backend::Reference, &()).unwrap();
        let [one, several] = [one, several].map(|frame| frame.color.iter().map(|color| color[3]).sum::<f32>());
        assert!((one / several - 1.0).abs() < 0.02, "{one} {several}");
    }
}

#[test]
fn clouds_without_radii_take_one_for_all_whatever_the_order() {
    let positions: Vec<[f64; 3]> =
        sphere(20_000, 1.0).surfels.iter().map(|surfel| surfel.center.map(f64::from)).collect();
    let cloud = |positions: &[[f64; 3]]| Points { positions: positions.to_vec(), ..Points::default() };
    let built =
        |positions: &[[f64; 3]], size| build_facing(vec![cloud(positions)], size, &Limits::default(), &()).unwrap();
    let (scene, preparation) = built(&positions, PointSize::Radius(2.0));
    let spacing = (4.0 * std::f64::consts::PI / 20_000f64).sqrt();
    let (lacking, radius) = preparation.common_radius.unwrap();
    assert!(lacking == 20_000 && (0.8..1.25).contains(&(radius / (3.6 * spacing))), "{radius} {spacing}");
    assert!(scene.surfels.iter().all(|surfel| (f64::from(surfel.radius()) / radius - 1.0).abs() < 1e-6));
    assert!(!scene.oriented && preparation.estimated_normals == 0);
    let reversed: Vec<_> = positions.iter().rev().copied().collect();
    assert_eq!(built(&reversed, PointSize::Radius(2.0)).1.common_radius, preparation.common_radius);
    let (scene, preparation) = built(&positions, PointSize::Absolute(0.25));
    assert!(scene.surfels[7].radius() == 0.25 && preparation.common_radius.is_none());
    // Given radii remain; only missing or unusable ones get the common radius.
    let given = Points { radii: Some(vec![0.5, f32::NAN, 0.0]), ..cloud(&positions[..3]) };
    let (scene, preparation) = build_facing(vec![given], PointSize::Radius(1.0), &Limits::default(), &()).unwrap();
    assert_eq!((scene.surfels[0].radius(), preparation.common_radius.unwrap().0), (0.5, 2));
}

#[test]
fn what_points_do_not_have_is_refused() {
    let facing = options(PointShape::Sphere);
    let refused = |options: Settings| check::options(&options, false).unwrap_err().to_string();
    assert!(refused(Settings { shading: Shading::Lambert, ..facing.clone() }).contains("no normals"));
    assert!(refused(Settings { maps: Maps::of(&[Map::Normal]), ..facing.clone() }).contains("no normals"));
    assert!(refused(Settings { low_pass: LowPass::Max, ..facing.clone() }).contains("no low-pass"));
    assert!(refused(Settings { cull: Cull::Back, ..facing.clone() }).contains("no backs"));
    let raster = Some(Raster { format: BlendFormat::Rgba16Float, depth: RasterDepth::Offset });
    assert!(refused(Settings { raster, ..facing.clone() }).contains("exact"));
    assert!(check::options(&facing, false).is_ok());
}

/// The mean change of a pixel's error when the camera turns by a tenth of a degree, linear light. A
/// picture's error is its difference from rays, so the motion of the surface itself is no change.
fn flicker(scene: &Scene, options: &Settings) -> f64 {
    let error = |degrees: f64| -> Vec<f64> {
        let turn = degrees.to_radians();
        let eye = DVec3::new(turn.sin(), 0.0, turn.cos()) * 3.0;
        let camera = Camera::look_at((150, 150), Lens::Fov(35.0), eye, DVec3::ZERO, None, Up::Y, 1e-3).unwrap();
        let (frame, _) = render(scene, &camera, options, &Backend::Reference, &()).unwrap();
        let surface = Surface::Analytic(Shape::Checkerboard);
        let truth = Truth::cast(&surface, &camera, options, DEFAULT_GRID, &()).unwrap().frame;
        frame.color.iter().zip(&truth.color).map(|(ours, rays)| f64::from(ours[1] - rays[1])).collect()
    };
    let views: Vec<Vec<f64>> = [-0.15, -0.05, 0.05, 0.15].map(error).into();
    let change = |pair: &[Vec<f64>]| pair[0].iter().zip(&pair[1]).map(|(a, b)| (a - b).abs()).sum::<f64>();
    views.windows(2).map(change).sum::<f64>() / (3.0 * 150.0 * 150.0)
}

/// Squares and circles flicker when the camera turns, as points change their order; shapes that
/// rise and blended circles do not (Schuetz and Wimmer 2015, section IV).
#[test]
fn shapes_that_rise_flicker_less_than_flat_ones() {
    let mut scene = common::scenes::generated(Shape::Checkerboard, 10_000, |_| true);
    let color = |[r, g, b]: [u8; 3]| [r, g, b, 255];
    let colors = generate(Shape::Checkerboard, 10_000).map(|sample| color(sample.color));
    scene.colors = Colors::Srgb8(colors.collect());
    let mut random = Random(11);
    for surfel in &mut scene.surfels {
        // A twentieth of the spacing off the surface.
        surfel.center[2] += random.between(-1e-3, 1e-3) as f32;
    }
    let plain = |options: Settings| Settings { maps: Maps::NONE, ..options };
    let of = |shape: PointShape| flicker(&scene, &plain(nearest(shape)));
    let [square, circle, sphere, cone, paraboloid] = POINT_SHAPES.map(|(_, shape)| of(shape));
    let blended = flicker(&scene, &plain(Settings { epsilon: Epsilon::Radius(1.0), ..options(PointShape::Circle) }));
    let all = format!("{square} {circle} {sphere} {cone} {paraboloid} {blended}");
    assert!([sphere, cone, paraboloid, blended].iter().all(|rising| *rising < 0.5 * circle.min(square)), "{all}");
    assert!(circle > 1e-3, "{all}");
}
