//! Compiled kernels on disk: they change no picture, and no fault of their file is an error.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use super::common;
use super::common::command::{DATA, Folder, text};

/// Starts a render whose compiled kernels are kept in `cache`.
fn started(cache: &Path, picture: &Path) -> Child {
    let bunny = format!("{DATA}/bunny.obj");
    let mut command = Command::new(env!("CARGO_BIN_EXE_epsplat"));
    command.args(["render", &bunny, "--size", "64x64", "--json", "-", "-o", text(picture)]);
    command.env("EPSPLAT_CACHE", cache).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().unwrap()
}

/// Waits for a render, and returns the hashes of its bits. Standard error must have the lines of
/// any render alone.
fn bits(child: Child) -> serde_json::Value {
    let output = child.wait_with_output().unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{told}");
    assert!(told.lines().all(|line| ["rendering on", "view:"].iter().any(|start| line.starts_with(start))), "{told}");
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(json["compile_ms"].as_f64().unwrap() > 0.0, "{json}");
    assert!(json["bits"].is_object());
    json["bits"].clone()
}

/// The files in `cache`; none if there is no such folder.
fn files(cache: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(cache).into_iter().flatten();
    entries.map(|entry| entry.unwrap().path()).collect()
}

/// Whether the default adapter has a cache of compiled kernels: wgpu has one for Vulkan alone.
fn has_cache() -> bool {
    common::gpu().is_some_and(|gpu| gpu.adapter.api == "vulkan")
}

#[test]
fn kernels_on_disk_change_no_picture_and_their_faults_are_no_errors() {
    if !has_cache() {
        return;
    }
    let folder = Folder::new();
    let (cache, picture) = (folder.path("cache"), folder.path("picture.png"));
    let drawn = |cache: &Path| bits(started(cache, &picture));
    let expected = drawn(Path::new("off"));
    assert!(!Path::new("off").exists());
    // The first run writes the file, the second one reads it.
    assert_eq!([drawn(&cache), drawn(&cache)], [expected.clone(), expected.clone()]);
    let [file] = files(&cache).try_into().expect("one file");
    let whole = fs::read(&file).unwrap();
    // A broken file is written anew: one that ends early, one of something else, and that of
    // another adapter.
    let (short, other) = (whole[..whole.len() - 1].to_vec(), b"something else".to_vec());
    let mut foreign = whole.clone();
    foreign[8..16].copy_from_slice(&[7; 8]);
    for broken in [short.clone(), other, foreign] {
        fs::write(&file, &broken).unwrap();
        assert_eq!(drawn(&cache), expected);
        assert_ne!(fs::read(&file).unwrap(), broken);
    }
    // A file that must not be written stays as it is.
    fs::write(&file, &short).unwrap();
    let mut mode = fs::metadata(&file).unwrap().permissions();
    mode.set_readonly(true);
    fs::set_permissions(&file, mode).unwrap();
    assert_eq!(drawn(&cache), expected);
    assert_eq!(fs::read(&file).unwrap(), short);
    // A folder that cannot be made.
    assert_eq!(drawn(&picture.join("cache")), expected);
    assert_eq!(files(&cache), [file]);
}

#[test]
fn programs_that_run_at_once_share_kernels_on_disk() {
    if !has_cache() {
        return;
    }
    let folder = Folder::new();
    let cache = folder.path("cache");
    let running = ["a.png", "b.png", "c.png"].map(|name| started(&cache, &folder.path(name)));
    let [first, second, third] = running.map(bits);
    assert!(first == second && first == third);
    assert_eq!(files(&cache).len(), 1);
    // The file is whole, and of use to the next run.
    assert_eq!(bits(started(&cache, &folder.path("d.png"))), first);
}
