//! Checks, before anything is read, that outputs can be written and overwrite neither inputs nor
//! each other.

use std::collections::HashMap;
use std::fs::Metadata;
use std::path::{Path, PathBuf};

use epsplat::io::{Format, Points, atomic, companions};
use epsplat::{Error, Files, Result};

use super::note;

/// A file that a command reads.
#[derive(Clone, Copy)]
pub(super) enum Source<'a> {
    /// A cloud or a mesh, which may name other files, such as textures. The format is optional.
    Cloud(&'a Path, Option<Format>),
    /// A file that names no other files.
    Other(&'a Path),
}

impl<'a> Source<'a> {
    pub(super) fn cloud(path: &'a (impl AsRef<Path> + ?Sized)) -> Self {
        Self::Cloud(path.as_ref(), None)
    }

    /// Returns the files of a scene.
    pub(super) fn of(files: &'a Files) -> impl Iterator<Item = Self> {
        let format = files.options().file.input_format;
        files.paths().iter().map(move |path| Self::Cloud(path, format))
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

/// Fails for outputs that cannot be written, and where [`check_distinct`] fails.
pub(super) fn check<'a, O: AsRef<Path>>(
    inputs: impl IntoIterator<Item = Source<'a>>,
    outputs: impl IntoIterator<Item = O>,
) -> Result<()> {
    let outputs: Vec<O> = outputs.into_iter().collect();
    check_distinct(inputs, &outputs)?;
    outputs.iter().try_for_each(|output| try_output(output.as_ref()))
}

/// Fails if the output cannot be written. Stdout (`-`) passes always.
pub(super) fn try_output(output: &Path) -> Result<()> {
    if output == Path::new("-") { Ok(()) } else { atomic::try_output(output) }
}

/// Fails for outputs that would overwrite an input, a file that an input names, or each other.
///
/// Files are recognised under other names too, by symbolic and hard links. Outputs that are no
/// files (a device, a pipe, `-` for stdout) overwrite nothing.
pub(super) fn check_distinct<'a, O: AsRef<Path>>(
    inputs: impl IntoIterator<Item = Source<'a>>,
    outputs: impl IntoIterator<Item = O>,
) -> Result<()> {
    let mut written = Written::default();
    for output in outputs {
        let output = output.as_ref();
        if output == Path::new("-") {
            continue;
        }
        if let Some(other) = written.add(output) {
            let (output, other) = (output.display(), other.display());
            return Err(Error::Usage(format!(
                "{output} and {other} are the same file, so one output would overwrite the other: give them different names"
            )));
        }
    }
    if let Some((file, inside)) = written.file_as_folder() {
        let (file, inside) = (file.display(), inside.display());
        return Err(Error::Usage(format!("{inside} would lie in {file}, which is a file to be written, not a folder")));
    }
    let inputs: Vec<Source<'_>> = inputs.into_iter().collect();
    inputs.iter().try_for_each(|input| written.check_against(input.path()))?;
    // Commands that write only to streams, such as stdout, do not need the files that inputs name.
    let named = if written.is_empty() { Vec::new() } else { all_named(inputs)? };
    named.iter().try_for_each(|named| written.check_against(named))
}

/// Returns the files that are read because these inputs name them, such as textures.
pub(super) fn all_named<'a>(inputs: impl IntoIterator<Item = Source<'a>>) -> Result<Vec<PathBuf>> {
    let mut named = Vec::new();
    for input in inputs {
        if let Source::Cloud(path, format) = input {
            named.extend(companions(path, format)?);
        }
    }
    Ok(named)
}

/// Fails for a file whose name cannot be written in a line of a PLY header.
pub(super) fn check_named_in_ply(path: &Path) -> Result<()> {
    let name = path.to_str().filter(|name| name.trim() == *name && !name.contains(|c: char| c.is_control()));
    match name.filter(|name| cfg!(windows) || !name.contains('\\')) {
        Some(_) => Ok(()),
        None => Err(Error::Usage(format!(
            "{} cannot be named in a PLY file, because of a character or a space at an end: choose another name",
            path.display()
        ))),
    }
}

/// Returns the name of the mesh whose triangles are drawn with the surfels of `output`.
///
/// A mesh is returned if there is a single input, which names the mesh, and the mesh lies in the
/// folder of `output`. Otherwise the meshes are left out, with a warning for each.
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

/// Files to be written, by their resolved path and, if they exist, by their identity on disk.
#[derive(Default)]
struct Written {
    places: HashMap<PathBuf, PathBuf>,
    nodes: HashMap<Node, PathBuf>,
    /// Existing files behind streams, such as a redirected stdout.
    streams: HashMap<Node, PathBuf>,
}

impl Written {
    /// Adds a file. If it is there already, returns the path under which it was added.
    fn add(&mut self, path: &Path) -> Option<PathBuf> {
        let Some(place) = atomic::place_of(path) else {
            // A stream such as a redirected stdout may end in a file. Several outputs may go to
            // that file one after the other, but the file must not be an input.
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

    /// Fails if the file `read`, an input, would be overwritten.
    fn check_against(&self, read: &Path) -> Result<()> {
        let standard = read == Path::new("-");
        let node = if standard { standard_input() } else { node_of(read) };
        let by_node = || node.and_then(|node| self.nodes.get(&node).or(self.streams.get(&node))).map(PathBuf::as_path);
        let by_place = if standard { None } else { self.find(read) };
        let Some(output) = by_place.or_else(by_node) else { return Ok(()) };
        let read =
            if standard { "that is standard input".into() } else { epsplat::io::shown(read).display().to_string() };
        Err(Error::Usage(format!(
            "{} would overwrite the input {read}: choose another name for the output",
            output.display()
        )))
    }

    fn find(&self, path: &Path) -> Option<&Path> {
        let place = atomic::place_of(path).and_then(|place| self.places.get(&place));
        place.or_else(|| self.nodes.get(&node_of(path)?)).map(PathBuf::as_path)
    }

    /// Finds an output file that would be a folder of another output. Returns both, that file
    /// first.
    fn file_as_folder(&self) -> Option<(&Path, &Path)> {
        self.places.iter().find_map(|(place, inside)| {
            let file = place.ancestors().skip(1).find_map(|folder| self.places.get(folder))?;
            Some((file.as_path(), inside.as_path()))
        })
    }
}

/// Identity of a file under all its names: device and inode on Unix, otherwise the canonical path.
#[cfg(unix)]
type Node = (u64, u64);
#[cfg(not(unix))]
type Node = PathBuf;

/// Returns the identity of the regular file that `path` leads to, or None if there is none.
fn node_of(path: &Path) -> Option<Node> {
    std::fs::metadata(path).ok().filter(Metadata::is_file).and_then(|there| node(path, &there))
}

/// Returns the identity of the file that standard input is redirected from, if it is redirected.
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
