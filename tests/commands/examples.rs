//! The examples run on a file of the repository and write what they say.

#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const BUNNY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/data/bunny.obj");

/// Runs the example `name` in `folder`. `cargo test` builds all examples beside the program, but
/// `cargo test --test commands` does not: `tests/run` builds them first.
fn run(name: &str, arguments: &[&str], folder: &Path) -> Output {
    let built = PathBuf::from(env!("CARGO_BIN_EXE_epsplat")).with_file_name("examples").join(name);
    assert!(built.exists(), "cargo build --release --all-features --examples has to run first");
    let output = Command::new(built).args(arguments).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{name}: {output:?}");
    output
}

fn printed(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// The mean of all codes of an image.
fn mean(path: &Path) -> f64 {
    let image = image::open(path).unwrap().to_rgb8();
    image.as_raw().iter().map(|code| f64::from(*code)).sum::<f64>() / image.as_raw().len() as f64
}

#[test]
fn a_frame_has_its_depth_and_a_filter_darkens_its_edges() {
    let folder = tempfile::tempdir().unwrap();
    let text = printed(&run("depth", &[BUNNY, "bunny.png"], folder.path()));
    let count: usize = text.split(' ').next().unwrap().parse().unwrap();
    assert!(count > 100_000 && text.contains("of 1048576 pixels"), "{text}");
    run("filter", &[BUNNY, "edges.png"], folder.path());
    let [plain, edges] = ["bunny.png", "edges.png"].map(|file| mean(&folder.path().join(file)));
    assert!(plain > 10.0 && edges < 0.99 * plain && edges > 0.5 * plain, "{plain} {edges}");
}

#[test]
fn one_renderer_draws_many_views() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(printed(&run("views", &[BUNNY, "."], folder.path())).lines().count(), 8);
    let means: Vec<f64> = (0..8).map(|k| mean(&folder.path().join(format!("view-{k}.png")))).collect();
    assert!(means.iter().all(|mean| *mean > 5.0), "{means:?}");
    assert!(means.windows(2).all(|two| two[0] != two[1]), "{means:?}");
}

#[test]
fn a_kernel_of_ones_own_errs_by_rounding_and_differs_from_the_built_in_one() {
    let folder = tempfile::tempdir().unwrap();
    let text = printed(&run("kernel", &[BUNNY], folder.path()));
    let errors: Vec<f64> = text.lines().map(|line| line.rsplit(' ').next().unwrap().parse().unwrap()).collect();
    let [to_own, to_built_in] = errors[..] else { panic!("{text}") };
    assert!(to_own < 1e-5 && to_built_in > 1e-4, "{text}");
}

#[test]
fn a_turn_stays_on_the_device() {
    let folder = tempfile::tempdir().unwrap();
    let text = printed(&run("turn_on_device", &[], folder.path()));
    let numbers: Vec<f64> = text.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
    let [frames, complete, rate] = numbers[..3] else { panic!("{text}") };
    assert_eq!((frames, complete), (300.0, 300.0), "{text}");
    assert!(rate > 1.0, "{text}");
}

#[test]
fn a_kernel_of_ones_own_gets_the_depth_of_a_frame() {
    let folder = tempfile::tempdir().unwrap();
    let text = printed(&run("depth_to_kernel", &[BUNNY], folder.path()));
    let numbers: Vec<u32> = text.split(' ').filter_map(|word| word.parse().ok()).collect();
    let [covered, edges] = numbers[..] else { panic!("{text}") };
    assert!((20_000..160_000).contains(&covered) && (100..covered / 5).contains(&edges), "{text}");
    assert!(text.contains("complete: true"), "{text}");
}
