//! The files of a scene. A folder stands for the files in it, and parts that cannot be read are
//! left out with a note.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::address;
use crate::error::{Error, Result};
use crate::io::las::Copc;
use crate::io::place::GeoKeys;
use crate::io::ply::{Levels, Rows};
use crate::io::vpc::{self, Tile};
use crate::io::{self, ColorRules, Format, Input, Mesh, Points, ReadOptions, Up};
use crate::options::{FormatOptions, InputOptions};
use crate::progress::Progress;

/// The most unreadable files of folders that a note names.
const MOST_NAMED: usize = 8;

/// The input files of a scene, and how they are read.
#[derive(Clone, Debug, Default)]
pub struct Files {
    paths: Vec<PathBuf>,
    options: InputOptions,
    /// Paths that were found in folders.
    of_folders: BTreeSet<PathBuf>,
    /// The tiles of virtual point clouds, by their path.
    tiles: BTreeMap<PathBuf, Tile>,
}

impl Files {
    /// Lists the files at `paths`, where each folder stands for its readable files, sorted by name,
    /// and each virtual point cloud (`.vpc`) for its tiles. Nothing else is read yet.
    ///
    /// A path that begins with `http://` or `https://` is the address of a file on a server.
    ///
    /// A file of a folder is readable if its extension is a format's name; `.txt` and `.csv` files
    /// also have to start as a table. Names with a leading dot are skipped, as they are files that
    /// programs and systems store for themselves. Subfolders are not searched. The path `-` is
    /// standard input.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] if a folder cannot be listed, [`Error::Usage`] if it has no readable file,
    /// and the errors of [`vpc::read`].
    pub fn new(paths: impl IntoIterator<Item = impl Into<PathBuf>>, options: &InputOptions) -> Result<Self> {
        let mut files = Self { options: options.clone(), ..Self::default() };
        for path in paths {
            let path = path.into();
            if vpc::is_one(&path) && !path.is_dir() {
                for tile in vpc::read(&path)? {
                    files.paths.push(tile.path.clone());
                    files.add_tile(tile);
                }
                continue;
            }
            if !path.is_dir() {
                files.paths.push(path);
                continue;
            }
            let mut found = files_of(&path)?;
            if found.is_empty() {
                let formats = Format::sentence();
                return Err(Error::Usage(format!("the folder {} has no {formats} files", path.display())));
            }
            files.of_folders.extend(found.iter().cloned());
            files.paths.append(&mut found);
        }
        Ok(files)
    }

    /// Adds a tile. If several clouds name it, its points lie in the boxes of all of them together.
    fn add_tile(&mut self, tile: Tile) {
        match self.tiles.entry(tile.path.clone()) {
            Entry::Vacant(place) => drop(place.insert(tile)),
            Entry::Occupied(mut known) => {
                let both = known.get().bounds.zip(tile.bounds);
                known.get_mut().bounds = both.map(|(one, other)| one.union(other));
            }
        }
    }

    /// The paths of all files, including those found in folders.
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    /// Returns the keys of the coordinate system of the files; None if they name none, or if some
    /// of them name others. Of the tiles of virtual point clouds only the first is looked at.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] and [`Error::Malformed`] for files whose header cannot be read.
    pub fn geo_keys(&self) -> Result<Option<GeoKeys>> {
        let of_file = |path: &PathBuf| GeoKeys::of_file(path, self.options.file.input_format);
        let mut tiles = self.paths.iter().filter(|path| self.is_tile(path));
        let first_tile = tiles.next();
        let looked_at = |path: &Path| !self.is_tile(path) || first_tile.is_some_and(|first| first == path);
        let open = |path: &Path| if looked_at(path) { of_file(&path.to_owned()).map(Some) } else { Ok(None) };
        let keys = self.each(open, || None)?.0;
        let mut keys = keys.into_iter().flatten().flatten();
        let first = keys.next();
        Ok(first.filter(|first| keys.all(|other| other == *first)))
    }

    /// How the files are read.
    pub fn options(&self) -> &InputOptions {
        &self.options
    }

    /// Adds the file's name to an [`Error::EmptyScene`] if there is exactly one file.
    pub fn named(&self, error: Error) -> Error {
        error.of_inputs(&self.paths)
    }

    /// Opens or reads each file. Returns the results and a sentence that names unreadable files.
    ///
    /// Unless the options are strict, a file of a folder that cannot be read is replaced by
    /// `stands_in()`, or left out if that is None. If no file can be read, the first error is
    /// returned.
    fn each<T>(
        &self,
        open: impl Fn(&Path) -> Result<T>,
        stands_in: impl Fn() -> Option<T>,
    ) -> Result<(Vec<T>, Option<String>)> {
        let (mut all, mut failed) = (Vec::new(), Vec::new());
        for path in &self.paths {
            match open(path) {
                Ok(opened) => all.push(opened),
                Err(error @ (Error::Read { .. } | Error::Malformed { .. }))
                    if !self.options.strict && self.of_folders.contains(path) =>
                {
                    failed.push(error);
                    all.extend(stands_in());
                }
                Err(error) => return Err(error),
            }
        }
        if failed.len() == self.paths.len()
            && let Some(first) = failed.pop()
        {
            return Err(failed.into_iter().next().unwrap_or(first));
        }
        let told = failed.iter().take(MOST_NAMED).map(ToString::to_string).collect::<Vec<_>>().join("; ");
        let more = failed.len().saturating_sub(MOST_NAMED);
        let more = if more > 0 { format!("; and {more} more") } else { String::new() };
        let (count, files) = (failed.len(), self.of_folders.len());
        let sentence = format!("{count} of {files} files of folders left out: {told}{more} (--strict refuses them)");
        Ok((all, (count > 0).then_some(sentence)))
    }

    /// Whether the path is that of a tile of a virtual point cloud. It may be on a disk that is not
    /// there as long as no picture shows it.
    pub(super) fn is_tile(&self, path: &Path) -> bool {
        self.tiles.contains_key(path)
    }

    /// The tile at each path; None if a path is not that of a tile of a virtual point cloud.
    pub(super) fn tiles(&self) -> Option<Vec<&Tile>> {
        self.paths.iter().map(|path| self.tiles.get(path)).collect()
    }

    /// Opens a regular file, or a remote one that is read in part. Returns None for standard input
    /// and other paths in which no position can be sought.
    pub(super) fn seekable(&self, path: &Path) -> Result<Option<Input>> {
        if address::is_remote(path) {
            let input = Input::open(path, self.options.file.input_format)?;
            if !input.is_copy() {
                return Ok(Some(input));
            }
            // The copy is what the next call that opens the path gets.
            return input.keep(path).map(|()| None).map_err(|error| Error::read(path, error));
        }
        let is_file = path.is_file() && path != Path::new("-");
        is_file.then(|| Input::open(path, self.options.file.input_format)).transpose()
    }

    /// Opens the files as octrees if all of them are COPC. Otherwise returns None.
    pub(super) fn octrees(&self, progress: &dyn Progress) -> Result<Option<Vec<Copc>>> {
        let open = |path: &Path| {
            let input = self.seekable(path)?;
            if input.is_none() && address::is_remote(path) && Format::is_las(path) {
                let path = address::shown(path);
                progress.note(&format!(
                    "{}: its server sends no ranges of bytes, so the whole file is copied and read",
                    path.display()
                ));
            }
            input.map_or(Ok(None), Copc::open)
        };
        let (files, left_out) = self.each(open, || None)?;
        let files: Option<Vec<Copc>> = files.into_iter().collect();
        left_out.iter().filter(|_| files.is_some()).for_each(|line| progress.note(line));
        Ok(files)
    }

    /// Opens the only file if it is a regular file with levels of detail. Otherwise returns None.
    pub(super) fn levels(&self) -> Result<Option<Levels>> {
        let [path] = &self.paths[..] else { return Ok(None) };
        if self.options.file.input_format.is_none() && Format::is_las(path) {
            return Ok(None);
        }
        self.seekable(path)?.map_or(Ok(None), Levels::open)
    }

    /// Opens the files for reading their points piece by piece.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if a file cannot be read piece by piece, for example because it is not
    /// binary PLY.
    pub fn rows(&self, progress: &dyn Progress) -> Result<Vec<Rows>> {
        let open = |path: &Path| {
            let input = self.seekable(path)?;
            let rows = input.map_or(Ok(None), |input| Rows::open(input, self.options.file.ignore_alpha))?;
            rows.ok_or_else(|| {
                Error::Usage(format!(
                    "--memory needs binary PLY files of points with normals and radii, or half-axes, and without faces, textures or levels of detail, which {} is not: make surfels of it first (epsplat surfels), or leave --memory out",
                    address::shown(path).display()
                ))
            })
        };
        let (mut files, left_out) = self.each(open, || None)?;
        left_out.iter().for_each(|line| progress.note(line));
        Rows::settle_colors(&mut files)?;
        Ok(files)
    }

    /// Opens the files for reading shares of their points: None unless all are binary PLY files on
    /// this machine whose points are surfels.
    pub(super) fn surfels(&self) -> Result<Option<Vec<Rows>>> {
        if self.paths.iter().any(|path| address::is_remote(path)) {
            return Ok(None);
        }
        let open = |path: &PathBuf| {
            self.seekable(path)?.map_or(Ok(None), |input| Rows::open(input, self.options.file.ignore_alpha))
        };
        let files: Option<Vec<Rows>> = self.paths.iter().map(open).collect::<Result<_>>()?;
        let mut files = files.filter(|files| !files.is_empty());
        files.iter_mut().try_for_each(|files| Rows::settle_colors(files))?;
        Ok(files)
    }

    /// Reads the points of the given nodes of each octree, none where there is no octree.
    ///
    /// The first points read with `rules` decide how colours are interpreted, so that later calls
    /// with the same rules agree.
    pub(super) fn nodes<'a>(
        &self,
        octrees: impl Iterator<Item = (Option<&'a mut Copc>, &'a Vec<usize>)>,
        (rules, column): (&mut ColorRules, Option<String>),
        progress: &dyn Progress,
    ) -> Result<Vec<Points>> {
        let options = self.options.with_column(column);
        let read = |(file, nodes): (Option<&mut Copc>, &Vec<usize>)| match file {
            Some(file) => file.read_raw(nodes, &options, progress),
            None => Ok(Points { up: Some(Up::Z), ..Points::default() }),
        };
        let mut points = octrees.map(read).collect::<Result<Vec<_>>>()?;
        rules.settle(&mut points);
        Ok(points)
    }

    /// Reads the points of each file, one entry for each path.
    ///
    /// # Errors
    ///
    /// The errors of [`io::read`], and [`Error::Usage`] if standard input is named twice, or if
    /// opacities are given for classes that no file has.
    pub fn read(&self, progress: &dyn Progress) -> Result<Vec<Points>> {
        self.read_with(None, false, progress)
    }

    /// Reads the points of each file with the attribute `column`; `solid` is
    /// [`ReadOptions::solid`].
    pub(super) fn read_with(
        &self,
        column: Option<String>,
        solid: bool,
        progress: &dyn Progress,
    ) -> Result<Vec<Points>> {
        if self.paths.iter().filter(|path| *path == Path::new("-")).count() > 1 {
            return Err(Error::Usage("standard input can be read only once: give - once".into()));
        }
        let options = ReadOptions { solid, ..self.options.with_column(column) };
        let read = |path: &Path| io::read_raw(path, options.clone(), progress);
        let (mut inputs, left_out) = self.each(read, || Some(Points::default()))?;
        // An unreadable file has an entry without points, so that indices of inputs stay those of
        // `paths`.
        inputs.iter_mut().take(1).for_each(|first| first.unread.extend(left_out.clone()));
        // All tiles of one scan must use the same white point.
        io::settle_colors(&mut inputs);
        check_classes(&self.options, &inputs)?;
        Ok(inputs)
    }

    /// Reads the points of a file and the description in its header ([`Points::about`]).
    ///
    /// # Errors
    ///
    /// The errors of [`Files::read`].
    pub fn described(path: &Path, options: &InputOptions, progress: &dyn Progress) -> Result<Points> {
        let mut reading = ReadOptions { describe: true, solid: true, ..options.of_file() };
        reading.wanted.spans = true;
        let points = io::read_with(path, reading, progress)?;
        check_classes(options, std::slice::from_ref(&points))?;
        Ok(points)
    }
}

impl FormatOptions {
    /// Reads the file at `path` as a mesh.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if the format holds no meshes, or an error of reading.
    pub fn mesh(&self, path: &Path, progress: &dyn Progress) -> Result<Mesh> {
        let format = self.input_format;
        if format.is_some_and(|format| !Format::MESHES.contains(&format)) {
            return Err(Error::Usage(format!(
                "only {} files can be read as meshes: choose one of them for --input-format",
                Format::meshes_sentence()
            )));
        }
        let options = ReadOptions { format, ignore_alpha: self.ignore_alpha, ..ReadOptions::default() };
        io::read_mesh_with(path, options, progress)
    }
}

/// Lists the readable files of a folder, sorted by name.
fn files_of(folder: &Path) -> Result<Vec<PathBuf>> {
    let is_read = |path: &PathBuf| {
        if path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b".")) {
            return false;
        }
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        let is_known = Format::READ.iter().any(|(name, _)| name.eq_ignore_ascii_case(extension));
        path.is_file() && is_known && !io::text::is_other_text(path)
    };
    let listed = std::fs::read_dir(folder).and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect());
    let mut files: Vec<PathBuf> = listed.map_err(|error| Error::read(folder, error))?;
    files.retain(is_read);
    files.sort();
    Ok(files)
}

/// Fails if opacities of classes are given and none of the inputs has classes.
fn check_classes(options: &InputOptions, inputs: &[Points]) -> Result<()> {
    let plain = options.class_opacity.is_none_or(|opacities| opacities.are_plain());
    // An input without points may be a LAS file, so it does not show that classes are missing.
    let none = inputs.iter().all(|input| input.classes.is_empty() && !input.positions.is_empty());
    if plain || !none {
        return Ok(());
    }
    Err(Error::Usage("no input has points with classes, which LAS files have: leave --class-opacity out".into()))
}
