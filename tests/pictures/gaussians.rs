//! Files of Gaussian surfels against closed forms and an independent oracle, and files with faults.
//!
//! Also tests that order and memory do not change a bit.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use common::command::{Folder, epsplat, fails, succeeds, text};
use common::gaussians::{Gaussian, file, harmonic, picture, torus};
use common::scenes::shuffled;
use epsplat::io::{self, ReadOptions};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::metrics::DECISION_MARGIN;
use epsplat::low_level::plan::{Facts, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::color::linear_to_srgb;
use epsplat::low_level::scene::composite::ALL_LAYERS;
use epsplat::low_level::scene::harmonics::basis;
use epsplat::low_level::scene::lens::DEFAULT_FOV;
use epsplat::low_level::scene::{Camera, Colors, Composite, Lens, LowPass, Map, Maps, Scene, Shading, Up, gaussian};
use epsplat::low_level::surfels::{Preparation, build};
use glam::{DMat3, DVec3};

fn gpu() -> Option<Backend> {
    common::gpu().map(Backend::gpu)
}

/// The command line's defaults for Gaussians.
fn options() -> Settings {
    Settings {
        kernel: gaussian::KERNEL,
        low_pass: LowPass::Gaussians,
        composite: Composite::Gaussians,
        shading: Shading::Unlit,
        ..Settings::default()
    }
}

/// The scene of a file with these Gaussians, and its preparation.
fn scene(gaussians: &[Gaussian]) -> (Scene, Preparation) {
    let folder = Folder::new();
    let points = io::read(&folder.file("gaussians.ply", file(gaussians)), &()).unwrap();
    build(vec![points], &()).unwrap()
}

/// A camera at the origin that looks along z, with 100 pixels per radian at the axis.
fn ahead(size: u32) -> Camera {
    let half = f64::from(size) / 2.0;
    let lens = Lens::Intrinsics([100.0, 100.0, half, half]);
    Camera::posed((size, size), lens, DVec3::ZERO, DMat3::IDENTITY, 1e-3).unwrap()
}

fn around(size: u32) -> Camera {
    let eye = DVec3::new(1.2, -2.6, 2.2);
    Camera::look_at((size, size), Lens::Fov(DEFAULT_FOV), eye, DVec3::ZERO, Some(DVec3::Z), Up::Z, 0.01).unwrap()
}

fn frame(scene: &Scene, camera: &Camera, options: &Settings, backend: &Backend) -> Frame {
    render(scene, camera, options, backend, &()).unwrap().0
}

/// A pixel's sRGB-encoded colour, premultiplied by alpha, and alpha.
fn codes([r, g, b, alpha]: [f32; 4]) -> [f64; 4] {
    let code = |light: f32| f64::from(alpha) * linear_to_srgb(light.into());
    [code(r), code(g), code(b), alpha.into()]
}

fn backends() -> Vec<Backend> {
    gpu().into_iter().chain([Backend::Reference]).collect()
}

/// A Gaussian 10 units away with a standard deviation of 5 pixels, or a third of one, has the alpha
/// `o exp(-rho^2 / 2)`: none below 1/255, and at most 0.99.
#[test]
fn one_gaussian_is_its_closed_form() {
    let camera = ahead(64);
    let color = [0.8, 0.4, 0.2];
    for (sigma, opacity) in [(0.5, 0.6), (0.5, 0.9999), (0.5, 0.02), (0.03, 0.8)] {
        let one = Gaussian::round([0.0, 0.0, 10.0], sigma, opacity, color);
        let (scene, _) = scene(std::slice::from_ref(&one));
        assert!(scene.encoded && matches!(scene.colors, Colors::Constant(_)));
        for backend in backends() {
            let shown = frame(&scene, &camera, &options(), &backend);
            let mut seen = 0;
            for (pixel, color_there) in shown.color.iter().enumerate() {
                let [dx, dy] = [pixel % 64, pixel / 64].map(|at| at as f64 - 31.5);
                let squared = dx * dx + dy * dy;
                let sigma = f64::from(one.scales[0]).exp() * 10.0;
                let value = one.alpha() * (-0.5 * (squared / (sigma * sigma)).min(2.0 * squared)).exp();
                let alpha = if value < 1.0 / 255.0 { 0.0 } else { value.min(0.99) };
                seen += usize::from(alpha > 0.0);
                let found = codes(*color_there);
                for (found, expected) in found.iter().zip([color[0], color[1], color[2], 1.0]) {
                    assert!((found - alpha * expected).abs() < 1e-6, "{sigma} {opacity}: {found} at {dx} {dy}");
                }
            }
            assert!(seen > 3, "{sigma}: {seen}");
        }
    }
}

/// The nearer Gaussian is composited over the farther in any order of the file, in encoded colours:
/// half of white over half of black is 0.5, unlike in linear light.
#[test]
fn two_gaussians_are_composited_by_depth_as_codes() {
    let [white, black] = [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]];
    let near = Gaussian::round([0.0, 0.0, 8.0], 0.6, 0.5, white);
    let far = Gaussian::round([0.1, 0.0, 12.0], 0.6, 0.75, black);
    let camera = ahead(48);
    let both = [near.clone(), far.clone()];
    let expected: Vec<[f64; 4]> = (0..48 * 48)
        .map(|pixel| {
            let at = |one: &Gaussian| {
                let scale = 100.0 / f64::from(one.position[2]);
                let sigma = f64::from(one.scales[0]).exp() * scale;
                let dx = f64::from(pixel % 48) - 23.5 - f64::from(one.position[0]) * scale;
                let dy = f64::from(pixel / 48) - 23.5;
                let alpha = one.alpha() * (-0.5 * (dx * dx + dy * dy) / (sigma * sigma)).exp();
                if alpha < 1.0 / 255.0 { 0.0 } else { alpha }
            };
            let [first, second] = [at(&near), at(&far)];
            let light = first;
            [light, light, light, first + (1.0 - first) * second]
        })
        .collect();
    for backend in backends() {
        for order in [[0, 1], [1, 0]] {
            let (scene, _) = scene(&order.map(|k: usize| both[k].clone()));
            let background = [1.0, 1.0, 1.0, 1.0];
            for (pixel, shown) in frame(&scene, &camera, &options(), &backend).color.iter().enumerate() {
                for (found, expected) in codes(*shown).iter().zip(expected[pixel]) {
                    assert!((found - expected).abs() < 1e-6, "{pixel}: {found} {expected}");
                }
            }
            let over = frame(&scene, &camera, &Settings { background, ..options() }, &backend);
            let middle = over.color[24 * 48 + 24];
            let [light, .., alpha] = expected[24 * 48 + 24];
            assert!((codes(middle)[0] - (light + 1.0 - alpha)).abs() < 1e-6, "{middle:?}");
            assert_eq!(over.color[0], [1.0; 4]);
        }
    }
}

/// A file of 100,000 Gaussians with harmonics of degree 3 matches the oracle, on the device and in
/// the twin. Broken kernels and harmonics do not.
#[test]
fn a_large_file_is_what_the_published_formulas_say() {
    let gaussians = torus(100_000, 3, 5);
    let (scene, preparation) = scene(&gaussians);
    assert_eq!((preparation.points, preparation.surfels), (100_000, 100_000));
    let Colors::Harmonics(harmonics) = &scene.colors else { panic!("they have no harmonics") };
    assert_eq!(harmonics.degree(), 3);
    let camera = around(160);
    let expected = picture(&gaussians, &camera);
    let certain = expected.iter().filter(|pixel| pixel.1 && pixel.0[3] > 0.0).count();
    assert!(certain > 3000, "{certain}");
    let rmse = |frame: &Frame| {
        let pixels = expected.iter().zip(&frame.color).filter(|(expected, _)| expected.1);
        let errors = pixels.flat_map(|(expected, shown)| {
            let shown = codes(*shown);
            (0..4).map(move |k| (shown[k] - expected.0[k].min(f64::from(u8::from(k == 3)).max(shown[3]))).powi(2))
        });
        let (sum, count) = errors.fold((0.0, 0), |(sum, count), error| (sum + error, count + 1));
        (sum / f64::from(count)).sqrt()
    };
    for backend in backends() {
        let error = rmse(&frame(&scene, &camera, &options(), &backend));
        println!("{error:e}");
        assert!(error < 1e-6, "{error:e}");
    }
    let Some(_) = gpu() else { return };
    for (name, from, to) in [
        ("color_harmonics.wgsl", "2.0 * zz - 3.0 * xx", "2.0 * zz - 2.0 * xx"),
        ("color_harmonics.wgsl", "0.54627421529603954", "-0.54627421529603954"),
        ("sorted.wgsl", "shows_more || !LEAVES_LAST", "true"),
        ("sorted.wgsl", ", MOST_ALPHA)", ", 1.0)"),
        ("fragments_ranked.wgsl", "alpha >= LEAST_ALPHA", "alpha >= 0.0"),
        ("lowpass_max.wgsl", "1.0 / FILTER_RADIUS", "1.2 / FILTER_RADIUS"),
    ] {
        let sources = Sources::default().replace(name, from, to).unwrap();
        let broken = Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources };
        let error = rmse(&frame(&scene, &camera, &options(), &broken));
        assert!(error > 1e-4, "{name}: {from}: {error:e}");
    }
}

/// Device and twin agree to 1e-6 at pixels where rounding changes no decision, for every degree and
/// each composite.
#[test]
fn device_and_twin_agree_in_every_degree_and_composite() {
    let Some(backend) = gpu() else { return };
    let camera = around(128);
    for degree in 0..=3 {
        let (scene, _) = scene(&torus(5_000, degree, 7));
        let all = [Composite::Gaussians, Composite::Sorted, Composite::Layers(ALL_LAYERS), Composite::Opaque];
        for composite in all.into_iter().take(if degree == 2 { 4 } else { 1 }) {
            let of = Settings { composite, maps: Maps::of(&[Map::Decision]), ..options() };
            let twin = frame(&scene, &camera, &of, &Backend::Reference);
            let shown = frame(&scene, &camera, &Settings { maps: Maps::NONE, ..of }, &backend);
            let margins = twin.map(Map::Decision).unwrap();
            let pixels = (0..margins.len()).filter(|pixel| margins[*pixel] > DECISION_MARGIN);
            let (mut sum, mut count) = (0.0, 0);
            for pixel in pixels {
                let [a, b] = [twin.color[pixel], shown.color[pixel]].map(codes);
                sum += a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                count += 4;
            }
            let rmse = (sum / f64::from(count)).sqrt();
            assert!(count > 40_000 && rmse < 1e-6, "{degree} {composite:?}: {rmse:e} over {count}");
        }
    }
}

/// The order in the file, the number of fragments per buffer and of surfels per page, and optional
/// device features change no bit.
#[test]
fn order_and_memory_do_not_show() {
    let Some(backend) = gpu() else { return };
    let camera = around(96);
    let (scene, _) = scene(&torus(6_000, 3, 9));
    let small = |bytes| Backend::gpu(Gpu::with_buffer_limit(common::gpu().unwrap(), bytes));
    let core = common::core_gpu().map(Backend::gpu).unwrap();
    for of in [options(), Settings { composite: Composite::Opaque, ..options() }] {
        let first = bits(&frame(&scene, &camera, &of, &backend));
        for seed in [1, 2] {
            assert!(bits(&frame(&shuffled(&scene, seed), &camera, &of, &backend)) == first, "order {seed}");
        }
        // A row of this image has about 96 x 30 fragments of 32 bytes; a surfel has 196 bytes of
        // attributes.
        assert!(bits(&frame(&scene, &camera, &of, &small(500_000))) == first, "bands and pages");
        assert!(bits(&frame(&scene, &camera, &of, &core)) == first, "core features");
        let mut other = scene.clone();
        other.surfels.iter_mut().for_each(|surfel| surfel.center[0] = surfel.center[0].next_up());
        assert!(bits(&frame(&other, &camera, &of, &backend)) != first);
    }
}

/// A pixel of a far cloud has thousands of fragments, more than a device sorts.
///
/// Lists that end where further fragments are invisible give the bits of complete lists; lists that
/// end earlier do not.
#[test]
fn far_clouds_are_drawn_to_the_bits_of_whole_lists() {
    let Some(backend) = gpu() else { return };
    let (scene, _) = scene(&torus(6_000, 1, 21));
    let far = |distance: f64| {
        let eye = distance * DVec3::new(0.3, -0.7, 0.6);
        Camera::look_at((48, 48), Lens::Fov(45.0), eye, DVec3::ZERO, Some(DVec3::Z), Up::Z, 0.01).unwrap()
    };
    let needs = |options: &Settings, backend: &Backend| {
        let (frame, report) = render(&scene, &far(16.0), options, backend, &()).unwrap();
        (bits(&frame), report.needs.contains(&"veils"))
    };
    let small = || Gpu::with_buffer_limit(common::gpu().unwrap(), 330_000);
    let sources = Sources::default();
    let early = sources
        .replace("fragments_veils.wgsl", "(held_back >= ENOUGH_HELD)", "(held_back >= ENOUGH_HELD / 8u)")
        .unwrap();
    for composite in [Composite::Gaussians, Composite::Sorted] {
        let of = Settings { composite, opacity: 0.9, ..options() };
        let (whole, veiled) = needs(&of, &backend);
        assert!(!veiled);
        let (ended, veiled) = needs(&of, &Backend::gpu(small()));
        assert!(veiled && ended == whole, "{composite:?}: {veiled}");
        let broken = Backend::Gpu { gpu: Box::new(small()), sources: early.clone() };
        assert!(needs(&of, &broken).0 != whole, "{composite:?}");
    }
    // The whole cloud covers a few pixels. Fragments whose depths differ only by rounding may come
    // in either order, which changes colours little, because they are alike.
    let camera = far(2000.0);
    let of = Settings { maps: Maps::of(&[Map::Decision]), ..options() };
    let twin = frame(&scene, &camera, &of, &Backend::Reference);
    let shown = frame(&scene, &camera, &options(), &backend);
    let mut compared = 0;
    for (pixel, margin) in twin.map(Map::Decision).unwrap().iter().enumerate() {
        if *margin > DECISION_MARGIN || twin.color[pixel][3] > 0.99 {
            compared += usize::from(twin.color[pixel][3] > 0.5);
            let [a, b] = [twin.color[pixel], shown.color[pixel]].map(codes);
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.02), "{pixel}: {a:?} {b:?}");
        }
    }
    assert!(compared >= 4, "{compared}");
}

#[test]
fn the_oracles_harmonics_are_the_programs() {
    for direction in [DVec3::new(0.3, -0.8, 0.2), DVec3::new(-0.1, 0.2, -0.9), DVec3::X, DVec3::Z] {
        let direction = direction.normalize();
        let orders = (1..4).flat_map(|l| (-l..=l).map(move |m| (l, m)));
        for ((l, m), value) in orders.zip(basis(direction)) {
            assert!((harmonic(l, m, direction) - value).abs() < 1e-12, "{l} {m}");
        }
    }
}

/// Flat ellipsoids become surfels perpendicular to their shortest axis; commands that make surfels
/// refuse thicker ellipsoids without `--flatten`.
#[test]
fn flat_ellipsoids_are_surfels_and_others_are_told() {
    let flat = torus(500, 1, 3);
    let solid = |thickness: f32, shortest: usize| -> Vec<Gaussian> {
        let thick = |one: &Gaussian| {
            let mut solid = one.clone();
            let thin = one.scales[0].min(one.scales[1]) + thickness.ln();
            solid.scales.insert(shortest, thin);
            solid
        };
        flat.iter().map(thick).collect()
    };
    let folder = Folder::new();
    let expected = scene(&flat).0;
    let (thin, preparation) = scene(&solid(0.01, 2));
    assert_eq!((thin.surfels, &thin.colors), (expected.surfels, &expected.colors));
    let flattened = preparation.flattened.unwrap();
    assert_eq!((flattened.count, flattened.thick), (500, 0));
    // Here the shortest axis is another axis of the rotation.
    let (turned, _) = scene(&solid(0.01, 0));
    assert!(turned.surfels.iter().all(|surfel| surfel.normal().is_finite()));
    let path = folder.file("solid.ply", file(&solid(0.5, 2)));
    let output = folder.path("solid.png");
    let levels = folder.path("levels.ply");
    fails(&["lod", text(&path), "-o", text(&levels)], 1, &["500 of its 500 Gaussians", "--flatten"]);
    assert!(!levels.exists());
    let told = succeeds(&["render", text(&path), "-o", text(&output), "--flatten", "--size", "64x64"]);
    let told = String::from_utf8(told.stderr).unwrap();
    assert!(told.contains("500 were thicker than a tenth") && output.exists(), "{told}");
    let options = ReadOptions { flatten: true, ..ReadOptions::default() };
    assert_eq!(io::read_with(&path, options, &()).unwrap().flattened.unwrap().thick, 500);
}

/// A Gaussian that cannot be drawn is left out and counted; a file that lacks properties is refused
/// in one sentence.
#[test]
fn odd_files_end_in_a_sentence_or_are_counted() {
    let mut odd = torus(40, 3, 11);
    odd[0].rotation = [0.0; 4];
    odd[1].scales[0] = f32::NAN;
    odd[2].scales[1] = 200.0;
    odd[3].scales[0] = -200.0;
    odd[4].opacity = f32::NAN;
    odd[5].opacity = 1e9;
    odd[6].opacity = -1e9;
    odd[7].opacity = f32::INFINITY;
    odd[8].base[1] = f32::NAN;
    odd[9].rest[20] = f32::INFINITY;
    odd[10].position[2] = f32::NAN;
    odd[11].rotation[1] = f32::NAN;
    let (scene, preparation) = scene(&odd);
    assert_eq!((preparation.shapeless, preparation.dropped_non_finite, preparation.replaced_colors), (7, 1, 1));
    assert_eq!((preparation.surfels, preparation.estimated_normals, preparation.estimated_radii), (32, 0, 0));
    let numbers: Vec<_> = (0..32).map(|surfel| scene.provenance.of(surfel)).collect();
    assert_eq!(numbers[0].1, 5, "{numbers:?}");
    for alpha in [1.0, 0.0, 1.0].iter().zip(0..) {
        assert_eq!(scene.colors.linear(alpha.1)[3], *alpha.0);
    }
    let notes = preparation.notes().join("\n");
    assert!(notes.contains("7 Gaussians were left out") && notes.contains("1 points had a colour"), "{notes}");
    if let Some(backend) = gpu() {
        let shown = frame(&scene, &around(64), &options(), &backend);
        assert!(shown.color.iter().flatten().all(|value| value.is_finite()));
    }

    let folder = Folder::new();
    let good = String::from_utf8_lossy(&file(&torus(1, 1, 1))).into_owned();
    let header = good.split("end_header").next().unwrap();
    let whole = |header: &str| [header.as_bytes(), b"end_header\n", &[0; 400]].concat();
    for (name, from, to, words) in [
        ("rest", "property float f_rest_8\n", "", ["have 8 properties f_rest_0", "0, 9, 24 or 45"]),
        ("dc", "property float f_dc_1\n", "", ["as Gaussians do", "f_dc_1"]),
        ("opacity", "property float opacity\n", "", ["as Gaussians do", "opacity"]),
        ("rot", "property float rot_3\n", "", ["as Gaussians do", "rot_3"]),
        ("scale", "property float scale_1\n", "", ["as Gaussians do", "scale_1"]),
    ] {
        assert!(header.contains(from));
        let path = folder.file(&format!("{name}.ply"), whole(&header.replace(from, to)));
        fails(&["info", text(&path)], 1, &words);
    }
    let zeros = folder.file("zeros.ply", whole(header));
    let output = folder.path("zeros.png");
    fails(&["render", text(&zeros), "-o", text(&output)], 1, &["none of the 1 Gaussians", "nothing to draw"]);
    let alpha = folder.file(
        "alpha.ply",
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nproperty float red\n\
         property float green\nproperty float blue\nproperty float alpha\nend_header\n0 0 0 1 1 1 1.5\n1 0 0 1 1 1 -0.5\n",
    );
    let told = String::from_utf8(succeeds(&["info", text(&alpha)]).stdout).unwrap();
    assert!(told.contains("2 points had an alpha outside 0 to 1"), "{told}");
}

/// By default the command line draws a file as it was trained; other options change the picture.
#[test]
fn a_file_is_drawn_as_it_was_trained() {
    let Some(_) = gpu() else { return };
    let folder = Folder::new();
    let gaussians = torus(3_000, 2, 13);
    let path = folder.file("torus.ply", file(&gaussians));
    let output = folder.path("torus.exr");
    let view = ["--eye", "1.2,-2.6,2.2", "--target", "0,0,0", "--up", "z", "--size", "128x128"];
    let render = |more: &[&str]| {
        let told = succeeds(&[&["render", text(&path), "-o", text(&output)], &view[..], more].concat());
        (io::exr::read(&output).unwrap(), String::from_utf8(told.stderr).unwrap())
    };
    let (own, _) = render(&[]);
    let expected = picture(&gaussians, &around(128));
    let far = |frame: &Frame| {
        let pixels = expected.iter().zip(&frame.color).filter(|(expected, _)| expected.1);
        pixels.filter(|(expected, shown)| (codes(**shown)[3] - expected.0[3]).abs() > 1e-4).count()
    };
    assert_eq!(far(&own), 0);
    let (wide, told) = render(&["--kernel", "gaussian"]);
    assert!(far(&wide) > 100 && told.contains("takes the place of the Gaussians' own"), "{told}");
    assert!(far(&render(&["--composite", "sorted"]).0) > 100);
    assert!(far(&render(&["--lowpass", "none"]).0) > 100);
    fails(&["render", text(&path), "-o", text(&output), "--shading", "lambert"], 2, &["take --shading unlit"]);
    assert!(far(&render(&["--outline", "6"]).0) > 100);
    assert_eq!(far(&render(&["--lowpass", "gaussians", "--kernel", "gaussian:0.3003866"]).0), 0);
    fails(
        &["render", text(&path), "-o", text(&output), "--lowpass", "gaussians", "--kernel", "hat"],
        2,
        &["needs a Gaussian kernel"],
    );
    for other in [&["--facing", "circle"][..], &["--backend", "raster"], &["--composite", "layers"]] {
        assert!(render(other).0.color.iter().any(|color| color[3] > 0.5), "{other:?}");
    }
    let told = String::from_utf8(succeeds(&["info", text(&path)]).stdout).unwrap();
    assert!(told.contains("Gaussian surfels") && told.contains("degree 2"), "{told}");
}

/// Other commands treat Gaussians as surfels in linear light, and a scene may hold both kinds.
#[test]
fn gaussians_are_surfels_to_others() {
    let folder = Folder::new();
    let path = folder.file("torus.ply", file(&torus(2_000, 1, 17)));
    let output = folder.path("surfels.ply");
    succeeds(&["surfels", text(&path), "-o", text(&output)]);
    let (read, own) = (io::read(&output, &()).unwrap(), io::read(&path, &()).unwrap());
    assert!(own.encoded && !read.encoded);
    let (Some(Colors::Linear(light)), Some(colors)) = (&read.colors, &own.colors) else {
        panic!("they are of another kind")
    };
    for (index, light) in light.iter().enumerate() {
        for (light, code) in light.iter().zip(colors.linear(index)).take(3) {
            assert!((linear_to_srgb(f64::from(*light)) - f64::from(code.min(1.0))).abs() < 1e-5);
        }
    }
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/data/bunny.obj");
    let both = epsplat(&["render", data, text(&path), "-o", text(&folder.path("both.png")), "--size", "64x64"]);
    assert!(both.status.success(), "{}", String::from_utf8_lossy(&both.stderr));
    let (scene, _) = build(vec![own, read], &()).unwrap();
    assert!(scene.encoded && Facts::of(&scene).encoded);
    let pair = [0, 2_000].map(|surfel| scene.colors.linear(surfel));
    assert!((0..3).all(|k| (pair[0][k].min(1.0) - pair[1][k]).abs() < 1e-5), "{pair:?}");
}
