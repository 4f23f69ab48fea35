//! Textured surfels: the device against its twin, pictures against rays, and inputs that cannot be
//! textured.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod several;

use crate::common;

use std::f64::consts::{PI, TAU};
use std::process::Command;

use common::bits;
use common::scenes::{shuffled, sphere, sphere_camera};
use epsplat::io::{self, Points, Texture};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::passes::project::reference_all;
use epsplat::low_level::passes::{accumulate, visibility};
use epsplat::low_level::plan::{Accumulator, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{
    Camera, Colors, Lens, LowPass, Map, Maps, Place, Projection, Scene, Shading, Textured, Up,
};
use epsplat::low_level::surfels::simplify::{Options, SplatShape, Tolerance, points, simplify_in_texture};
use epsplat::low_level::surfels::{Coordinates, build_at_vertices, build_textured};
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

/// The largest difference of neighbouring texels in linear light: 100 codes of a wave of 64 / 3
/// texels are 30 codes per texel, each at most 0.0086.
const STEEPEST: f64 = 30.0 * 0.0086;

/// The belt of a sphere; the texture goes around it once, with a seam from end to end.
fn globe(count: usize, radius: f64, texture: Texture) -> Scene {
    build_textured(vec![belt(count, radius)], vec![texture], &()).unwrap().0
}

fn belt(count: usize, radius: f64) -> Points {
    let whole = sphere(count, radius);
    let centers = whole.surfels.iter().map(|surfel| Vec3::from_array(surfel.center));
    let belt: Vec<Vec3> = centers.filter(|center| center.y.abs() < 0.8).collect();
    let around = |p: &Vec3| [(0.5 + f64::from(p.z).atan2(p.x.into()) / TAU) as f32, 1.0 - p.y.acos() / PI as f32];
    Points {
        positions: belt.iter().map(|center| center.as_dvec3().to_array()).collect(),
        normals: Some(belt.iter().map(Vec3::to_array).collect()),
        radii: Some(vec![whole.surfels[0].radius(); belt.len()]),
        texture: Some(belt.iter().map(around).collect()),
        ..Points::default()
    }
}

fn textured(scene: &Scene) -> &Textured {
    let Colors::Textured(textured) = &scene.colors else { panic!("it is not textured") };
    textured
}

/// A camera that sees the seam, unlike that of [`sphere_camera`].
fn camera(size: u32, projection: Projection) -> Camera {
    let eye = DVec3::new(-2.6, 0.7, 0.9);
    let lens = sphere_camera(size, projection);
    let lens = match projection {
        Projection::Pinhole => Lens::Intrinsics([lens.fx, lens.fy, lens.cx, lens.cy]),
        Projection::Orthographic => Lens::OrthographicHeight(2.1),
    };
    Camera::look_at((size, size), lens, eye, DVec3::ZERO, None, Up::Y, 1e-5).unwrap()
}

/// Counts the pixels whose colours on the device and in the twin differ by more than the bounds.
///
/// The bounds add the error of the sums, the texture's slope, and the transition between the
/// texture and the blended colour. The counts are of pixels beyond the bounds, covered, undecided,
/// and in the transition.
fn beyond_bounds(scene: &Scene, camera: &Camera, accumulator: Accumulator, sources: &Sources) -> Option<[usize; 4]> {
    let gpu = common::gpu()?;
    let options = Settings { accumulator, ..unlit() };
    let row = accumulator.row();
    let fraction_bits = row.fraction_bits(scene.surfels.len() as u64);
    let backend = Backend::Gpu { gpu: Box::new(gpu), sources: sources.clone() };
    let (device, _) = render(scene, camera, &options, &backend, &()).unwrap();
    let exact = Settings { maps: options.maps.and(&[Map::Decision, Map::Normal]), ..options };
    let (twin, _) = render(scene, camera, &exact, &Backend::Reference, &()).unwrap();
    let splats = reference_all(scene, camera, &exact);
    let nearest = visibility::reference(splats.iter(), camera, LowPass::None, 0, camera.height);
    let sums = accumulate::reference(splats.iter(), scene, camera, &exact, 0, &nearest);
    let range = textured(scene).range();
    let [width, height] = textured(scene).mipmaps()[0].levels()[0].size().map(f64::from);
    // The change of colour per unit of u and v.
    let slope = STEEPEST * width.hypot(height);
    let (mut found, mut worst) = ([0; 4], 0f64);
    for (pixel, sum) in sums.iter().enumerate().filter(|(_, sum)| sum.weight > 0.0) {
        found[1] += 1;
        if twin.map(Map::Decision).unwrap()[pixel] < 1e-5 {
            found[2] += 1;
            continue;
        }
        let [u, v, squared, reach_2, _] = sum.place.map(|total| total / sum.weight);
        let variance = squared - u * u - v * v;
        // `mean` is the error of a mean as a fraction of its range, `fragment` that of a fragment's
        // f32 weight and place on the disk.
        let mean = 3.0 * (row.error_bound)(sum.count.max(1).into(), sum.weight, fraction_bits);
        let fragment = 2e-6;
        let apart = variance.max(0.0).sqrt() + reach_2.sqrt();
        // A fragment's point errs by a few roundings of its distance, which is about 3, and on a
        // tilted surface by more. Texture coordinates change by less than 0.4 per unit.
        let normal = Vec3::from_array(twin.normals().unwrap()[pixel]).as_dvec3();
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
        let cosine = normal.dot(camera.ray(f64::from(x) + 0.5, f64::from(y) + 0.5).normalize()).abs();
        let of_point = 4.0 * (-24f64).exp2() * 3.0 * 0.4 / (cosine * cosine).max(1e-4);
        let of_lookup = slope * f64::from(range.span) * (mean + fragment * apart + of_point);
        // The variance is a difference of means of at most 1/2. Far from the transition, the
        // texture's share is 0 or 1 on the device and in the twin.
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

fn unlit() -> Settings {
    Settings { shading: Shading::Unlit, ..Settings::default() }
}

/// Fragments outside their disks have texture coordinates beyond the scene's range: device and twin
/// clamp them alike.
#[test]
fn filtered_surfels_are_painted_alike_outside_their_disks() {
    let Some(gpu) = common::gpu() else { return };
    let camera = camera(60, Projection::Pinhole);
    let globe = globe(60, 0.4, waves(true));
    let options = Settings { low_pass: LowPass::Max, maps: Maps::of(&[Map::TexZ]), ..unlit() };
    let exact = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
    let (twin, _) = render(&globe, &camera, &exact, &Backend::Reference, &()).unwrap();
    let decided = |pixel: &usize| twin.map(Map::Decision).unwrap()[*pixel] > 1e-3;
    let apart = |sources: Sources| {
        let backend = Backend::Gpu { gpu: Box::new(gpu.clone()), sources };
        let (frame, _) = render(&globe, &camera, &options, &backend, &()).unwrap();
        let (ours, theirs) = (frame.map(Map::TexZ).unwrap(), twin.map(Map::TexZ).unwrap());
        let step =
            |pixel: usize| (0..2).map(|k| (ours[3 * pixel + k] - theirs[3 * pixel + k]).abs()).fold(0.0, f32::max);
        (0..frame.color.len()).filter(decided).map(step).filter(|step| step.is_finite()).fold(0.0, f32::max)
    };
    let error = apart(Sources::default());
    assert!(error < 1e-4, "{error}");
    // Control: other ends of the range.
    let from = "let seen = clamp(beyond, vec2<f32>(0.0), vec2<f32>(1.0));";
    let cut =
        Sources::default().replace("texture.wgsl", from, "let seen = clamp(beyond, vec2<f32>(0.1), vec2<f32>(0.9));");
    let error = apart(cut.unwrap());
    assert!(error > 1e-3, "{error}");
}

#[test]
fn the_device_paints_as_its_twin_does() {
    let Some(gpu) = common::gpu() else { return };
    let globe = globe(3000, 1.5, waves(true));
    for row in common::accumulators(&gpu) {
        let camera = camera(160, Projection::Pinhole);
        let Some(found) = beyond_bounds(&globe, &camera, row.of, &Sources::default()) else { return };
        let [wrong, covered, open, passing] = found;
        assert!(wrong == 0 && covered > 8000 && open < covered / 50 && passing > 0, "{}: {found:?}", row.name);
    }
    for (scene, projection) in
        [(&globe, Projection::Orthographic), (&self::globe(3000, 1.5, waves(false)), Projection::Pinhole)]
    {
        let found = beyond_bounds(scene, &camera(160, projection), Accumulator::Fixed, &Sources::default()).unwrap();
        assert!(found[0] == 0 && found[1] > 8000, "{found:?}");
    }
    for (file, from, to) in [
        ("textures.wgsl", "select(fract(turns),", "select(fract(turns + vec2<f32>(0.001, 0.0)),"),
        ("texture.wgsl", "clamp(2.0 -", "clamp(200.0 -"),
        ("texture.wgsl", "(point - place.position) * held.world", "(point - place.position) * (0.9 * held.world)"),
        ("textures.wgsl", "column + 1, row + 1), share.x)", "column + 1, row + 1), 0.99 * share.x)"),
        ("srgb.wgsl", "(code >> 8u) & 0xffu", "(code >> 9u) & 0xffu"),
        (
            "resolve_surface.wgsl",
            "textured(sums_of, weight, resolve_color(sums_of, weight))",
            "resolve_color(sums_of, weight)",
        ),
    ] {
        let broken = Sources::default().replace(file, from, to).unwrap();
        let found = beyond_bounds(&globe, &camera(160, Projection::Pinhole), Accumulator::Fixed, &broken).unwrap();
        assert!(found[0] >= 20, "{from} became {to}, and {found:?}");
    }
}

#[test]
fn a_painted_image_does_not_depend_on_the_order_of_surfels() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, camera) = (globe(2000, 1.5, waves(true)), camera(96, Projection::Pinhole));
    let backend = Backend::gpu(gpu);
    let drawn = |scene: &Scene| bits(&render(scene, &camera, &unlit(), &backend, &()).unwrap().0);
    let first = drawn(&scene);
    assert_eq!(first, drawn(&shuffled(&scene, 7)));
    // Control: another texture gives another image.
    assert_ne!(first, drawn(&globe(2000, 1.5, waves(false))));
}

/// A square with a checkerboard of single texels, black and white.
fn board() -> Scene {
    let texels = (0..256 * 256).map(|k| if (k % 256 + k / 256) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] });
    let texture = Texture::new(256, 256, texels.collect()).unwrap();
    let at = |k: usize| [(k % 41) as f64 / 20.0 - 1.0, (k / 41) as f64 / 20.0 - 1.0, 0.0];
    let positions: Vec<_> = (0..41 * 41).map(at).collect();
    let points = Points {
        normals: Some(vec![[0.0, 0.0, 1.0]; positions.len()]),
        radii: Some(vec![0.06; positions.len()]),
        texture: Some(positions.iter().map(|[x, y, _]| [0.5 + 0.5 * *x as f32, 0.5 + 0.5 * *y as f32]).collect()),
        positions,
        ..Points::default()
    };
    build_textured(vec![points], vec![texture], &()).unwrap().0
}

/// A pixel shows the mean of the many texels it covers, or parts of a single texel; device and twin
/// agree. Without mipmaps a kernel picks single texels.
#[test]
fn what_is_seen_from_afar_is_averaged() {
    let Some(gpu) = common::gpu() else { return };
    let scene = board();
    let eye = DVec3::new(0.8, 1.1, 3.0);
    let view = |lens| Camera::look_at((48, 48), lens, eye, DVec3::ZERO, None, Up::Y, 1e-3).unwrap();
    let cameras = [
        view(Lens::Fov(40.0)),
        view(Lens::OrthographicHeight(2.2)),
        // Four pixels per texel.
        view(Lens::OrthographicHeight(2.0 / 256.0 * 48.0 / 4.0)),
    ];
    let picking = Sources::default().replace("textures.wgsl", "0.5 * log2(max(texels, 1.0))", "0.0").unwrap();
    let backend = Backend::gpu(gpu);
    let picks = Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources: picking };
    for (camera, far) in cameras.iter().zip([true, true, false]) {
        let exact = Settings { maps: Maps::of(&[Map::Decision]), ..unlit() };
        let (twin, _) = render(&scene, camera, &exact, &Backend::Reference, &()).unwrap();
        let (device, _) = render(&scene, camera, &unlit(), &backend, &()).unwrap();
        let (picked, _) = render(&scene, camera, &unlit(), &picks, &()).unwrap();
        // Away from the square's outline, where only the square shows.
        let inner = |pixel: &usize| (16..32).contains(&(pixel % 48)) && (16..32).contains(&(pixel / 48));
        let off = |frame: &Frame, pixel: usize| f64::from((frame.color[pixel][0] - twin.color[pixel][0]).abs());
        let decided = twin.map(Map::Decision).unwrap();
        let inner: Vec<usize> = (0..48 * 48).filter(inner).filter(|&pixel| decided[pixel] > 1e-5).collect();
        assert!(inner.len() > 200);
        let worst = |frame: &Frame| inner.iter().map(|&pixel| off(frame, pixel)).fold(0.0, f64::max);
        assert!(worst(&device) < 2e-4, "{}", worst(&device));
        let spread = |frame: &Frame| {
            let from_mean = inner.iter().map(|&pixel| (f64::from(frame.color[pixel][0]) - 0.5).abs());
            from_mean.sum::<f64>() / inner.len() as f64
        };
        assert_eq!(far, spread(&twin) < 0.02, "{}", spread(&twin));
        assert!(spread(&picked) > 0.1, "{}", spread(&picked));
        assert_eq!(far, worst(&picked) > 0.1, "{}", worst(&picked));
    }
}

/// The scene with its places in the texture changed by `other`.
fn with_places(scene: &Scene, other: impl Fn(&Place) -> Place) -> Scene {
    let painted = textured(scene);
    let places = painted.places().iter().map(other).collect();
    let textures = painted.mipmaps().iter().map(|mipmap| mipmap.levels()[0].clone()).collect();
    let again = Textured::new(textures, painted.atlas(), places, painted.colors().to_vec()).unwrap();
    Scene { colors: Colors::Textured(again), ..scene.clone() }
}

/// The RMS difference between the picture of a [`globe`] and the texture at the exact points of the
/// sphere.
///
/// Pixels at the outline and at the belt's ends are left out. The first value is over pixels at
/// least two spacings from the seam, the second over those nearer to it.
fn apart_from_the_sphere(scene: &Scene, texture: &Texture, spacing: f64) -> [f64; 2] {
    let camera = camera(240, Projection::Pinhole);
    let (frame, _) = render(scene, &camera, &unlit(), &Backend::Reference, &()).unwrap();
    let mut sums = [[0.0; 2]; 2];
    for (pixel, color) in frame.color.iter().enumerate() {
        let (x, y) = ((pixel % 240) as f64 + 0.5, (pixel / 240) as f64 + 0.5);
        let (start, toward) = (camera.eye, camera.ray(x, y).normalize());
        let nearest = -start.dot(toward);
        let half_2 = 1.0 - start.length_squared() + nearest * nearest;
        let point = start + (nearest - half_2.max(0.0).sqrt()) * toward;
        if half_2 <= 0.0 || point.dot(toward) > -0.4 || point.y.abs() > 0.6 {
            continue;
        }
        let [u, v] = [0.5 + point.z.atan2(point.x) / TAU, 1.0 - point.y.acos() / PI];
        let texel = texture.premultiplied_at([u, v]);
        let squared = (0..3).map(|k| (f64::from(color[k]) - texel[k]).powi(2)).sum::<f64>() / 3.0;
        let at_seam = point.x < 0.0 && point.z.abs() < 2.0 * spacing;
        for (sum, counts) in sums.iter_mut().zip([!at_seam, at_seam]) {
            *sum = if counts { [sum[0] + squared, sum[1] + 1.0] } else { *sum };
        }
    }
    assert!(sums[0][1] > 10_000.0 && sums[1][1] > 500.0, "{sums:?}");
    sums.map(|[sum, count]| (sum / count).sqrt())
}

#[test]
fn a_texture_shows_what_is_finer_than_surfels() {
    // A wave of the texture is as long as four surfels.
    let texel = |k: u32| {
        let (x, y) = (TAU * f64::from(k % 512) / 512.0, TAU * f64::from(k / 512) / 256.0);
        let code = |wave: f64| (128.0 + 110.0 * wave) as u8;
        [code((16.0 * x).sin()), code((8.0 * y).sin()), code((16.0 * x).cos() * (8.0 * y).cos()), 255]
    };
    let texture = Texture::new(512, 256, (0..512 * 256).map(texel).collect()).unwrap();
    let count = 1500;
    let spacing = (4.0 * PI / count as f64).sqrt();
    let painted = globe(count, 0.9, texture.clone());
    let at_centers = textured(&painted).places().iter().map(|place| texture.at(place.center[0], place.center[1]));
    let colored = Scene { colors: Colors::Linear(at_centers.collect()), ..painted.clone() };
    // As in the paper's TexZ map, the whole splat has the coordinates of its centre.
    let of_centers = with_places(&painted, |place| Place { slopes: [[0.0; 3]; 2], ..*place });
    // A large reach blends across seams too.
    let across_seams = with_places(&painted, |place| Place { reach: 10.0, ..*place });
    let apart = |scene: &Scene| apart_from_the_sphere(scene, &texture, spacing);
    let [by_texture, by_color, of_centers, across] = [&painted, &colored, &of_centers, &across_seams].map(apart);
    eprintln!("texture {by_texture:.4?}, colour {by_color:.4?}, centres {of_centers:.4?}, across seams {across:.4?}");
    assert!(by_texture[0] < 0.1 * by_color[0] && by_texture[0] < 0.1 * of_centers[0]);
    assert!(by_texture[1] < 0.6 * across[1] && by_texture[1] < 0.7 * by_color[1]);
}

/// Options with an absolute tolerance.
fn within(tolerance: f64, shape: SplatShape) -> Options {
    Options { tolerance: Tolerance::Absolute(tolerance), shape, relaxations: 0 }
}

/// After simplification, and after PLY, surfels keep their texture coordinates and hardly reach
/// past a seam. The coordinates of the plane jump at the seam.
#[test]
fn simplified_surfels_keep_their_place_in_a_texture() {
    let across = |x: f64| if x > 0.0 { 0.5 } else { 0.0 };
    let coordinates = |[x, y, _]: [f64; 3]| [(0.1 * x + 0.05 * y + across(x)) as f32, (0.3 * y) as f32];
    let positions: Vec<[f64; 3]> =
        (0..3600).map(|k| [f64::from(k % 60) / 30.0 - 0.991, f64::from(k / 60) / 30.0 - 0.99, 2.0]).collect();
    let sampled = Points {
        normals: Some(vec![[0.0, 0.0, 1.0]; 3600]),
        radii: Some(vec![0.04; 3600]),
        texture: Some(positions.iter().map(|position| coordinates(*position)).collect()),
        positions,
        ..Points::default()
    };
    let (scene, _, own) = build_at_vertices(vec![sampled], &()).unwrap();
    let options = within(1e-3, SplatShape::Disk);
    // The farthest that any surfel shows past the seam, from its own side.
    let past = |left: &Points| {
        let shown = build_at_vertices(vec![left.clone()], &()).unwrap().0;
        let reaches = shown.surfels.iter().enumerate().map(|(index, surfel)| {
            let own = shown.origin.x + f64::from(surfel.center[0]);
            let rim = (0..720).flat_map(|k| [0.25, 0.5, 0.75, 1.0].map(|r| (r, TAU * f64::from(k) / 720.0)));
            let shows = rim.filter(|(r, angle)| {
                let clip = shown.clips.get(index).copied().unwrap_or_default();
                clip.0.iter().all(|[x, y, z]| {
                    f64::from(*x) * r * angle.cos() + f64::from(*y) * r * angle.sin() + f64::from(*z) >= 0.0
                })
            });
            let x = shows.map(|(r, angle)| {
                own + r * (f64::from(surfel.s[0]) * angle.cos() + f64::from(surfel.t[0]) * angle.sin())
            });
            x.map(|x| if (x > 0.0) == (own > 0.0) { 0.0 } else { x.abs() }).fold(0.0, f64::max)
        });
        reaches.fold(0.0, f64::max)
    };
    let (simplified, left, report) = simplify_in_texture(&scene, &own, &options, &()).unwrap();
    let left = points(&simplified, left, SplatShape::Disk);
    assert!(past(&left) < 0.05, "{}", past(&left));
    let (unaware, nothing, of_all) = simplify_in_texture(&scene, &Coordinates::default(), &options, &()).unwrap();
    assert!(report.selected > of_all.selected && report.selected < of_all.selected * 6 / 5, "{report:?} {of_all:?}");
    assert!(nothing.centers.is_empty() && past(&points(&unaware, nothing, SplatShape::Disk)) > 0.2);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("left.ply");
    io::ply::write_points(&path, &left, &()).unwrap();
    let read = io::read(&path, &()).unwrap();
    assert_eq!(read.texture_slopes.as_ref().unwrap().len() as u64, report.selected);
    let (painted, _) = build_textured(vec![read], vec![waves(true)], &()).unwrap();
    for (index, place) in textured(&painted).places().iter().enumerate() {
        let center = (painted.origin + painted.center(index)).to_array();
        let expected = coordinates(center);
        assert!((0..2).all(|k| (place.center[k] - expected[k]).abs() < 1e-5), "{center:?}: {place:?}");
        let [u, v] = place.slopes.map(Vec3::from_array);
        assert!(u.distance(Vec3::new(0.1, 0.05, 0.0)) < 1e-4 && v.distance(0.3 * Vec3::Y) < 1e-4, "{u} {v}");
    }
}

/// After simplification, a third of a globe's surfels paint it nearly as well. With slopes fitted
/// to this third alone they do not.
#[test]
fn a_texture_survives_simplification() {
    let texture = waves(true);
    let dense = globe(20_000, 1.3, texture.clone());
    let centers = textured(&dense).places().iter().map(|place| place.center).collect();
    let own = Coordinates { centers, ..Coordinates::default() };
    let options = within(0.0005, SplatShape::Cap);
    let (simplified, left, _) = simplify_in_texture(&dense, &own, &options, &()).unwrap();
    let left = points(&simplified, left, SplatShape::Cap);
    assert!(3 * left.positions.len() < dense.surfels.len(), "{}", left.positions.len());
    let refitted = Points { texture_slopes: None, ..left.clone() };
    let [painted, refitted] =
        [left, refitted].map(|points| build_textured(vec![points], vec![texture.clone()], &()).unwrap().0);
    let spacing = (4.0 * PI / 20_000.0).sqrt();
    let [before, after, refitted] =
        [&dense, &painted, &refitted].map(|scene| apart_from_the_sphere(scene, &texture, 4.0 * spacing));
    eprintln!("all {before:.5?}, a third {after:.5?}, refitted {refitted:.5?}");
    assert!(before[0] < 0.001 && after[0] < 0.005 && refitted[0] > 2.0 * after[0]);
}

/// The TexZ map holds the texture coordinates of the point that is seen, and its depth, on the
/// device and in the twin.
#[test]
fn texz_holds_where_a_pixel_lies_in_the_texture() {
    let scene = globe(6000, 1.2, waves(true));
    let camera = sphere_camera(96, Projection::Pinhole);
    let of = Settings { maps: Maps::of(&[Map::TexZ, Map::Depth]), ..unlit() };
    let twin = render(&scene, &camera, &of, &Backend::Reference, &()).unwrap().0;
    let places = |frame: &Frame| frame.map(Map::TexZ).unwrap().as_chunks::<3>().0.to_vec();
    let mut compared = 0;
    for (pixel, [u, v, z]) in places(&twin).into_iter().enumerate() {
        assert_eq!(z.to_bits(), twin.map(Map::Depth).unwrap()[pixel].to_bits());
        if z.is_infinite() {
            assert_eq!([u, v], [0.0; 2]);
            continue;
        }
        let (x, y) = ((pixel % 96) as f64 + 0.5, (pixel / 96) as f64 + 0.5);
        // The seen point, moved onto the sphere inside the disks.
        let point = (camera.eye + camera.ray(x, y) * f64::from(z)).normalize();
        let seam = point.x < 0.0 && point.z.abs() < 0.15;
        if point.y.abs() < 0.6 && !seam {
            let [expected_u, expected_v] = [0.5 + point.z.atan2(point.x) / TAU, 1.0 - point.y.acos() / PI];
            let off = (f64::from(u) - expected_u).abs().max((f64::from(v) - expected_v).abs());
            assert!(off < 2e-3, "{pixel}: {u} {v} and {expected_u} {expected_v}");
            compared += 1;
        }
    }
    assert!(compared > 2000, "{compared}");
    let refused = render(&sphere(50, 1.0), &camera, &of, &Backend::Reference, &()).unwrap_err();
    assert!(refused.to_string().contains("texz"), "{refused}");
    let Some(gpu) = common::gpu() else { return };
    let device = render(&scene, &camera, &of, &Backend::gpu(gpu), &()).unwrap().0;
    let off = |other: &Frame| {
        let pairs = places(&twin).into_iter().zip(places(other));
        let far = |(a, b): ([f32; 3], [f32; 3])| a.iter().zip(b).any(|(a, b)| a != &b && (a - b).abs() >= 1e-4);
        pairs.filter(|pair| far(*pair)).count()
    };
    // Few pixels are decided differently at rims and at epsilon.
    assert!(off(&device) < 40, "{}", off(&device));
    let unslanted = with_places(&scene, |place| Place { slopes: [[0.0; 3]; 2], ..*place });
    let gpu = common::gpu().unwrap();
    assert!(off(&render(&unslanted, &camera, &of, &Backend::gpu(gpu), &()).unwrap().0) > 1000);
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
        (vec![bunny, "--texture", cube, "--backend", "raster"], 2, ["rasteriser", "leave the texture out"]),
        (vec![bunny, "--shininess", "5"], 2, ["--shininess", "phong"]),
        (vec![bunny, "--shading", "phong", "--shininess", "0"], 2, ["shininess is 1", "1000"]),
    ] {
        let (status, told) = refused(&arguments);
        assert!(status == code && words.iter().all(|word| told.contains(word)), "{arguments:?}: {status} {told}");
    }
    let bare = Points { positions: vec![[0.0; 3]; 3], ..Points::default() };
    assert!(
        build_textured(vec![bare], vec![waves(true)], &()).unwrap_err().to_string().contains("texture coordinates")
    );
}

#[test]
fn places_that_are_no_numbers_are_counted() {
    let points = Points {
        positions: (0..25).map(|k| [f64::from(k % 5), f64::from(k / 5), 0.0]).collect(),
        texture: Some((0..25).map(|k| [0.1 * (k % 5) as f32, if k == 12 { f32::NAN } else { 0.5 }]).collect()),
        ..Points::default()
    };
    let (scene, preparation) = build_textured(vec![points], vec![waves(true)], &()).unwrap();
    assert_eq!(preparation.replaced_places, 1);
    assert!(preparation.notes().iter().any(|note| note.contains("1 points had texture coordinates")));
    assert_eq!(textured(&scene).places()[12].center, [0.0; 2]);
    // Along x the coordinate u increases by 0.1 per unit.
    let [u_slope, v_slope] = textured(&scene).places()[6].slopes.map(Vec3::from_array);
    assert!(u_slope.distance(0.1 * Vec3::X) < 1e-6 && v_slope.length() < 1e-6, "{u_slope} {v_slope}");
}
