//! Input options shared by the subcommands: help texts, folders, and reading of files.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use epsplat::io::las::Copc;
use epsplat::io::ply::{Levels, Rows};
use epsplat::io::{self, ClassOpacities, ColorRules, Format, Input, Mesh, Points, ReadOptions};
use epsplat::surfels::Limits;
use epsplat::{Error, Progress, Result};

use super::note;
use super::outputs::Source;
use super::progress::Bars;

/// Most unreadable files of folders that a note names.
const MOST_NAMED: usize = 8;

/// Options for the format of the inputs and for attributes to ignore.
#[derive(Args)]
#[command(next_help_heading = "Input")]
pub(super) struct InputFormat {
    /// Format of the inputs [default: from their names, or else their first bytes]
    #[arg(long, value_name = "FORMAT", value_parser = formats(), hide_short_help = true)]
    input_format: Option<Format>,
    /// Ignore the alphas of colours, where some programs store other values
    ///
    /// The opacities of Gaussians are still used
    #[arg(long, hide_short_help = true)]
    ignore_alpha: bool,
}

/// Options for reading point clouds.
#[derive(Args)]
#[command(next_help_heading = "Input")]
pub(super) struct Reading {
    #[command(flatten)]
    input: InputFormat,
    /// Keep points that a LAS file marks as withheld (deleted), which are left out by default
    #[arg(long, hide_short_help = true)]
    keep_withheld: bool,
    /// Opacities of LAS classes: CLASS:A or FIRST-LAST:A, such as 3-5:0.3,7:0
    ///
    /// The example makes vegetation (3 to 5) transparent and leaves out noise (7). Points of
    /// opacity 0 are left out and counted; others are transparent with render --composite
    #[arg(long, value_name = "RULES", hide_short_help = true)]
    pub(super) class_opacity: Option<ClassOpacities>,
    /// Draw the Gaussians of a 3DGS file as surfels, without their shortest axis
    #[arg(long, hide_short_help = true)]
    flatten: bool,
    /// Fail if a part of an input cannot be read; by default the rest is drawn
    ///
    /// A part is a file of a folder, a scan of an E57 file, a chunk of a LAZ file or a node of a
    /// COPC file. A note names the parts that are left out
    #[arg(long, hide_short_help = true)]
    strict: bool,
    /// Paths of the inputs that were found in folders.
    #[arg(skip)]
    of_folders: BTreeSet<PathBuf>,
}

/// Options for outliers and for the size and shape of estimated surfels.
#[derive(Args)]
#[command(next_help_heading = "Surfels from points")]
pub(super) struct LimitArguments {
    /// Drop outliers: points K standard deviations farther from their neighbours than the mean
    ///
    /// A point's distance is its mean distance to 16 neighbours
    #[arg(long, value_name = "K", hide_short_help = true)]
    outliers: Option<f64>,
    /// Largest estimated half-axis, as a multiple of the neighbours' median; inf for no limit
    #[arg(long, value_name = "FACTOR", default_value = "3", hide_short_help = true)]
    max_radius: f64,
    /// Estimate flat disks instead of disks that curve with the surface: faster frames
    #[arg(long)]
    flat: bool,
}

impl LimitArguments {
    pub(super) fn limits(&self) -> Limits {
        Limits { outliers: self.outliers, largest_ratio: self.max_radius, curved: !self.flat }
    }
}

/// Parses the names of the formats that this build reads.
fn formats() -> impl TypedValueParser<Value = Format> {
    let names = Format::READ.iter().map(|(name, _)| *name);
    PossibleValuesParser::new(names).try_map(|name| name.parse::<Format>())
}

/// Replaces each folder among the inputs by its readable files, sorted by name.
///
/// A file is readable if its extension is a format's name. Names with a leading dot are skipped, as
/// they are files that programs and systems store for themselves. Subfolders are not searched.
///
/// # Errors
///
/// [`Error::Read`] if a folder cannot be listed, [`Error::Usage`] if it has no readable file.
pub(super) fn with_folders(inputs: &mut Vec<PathBuf>, reading: &mut Reading) -> Result<()> {
    let is_read = |path: &PathBuf| {
        if path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b".")) {
            return false;
        }
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        path.is_file() && Format::READ.iter().any(|(name, _)| name.eq_ignore_ascii_case(extension))
    };
    for folder in std::mem::take(inputs) {
        if !folder.is_dir() {
            inputs.push(folder);
            continue;
        }
        let listed = std::fs::read_dir(&folder).and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect());
        let mut files: Vec<PathBuf> = listed.map_err(|error| Error::read(&folder, error))?;
        files.retain(is_read);
        files.sort();
        if files.is_empty() {
            let formats = Format::sentence();
            return Err(Error::Usage(format!("the folder {} has no {formats} files", folder.display())));
        }
        reading.of_folders.extend(files.iter().cloned());
        inputs.append(&mut files);
    }
    Ok(())
}

/// Returns the help text of an input: `what` it is and its file extensions.
pub(super) fn help_of(what: &str) -> String {
    let extensions: Vec<_> = Format::READ.iter().map(|(name, _)| format!(".{name}")).collect();
    format!("{what}: {}; - is standard input", extensions.join(", "))
}

/// Returns the help text of inputs that may also be folders.
pub(super) fn help_of_all(what: &str) -> String {
    format!("{}; a folder stands for its files", help_of(what))
}

/// Adds the file's name to an [`Error::EmptyScene`] if the scene has exactly one input.
pub(super) fn named(error: Error, inputs: &[PathBuf]) -> Error {
    match (error, inputs) {
        (Error::EmptyScene(what), [input]) => Error::malformed(input, what),
        (error, _) => error,
    }
}

impl InputFormat {
    /// Returns the file at `path` with this format, for checks of outputs.
    pub(super) fn source<'a>(&self, path: &'a Path) -> Source<'a> {
        Source::Cloud(path, self.input_format)
    }

    /// Reads a mesh.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if `--input-format` is neither obj nor ply, or an error of reading.
    pub(super) fn mesh(&self, path: &Path, bars: &Bars) -> Result<Mesh> {
        let format = self.input_format;
        if format.is_some_and(|format| format != Format::Obj && format != Format::Ply) {
            return Err(Error::Usage(
                "only obj and ply files can be read as meshes: choose one of them for --input-format".into(),
            ));
        }
        let options = ReadOptions { format, ignore_alpha: self.ignore_alpha, ..ReadOptions::default() };
        io::read_mesh_with(path, options, bars)
    }
}

impl Reading {
    /// Returns the files with their format, for checks of outputs.
    pub(super) fn sources<'a>(&self, paths: &'a [PathBuf]) -> impl Iterator<Item = Source<'a>> + use<'a> {
        let format = self.input.input_format;
        paths.iter().map(move |path| Source::Cloud(path, format))
    }

    /// Reads the points of a file and the description in its header ([`Points::about`]).
    pub(super) fn described(&self, path: &Path, bars: &Bars) -> Result<Points> {
        let points = io::read_with(path, ReadOptions { describe: true, ..self.options() }, bars)?;
        self.check_classes(std::slice::from_ref(&points))?;
        Ok(points)
    }

    /// Returns true if `--ignore-alpha` is given.
    pub(super) fn ignores_alpha(&self) -> bool {
        self.input.ignore_alpha
    }

    fn options(&self) -> ReadOptions {
        ReadOptions {
            format: self.input.input_format,
            keep_withheld: self.keep_withheld,
            flatten: self.flatten,
            classes: self.class_opacity.unwrap_or_default(),
            ignore_alpha: self.input.ignore_alpha,
            describe: false,
            strict: self.strict,
        }
    }

    /// Opens or reads each file. Returns the results and a sentence that names unreadable files.
    ///
    /// Unless `--strict` is given, a file of a folder that cannot be read is replaced by
    /// `stands_in()`, or left out if that is None. If no file can be read, the first error is
    /// returned.
    fn each<T>(
        &self,
        paths: &[PathBuf],
        open: impl Fn(&Path) -> Result<T>,
        stands_in: impl Fn() -> Option<T>,
    ) -> Result<(Vec<T>, Option<String>)> {
        let (mut all, mut failed) = (Vec::new(), Vec::new());
        for path in paths {
            match open(path) {
                Ok(opened) => all.push(opened),
                Err(error @ (Error::Read { .. } | Error::Malformed { .. }))
                    if !self.strict && self.of_folders.contains(path) =>
                {
                    failed.push(error);
                    all.extend(stands_in());
                }
                Err(error) => return Err(error),
            }
        }
        if failed.len() == paths.len()
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

    /// Opens the files as octrees if all of them are COPC. Otherwise returns None.
    ///
    /// Standard input is never an octree, as it cannot seek to a node.
    pub(super) fn octrees(&self, paths: &[PathBuf]) -> Result<Option<Vec<Copc>>> {
        let open = |path: &Path| {
            let is_file = path.is_file() && path != Path::new("-");
            if is_file { Copc::open(Input::open(path, self.input.input_format)?) } else { Ok(None) }
        };
        let (files, left_out) = self.each(paths, open, || None)?;
        let files: Option<Vec<Copc>> = files.into_iter().collect();
        left_out.iter().filter(|_| files.is_some()).for_each(|line| note(line));
        Ok(files)
    }

    /// Opens the file if it is a regular file with levels of detail. Otherwise returns None.
    pub(super) fn levels(&self, path: &Path) -> Result<Option<Levels>> {
        let is_file = path.is_file() && path != Path::new("-");
        if is_file { Levels::open(Input::open(path, self.input.input_format)?) } else { Ok(None) }
    }

    /// Opens the files for reading their points piece by piece.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if a file cannot be read like this, for example because it is not binary
    /// PLY.
    pub(super) fn rows(&self, paths: &[PathBuf]) -> Result<Vec<Rows>> {
        let open = |path: &Path| {
            let is_file = path.is_file() && path != Path::new("-");
            let input = if is_file { Some(Input::open(path, self.input.input_format)?) } else { None };
            let rows = input.map_or(Ok(None), |input| Rows::open(input, self.input.ignore_alpha))?;
            rows.ok_or_else(|| {
                Error::Usage(format!(
                    "--memory needs binary PLY files of points with normals and radii, or half-axes, and without faces, textures or levels of detail, which {} is not: make surfels of it first (epsplat surfels), or leave --memory out",
                    path.display()
                ))
            })
        };
        let (mut files, left_out) = self.each(paths, open, || None)?;
        left_out.iter().for_each(|line| note(line));
        Rows::settle_colors(&mut files)?;
        Ok(files)
    }

    /// Reads the points of the given nodes of each file.
    ///
    /// The first points read with `rules` decide how colours are interpreted, so that later calls
    /// with the same rules agree.
    pub(super) fn nodes<'a>(
        &self,
        files: impl Iterator<Item = (&'a mut Copc, &'a Vec<usize>)>,
        rules: &mut ColorRules,
        progress: &dyn Progress,
    ) -> Result<Vec<Points>> {
        let options = self.options();
        let read = |(file, nodes): (&mut Copc, &Vec<usize>)| file.read_raw(nodes, &options, progress);
        let mut points = files.map(read).collect::<Result<Vec<_>>>()?;
        rules.settle(&mut points);
        Ok(points)
    }

    /// Fails if `--class-opacity` is given and none of the inputs has classes.
    fn check_classes(&self, inputs: &[Points]) -> Result<()> {
        let plain = self.class_opacity.is_none_or(|opacities| opacities.are_plain());
        // An input without points may be a LAS file: only inputs with points show what is missing.
        let none = inputs.iter().all(|input| input.classes.is_empty() && !input.positions.is_empty());
        if plain || !none {
            return Ok(());
        }
        Err(Error::Usage("no input has points with classes, which LAS files have: leave --class-opacity out".into()))
    }

    /// Reads the points of each file, one entry for each path.
    pub(super) fn all(&self, paths: &[PathBuf], bars: &Bars) -> Result<Vec<Points>> {
        if paths.iter().filter(|path| *path == Path::new("-")).count() > 1 {
            return Err(Error::Usage("standard input can be read only once: give - once".into()));
        }
        let read = |path: &Path| io::read_raw(path, self.options(), bars);
        let (mut inputs, left_out) = self.each(paths, read, || Some(Points::default()))?;
        // An unreadable file has an entry without points, so that indices of inputs stay those of
        // `paths`.
        inputs.iter_mut().take(1).for_each(|first| first.unread.extend(left_out.clone()));
        // All tiles of one scan must use the same white point.
        io::settle_colors(&mut inputs);
        self.check_classes(&inputs)?;
        Ok(inputs)
    }

    /// Returns these options as arguments, each after a space, for a command that reads the file.
    pub(super) fn arguments(&self) -> String {
        let format = self.input.input_format.and_then(|format| Format::READ.iter().find(|(_, known)| *known == format));
        let format = format.map_or(String::new(), |(name, _)| format!(" --input-format {name}"));
        let withheld = if self.keep_withheld { " --keep-withheld" } else { "" };
        let classes = self.class_opacity.filter(|opacities| !opacities.are_plain());
        let classes = classes.map_or(String::new(), |opacities| format!(" --class-opacity {opacities}"));
        let alpha = if self.input.ignore_alpha { " --ignore-alpha" } else { "" };
        let strict = if self.strict { " --strict" } else { "" };
        format + withheld + if self.flatten { " --flatten" } else { "" } + alpha + &classes + strict
    }
}
