//! Buffers of splats have slots only for batches that are drawn: skipping batches saves memory and
//! does not change a bit.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use common::scenes::sphere;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::plan::{Optimisation, Organisation, Settings};
use epsplat::low_level::render::{Backend, Renderer, render};
use epsplat::low_level::scene::{Camera, Epsilon, Lens, LowPass, Maps, Scene, Shading, Surfel, Up};
use glam::DVec3;

/// The eye of the second view.
const OUTSIDE: DVec3 = DVec3::new(1.0, 0.7, 3.0);

/// 199,998 disks on a sphere, and behind it a very large one that faces [`OUTSIDE`].
///
/// The large disk's centre is 60,000 pixels outside the image, but its rim reaches into the image.
/// The last batch is not full.
fn scene() -> Scene {
    let mut scene = sphere(200_000, 1.5);
    let last = scene.surfels.len() - 1;
    let (toward, beside) = (OUTSIDE.normalize(), OUTSIDE.cross(DVec3::Y).normalize());
    let center = 2400.0 * beside - 3.0 * toward;
    scene.surfels[last] = Surfel::disk(center.as_vec3(), toward.as_vec3(), 2400.0);
    let index = scene.surfels.len() / 3;
    scene.surfels.swap(index, last);
    scene.surfels.truncate(199_999);
    if let epsplat::low_level::scene::Colors::Srgb8(codes) = &mut scene.colors {
        codes.truncate(199_999);
    }
    scene
}

/// Views that see more and more of the scene, then less.
fn views() -> Vec<Camera> {
    let look = |eye: DVec3, lens| Camera::look_at((128, 128), lens, eye, DVec3::ZERO, None, Up::Y, 1e-3).unwrap();
    vec![
        look(OUTSIDE * 0.5, Lens::Fov(15.0)),
        look(OUTSIDE, Lens::Fov(45.0)),
        look(DVec3::new(0.1, 0.2, 0.6), Lens::Fov(90.0)),
        look(OUTSIDE, Lens::OrthographicHeight(2.2)),
    ]
}

fn options() -> Vec<Settings> {
    // This epsilon does not depend on the large disk. One that does would make all surfels visible.
    let plain = Settings { epsilon: Epsilon::Relative(0.01), ..Settings::default() };
    let lit = Settings { maps: Maps::ON_DEVICE, ..plain.clone() };
    vec![
        Settings { shading: Shading::Unlit, ..plain },
        Settings { low_pass: LowPass::Ewa, organisation: Organisation::Scatter, ..lit.clone() },
        Settings { organisation: Organisation::Tile, ..lit },
    ]
}

fn without_culling(options: &Settings) -> Settings {
    Settings { without: vec![Optimisation::Culling], ..options.clone() }
}

/// The first view has too few slots for the second, which is rendered again; later views reuse the
/// larger buffers.
#[test]
fn a_view_that_needs_more_slots_gets_them() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, backend) = (scene(), Backend::gpu(gpu));
    for options in options() {
        let mut renderer = Renderer::new(&scene, &options, &backend).unwrap();
        let mut room = Vec::new();
        for view in views() {
            let (kept, report) = renderer.frame(&view, &()).unwrap();
            assert!(report.needs.contains(&"cull"));
            let (all, of_all) = render(&scene, &view, &without_culling(&options), &backend, &()).unwrap();
            assert!(!of_all.needs.contains(&"cull"));
            assert!(bits(&kept) == bits(&all), "{options:?}, {view:?}");
            room.push(renderer.device_bytes().splats);
        }
        assert!(room.is_sorted() && room[0] < room[1], "no buffer had to grow, so this tests nothing: {room:?}");
    }
}

#[test]
fn what_is_left_out_takes_no_room() {
    let Some(gpu) = common::gpu() else { return };
    let (scene, backend) = (scene(), Backend::gpu(gpu));
    for options in options() {
        let room = |options: &Settings, view: &Camera| {
            let mut renderer = Renderer::new(&scene, options, &backend).unwrap();
            let (_, report) = renderer.frame(view, &()).unwrap();
            (renderer.device_bytes().splats as f64, report.splats_drawn as f64 / scene.surfels.len() as f64)
        };
        // A surfel needs 36 bytes and its colour 4.
        let surfels = 40.0 * scene.surfels.len() as f64;
        // The first view shows part of the sphere, the second half of it. With tiles, no splat is
        // drawn early enough to hide others before they are projected.
        let half = if options.organisation == Organisation::Tile { 1.01 } else { 0.9 };
        for (view, most) in views().iter().zip([0.15, half]) {
            let ((all, _), (own, drawn)) = (room(&without_culling(&options), view), room(&options, view));
            let share = (own - surfels) / (all - surfels);
            assert!(drawn < share && share < most, "{share} of the room for {drawn} of the surfels: {options:?}");
        }
    }
}

#[test]
fn wrong_slots_are_noticed() {
    let Some(gpu) = common::gpu() else { return };
    // In the third view some far batches are visible.
    let (scene, views) = (scene(), &views()[1..3]);
    let mut backend = Backend::gpu(gpu);
    let mut image = |sources: Sources, options: &Settings| {
        if let Backend::Gpu { sources: kept, .. } = &mut backend {
            *kept = sources;
        }
        let frames = views.iter().map(|view| render(&scene, view, options, &backend, &()).unwrap().0);
        frames.map(|frame| bits(&frame)).collect::<Vec<_>>()
    };
    let broken = |file, from, to| Sources::default().replace(file, from, to).unwrap();
    let wrong = [
        ("cull.wgsl", "spare.y << SPARE.x", "spare.y"),
        ("cull.wgsl", "drawn[1] - workgroups.y + turn", "turn"),
        // The large disk's anchor needs more than 16 bits.
        ("cull.wgsl", "const SPARE: vec2<u32> = vec2<u32>(9u)", "const SPARE: vec2<u32> = vec2<u32>(16u)"),
        ("project.wgsl", "&rare[QUEUE_START + place], slot)", "&rare[QUEUE_START + place], place_for(slot))"),
    ];
    for (number, options) in options().into_iter().enumerate() {
        let expected = image(Sources::default(), &options);
        for (_, (file, from, to)) in wrong.into_iter().enumerate().filter(|(k, _)| common::takes(number + k, 3)) {
            assert!(image(broken(file, from, to), &options) != expected, "{from} in {file} may be {to:?}: {options:?}");
        }
        if !common::takes(number, 3) {
            continue;
        }
        // Repeating the last surfel to the end of its batch has no effect until the check for
        // existence is removed.
        let repeated = broken("project.wgsl", "surfel_at(index)", "surfel_at(min(index, surfels_held() - 1u))");
        assert!(image(repeated.clone(), &options) == expected);
        let repeated = repeated.replace("project.wgsl", "exists && faces", "faces").unwrap();
        assert!(image(repeated, &options) != expected, "surfels past the last may be drawn: {options:?}");
    }
}
