//! Files of 3D Gaussian splatting against an independent oracle, and what cannot be drawn of them.
//!
//! Also tests that order and memory do not change a bit.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use common::command::{Folder, fails, succeeds, text};
use common::gaussians::{Gaussian, file};
use common::scenes::shuffled;
use common::solids::{Rules, cloud, picture};
use epsplat::io::{self, ReadOptions};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::metrics::DECISION_MARGIN;
use epsplat::low_level::plan::{Facts, Settings};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::color::linear_to_srgb;
use epsplat::low_level::scene::{Camera, Composite, Lens, LowPass, Map, Maps, Samples, Scene, Shading, Up, gaussian};
use epsplat::low_level::surfels::build;
use glam::DVec3;

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

fn scene(gaussians: &[Gaussian]) -> Scene {
    let folder = Folder::new();
    let options = ReadOptions { solid: true, ..ReadOptions::default() };
    let points = io::read_with(&folder.file("gaussians.ply", file(gaussians)), options, &()).unwrap();
    assert_eq!(points.flattened, None);
    build(vec![points], &()).unwrap().0
}

/// A camera at `eye` that looks at the origin.
fn toward(size: (u32, u32), lens: Lens, eye: [f64; 3]) -> Camera {
    Camera::look_at(size, lens, DVec3::from_array(eye), DVec3::ZERO, Some(DVec3::Z), Up::Z, 0.05).unwrap()
}

/// Cameras outside the cloud and inside it, of several lenses.
fn cameras() -> [(&'static str, Camera); 5] {
    let outside = [1.6, -2.9, 2.1];
    [
        ("around", toward((128, 96), Lens::Fov(45.0), outside)),
        ("off centre", toward((96, 96), Lens::Intrinsics([90.0, 130.0, 20.0, 70.0]), outside)),
        ("inside", toward((96, 96), Lens::Fov(90.0), [0.3, -0.2, 0.25])),
        ("far", toward((48, 48), Lens::Fov(45.0), [10.0, -16.0, 12.0])),
        ("orthographic", toward((128, 96), Lens::OrthographicHeight(2.6), outside)),
    ]
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

/// The root of the mean square error over the certain pixels, and the largest error.
fn errors(expected: &[([f64; 4], bool)], shown: &Frame) -> (f64, f64) {
    let pixels = expected.iter().zip(&shown.color).filter(|(expected, _)| expected.1);
    let errors = pixels.flat_map(|(expected, shown)| {
        let shown = codes(*shown);
        // Codes above 1 are clamped.
        (0..4).map(move |k| (shown[k] - expected.0[k].min(f64::from(u8::from(k == 3)).max(shown[3]))).abs())
    });
    let (sum, count, most) =
        errors.fold((0.0, 0, 0.0f64), |(sum, count, most), error| (sum + error * error, count + 1, most.max(error)));
    assert!(count > 400, "{count}");
    ((sum / f64::from(count)).sqrt(), most)
}

/// Device and twin show what the published formulas say, from outside and inside the cloud, by
/// pinhole and orthographic cameras. They do not show what the formulas say without the 0.3 square
/// pixels, without the third axis, or without the limit on the Jacobian.
#[test]
fn pictures_are_what_the_published_formulas_say() {
    let gaussians = cloud(1_500, 3, 5);
    let scene = scene(&gaussians);
    assert!(Facts::of(&scene).solid && scene.thirds.len() == 1_500);
    for (name, camera) in cameras() {
        let expected = picture(&gaussians, &camera, Rules::PUBLISHED);
        let certain = expected.iter().filter(|pixel| pixel.1 && pixel.0[3] > 0.0).count();
        assert!(certain > 40, "{name}: {certain}");
        let controls = [
            Rules { dilation: 0.0, ..Rules::PUBLISHED },
            Rules { third: false, ..Rules::PUBLISHED },
            Rules { limited: false, ..Rules::PUBLISHED },
        ];
        for backend in backends() {
            let shown = frame(&scene, &camera, &options(), &backend);
            let (rmse, most) = errors(&expected, &shown);
            println!("{name}: {certain} certain pixels, RMSE {rmse:e}, at most {most:e}");
            assert!(rmse < 1e-6 && most < 3e-5, "{name}: {rmse:e} {most:e}");
            for (k, rules) in controls.into_iter().enumerate() {
                let (rmse, _) = errors(&picture(&gaussians, &camera, rules), &shown);
                // Only a camera among the Gaussians sees some whose centres lie beside the image.
                let differs = if k == 2 { name == "inside" } else { true };
                assert!(!differs || rmse > 1e-4, "{name}: {rules:?}: {rmse:e}");
            }
        }
    }
}

/// Changes of the kernel's formulas show.
#[test]
fn a_broken_conic_shows() {
    let Some(_) = gpu() else { return };
    let gaussians = cloud(1_500, 0, 5);
    let scene = scene(&gaussians);
    let (_, camera) = &cameras()[2];
    let expected = picture(&gaussians, camera, Rules::PUBLISHED);
    for (name, from, to) in [
        ("axes_conic.wgsl", "xx * down + across * down", "across * down"),
        ("axes_conic.wgsl", "t.x - slope.x * t.z, w.x", "t.x + slope.x * t.z, w.x"),
        ("axes_conic.wgsl", "sqrt(xx + across)", "sqrt(xx)"),
        ("axes_conic.wgsl", "* third;", "* third * 1.01;"),
        ("camera_pinhole.wgsl", "-0.15 * size", "-0.5 * size"),
    ] {
        let sources = Sources::default().replace(name, from, to).unwrap();
        let broken = Backend::Gpu { gpu: Box::new(common::gpu().unwrap()), sources };
        let (rmse, _) = errors(&expected, &frame(&scene, camera, &options(), &broken));
        assert!(rmse > 1e-5, "{name}: {from}: {rmse:e}");
    }
}

/// Device and twin agree at pixels where rounding changes no decision, with both composites, with
/// and without the pixel's Gaussian, and with several samples.
#[test]
fn device_and_twin_agree() {
    let Some(backend) = gpu() else { return };
    let scene = scene(&cloud(1_500, 1, 7));
    for (name, camera) in cameras() {
        for of in [
            options(),
            Settings { composite: Composite::Sorted, ..options() },
            Settings { low_pass: LowPass::None, ..options() },
            Settings { samples: Samples::FOUR, ..options() },
        ] {
            let twin = frame(
                &scene,
                &camera,
                &Settings { maps: Maps::of(&[Map::Decision]), ..of.clone() },
                &Backend::Reference,
            );
            let shown = frame(&scene, &camera, &of, &backend);
            let margins = twin.map(Map::Decision).unwrap();
            let (mut sum, mut count) = (0.0, 0);
            for pixel in (0..margins.len()).filter(|pixel| margins[*pixel] > DECISION_MARGIN) {
                let [a, b] = [twin.color[pixel], shown.color[pixel]].map(codes);
                sum += a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                count += 4;
            }
            let rmse = (sum / f64::from(count)).sqrt();
            println!("{name} {:?} {:?} {:?}: {rmse:e} over {count}", of.composite, of.low_pass, of.samples);
            assert!(count > 1_000 && rmse < 2e-6, "{name}: {rmse:e} over {count}");
        }
    }
}

/// The order in the file, buffers, pages, optional features and the driver change no bit, although
/// several Gaussians have the depth of others to the bit.
#[test]
fn order_and_memory_do_not_show() {
    let Some(backend) = gpu() else { return };
    let mut gaussians = cloud(3_000, 1, 9);
    // Half of them lie in one plane parallel to the image of the first camera.
    for one in gaussians.iter_mut().step_by(2) {
        one.position[2] = 0.125;
    }
    let scene = scene(&gaussians);
    let small = |bytes| Backend::gpu(Gpu::with_buffer_limit(common::gpu().unwrap(), bytes));
    let core = common::core_gpu().map(Backend::gpu).unwrap();
    let above =
        Camera::look_at((96, 96), Lens::Fov(45.0), DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, Some(DVec3::Y), Up::Y, 0.05)
            .unwrap();
    for camera in [above, cameras()[2].1.clone()] {
        let first = bits(&frame(&scene, &camera, &options(), &backend));
        for seed in [1, 2] {
            assert!(bits(&frame(&shuffled(&scene, seed), &camera, &options(), &backend)) == first, "order {seed}");
        }
        assert!(bits(&frame(&scene, &camera, &options(), &small(800_000))) == first, "bands and pages");
        assert!(bits(&frame(&scene, &camera, &options(), &core)) == first, "core features");
        if let Some(other) = common::opengl() {
            assert!(bits(&frame(&scene, &camera, &options(), &Backend::gpu(other))) == first, "OpenGL");
        }
        let mut other = scene.clone();
        other.thirds.iter_mut().for_each(|third| *third *= 0.99);
        assert!(bits(&frame(&other, &camera, &options(), &backend)) != first);
    }
}

/// Gaussians of sizes of all magnitudes, in front of the eye and far away, have finite pixels.
#[test]
fn sizes_of_all_magnitudes_are_drawn() {
    let mut gaussians = cloud(400, 0, 11);
    for (k, one) in gaussians.iter_mut().enumerate() {
        let turn = (k % 8) as f32;
        one.scales = vec![-20.0 + 3.0 * turn, -16.0 + 2.0 * turn, 2.0 - 3.0 * turn];
    }
    let scene = scene(&gaussians);
    for (name, camera) in cameras() {
        for backend in backends() {
            let shown = frame(&scene, &camera, &options(), &backend);
            assert!(shown.color.iter().flatten().all(|value| value.is_finite()), "{name}");
            let (rmse, most) = errors(&picture(&gaussians, &camera, Rules::PUBLISHED), &shown);
            println!("{name}: {rmse:e} {most:e}");
            assert!(rmse < 1e-6 && most < 3e-5, "{name}: {rmse:e} {most:e}");
            // Control: the loss of the thinnest eighth shows.
            let others: Vec<_> =
                gaussians.iter().enumerate().filter(|(k, _)| k % 8 != 0).map(|(_, one)| one.clone()).collect();
            let (rmse, _) = errors(&picture(&others, &camera, Rules::PUBLISHED), &shown);
            assert!(rmse > 1e-4, "{name}: {rmse:e}");
        }
    }
}

/// The command line draws a file of 3D Gaussian splatting without an option, and refuses what has
/// no meaning for it.
#[test]
fn a_file_is_drawn_without_an_option() {
    let Some(_) = gpu() else { return };
    let folder = Folder::new();
    let gaussians = cloud(1_000, 3, 13);
    let path = folder.file("solid.ply", file(&gaussians));
    let output = folder.path("solid.exr");
    let view = ["--eye", "1.6,-2.9,2.1", "--target", "0,0,0", "--up", "z", "--size", "96x96"];
    let told = succeeds(&[&["render", text(&path), "-o", text(&output)], &view[..]].concat());
    let told = String::from_utf8(told.stderr).unwrap();
    assert!(!told.contains("shortest axis"), "{told}");
    let camera = toward((96, 96), Lens::Fov(45.0), [1.6, -2.9, 2.1]);
    let (rmse, _) = errors(&picture(&gaussians, &camera, Rules::PUBLISHED), &io::exr::read(&output).unwrap());
    assert!(rmse < 1e-6, "{rmse:e}");
    succeeds(
        &[&["render", text(&path), "-o", text(&output), "--aov", "depth,transmittance,layers,index"], &view[..]]
            .concat(),
    );
    let other = folder.path("other.exr");
    let refused: [(&[&str], i32, &str); 12] = [
        (&["--composite", "opaque"], 2, "no surface"),
        (&["--composite", "layers"], 2, "no surface"),
        (&["--composite", "moments"], 2, "no surface"),
        (&["--blend", "nearest"], 2, "no surface"),
        (&["--backend", "raster"], 2, "rasteriser"),
        (&["--lod", "4px"], 2, "levels of detail"),
        (&["--kernel", "constant"], 2, "kernel of their own"),
        (&["--lowpass", "ewa"], 2, "--lowpass gaussians"),
        (&["--outline", "6"], 2, "--outline"),
        (&["--aov", "normal"], 2, "no normals"),
        (&["--shading", "lambert"], 2, "unlit"),
        (&["--facing", "circle"], 1, "--flatten"),
    ];
    for (more, code, said) in refused {
        fails(&[&["render", text(&path), "-o", text(&other)], more].concat(), code, &[said]);
        assert!(!other.exists());
    }
    for command in ["surfels", "lod", "simplify"] {
        fails(&[command, text(&path), "-o", text(&folder.path("made.ply"))], 1, &["1000 Gaussians", "--flatten"]);
    }
    let told = String::from_utf8(succeeds(&["info", text(&path)]).stdout).unwrap();
    assert!(told.contains("3D Gaussians") && told.contains("degree 3"), "{told}");
    let flat = succeeds(&[&["render", text(&path), "-o", text(&other), "--flatten"], &view[..]].concat());
    assert!(String::from_utf8(flat.stderr).unwrap().contains("shortest axis"));
}
