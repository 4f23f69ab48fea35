//! `epsplat card`, which runs all studies on one adapter: its records hold the findings, and
//! failures are reported.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::path::Path;

use common::command::{Folder, epsplat, fails, text};
use epsplat::low_level::plan::Optimisation;
use serde_json::Value;

const STUDY: &str = "name = \"small\"\nabout = \"A test.\"\nsize = [32, 32]\nruns = 3\nbaseline = \"fixed\"\n[quick]\nruns = 1\n\
    [[scene]]\nname = \"ball\"\nshape = \"sphere\"\ncount = [100, 200]\n\
    [[config]]\nname = \"fixed\"\nbackend = \"gpu\"\nerror_limit = 1e-5\n";

/// Runs `epsplat card --quick` and returns the exit code and stderr.
fn card(studies: [&Path; 2], out: &Path) -> (Option<i32>, String) {
    let mut arguments = vec!["card", text(studies[0]), text(studies[1]), "--quick", "--out", text(out)];
    let adapter = std::env::var("EPSPLAT_TEST_ADAPTER").ok();
    arguments.extend(adapter.iter().flat_map(|name| ["--adapter", name.as_str()]));
    let output = epsplat(&arguments);
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

fn record(out: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(out.join("card.json")).unwrap()).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn rows(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

#[test]
fn a_quick_run_tries_everything_and_keeps_it() {
    let Some(gpu) = common::gpu() else { return };
    let folder = Folder::new();
    let (study, out) = (folder.file("small.toml", STUDY), folder.path("records/of a card"));
    // A study that misses its limit fails the run but does not stop the others.
    let strict = folder.file("strict.toml", STUDY.replace("1e-5", "1e-15").replace("\"small\"", "\"strict\""));
    let (code, stderr) = card([&study, &strict], &out);
    assert_eq!(code, Some(1), "{stderr}");
    let said = stderr.lines().find(|line| line.starts_with("error: ")).unwrap();
    assert!(said.contains("the study strict: fixed on ball (100 surfels") && said.ends_with(", and 1 more"), "{said}");
    let steps =
        ["[1/7] adapter", "[2/7] copy", "[3/7] acc", "[4/7] det", "[5/7] thr", "[6/7] choices", "[7/7] studies"];
    for step in steps {
        assert!(stderr.contains(step), "{step}: {stderr}");
    }
    let found = record(&out);
    assert_eq!((found["adapter"]["name"].as_str(), &found["quick"]), (Some(&*gpu.adapter.name), &Value::Bool(true)));
    assert_eq!(rows(&found["steps"]).len(), 7);
    assert!(rows(&found["problems"]).is_empty(), "{}", found["problems"]);
    let copy = copies(&found["copies"], gpu.adapter.timestamps);
    clocks(&found["clocks"], gpu.adapter.kind == "software");
    accuracy(&found["accuracy"], &out);
    determinism(&found["determinism"]);
    let bits = found["bits"].as_object().unwrap();
    assert!(bits.len() == 2 && bits.values().all(|bits| bits["color"].is_string()), "{bits:?}");
    throughput(&found["throughput"], copy);
    let changes = changes(&found["changes"]);
    assert_eq!(changes, ["without culling", "without order", "scatter", "tile"]);
    studies(&found["studies"], &out);
    let summary = std::fs::read_to_string(out.join("card.md")).unwrap();
    for words in [
        "A quick run",
        "| copy by a kernel | **",
        "| copy command | **",
        "## Clocks",
        "## Passes alone",
        "none fails",
        "## What is wrong\n\n- the study strict: ",
        "| 10000 |",
        "[small](<small/index.html>) | 2 |",
        "| fixed | 2 | 1.00 | 1.00 | 1.00 | 1.00 | 1.00 | 1.00 |",
    ] {
        assert!(summary.contains(words), "{words:?}: {summary}");
    }
    assert!(!summary.contains("DIFFER"), "{summary}");
    // The records are meant to be shared, so they contain no path of this machine.
    for name in ["card.md", "card.json"] {
        assert!(!std::fs::read_to_string(out.join(name)).unwrap().contains(text(&folder.path(""))), "{name}");
    }
}

fn studies(found: &Value, out: &Path) {
    let [small, strict] = rows(found) else { panic!("{found}") };
    assert_eq!((&small["name"], number(&small["measurements"])), (&"small".into(), 2.0));
    assert_eq!([small, strict].map(|study| rows(&study["failures"]).len()), [0, 2]);
    assert!(number(&small["configs"][0]["worst_rmse"]) < 1e-5, "{small}");
    let page = std::fs::read_to_string(out.join("small/index.html")).unwrap();
    assert!(page.contains("epsplat card small.toml strict.toml --quick --out"), "the page names its command");
    assert_eq!(std::fs::read_to_string(out.join("small/results.csv")).unwrap().lines().count(), 3);
}

fn accuracy(found: &Value, out: &Path) {
    assert_eq!((number(&found["failed"]), rows(&found["failures"]).len()), (0.0, 0));
    assert!(number(&found["passed"]) >= 5.0 && number(&found["cases"]) >= 5.0, "{found}");
    let used = number(&found["worst"]["used"]);
    assert!(used > 0.0 && used <= 1.0, "{found}");
    let all: Value = serde_json::from_str(&std::fs::read_to_string(out.join("hardcases.json")).unwrap()).unwrap();
    assert_eq!((&all["passed"], rows(&all["rows"]).len() as f64), (&found["passed"], number(&found["passed"])));
}

fn determinism(found: &Value) {
    let found = rows(found);
    let of = |what: &str| found.iter().filter(|row| row["what"].as_str().unwrap().starts_with(what)).count();
    // Each comparison is made at two sizes of splats.
    assert!(of("organisation") == 4 && of("without") >= 20 && of("surfels in reverse") == 2, "{found:?}");
    assert!(of("the second frame") >= 4 && of("the second frame") == of("another renderer"));
    for row in found {
        assert_eq!((&row["equal"], number(&row["differing"])), (&Value::Bool(true), 0.0), "{row}");
        assert_eq!(number(&row["values"]), 160.0 * 160.0 * 10.0);
    }
}

/// Checks the bandwidths of copies, and returns that of memory by a kernel, GB/s.
fn copies(found: &Value, timestamps: bool) -> f64 {
    let of = |by: &str| rows(found).iter().filter(|copy| copy["by"] == by).collect::<Vec<_>>();
    for by in ["kernel", "command"] {
        let sizes: Vec<f64> = of(by).iter().map(|copy| number(&copy["buffer_bytes"])).collect();
        assert!(!sizes.is_empty() && sizes.is_sorted(), "{found}");
    }
    for copy in rows(found) {
        assert!((0.1..1e5).contains(&number(&copy["gb_per_second"]["median"])), "{copy}");
        assert!(copy["clock"] != "timestamps" || timestamps);
    }
    number(&of("kernel").last().unwrap()["gb_per_second"]["max"])
}

/// Clocks are read before and after each step; those of a processor are not known.
fn clocks(found: &Value, software: bool) {
    let of = |when: &str| rows(found).iter().find(|row| row["when"] == when).unwrap_or_else(|| panic!("{when}"));
    for step in ["copy bandwidth", "accuracy", "determinism", "throughput", "choices", "studies"] {
        of(&format!("before {step}"));
        of(&format!("after {step}"));
    }
    of("after frames of 10000 surfels");
    assert!(!software || rows(found).iter().all(|row| row["source"] == "not known" && row["core_mhz"].is_null()));
}

fn throughput(found: &Value, copy: f64) {
    let sizes: Vec<f64> = rows(found).iter().map(|row| number(&row["surfels"])).collect();
    assert_eq!(sizes, [1000.0, 10_000.0]);
    for row in rows(found) {
        let (total, passes) = (number(&row["wait_ms"]["median"]), row["passes"].as_object().unwrap());
        assert!(total > 0.0 && number(&row["covered_pixels"]) > 3e5 && number(&row["rest_ms"]) < total, "{row}");
        let drawn = number(&row["splats_drawn"]) / number(&row["surfels"]);
        assert!(drawn > 0.9 && drawn <= 1.0, "{row}");
        let flown = &row["in_flight"];
        assert!(number(&flown["depth"]) == 3.0 && number(&flown["ms"]) > 0.0, "{row}");
        assert!(number(&row["warm_up"]["frames"]) >= 3.0, "{row}");
        for name in ["project", "visibility", "accumulate"] {
            let pass = &passes[name];
            let share = number(&pass["share_of_copy"]);
            // Caches may give more than the memory's bandwidth.
            assert!(share > 0.0 && share < 20.0, "{name}: {pass}");
            assert!((share * copy / number(&pass["gb_per_second"]) - 1.0).abs() < 1e-9);
        }
    }
}

/// Checks the changes of the hot path, and returns their names.
fn changes(found: &Value) -> Vec<&str> {
    for row in rows(found) {
        let [default, changed, ratio] = ["default_ms", "ms", "ratio"].map(|name| number(&row[name]["median"]));
        assert!(default > 0.0 && changed > 0.0 && ratio > 0.0, "{row}");
        let flies = row["change"].as_str().unwrap().ends_with("in flight");
        assert_eq!((row["passes_ratio"].is_null(), rows_of(&row["passes"]) == 0), (flies, flies), "{row}");
    }
    rows(found).iter().map(|row| row["change"].as_str().unwrap()).collect()
}

fn rows_of(object: &Value) -> usize {
    object.as_object().unwrap().len()
}

#[test]
fn each_change_of_the_hot_path_is_tried_alone_and_a_changed_bit_is_a_failure() {
    let Some(_) = common::gpu() else { return };
    let folder = Folder::new();
    let own = "[[config]]\nname = \"same bits\"\nbackend = \"gpu\"\nlarge = 32\n\
        [[config]]\nname = \"other bits\"\nbackend = \"gpu\"\nkernel = \"hat\"\n";
    let (study, out) = (folder.file("own.toml", STUDY.replace("\"small\"", "\"own\"") + own), folder.path("out"));
    let mut arguments = vec!["card", text(&study), "--study", "hot-path", "--quick", "--out", text(&out)];
    let adapter = std::env::var("EPSPLAT_TEST_ADAPTER").ok();
    arguments.extend(adapter.iter().flat_map(|name| ["--adapter", name.as_str()]));
    let output = epsplat(&arguments);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    let said = stderr.lines().find(|line| line.starts_with("error: ")).unwrap();
    assert!(said.ends_with("own, other bits: the bits are not those of the default"), "{said}");
    let found = record(&out);
    let names = changes(&found["changes"]);
    for (_, name) in Optimisation::ALL {
        assert!(names.contains(&&*format!("without {name}")), "{name}: {names:?}");
    }
    for name in ["scatter", "tile", "fetch alone", "fetch staged", "large 64", "2 in flight", "own, same bits"] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    let of = |name: &str| rows(&found["changes"]).iter().find(|row| row["change"] == name).unwrap();
    assert!(rows(&found["changes"]).iter().all(|row| (row["equal"] == true) == (row["change"] != "own, other bits")));
    // No surfel of a sphere has copies, and the order is that of the buffers alone.
    assert_eq!(["without copies", "without order"].map(|name| of(name)["same_kernels"] == true), [true; 2]);
    assert_eq!(["scatter", "own, other bits"].map(|name| of(name)["same_kernels"] == true), [false; 2]);
    let summary = std::fs::read_to_string(out.join("card.md")).unwrap();
    assert!(summary.contains("## Changes of the hot path") && summary.contains("**DIFFER**"), "{summary}");
}

#[test]
fn what_cannot_be_used_is_told_in_a_sentence_before_anything_is_done() {
    let folder = Folder::new();
    let study = folder.file("small.toml", STUDY);
    let with =
        |arguments: &[&str]| [&["card", text(&study)], arguments].concat().iter().map(|a| a.to_string()).collect();
    let said = |arguments: Vec<String>, code, words: &[&str]| {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        fails(&arguments, code, words);
    };
    let file = folder.file("taken", "");
    said(with(&["--out", text(&file)]), 1, &["cannot write", "taken"]);
    #[cfg(target_os = "linux")]
    said(with(&["--out", "/proc/records"]), 1, &["cannot write /proc/records"]);
    said(with(&["--study", "cold-path", "--out", text(&folder.path("out"))]), 2, &["cold-path", "take hot-path"]);
    said(with(&["--minutes", "0", "--out", text(&folder.path("out"))]), 2, &["--minutes"]);
    said(with(&[text(&study), "--out", text(&folder.path("out"))]), 2, &["two studies are called \"small\""]);
    let away = folder.file("away.toml", STUDY.replace("\"small\"", "\"../small\""));
    said(with(&[text(&away), "--out", text(&folder.path("out"))]), 2, &["../small", "folder"]);
    // An output would overwrite a study.
    let inside = folder.file("card.json", STUDY);
    said(with(&[text(&inside), "--out", text(&folder.path(""))]), 2, &["two studies"]);
    fails(&["card", text(&inside), "--out", text(&folder.path(""))], 2, &["would overwrite the input"]);
    fails(&["card", text(&folder.path("missing.toml")), "--out", text(&folder.path("out"))], 1, &["cannot read"]);
    assert!(!folder.path("out").exists());
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_epsplat"))
        .args(["card", "--out", "out"])
        .current_dir(folder.path(""))
        .output()
        .unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("there is no folder benches here"), "{stderr}");
}
