//! Lookup of the files that a mesh refers to by name.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of a mesh, and the listings of the folders that were searched.
#[derive(Debug)]
pub(super) struct Beside {
    folder: PathBuf,
    /// Entries of each folder by their lower-case names; the first in sorted order if several
    /// differ only in case.
    listed: HashMap<PathBuf, HashMap<String, PathBuf>>,
}

impl Beside {
    /// Prepares the lookup of files beside the one at `path`.
    pub(super) fn of(path: &Path) -> Self {
        Self { folder: path.parent().unwrap_or(Path::new("")).to_owned(), listed: HashMap::new() }
    }

    /// The path of the file with this `name`, which may have Windows backslashes and differ in case
    /// from the file on disk. If no file matches, the path of the name as it is written.
    pub(super) fn file(&mut self, name: &str) -> PathBuf {
        let name = name.replace('\\', "/");
        let as_written = self.folder.join(&name);
        if as_written.exists() { as_written } else { self.in_any_case(Path::new(&name)).unwrap_or(as_written) }
    }

    /// The file whose path equals that of `name` except for case.
    fn in_any_case(&mut self, name: &Path) -> Option<PathBuf> {
        let mut path = self.folder.clone();
        for part in name.components() {
            let next = path.join(part);
            path = if next.exists() { next } else { self.entries(&path).get(&lower(Path::new(&part)))?.clone() };
        }
        Some(path)
    }

    fn entries(&mut self, folder: &Path) -> &HashMap<String, PathBuf> {
        self.listed.entry(folder.to_owned()).or_insert_with(|| {
            let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
            let names = fs::read_dir(here).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.file_name()));
            let mut names: Vec<_> = names.collect();
            names.sort_unstable();
            // Later entries replace earlier ones, so the reversed order lets the first one win.
            names.iter().rev().map(|name| (lower(Path::new(name)), folder.join(name))).collect()
        })
    }
}

fn lower(name: &Path) -> String {
    name.to_string_lossy().to_lowercase()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn names_are_found_in_any_case() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("Maps")).unwrap();
        for name in ["Maps/Wood.PNG", "a.png", "A.png", "ÄPFEL.jpg"] {
            fs::write(at(name), "").unwrap();
        }
        let mut beside = Beside::of(&at("m.obj"));
        for (name, found) in [
            ("maps\\wood.png", "Maps/Wood.PNG"),
            ("MAPS/Wood.PNG", "Maps/Wood.PNG"),
            ("a.png", "a.png"),
            ("A.png", "A.png"),
            ("a.PNG", "A.png"),
            ("äpfel.JPG", "ÄPFEL.jpg"),
            ("maps/none.png", "maps/none.png"),
            ("./Maps/../a.png", "./Maps/../a.png"),
        ] {
            assert_eq!(beside.file(name), at(found), "{name}");
        }
    }
}
