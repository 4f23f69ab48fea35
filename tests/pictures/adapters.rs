//! Tests on other adapters than the default one: a second driver, OpenGL, and graphics cards.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use common::command::{DATA, Folder, epsplat, succeeds, text};
use common::scenes::{crowded, sphere, sphere_camera};
use epsplat::low_level::gpu::AdapterDescription;
use epsplat::low_level::plan::{Organisation, Settings};
use epsplat::low_level::render::{Backend, Renderer};
use epsplat::low_level::scene::Projection;
use std::path::Path;
use std::process::{Command, Output};

/// SwiftShader in the Chromium packages of Debian and Ubuntu.
///
/// It shares no code with Mesa. Like Windows' WARP, it has subgroups of four invocations and no
/// 64-bit integers.
const DRIVERS: [&str; 2] =
    ["/usr/lib/chromium/vk_swiftshader_icd.json", "/usr/lib/chromium-browser/vk_swiftshader_icd.json"];

/// Draws three scenes on the adapter, and compares them with the reference and, bit by bit, with
/// those of the default adapter.
///
/// `render` runs the program with the given arguments; its flag says whether the run uses the
/// adapter. The adapter's name must contain `name`.
fn draws_the_same_picture(name: &str, render: impl Fn(&[&str], bool) -> Output) {
    let folder = Folder::new();
    let [many, few, theirs, ours] = ["many.ply", "few.ply", "theirs.exr", "ours.exr"].map(|name| folder.path(name));
    succeeds(&["generate", "sphere", "--count", "20000", "-o", text(&many)]);
    succeeds(&["generate", "sphere", "--count", "300", "-o", text(&few)]);
    let bunny = format!("{DATA}/bunny.obj");
    // In order: many splats, of which some are culled; few large splats; filtered disks of a mesh.
    let scenes: [&[&str]; 3] = [&[text(&many), "--shading", "unlit"], &[text(&few)], &[&bunny, "--lowpass", "ewa"]];
    for scene in scenes {
        let render = |out: &Path, backend: &str, maps: &str| {
            // SwiftShader takes a minute to compile maps with several samples, and may crash.
            let rest = [
                "--samples",
                "1",
                "--size",
                "96x96",
                "--aov",
                maps,
                "--json",
                "-",
                "--backend",
                backend,
                "-o",
                text(out),
            ];
            let arguments = [&["render"], scene, &rest].concat();
            let output = render(&arguments, backend == "gpu");
            assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
            output
        };
        let output = render(&theirs, "gpu", "depth,weight,count");
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(told.lines().any(|line| line.starts_with("rendering on ") && line.contains(name)), "{told}");
        let bits = |json: &[u8]| serde_json::from_slice::<serde_json::Value>(json).unwrap()["bits"].clone();
        let own = [&["render"], scene, &["--samples", "1", "--size", "96x96", "--aov", "depth,weight,count"]].concat();
        let own = succeeds(&[&own[..], &["--json", "-", "-o", text(&ours)]].concat());
        assert!(bits(&output.stdout).is_object() && bits(&output.stdout) == bits(&own.stdout), "{scene:?}");
        render(&ours, "reference", "depth,weight,count,decision");
        let output = succeeds(&["compare", text(&theirs), text(&ours), "--json", "-"]);
        let comparison: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        // This is also the limit of the studies. It is over decided pixels, where no fragment is
        // within rounding of a decision: one lost fragment in such a pixel gives a thousand times
        // this error.
        assert!(comparison["rmse_decided"].as_f64().unwrap() < 1e-6, "{scene:?}: {comparison}");
        assert!(comparison["excused"].as_f64().unwrap() < 0.01, "{scene:?}: {comparison}");
    }
}

#[test]
fn another_driver_draws_the_same_picture() {
    let Some(driver) = DRIVERS.into_iter().find(|driver| Path::new(driver).exists()) else {
        eprintln!("skipped: Chromium's SwiftShader is not at {DRIVERS:?}");
        return;
    };
    draws_the_same_picture("SwiftShader", |arguments, _| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_epsplat"));
        command.env("VK_DRIVER_FILES", driver).env("VK_ICD_FILENAMES", driver).args(arguments).output().unwrap()
    });
}

/// Without `--adapter`, OpenGL is the last choice. With `--adapter gl` it draws even if other
/// adapters exist.
#[test]
fn opengl_draws_the_same_picture() {
    if common::opengl().is_none() {
        return;
    }
    draws_the_same_picture("(gl,", |arguments, adapter| {
        epsplat(&[arguments, if adapter { &["--adapter", "gl"] } else { &[] }].concat())
    });
}

#[test]
fn an_adapter_is_chosen_by_its_api_or_by_a_part_of_its_name() {
    if common::gpu().is_none() {
        return;
    }
    let folder = Folder::new();
    let (scene, image) = (folder.path("s.ply"), folder.path("s.png"));
    succeeds(&["generate", "sphere", "--count", "10", "-o", text(&scene)]);
    let all = epsplat::low_level::gpu::adapters();
    let best = |chosen: &dyn Fn(&AdapterDescription) -> bool| {
        let found = all.iter().find(|adapter| adapter.usable && chosen(adapter));
        found.map(|adapter| format!("rendering on {} ({}, {})", adapter.name, adapter.api, adapter.kind))
    };
    let check = |name: &str, expected: Option<String>| {
        let output = epsplat(&["render", text(&scene), "-o", text(&image), "--size", "8x8", "--adapter", name]);
        let told = String::from_utf8(output.stderr).unwrap();
        match expected {
            Some(line) => assert!(output.status.success() && told.lines().any(|l| l == line), "{name}: {line}: {told}"),
            None => assert!(output.status.code() == Some(1) && told.contains(&format!("{name:?}")), "{name}: {told}"),
        }
    };
    for (name, api) in [("vulkan", "vulkan"), ("gl", "gl"), ("OpenGL", "gl"), ("metal", "metal"), ("DX12", "dx12")] {
        check(name, best(&|adapter| adapter.api == api));
    }
    for adapter in &all {
        check(&adapter.name.to_uppercase(), best(&|other| other.name.contains(&adapter.name)));
    }
    check("no such adapter", None);
}

/// A graphics card is timed by its own timestamps, and draws only large splats by tiles, with an
/// invocation for each pixel. The bits are the same as on a software adapter. Compiling these tiles
/// takes llvmpipe a while, so one scene has them; tests/kernels/tiles.rs draws them by the twin.
#[test]
fn a_card_is_timed_by_its_own_clock_and_draws_the_same() {
    let (Some(software), Some(mut card)) = (common::gpu(), common::gpu()) else { return };
    if !software.adapter.timestamps {
        eprintln!("skipped: no timestamps");
        return;
    }
    card.adapter.kind = "discrete";
    let small_pages = common::gpu().map(|gpu| {
        let mut gpu = gpu.with_buffer_limit(70_000);
        gpu.adapter.kind = "discrete";
        gpu
    });
    let [software, card, small_pages] = [Some(software), Some(card), small_pages].map(|gpu| Backend::gpu(gpu.unwrap()));
    let mut scenes = crowded();
    scenes.push((sphere(3000, 1.8), sphere_camera(90, Projection::Pinhole)));
    for (index, (scene, camera)) in scenes.iter().enumerate() {
        let organisations = [Organisation::Scatter, Organisation::Auto];
        for organisation in organisations.into_iter().take(if index == 0 { 2 } else { 1 }) {
            let options = Settings { organisation, ..Settings::default() };
            let frames = [&software, &card, &small_pages].map(|backend| {
                let mut renderer = Renderer::new(scene, &options, backend).unwrap();
                renderer.frame(camera, &()).unwrap();
                renderer.frame(camera, &()).unwrap()
            });
            let [(expected, wall), (own, timed), (paged, pages)] = &frames;
            assert!(bits(own) == bits(expected) && bits(paged) == bits(expected), "{organisation:?}");
            // The host times a software adapter's passes once the device has drawn triangles.
            assert!(["wall", "timestamps"].contains(&wall.clock), "{}", wall.clock);
            assert_eq!((timed.clock, pages.clock), ("timestamps", "timestamps"));
            assert!(timed.passes.values().all(|ms| ms.is_finite()), "{:?}", timed.passes);
            assert!(
                ["project_ms", "visibility_ms", "accumulate_ms"].iter().all(|pass| timed.passes.contains_key(*pass))
            );
        }
    }
}
