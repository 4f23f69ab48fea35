//! `epsplat card`, which runs all studies on one adapter: its records hold the findings, and
//! failures are reported.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::path::Path;

use common::command::{Folder, epsplat, fails, text};
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
    for step in ["[1/6] adapter", "[2/6] copy", "[3/6] acc", "[4/6] det", "[5/6] thr", "[6/6] studies"] {
        assert!(stderr.contains(step), "{step}: {stderr}");
    }
    let found = record(&out);
    assert_eq!((found["adapter"]["name"].as_str(), &found["quick"]), (Some(&*gpu.adapter.name), &Value::Bool(true)));
    assert_eq!(rows(&found["steps"]).len(), 6);
    assert!(rows(&found["problems"]).is_empty(), "{}", found["problems"]);
    let copy = &found["copy_bandwidth"];
    assert!((0.1..1e5).contains(&number(&copy["gb_per_second"]["median"])), "{copy}");
    assert!(copy["clock"] != "timestamps" || gpu.adapter.timestamps);
    accuracy(&found["accuracy"], &out);
    determinism(&found["determinism"]);
    let bits = found["bits"].as_object().unwrap();
    assert!(bits.len() == 2 && bits.values().all(|bits| bits["color"].is_string()), "{bits:?}");
    throughput(&found["throughput"], number(&copy["gb_per_second"]["median"]));
    studies(&found["studies"], &out);
    let summary = std::fs::read_to_string(out.join("card.md")).unwrap();
    for words in [
        "A quick run",
        "GB/s** read and written",
        "none fails",
        "## What is wrong\n\n- the study strict: ",
        "| 10000 |",
        "[small](<small/index.html>) | 2 |",
        "| fixed | 2 | 1.00 | 1.00 | 1.00 |",
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

fn throughput(found: &Value, copy: f64) {
    let sizes: Vec<f64> = rows(found).iter().map(|row| number(&row["surfels"])).collect();
    assert_eq!(sizes, [1000.0, 10_000.0]);
    for row in rows(found) {
        let (total, passes) = (number(&row["total_ms"]["median"]), row["passes"].as_object().unwrap());
        assert!(total > 0.0 && number(&row["covered_pixels"]) > 3e5 && number(&row["rest_ms"]) < total, "{row}");
        assert!(number(&row["splats_drawn"]) > 0.9 * number(&row["surfels"]), "{row}");
        assert!((number(&row["splats_per_second"]) / (number(&row["surfels"]) / total * 1e3) - 1.0).abs() < 1e-9);
        for name in ["project", "visibility", "accumulate"] {
            let pass = &passes[name];
            let share = number(&pass["share_of_copy"]);
            // Caches may give more than the memory's bandwidth.
            assert!(share > 0.0 && share < 20.0, "{name}: {pass}");
            assert!((share * copy / number(&pass["gb_per_second"]) - 1.0).abs() < 1e-9);
        }
    }
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
