//! The README stays true: every command in it runs.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::Path;
use std::process::Command;

/// The lines of the README's ```sh blocks, continuation lines joined.
fn commands() -> Vec<String> {
    let readme = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).unwrap();
    let mut commands = Vec::new();
    for block in readme.split("```sh\n").skip(1) {
        let block = block.split("```").next().unwrap().replace("\\\n", " ");
        commands
            .extend(block.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#')).map(str::to_owned));
    }
    commands
}

#[cfg(unix)]
#[test]
fn every_command_of_the_readme_runs() {
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in ["data", "benches"] {
        std::os::unix::fs::symlink(root.join(name), folder.path().join(name)).unwrap();
    }
    let commands = commands();
    assert!(commands.len() >= 8, "the README lost its commands: {commands:?}");
    let mut ran = 0;
    for command in &commands {
        // What installs or runs the tests is run by the tests' own script, so that script must hold it.
        if command.contains("apt-get") {
            let script = std::fs::read_to_string(root.join("tests/run")).unwrap();
            for package in command.split(' ').filter(|word| word.contains("vulkan")) {
                assert!(script.contains(package), "tests/run does not install {package}");
            }
            continue;
        }
        if command == "tests/run" {
            assert!(root.join("tests/run").exists());
            continue;
        }
        let binary = env!("CARGO_BIN_EXE_epsplat");
        let line = if let Some(rest) = command.strip_prefix("cargo run --release -- ") {
            format!("{binary} {rest}")
        } else if let Some(rest) = command.strip_prefix("epsplat ") {
            format!("{binary} {rest}")
        } else {
            panic!("the README has a command that no test runs: {command}");
        };
        let output = Command::new("sh").arg("-c").arg(&line).current_dir(folder.path()).output().unwrap();
        assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
        ran += 1;
    }
    assert!(ran >= 6, "only {ran} commands ran");
    let autzen = std::fs::metadata(folder.path().join("autzen.png")).expect("the first command writes autzen.png");
    assert!(autzen.len() > 100_000);
}

/// A file of tests that no module names would never run.
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
