//! A release: one version everywhere, and the checksum of each file of `data`.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

fn text(file: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).unwrap()
}

#[test]
fn the_version_is_the_same_everywhere() {
    let version = env!("CARGO_PKG_VERSION");
    assert!(text("CITATION.cff").lines().any(|line| line == format!("version: {version}")));
    assert!(text("CHANGELOG.md").lines().any(|line| line.starts_with(&format!("## {version}"))));
}

#[test]
fn data_has_the_checksums_that_are_stated() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    let stated = text("data/SHA256SUMS");
    let names: BTreeSet<&str> = stated.lines().filter_map(|line| line.split_once("  ")).map(|(_, name)| name).collect();
    let documents = ["README.md", "LICENSE-laspy", "SHA256SUMS", "cameras"];
    for entry in std::fs::read_dir(&folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(documents.contains(&name.as_str()) || names.contains(name.as_str()), "{name} has no checksum");
    }
    let check = Command::new("sha256sum").args(["--check", "--quiet", "SHA256SUMS"]).current_dir(&folder).status();
    assert!(check.unwrap().success());
}
