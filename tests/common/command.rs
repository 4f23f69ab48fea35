//! Helpers for tests that run the `epsplat` program as its users do.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The repository's own input files.
pub const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/data");

/// A temporary folder that is deleted when the test ends.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn file(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        std::fs::write(self.path(name), bytes).unwrap();
        self.path(name)
    }

    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }
}

/// Runs the program with these arguments.
pub fn epsplat(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_epsplat")).args(arguments).output().unwrap()
}

pub fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Runs the program and checks that it exits with `code` and that stderr ends in one sentence that
/// contains all of `words`.
pub fn fails(arguments: &[&str], code: i32, words: &[&str]) {
    let output = epsplat(arguments);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
    assert!(!stderr.contains("panicked"), "{arguments:?}: {stderr}");
    let error = stderr.lines().find(|line| line.starts_with("error: ")).expect(&stderr);
    for word in words {
        assert!(stderr.contains(word), "{arguments:?}: {word:?} is missing from {error:?}");
    }
    if code == 1 {
        assert_eq!(stderr.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{stderr}");
    }
}

pub fn succeeds(arguments: &[&str]) -> Output {
    let output = epsplat(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

/// An ASCII PLY file of `count` vertices with the given float properties; `rows` is its data.
pub fn ply(properties: &str, count: usize, rows: &str) -> String {
    let properties: String = properties.split(' ').map(|p| format!("property float {p}\n")).collect();
    format!("ply\nformat ascii 1.0\nelement vertex {count}\n{properties}end_header\n{rows}")
}
