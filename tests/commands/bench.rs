//! Benchmark studies: the shipped ones parse, a small one runs and writes its files, and missed
//! limits are reported.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use common::command::Folder;
use epsplat::low_level::bench::{self, Definition};
use epsplat::low_level::render::Backend;

const STUDIES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benches");

const SCENES: &str = "name = \"small\"\nabout = \"A test.\"\nsize = [48, 48]\nruns = 2\nbaseline = \"exact\"\n\
    [quick]\nruns = 1\n\
    [[scene]]\nname = \"ball\"\nshape = \"sphere\"\ncount = [200, 400]\nquick_count = 100\nviews = 2\ntruth = true\n\
    [[scene]]\nname = \"board\"\nshape = \"checkerboard\"\ncount = 300\nfootprint_px = 3\nfill = 0.5\n\
    [[config]]\nname = \"exact\"\nbackend = \"reference\"\naov = [\"depth\"]\n";

const GPU: &str = "[[config]]\nname = \"fixed\"\nbackend = \"gpu\"\nerror_limit = 1e-5\n\
    [[config]]\nname = \"float\"\nbackend = \"gpu\"\naccumulator = \"cas\"\n\
    [[config]]\nname = \"blended\"\nbackend = \"raster\"\n";

fn definition(text: &str) -> Definition {
    Definition::parse(text, Path::new("small.toml")).unwrap()
}

fn bench(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_epsplat")).arg("bench").args(arguments).output().unwrap()
}

fn studies() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(STUDIES).unwrap().map(|entry| entry.unwrap().path());
    entries.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect()
}

#[test]
fn every_shipped_study_is_one_and_has_a_quick_form() {
    let all = studies();
    assert!(all.len() >= 5, "{all:?}");
    for path in all {
        let study = Definition::read(&path).unwrap();
        assert_eq!(path.file_stem().unwrap().to_str().unwrap(), study.name);
        let (scenes, configs) = (study.scenes.len(), study.configs.len());
        let quick = study.quick_form().unwrap();
        assert!(!quick.scenes.is_empty() && !quick.configs.is_empty());
        assert!(quick.scenes.len() <= scenes && quick.configs.len() <= configs && quick.runs <= 2);
        assert!(quick.baseline.iter().all(|name| quick.configs.iter().any(|config| config.name == *name)));
    }
}

#[test]
fn a_study_without_an_adapter_measures_the_reference_against_itself() {
    let outcome = bench::run(&definition(SCENES), None, &()).unwrap();
    assert!(outcome.failures.is_empty() && outcome.notes.is_empty());
    let study = outcome.study;
    let sizes: Vec<_> = study.measurements.iter().map(|m| (m.scene.as_str(), m.surfels)).collect();
    assert_eq!(sizes, [("ball", 200), ("ball", 400), ("board", 300)]);
    for m in &study.measurements {
        let numeric = m.numeric.unwrap();
        assert_eq!((numeric.rmse, numeric.max_abs, numeric.psnr_db), (0.0, 0.0, None));
        assert_eq!((m.width, m.height, m.backend.as_str(), m.kept), (48, 48, "reference", true));
        assert!(m.total_ms.median > 0.0 && m.passes.contains_key("accumulate"), "{m:?}");
        assert!(m.splats_per_second > 0.0 && m.fragments_per_second.unwrap() > 0.0 && m.device_bytes == 0);
        assert_eq!(m.reconstruction.contains_key("psnr_db"), m.scene == "ball");
    }
    assert!((study.measurements[2].footprint_px - 3.0).abs() < 1e-6);
    // Twice as many disks approximate the surface more closely.
    let psnr = |index: usize| study.measurements[index].reconstruction["psnr_db"];
    assert!(psnr(1) > psnr(0) && psnr(0) > 10.0, "{} {}", psnr(0), psnr(1));
    assert_eq!(study.images.len(), 3);
    let needs_one = [SCENES, GPU].concat();
    assert!(bench::run(&definition(&needs_one), None, &()).unwrap_err().to_string().contains("adapter"));
}

/// A file with levels of detail that is read in parts looks like the scene that it was made from.
#[test]
fn scenes_that_are_read_in_parts_have_the_pictures_of_whole_ones() {
    let folder = Folder::new();
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_epsplat"));
        let status = command.current_dir(folder.path("")).args(arguments).output().unwrap().status;
        assert!(status.success(), "{arguments:?}");
    };
    run(&["generate", "sphere", "--count", "3000", "-o", "sphere.ply"]);
    run(&["lod", "sphere.ply", "-o", "levels.ply"]);
    let place = "views = 2\neye = [0, 0, 16]\ntarget = [0, 0, 0]\n";
    let scenes = format!(
        "[[scene]]\nname = \"all\"\nshape = \"sphere\"\ncount = 3000\n{place}\
         [[scene]]\nname = \"part\"\nfile = \"levels.ply\"\nsurfels = \"levels\"\n{place}"
    );
    let configs = "[[config]]\nname = \"3px\"\nbackend = \"reference\"\nlod = \"3px\"\n\
                   [[config]]\nname = \"6px\"\nbackend = \"reference\"\nlod = \"6px\"\nsamples = \"4\"\n";
    let text = ["name = \"n\"\nabout = \"a\"\nsize = [64, 64]\nruns = 1\n", &scenes, configs].concat();
    let study = |text: &str| {
        let definition = Definition::parse(text, &folder.path("study.toml")).unwrap();
        bench::run(&definition, None, &()).map(|outcome| outcome.study)
    };
    let shown = study(&text).unwrap();
    let cuts: Vec<_> = shown.measurements.iter().map(|m| (m.surfels, m.reconstruction["cut"])).collect();
    assert_eq!((cuts[0], cuts[1]), (cuts[2], cuts[3]));
    assert!(cuts[0].0 == 3000 && cuts[0].1 > 1.2 * cuts[1].1 && cuts[1].1 > 50.0, "{cuts:?}");
    let pictures: Vec<_> = shown.images.iter().map(|set| &set.image.color).collect();
    assert!(pictures[0] == pictures[2] && pictures[1] == pictures[3] && pictures[0] != pictures[1]);
    // An input without levels of detail is an error that names `epsplat lod`.
    let error = study(&text.replace("levels.ply", "sphere.ply")).unwrap_err().to_string();
    assert!(error.contains("sphere.ply") && error.contains("epsplat lod"), "{error}");
}

#[test]
fn each_backend_has_its_error_its_memory_and_its_ratio() {
    let Some(backend) = common::gpu().map(Backend::gpu) else { return };
    let few = "fill = 0.5\nconfigs = [\"exact\", \"fixed\", \"blended\"]";
    let outcome =
        bench::run(&definition(&[&SCENES.replace("fill = 0.5", few), GPU].concat()), Some(&backend), &()).unwrap();
    assert!(outcome.failures.is_empty(), "{:?}", outcome.failures);
    let all = &outcome.study.measurements;
    assert_eq!(all.len(), 4 + 4 + 3, "each scene runs its own configurations only");
    for m in all {
        let rmse = m.numeric.unwrap().rmse;
        match m.backend.as_str() {
            "reference" => assert_eq!(rmse, 0.0),
            "raster" => assert!(rmse > 1e-6 && rmse < 1e-2 && m.ratio_to_raster == Some(1.0), "{m:?}"),
            _ => assert!(rmse > 0.0 && rmse < 1e-5 && m.device_bytes > 48 * 48 * 4, "{m:?}"),
        }
        assert_eq!(m.bytes_per_splat > 36.0, m.backend != "reference", "{m:?}");
        // A graphics card draws small splats one by one and large ones by tiles.
        assert!((4..=5).contains(&m.passes.len()), "{m:?}");
    }
    assert!(!outcome.study.machine.adapter.is_empty());
}

/// An unrelated web page at the report's path is not taken for a report and stays.
#[test]
fn a_page_that_no_report_has_is_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let (file, page) = (folder.path().join("small.toml"), folder.path().join("index.html"));
    std::fs::write(&file, SCENES).unwrap();
    std::fs::write(&page, "mine").unwrap();
    let output = bench(&[file.to_str().unwrap(), "--quick", "--out", folder.path().to_str().unwrap()]);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(
        stderr.contains("index.html is not part of a report") && stderr.contains("no results.csv beside it"),
        "{stderr}"
    );
    assert_eq!(std::fs::read_to_string(&page).unwrap(), "mine");
}

#[test]
fn a_missed_limit_fails_after_everything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (folder.path().join("small.toml"), folder.path().join("report"));
    let Some(_) = common::gpu() else { return };
    let strict = "[[config]]\nname = \"too strict\"\nbackend = \"gpu\"\nerror_limit = 1e-12\n";
    std::fs::write(&file, [SCENES, strict].concat()).unwrap();
    let output = bench(&[file.to_str().unwrap(), "--quick", "--out", out.to_str().unwrap()]);
    let (stdout, stderr) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("error: the study small failed: too strict on ball (100 surfels"), "{stderr}");
    assert!(stdout.contains("too strict") && stdout.contains("MISSED") && stdout.contains("time / exact"), "{stdout}");
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let page = read("index.html");
    assert!(page.contains("too strict") && page.contains("epsplat bench small.toml --quick --out report"));
    let here = folder.path().to_str().unwrap();
    for name in ["index.html", "results.csv", "results.json"] {
        assert!(!read(name).contains(here), "{name} holds a path of this machine");
    }
    assert_eq!(read("results.csv").lines().count(), 1 + 2 * 2);
    let rows: serde_json::Value = serde_json::from_str(&read("results.json")).unwrap();
    assert_eq!(rows.as_array().unwrap().len(), 4);
}

#[test]
fn the_command_refuses_what_is_no_study() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("small.toml");
    let path = file.to_str().unwrap();
    let fails = |arguments: &[&str], code: i32, words: &[&str]| {
        let output = bench(arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{stderr}");
        assert!(words.iter().all(|word| stderr.contains(word)), "{words:?}: {stderr}");
    };
    fails(&[path], 1, &["cannot read", "small.toml"]);
    std::fs::write(&file, "name = 1\n").unwrap();
    fails(&[path], 1, &["small.toml: line 1, name: "]);
    std::fs::write(&file, SCENES.replace("baseline = \"exact\"\n", "")).unwrap();
    fails(&[path, "--table"], 2, &["--table", "baseline"]);
    fails(&[path, "--runs", "0"], 2, &["--runs"]);
    std::fs::write(&file, SCENES).unwrap();
    let output = bench(&[path, "--quick", "--runs", "1", "--table"]);
    let stdout = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && stdout.contains("| `exact` | 1.00 | 0.0e0 | 0.0e0 | yes |"), "{stdout}");
}

/// Runs the smallest of the shipped studies in its quick form, once.
#[test]
fn a_shipped_study_keeps_its_limits() {
    if common::gpu().is_none() {
        return;
    }
    let path = format!("{STUDIES}/accumulators.toml");
    let mut arguments = vec![path.as_str(), "--quick", "--runs", "1"];
    let adapter = std::env::var("EPSPLAT_TEST_ADAPTER").ok();
    arguments.extend(adapter.iter().flat_map(|name| ["--adapter", name.as_str()]));
    let output = bench(&arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8(output.stdout).unwrap().contains("sphere, unlit  fixed32"));
}
