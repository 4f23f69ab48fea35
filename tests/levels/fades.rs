//! Fading cuts of levels of detail: each sample shows one of 64 cuts, and nothing pops along a
//! camera path.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::collections::BTreeSet;

use common::bits;
use common::command::{Folder, fails, succeeds, text};
use common::levels::{frame, levels};
use common::scenes::{shuffled, sphere, sphere_camera};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::plan::{ACCUMULATORS, Organisation, Settings};
use epsplat::low_level::render::{Backend, Renderer, render};
use epsplat::low_level::scene::{
    Blend, Camera, Colors, Composite, Cull, Detail, Fade, Lens, LowPass, Map, Maps, Projection, Samples, Scene,
    Shading, Surfel, Up,
};
use epsplat::low_level::surfels::analytic::{Shape, generate};
use glam::{DVec3, Vec3};

/// Options with fading, for nodes of up to `pixels` square pixels.
fn fading(pixels: f64) -> Settings {
    Settings { detail: Detail::Pixels(pixels), detail_fades: true, cull: Cull::None, ..Settings::default() }
}

/// Each pixel shows one of the 64 cuts, by the cut's number, and is covered exactly if that cut
/// covers it. The cuts' node sizes increase from half the requested size.
#[test]
fn a_sample_shows_the_cut_of_its_number() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let (scene, camera) = (levels(sphere(6000, 1.1)), sphere_camera(96, Projection::Pinhole));
    // Nodes are flat here, as the outlines of caps hardly depend on the node size.
    let options = Settings { detail_caps: false, ..fading(400.0) };
    let [device, reference] =
        [&backend, &Backend::Reference].map(|backend| frame(&scene, &camera, &options, backend).color);
    let covers = |pixels: &[[f32; 4]]| pixels.iter().map(|color| color[3] == 1.0).collect::<Vec<bool>>();
    let mut outlines = BTreeSet::new();
    let (mut some, mut others) = (0, 0);
    for number in 0..64 {
        let size = 400.0 * (0.5 + f64::from(number) / 128.0);
        let plain = Settings { detail: Detail::Pixels(size), detail_fades: false, ..options.clone() };
        let expected = covers(&frame(&scene, &camera, &plain, &backend).color);
        for (index, expected) in expected.iter().enumerate() {
            let of_cut = Fade::threshold(index as u32 % 96, index as u32 / 96) == number;
            let shows = [&device, &reference].map(|color| color[index][3] == 1.0);
            assert!(!of_cut || shows == [*expected; 2], "{number}: {index}");
            // Cuts chosen with other random numbers often show something else here.
            others += usize::from(!of_cut && shows[0] != *expected);
            some += usize::from(of_cut);
        }
        outlines.insert(expected);
    }
    assert_eq!(some, 96 * 96);
    assert!(others > 100 && outlines.len() > 20, "{others} {}", outlines.len());
}

fn differ(shown: &Frame, truth: &Frame) -> usize {
    let near = |(a, b): (&[f32; 4], &[f32; 4])| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-5);
    shown.color.iter().zip(&truth.color).filter(|pair| !near(*pair)).count()
}

/// The device's fades equal the twin's by tiles and by scatter, with a low-pass, with several
/// samples, with every accumulator and in any order of the surfels.
#[test]
fn fades_are_those_of_the_twin_in_every_organisation() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let flat = sphere(6000, 1.7);
    let (scene, camera) = (levels(flat.clone()), sphere_camera(100, Projection::Pinhole));
    for low_pass in [LowPass::None, LowPass::Max, LowPass::Ewa] {
        let options = Settings { low_pass, samples: Samples { across: 2, down: 2 }, ..fading(200.0) };
        let reference = frame(&scene, &camera, &options, &Backend::Reference);
        let by = |organisation| Settings { organisation, ..options.clone() };
        let all = [Organisation::Auto, Organisation::Scatter, Organisation::Tile].map(|organisation| {
            let (shown, report) = render(&scene, &camera, &by(organisation), &backend, &()).unwrap();
            assert!(report.needs.contains(&"fades"));
            shown
        });
        assert!(all.iter().all(|shown| bits(shown) == bits(&all[0])), "{low_pass:?}");
        assert!(bits(&all[0]) == bits(&frame(&levels(shuffled(&flat, 3)), &camera, &options, &backend)));
        let wrong = differ(&all[0], &reference);
        assert!(wrong < 4, "{low_pass:?}: {wrong}");
        // A node size that is 1 % larger gives other fades.
        let other = Settings { detail: Detail::Pixels(202.0), ..options.clone() };
        let others = differ(&frame(&scene, &camera, &other, &backend), &reference);
        assert!(others > 100, "{low_pass:?}: {others}");
    }
    let maps = Settings { maps: Maps::of(&[Map::Depth, Map::Normal, Map::Weight, Map::Count]), ..fading(250.0) };
    let reference = frame(&scene, &camera, &maps, &Backend::Reference);
    let counted = |shown: &Frame| shown.map(Map::Count).unwrap().to_vec();
    let mut sums = 0;
    for row in ACCUMULATORS {
        // Not every adapter supports all accumulators.
        let options = Settings { accumulator: row.of, ..maps.clone() };
        let Ok((shown, _)) = render(&scene, &camera, &options, &backend, &()) else { continue };
        sums += 1;
        let counts = counted(&shown).iter().zip(&counted(&reference)).filter(|(a, b)| a != b).count();
        assert!(counts < 4, "{}: {counts}", row.name);
        // A splat in one of the 64 cuts has 1/64 of its weight. In sums of 24 fraction bits, its
        // rim then has only 9 significant bits.
        let colors = shown.color.as_flattened().iter().zip(reference.color.as_flattened());
        let off = colors.filter(|(a, b)| (*a - *b).abs() > 2e-3).count();
        assert!(off < 4, "{}: {off}", row.name);
        let far = shown.map(Map::Depth).unwrap().iter().zip(reference.map(Map::Depth).unwrap());
        let far =
            far.filter(|(a, b)| a.is_finite() != b.is_finite() || (a.is_finite() && (*a - *b).abs() > 1e-4)).count();
        assert!(far < 4, "{}: {far}", row.name);
    }
    assert!(sums >= 3, "{sums}");
}

/// A plane with a checkerboard of 64 x 64 squares that fills the view.
fn squares(count: usize) -> Scene {
    let side = (count as f64).sqrt();
    let all: Vec<_> = generate(Shape::Plane, count as u64).collect();
    let surfel = |place: [f64; 3]| Surfel::disk(DVec3::from_array(place).as_vec3(), Vec3::Z, (2.0 / side * 0.9) as f32);
    let dark = |[x, y, _]: [f64; 3]| ((x * 32.0).floor() + (y * 32.0).floor()).rem_euclid(2.0) == 0.0;
    let code = |place: [f64; 3]| if dark(place) { [40, 60, 90, 255] } else { [230, 220, 180, 255] };
    Scene {
        surfels: all.iter().map(|sample| surfel(sample.position)).collect(),
        colors: Colors::Srgb8(all.iter().map(|sample| code(sample.position)).collect()),
        oriented: true,
        up: Up::Z,
        ..Scene::default()
    }
}

/// Views of a dolly shot; each distance is the same fraction of the previous one.
fn dolly(size: u32, views: u32) -> Vec<Camera> {
    let view = |k: u32| {
        let distance = 1.6 * 0.7f64.powf(f64::from(k) / f64::from(views - 1));
        let target = DVec3::new(0.05, 0.03, 0.0);
        let eye = target + DVec3::new(0.1, 0.7, 0.9).normalize() * distance;
        Camera::look_at((size, size), Lens::Fov(20.0), eye, target, None, Up::Z, 1e-3).unwrap()
    };
    (0..views).map(view).collect()
}

/// The largest change of a pixel from one view to the next, and the largest difference of that
/// change from the full cloud's.
fn changes(shown: &[Frame], full: &[Frame]) -> [f32; 2] {
    let mut most = [0.0f32; 2];
    for (views, all) in shown.windows(2).zip(full.windows(2)) {
        for pixel in 0..views[0].color.len() {
            for k in 0..3 {
                let step = |views: &[Frame]| views[1].color[pixel][k] - views[0].color[pixel][k];
                let (of_cut, of_all) = (step(views), step(all));
                most = [most[0].max(of_cut.abs()), most[1].max((of_cut - of_all).abs())];
            }
        }
    }
    most
}

/// Along a dolly of 120 views, no pixel changes by more than 1.5 times the largest change of the
/// full cloud. Fades more than halve the largest difference from the full cloud's change of the
/// same pixel.
#[test]
fn nothing_pops_along_a_dolly() {
    let Some(gpu) = common::gpu() else { return };
    let backend = Backend::gpu(gpu);
    let scene = levels(squares(250_000));
    let options = Settings { samples: Samples { across: 2, down: 2 }, ..fading(16.0) };
    let views = dolly(128, 120);
    let along = |options: &Settings| {
        let mut renderer = Renderer::new(&scene, options, &backend).unwrap();
        views.iter().map(|camera| renderer.frame(camera, &()).unwrap()).unzip()
    };
    let (full, _): (Vec<Frame>, Vec<_>) = along(&Settings { detail: Detail::FINEST, ..options.clone() });
    let (fading, reports) = along(&options);
    let (popping, _) = along(&Settings { detail_fades: false, ..options.clone() });
    let coarse = reports.iter().filter(|report| report.cut.unwrap() < 60_000).count();
    assert!(coarse > 100, "{coarse}");
    let [of_all, none] = changes(&full, &full);
    assert_eq!(none, 0.0);
    let ([largest, beyond], [of_pops, popped]) = (changes(&fading, &full), changes(&popping, &full));
    assert!(largest <= 1.5 * of_all, "{largest} {of_all}");
    assert!(of_pops > largest && popped > 2.0 * beyond, "{of_pops} {largest} {popped} {beyond}");
}

/// The control: each way to break fading is noticed.
#[test]
fn broken_fades_are_noticed() {
    let Some(gpu) = common::gpu() else { return };
    let small = || common::gpu().unwrap().with_buffer_limit(70_000);
    let (scene, camera) = (levels(sphere(6000, 1.7)), sphere_camera(100, Projection::Pinhole));
    // Tiles draw all splats, or only large ones, or none.
    let by = |organisation| Settings { organisation, ..fading(800.0) };
    // With these sizes, only some of the cuts reach the root of a branch.
    let above = (12..18).map(|k| fading(f64::from(k).exp2()));
    let ways: Vec<_> =
        [Organisation::Tile, Organisation::Auto, Organisation::Scatter].map(by).into_iter().chain(above).collect();
    let (whole, in_branches) = (Backend::gpu(gpu), Backend::gpu(small()));
    let right: Vec<_> = ways.iter().map(|way| bits(&frame(&scene, &camera, way, &in_branches))).collect();
    assert!(ways.iter().zip(&right).all(|(way, right)| bits(&frame(&scene, &camera, way, &whole)) == *right));
    assert!(right[0] == right[1] && right[0] == right[2]);
    for (file, from, to) in [
        ("fade.wgsl", "fade.end - fade.first", "fade.end"),
        ("fade.wgsl", "cut < fade.end;", "true;"),
        ("fade.wgsl", "return front > 0.0 && farthest_shown(depth, radius, image) >= front;", "return true;"),
        ("fade.wgsl", "let differ = x ^ y;", "let differ = x;"),
        ("tile.wgsl", "fragment.hit && takes_sample(splat.fade, x, y + k)", "fragment.hit"),
        ("visibility.wgsl", "fragment.hit && takes_sample(splat.fade, x, y)", "fragment.hit"),
        ("select.wgsl", "(fate & ~CUTS_MASK) | min(cuts_of(fate), reached_in)", "fate"),
        ("select.wgsl", "reached[node.first] = cuts;", "reached[node.first] = ALL_CUTS;"),
        ("select.wgsl", "choose(at, below + k, 0u, cuts);", "choose(at, below + k, 0u, ALL_CUTS);"),
        ("select.wgsl", "index, cuts, reached_in);", "index, 0u, reached_in);"),
        ("select_fades.wgsl", "* drawn_at(place)];", "* drawn_at(place + 1u)];"),
        ("select_fades.wgsl", "floor(steps *", "floor(0.9 * steps *"),
    ] {
        let sources = Sources::default().replace(file, from, to).unwrap();
        let backend = Backend::Gpu { gpu: Box::new(small()), sources };
        let noticed = ways.iter().zip(&right).any(|(way, right)| {
            render(&scene, &camera, way, &backend, &()).is_ok_and(|(shown, _)| bits(&shown) != *right)
        });
        assert!(noticed, "{file}: {to}");
    }
}

/// Options that exclude fading are refused with a hint at `--lod-fade off`.
#[test]
fn what_does_not_fade_is_refused() {
    for options in [
        Settings { composite: Composite::Layers(2), ..fading(9.0) },
        Settings { composite: Composite::Weighted, ..fading(9.0) },
        Settings { blend: Blend::Nearest, shading: Shading::Unlit, ..fading(9.0) },
        Settings { raster: Some(Default::default()), ..fading(9.0) },
    ] {
        let refused = render(
            &levels(sphere(100, 1.7)),
            &sphere_camera(20, Projection::Pinhole),
            &options,
            &Backend::Reference,
            &(),
        );
        assert!(refused.unwrap_err().to_string().contains("--lod-fade off"), "{options:?}");
    }
}

/// Views of a set of cameras fade by default and single views do not; `--lod-fade` overrides both.
#[test]
fn views_of_many_cameras_fade() {
    let folder = Folder::new();
    let (surfels, levels) = (folder.path("sphere.ply"), folder.path("levels.ply"));
    succeeds(&["generate", "sphere", "--count", "4000", "-o", text(&surfels)]);
    succeeds(&["lod", text(&surfels), "-o", text(&levels)]);
    let cameras = folder.file(
        "transforms.json",
        r#"{"w": 64, "h": 64, "fl_x": 70, "frames": [{"file_path": "a", "transform_matrix":
        [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]}]}"#,
    );
    let picture = |more: &[&str]| {
        let views = folder.path("views");
        let base = ["render", text(&levels), "--backend", "reference", "--lod", "60px", "-o"];
        if more.contains(&"--cameras") {
            succeeds(&[&base[..], &[text(&views)], more].concat());
            return std::fs::read(views.join("a.png")).unwrap();
        }
        let one = folder.path("one.png");
        succeeds(&[&base[..], &[text(&one), "--size", "64x64", "--eye", "0,0,3"], more].concat());
        std::fs::read(&one).unwrap()
    };
    let many = |more: &[&str]| picture(&[&["--cameras", text(&cameras)], more].concat());
    assert!(many(&[]) == many(&["--lod-fade", "on"]) && many(&[]) != many(&["--lod-fade", "off"]));
    assert!(picture(&[]) == picture(&["--lod-fade", "off"]) && picture(&[]) != picture(&["--lod-fade", "on"]));
    // By default, options that exclude fading turn it off; with `--lod-fade on` they are refused.
    many(&["--composite", "layers:2"]);
    let output = folder.path("no");
    let base = ["render", text(&levels), "-o", text(&output), "--cameras", text(&cameras), "--lod-fade", "on"];
    fails(&[&base[..], &["--lod", "60px", "--composite", "layers:2"]].concat(), 2, &["--lod-fade off"]);
    fails(&base, 2, &["--lod"]);
}
