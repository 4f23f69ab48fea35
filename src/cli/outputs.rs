//! What a command writes takes the place neither of what it reads nor of what else it writes, and can be written: found out
//! before anything is read.

use std::collections::HashMap;
use std::fs::Metadata;
use std::path::{Path, PathBuf};

use epsplat::io::{Format, Points, atomic, companions};
use epsplat::{Error, Result};

use super::note;

/// A file that a command reads.
#[derive(Clone, Copy)]
pub(super) enum Source<'a> {
    /// A cloud or a mesh, of this format if one is given: it may name other files.
    Cloud(&'a Path, Option<Format>),
    /// Another file.
    Other(&'a Path),
}

impl<'a> Source<'a> {
    pub(super) fn cloud(path: &'a (impl AsRef<Path> + ?Sized)) -> Self {
        Self::Cloud(path.as_ref(), None)
    }

    pub(super) fn other(path: &'a (impl AsRef<Path> + ?Sized)) -> Self {
        Self::Other(path.as_ref())
    }

    fn path(self) -> &'a Path {
        match self {
            Self::Cloud(path, _) | Self::Other(path) => path,
        }
    }
}

/// Refuses outputs that cannot be written, or that [`check_distinct`] refuses.
pub(super) fn check<'a, O: AsRef<Path>>(
    inputs: impl IntoIterator<Item = Source<'a>>,
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

/// Refuses outputs that would overwrite an input, a file that is read with one because it or
/// another names it, or each other: under another name too, by a symbolic link or a hard one. What
/// is no file (a device, a pipe, `-` for stdout) overwrites nothing.
pub(super) fn check_distinct<'a, O: AsRef<Path>>(
    inputs: impl IntoIterator<Item = Source<'a>>,
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
    let inputs: Vec<Source<'_>> = inputs.into_iter().collect();
    inputs.iter().try_for_each(|input| written.check_against(input.path()))?;
    // Whoever writes to streams alone, such as stdout, need not know.
    let named = if written.is_empty() { Vec::new() } else { all_named(inputs)? };
    named.iter().try_for_each(|named| written.check_against(named))
}

/// The files that are read at second hand with these inputs.
pub(super) fn all_named<'a>(inputs: impl IntoIterator<Item = Source<'a>>) -> Result<Vec<PathBuf>> {
    let mut named = Vec::new();
    for input in inputs {
        if let Source::Cloud(path, format) = input {
            named.extend(companions(path, format)?);
        }
    }
    Ok(named)
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

/// The mesh that `output` is drawn beside if the one input is, by its name: both lie in one folder.
/// A mesh of another folder or of several inputs is left out, and told.
pub(super) fn beside(inputs: &[Points], output: &Path) -> Result<Option<PathBuf>> {
    let meshes: Vec<&PathBuf> = inputs.iter().filter_map(|points| points.beside.as_ref()).collect();
    if let ([mesh], [_], Some(name)) = (meshes.as_slice(), inputs, meshes.first().and_then(|mesh| mesh.file_name())) {
        let folder = |path: &Path| {
            let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
            parent.canonicalize().ok()
        };
        if folder(mesh).is_some_and(|of| folder(output) == Some(of)) {
            let name = PathBuf::from(name);
            check_named_in_ply(&name)?;
            return Ok(Some(name));
        }
    }
    for mesh in meshes {
        let what = if inputs.len() > 1 { "there are several inputs" } else { "the output lies in another folder" };
        note(&format!(
            "warning: the triangles of {} are left out, as {what}: name them by --triangles to render them",
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
    /// Files that streams lead to, such as a redirected stdout.
    streams: HashMap<Node, PathBuf>,
}

impl Files {
    /// Adds a file; returns the path under which it is known already.
    fn add(&mut self, path: &Path) -> Option<PathBuf> {
        let Some(place) = atomic::place_of(path) else {
            // A stream may lead to a file all the same: two outputs may follow each other there,
            // but it is no input.
            self.streams.extend(node_of(path).map(|node| (node, path.to_owned())));
            return None;
        };
        if let Some(known) = self.find(path) {
            return Some(known.to_owned());
        }
        if let Some(node) = node_of(&place) {
            self.nodes.insert(node, path.to_owned());
        }
        self.places.insert(place, path.to_owned());
        None
    }

    fn is_empty(&self) -> bool {
        self.places.is_empty() && self.streams.is_empty()
    }

    /// Refuses to overwrite a file that is read.
    fn check_against(&self, read: &Path) -> Result<()> {
        let standard = read == Path::new("-");
        let node = if standard { standard_input() } else { node_of(read) };
        let by_node = || node.and_then(|node| self.nodes.get(&node).or(self.streams.get(&node))).map(PathBuf::as_path);
        let by_place = if standard { None } else { self.find(read) };
        let Some(output) = by_place.or_else(by_node) else { return Ok(()) };
        let read = if standard { "that is standard input".into() } else { read.display().to_string() };
        Err(Error::Usage(format!(
            "{} would overwrite the input {read}: choose another name for the output",
            output.display()
        )))
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

/// The file that standard input is, if it is one.
#[cfg(unix)]
fn standard_input() -> Option<Node> {
    use std::os::fd::AsFd;
    let file = std::fs::File::from(std::io::stdin().as_fd().try_clone_to_owned().ok()?);
    file.metadata().ok().filter(Metadata::is_file).and_then(|there| node(Path::new("-"), &there))
}

#[cfg(not(unix))]
fn standard_input() -> Option<Node> {
    None
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
