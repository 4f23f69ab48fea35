//! A second Vulkan driver, which shares no code with Mesa's: SwiftShader, which Chromium brings along. Its subgroups have four
//! invocations and it has no 64-bit integers, as Windows' WARP.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::command::{DATA, Folder, succeeds, text};
use std::path::Path;
use std::process::{Command, Output};

/// Where Debian's and Ubuntu's packages have it.
const DRIVERS: [&str; 2] =
    ["/usr/lib/chromium/vk_swiftshader_icd.json", "/usr/lib/chromium-browser/vk_swiftshader_icd.json"];

/// Runs the program where SwiftShader is the only Vulkan driver.
fn on_swiftshader(driver: &str, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_epsplat"));
    let output =
        command.env("VK_DRIVER_FILES", driver).env("VK_ICD_FILENAMES", driver).args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

#[test]
fn another_driver_draws_the_same_picture() {
    let Some(driver) = DRIVERS.into_iter().find(|driver| Path::new(driver).exists()) else {
        eprintln!("skipped: Chromium's SwiftShader is not at {DRIVERS:?}");
        return;
    };
    let folder = Folder::new();
    let [many, few, theirs, ours] = ["many.ply", "few.ply", "theirs.exr", "ours.exr"].map(|name| folder.path(name));
    succeeds(&["generate", "sphere", "--count", "20000", "-o", text(&many)]);
    succeeds(&["generate", "sphere", "--count", "300", "-o", text(&few)]);
    let bunny = format!("{DATA}/bunny.obj");
    // Culled and scattered; large splats; disks of a mesh through a low-pass.
    let scenes: [&[&str]; 3] = [&[text(&many), "--shading", "unlit"], &[text(&few)], &[&bunny, "--lowpass", "ewa"]];
    for scene in scenes {
        let render = |out: &Path, backend: &str| {
            let rest = ["--size", "96x96", "--aov", "depth,weight,count", "--json", "-", "--backend", backend, "-o"];
            [&["render"], scene, &rest, &[text(out)]].concat().iter().map(|&s| s.to_owned()).collect::<Vec<_>>()
        };
        let run =
            |arguments: Vec<String>| on_swiftshader(driver, &arguments.iter().map(String::as_str).collect::<Vec<_>>());
        let report: serde_json::Value = serde_json::from_slice(&run(render(&theirs, "gpu")).stdout).unwrap();
        assert!(report["adapter"].as_str().unwrap().contains("SwiftShader"), "{report}");
        run(render(&ours, "reference"));
        let output = succeeds(&["compare", text(&theirs), text(&ours), "--json", "-"]);
        let comparison: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let error = |key: &str| comparison[key].as_f64().unwrap();
        // Some pixels of a rim may be decided otherwise, by less than a hundredth.
        assert!(error("percentile_99_9") < 1e-5 && error("coverage_mismatch") < 1e-3, "{scene:?}: {comparison}");
    }
}
