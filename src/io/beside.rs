//! Files that a mesh names, as they are called on the disk.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of a mesh, and the names in folders that were looked through.
#[derive(Debug)]
pub(super) struct Beside {
    folder: PathBuf,
    /// The entries of each folder by their names in lower case; of several in one case the first by
    /// its name.
    listed: HashMap<PathBuf, HashMap<String, PathBuf>>,
}

impl Beside {
    /// Files beside the one at `path`.
    pub(super) fn of(path: &Path) -> Self {
        Self { folder: path.parent().unwrap_or(Path::new("")).to_owned(), listed: HashMap::new() }
    }

    /// The file that is called `name`, which may be written as Windows does: with backslashes, and
    /// in another case than on the disk. Where there is none, the path of the name as it is.
    pub(super) fn file(&mut self, name: &str) -> PathBuf {
        let name = name.replace('\\', "/");
        let as_written = self.folder.join(&name);
        if as_written.exists() { as_written } else { self.in_any_case(Path::new(&name)).unwrap_or(as_written) }
    }

    /// The file whose path differs from that of `name` in nothing but case.
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
            // Later ones take the place of earlier ones.
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
