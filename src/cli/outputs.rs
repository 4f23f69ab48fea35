//! What a command writes takes the place neither of what it reads nor of what else it writes, and can be written: found out
//! before anything is read.

use std::collections::HashMap;
use std::fs::Metadata;
use std::path::{Path, PathBuf};

use epsplat::io::{Points, atomic, companions};
use epsplat::{Error, Result};

use super::note;

/// Refuses outputs that cannot be written, or that [`check_distinct`] refuses.
pub(super) fn check<I: AsRef<Path>, O: AsRef<Path>>(
    inputs: impl IntoIterator<Item = I>,
    outputs: impl IntoIterator<Item = O>,
) -> Result<()> {
    let outputs: Vec<O> = outputs.into_iter().collect();
    check_distinct(inputs, &outputs)?;
    outputs.iter().try_for_each(|output| try_output(output.as_ref()))
}

/// Refuses an output that cannot be written.
pub(super) fn try_output(output: &Path) -> Result<()> {
    if output == Path::new("-") { Ok(()) } else { atomic::try_output(output) }
}

/// Refuses outputs that would overwrite an input, a file that an input names, or each other: under another name too, by a
/// symbolic link or a hard one. What is no file (a device, a pipe, `-` for stdout) overwrites nothing.
pub(super) fn check_distinct<I: AsRef<Path>, O: AsRef<Path>>(
    inputs: impl IntoIterator<Item = I>,
    outputs: impl IntoIterator<Item = O>,
) -> Result<()> {
    let mut written = Files::default();
    for output in outputs {
        let output = output.as_ref();
        if output == Path::new("-") {
            continue;
        }
        if let Some(other) = written.add(output) {
            let (output, other) = (output.display(), other.display());
            return Err(Error::Usage(format!(
                "{output} and {other} are one file, of which the second would overwrite the first: give them different names"
            )));
        }
    }
    if let Some((file, inside)) = written.file_as_folder() {
        let (file, inside) = (file.display(), inside.display());
        return Err(Error::Usage(format!("{inside} would lie in {file}, which is a file to be written, not a folder")));
    }
    for input in inputs {
        let input = input.as_ref();
        let named = if written.nodes.is_empty() { Vec::new() } else { companions(input) };
        for read in std::iter::once(input).chain(named.iter().map(PathBuf::as_path)) {
            if let Some(output) = written.find(read) {
                let (output, read) = (output.display(), read.display());
                return Err(Error::Usage(format!(
                    "{output} would overwrite the input {read}: choose another name for the output"
                )));
            }
        }
    }
    Ok(())
}

/// Refuses a file that a line of a PLY header cannot name.
pub(super) fn check_named_in_ply(path: &Path) -> Result<()> {
    let name = path.to_str().filter(|name| name.trim() == *name && !name.contains(|c: char| c.is_control()));
    match name.filter(|name| cfg!(windows) || !name.contains('\\')) {
        Some(_) => Ok(()),
        None => Err(Error::Usage(format!(
            "{} has a character, or a space at an end, with which a PLY file cannot name it: choose another name",
            path.display()
        ))),
    }
}

/// The mesh that `output` is drawn beside if the one input is, as a file there names it; that of several is left out, and told.
pub(super) fn beside(inputs: &[Points], output: &Path) -> Result<Option<PathBuf>> {
    let meshes: Vec<&PathBuf> = inputs.iter().filter_map(|points| points.beside.as_ref()).collect();
    if let ([mesh], [_]) = (meshes.as_slice(), inputs) {
        let folder = |path: &Path| {
            let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
            parent.canonicalize().ok()
        };
        let named = match mesh.file_name() {
            Some(name) if folder(mesh).is_some_and(|of| folder(output) == Some(of)) => name.into(),
            _ => std::path::absolute(mesh).unwrap_or_else(|_| (*mesh).clone()),
        };
        check_named_in_ply(&named)?;
        return Ok(Some(named));
    }
    for mesh in meshes {
        note(&format!(
            "warning: the triangles of {} are left out: name them by --triangles to render them",
            mesh.display()
        ));
    }
    Ok(None)
}

/// Files that are written, by what makes them one: the place that a path leads to, and the file that is there already.
#[derive(Default)]
struct Files {
    places: HashMap<PathBuf, PathBuf>,
    nodes: HashMap<Node, PathBuf>,
}

impl Files {
    /// Adds a file; returns the path under which it is known already.
    fn add(&mut self, path: &Path) -> Option<PathBuf> {
        let place = atomic::place_of(path)?;
        if let Some(known) = self.find(path) {
            return Some(known.to_owned());
        }
        if let Some(node) = node_of(&place) {
            self.nodes.insert(node, path.to_owned());
        }
        self.places.insert(place, path.to_owned());
        None
    }

    fn find(&self, path: &Path) -> Option<&Path> {
        let place = atomic::place_of(path).and_then(|place| self.places.get(&place));
        place.or_else(|| self.nodes.get(&node_of(path)?)).map(PathBuf::as_path)
    }

    /// A file, and another that would need it to be a folder.
    fn file_as_folder(&self) -> Option<(&Path, &Path)> {
        self.places.iter().find_map(|(place, inside)| {
            let file = place.ancestors().skip(1).find_map(|folder| self.places.get(folder))?;
            Some((file.as_path(), inside.as_path()))
        })
    }
}

/// What a file is, whatever its names.
#[cfg(unix)]
type Node = (u64, u64);
#[cfg(not(unix))]
type Node = PathBuf;

/// The file that is at `path` now. Of what is no file there is none.
fn node_of(path: &Path) -> Option<Node> {
    std::fs::metadata(path).ok().filter(Metadata::is_file).and_then(|there| node(path, &there))
}

#[cfg(unix)]
fn node(_: &Path, there: &Metadata) -> Option<Node> {
    use std::os::unix::fs::MetadataExt;
    Some((there.dev(), there.ino()))
}

#[cfg(not(unix))]
fn node(path: &Path, _: &Metadata) -> Option<Node> {
    path.canonicalize().ok()
}
