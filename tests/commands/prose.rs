//! The form of comments: at most 100 columns, and no start with a word that hides the subject.

#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::{Path, PathBuf};

/// The longest line of a comment.
const COLUMNS: usize = 100;

/// First words of comments that name no subject.
const NO_SUBJECT: [&str; 5] = ["Of", "What", "That", "Those", "Who"];

/// All Rust and WGSL files below `folder`.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let below = |path: PathBuf| if path.is_dir() { files(&path) } else { vec![path] };
    let is_code = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "rs" || extension == "wgsl");
    entries.flat_map(below).filter(is_code).collect()
}

/// The faults of the comments of a text: the number of each line, and what is wrong with it.
fn faults(text: &str) -> Vec<(usize, &'static str)> {
    let mut faults = Vec::new();
    let mut within = false;
    for (number, line) in (1..).zip(text.lines()) {
        let comment = line.trim_start().strip_prefix("//");
        let Some(words) = comment.map(|rest| rest.trim_start_matches(['/', '!']).trim()) else {
            within = false;
            continue;
        };
        // An address has no place to be broken.
        if line.chars().count() > COLUMNS && !line.contains("://") {
            faults.push((number, "more than 100 columns"));
        }
        let first = words.split(|c: char| !c.is_alphabetic()).next().unwrap_or_default();
        if !within && NO_SUBJECT.contains(&first) {
            faults.push((number, "no subject"));
        }
        within = !words.is_empty();
    }
    faults
}

#[test]
fn comments_have_a_subject_and_fit_in_100_columns() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for folder in ["src", "wgsl", "tests", "benches", "examples"] {
        for path in files(&root.join(folder)) {
            let faults = faults(&std::fs::read_to_string(&path).unwrap());
            assert!(faults.is_empty(), "{}: {faults:?}", path.display());
        }
    }
    // Control.
    let long = format!("// {}", "x".repeat(98));
    let text = format!("// What it is.\nlet a = 1; // What.\n\n    /// Those\n    /// What\n{long}\n");
    assert_eq!(faults(&text), [(1, "no subject"), (4, "no subject"), (6, "more than 100 columns")]);
}
