//! Every command in the README and the guide runs.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::Path;
use std::process::Command;

use crate::common::server::Server;

/// The commands in the ```sh blocks of a page, with continuation lines joined.
fn commands(page: &str) -> Vec<String> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(page)).unwrap();
    let mut commands = Vec::new();
    for block in text.split("```sh\n").skip(1) {
        let block = block.split("```").next().unwrap().replace("\\\n", " ");
        commands
            .extend(block.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#')).map(str::to_owned));
    }
    commands
}

/// The shell command to run for a page's command; `None` for those that tests/run covers.
fn line(command: &str) -> Option<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    // tests/run installs drivers itself, and tests cannot run it.
    if command.contains("apt-get") {
        let script = std::fs::read_to_string(root.join("tests/run")).unwrap();
        for package in command.split(' ').filter(|word| word.contains("vulkan")) {
            assert!(script.contains(package), "tests/run does not install {package}");
        }
        return None;
    }
    if command == "tests/run" {
        assert!(root.join("tests/run").exists());
        return None;
    }
    let binary = env!("CARGO_BIN_EXE_epsplat");
    if command.starts_with("for ") && command.contains("; do epsplat ") {
        return Some(command.replace("; do epsplat ", &format!("; do {binary} ")));
    }
    let arguments = command.strip_prefix("cargo run --release -- ").or_else(|| command.strip_prefix("epsplat "));
    let arguments = arguments.unwrap_or_else(|| panic!("a page has a command that no test runs: {command}"));
    Some(format!("{binary} {arguments}"))
}

/// A server with the files that pages name at `https://example.org/`.
fn example() -> Server {
    let copc = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("data/simple.copc.laz")).unwrap();
    let bounds = r#""properties": {"proj:bbox": [600000, 800000, 0, 700000, 900000, 1000]}"#;
    let feature = format!(r#"{{"assets": {{"data": {{"href": "./simple.copc.laz"}}}}, {bounds}}}"#);
    let vpc = format!(r#"{{"type": "FeatureCollection", "features": [{feature}]}}"#);
    Server::new([("simple.copc.laz".to_owned(), copc), ("city.vpc".to_owned(), vpc.into_bytes())])
}

/// Runs a page's commands in order, in a new folder with links to the data and the studies; returns
/// that folder.
fn run(page: &str, least: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in ["data", "benches"] {
        std::os::unix::fs::symlink(root.join(name), folder.path().join(name)).unwrap();
    }
    let (commands, server) = (commands(page), example());
    let lines: Vec<String> = commands.iter().filter_map(|command| line(command)).collect();
    assert!(lines.len() >= least, "{page} lost its commands: {commands:?}");
    for line in lines {
        let line = line.replace("https://example.org/", &server.address(""));
        let output = Command::new("sh").arg("-c").arg(&line).current_dir(folder.path()).output().unwrap();
        assert!(output.status.success(), "{page}: {line}: {}", String::from_utf8_lossy(&output.stderr));
    }
    folder
}

#[cfg(unix)]
#[test]
fn the_readmes_commands_run() {
    let folder = run("README.md", 10);
    let autzen = std::fs::metadata(folder.path().join("autzen.png")).expect("the first command writes autzen.png");
    assert!(autzen.len() > 100_000);
}

#[cfg(unix)]
#[test]
fn the_guides_commands_run() {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/guide");
    let mut pages: Vec<String> = std::fs::read_dir(guide)
        .unwrap()
        .filter_map(|entry| entry.unwrap().file_name().into_string().unwrap().strip_suffix(".md").map(str::to_owned))
        .map(|name| format!("src/guide/{name}.md"))
        .collect();
    pages.push("benches/README.md".into());
    pages.sort();
    assert!(pages.len() >= 9, "{pages:?}");
    for page in pages {
        run(&page, 1);
    }
}

/// Every test file is declared as a module of a program; otherwise it would never run.
#[test]
fn every_file_of_tests_is_in_a_program() {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let names = |folder: &Path| -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
        entries.map(|name| name.into_string().unwrap()).collect()
    };
    let mut found = 0;
    for suite in names(&tests) {
        let Ok(main) = std::fs::read_to_string(tests.join(&suite).join("main.rs")) else { continue };
        for name in names(&tests.join(&suite)) {
            let module = match name.strip_suffix(".rs") {
                Some("main") => continue,
                Some(module) => module,
                None if tests.join(&suite).join(&name).join("mod.rs").is_file() => &name,
                None => continue,
            };
            assert!(main.contains(&format!("mod {module};\n")), "tests/{suite}/main.rs does not name {module}");
            found += 1;
        }
    }
    assert!(found >= 50, "{found}");
}
