//! `epsplat render` with `--cameras` or `--turntable`: renders a picture for each camera. While one
//! picture is rendered, earlier pictures are encoded and written.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};
use std::time::Instant;

use epsplat::io::write_behind::write_behind;
use epsplat::io::{atomic, cameras};
use epsplat::low_level::frame::pixel_bytes;
use epsplat::options::DeviceOptions;
use epsplat::{Error, Files, Maps, Picture, Progress, ReadReport, Renderer, Report, Result, Scene, View};
use serde::Serialize;

use super::super::outputs::Source;
use super::super::progress::{Bars, Notes};
use super::super::{note, outputs, write_json};
use super::Arguments;
use super::output::{named, note_cut, note_overflows};
use super::target::Target;

/// Limit of host memory for frames that wait for a writer or are being written, bytes.
///
/// A frame that alone exceeds the limit is still written.
const MOST_WAITING: u64 = 1 << 30;

/// The JSON report of a view's picture.
#[derive(Serialize)]
pub(super) struct Written {
    /// The number of the view, from 0.
    #[serde(skip)]
    pub(super) number: usize,
    file: PathBuf,
    #[serde(flatten)]
    report: Report,
    /// Numbers of nodes, points and bytes that were read; None if the inputs were read whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    read: Option<ReadReport>,
    /// A hash of the colour's and of each map's bits ([`Frame::hashes`](epsplat::Frame::hashes)).
    bits: Option<BTreeMap<&'static str, String>>,
    /// Milliseconds of encoding and writing, while other pictures were rendered.
    write_ms: f64,
}

#[derive(Serialize)]
struct Reports {
    views: Vec<Written>,
    /// Number of threads that encoded and wrote pictures.
    writers: usize,
    /// Milliseconds of rendering, summed over all views.
    render_ms: f64,
    /// Milliseconds of encoding and writing, summed over all views.
    write_ms: f64,
    /// Milliseconds from the scene in host memory to the last written picture. For files that are
    /// read in part, the time starts when the overview is in memory.
    total_ms: f64,
}

/// The pictures of a command: their files, and their views unless these depend on the scene.
struct Shots {
    files: Vec<PathBuf>,
    views: Option<Vec<View>>,
}

impl Shots {
    fn of(arguments: &Arguments, target: &Target) -> Result<Self> {
        if let Some(path) = &arguments.views.cameras {
            let (files, views) = views(arguments, path, target)?.into_iter().unzip();
            return Ok(Self { files, views: Some(views) });
        }
        // Finds faults of the lens before anything is read.
        View::new(&arguments.camera)?;
        let count = arguments.views.turntable.map_or(0, |count| count.get());
        let digits = count.saturating_sub(1).to_string().len().max(4);
        let files = (0..count).map(|step| file_of(arguments, target, &format!("{step:0digits$}"))).collect();
        Ok(Self { files, views: None })
    }

    /// Returns the number of pixels of the largest picture.
    fn pixels(&self, arguments: &Arguments) -> u64 {
        let (width, height) = arguments.camera.size.unwrap_or(View::DEFAULT_SIZE);
        let views = self.views.iter().flatten().map(View::pixels).max();
        views.unwrap_or(u64::from(width) * u64::from(height))
    }
}

/// The pictures of a command, ready to be drawn.
pub(super) struct Ready {
    pub files: Vec<PathBuf>,
    views: Vec<View>,
    renderer: Renderer,
    /// Number of threads that encode and write.
    writers: NonZeroUsize,
}

/// Renders a picture for each camera.
pub(super) fn run(arguments: &Arguments, target: &Target) -> Result<()> {
    let bars = Bars::new();
    let ready = ready(arguments, target, (&arguments.device, true), &bars)?;
    let (writers, start) = (ready.writers, Instant::now());
    let numbers = (0..ready.files.len()).map(Ok);
    let pictures = draw(arguments, target, ready, numbers, (&bars, true))?;
    tell(arguments, pictures, writers, start)
}

/// Checks the arguments, and reads and prepares the scene. The outputs are checked too if
/// `checks_outputs`.
pub(super) fn ready(
    arguments: &Arguments,
    target: &Target,
    (device, checks_outputs): (&DeviceOptions, bool),
    progress: &dyn Progress,
) -> Result<Ready> {
    let maps = Maps::of(&arguments.options.maps.aov);
    let inputs = Files::new(&arguments.inputs, &arguments.scene.input)?;
    Renderer::check(&inputs, &arguments.scene, &arguments.options, device)?;
    let shots = Shots::of(arguments, target)?;
    if checks_outputs {
        check_outputs(arguments, &inputs, target, &shots.files)?;
    }
    let scene = Scene::of_files(inputs, &arguments.scene)?;
    // A stream has the pictures in order, so a single thread writes them.
    let writers = if target.is_standard { NonZeroUsize::MIN } else { writers(shots.pixels(arguments), maps) };
    let renderer = Renderer::of_views(&scene, &arguments.options, device, progress)?;
    let renderer = renderer.with_frames(writers.get() as u64 + 1);
    let views = match (shots.views, arguments.views.turntable) {
        (Some(views), _) => views,
        (None, count) => renderer.turntable(&arguments.camera, count.unwrap_or(NonZeroU32::MIN))?,
    };
    Ok(Ready { files: shots.files, views, renderer, writers })
}

/// Draws and writes the pictures of these `numbers`. Notes are printed if it `speaks`.
pub(super) fn draw(
    arguments: &Arguments,
    target: &Target,
    ready: Ready,
    numbers: impl Iterator<Item = Result<usize>>,
    (bars, speaks): (&dyn Progress, bool),
) -> Result<Vec<Written>> {
    let Ready { files, views, mut renderer, writers } = ready;
    bars.begin("rendering views", views.len() as u64);
    // The bar counts views and not their stages.
    let notes: &dyn Progress = if speaks { &Notes } else { &() };
    // The first empty picture with the reason, and the number of empty pictures.
    let empty = RefCell::new((None, 0));
    let frames = numbers.map(|number| {
        let number = number?;
        let (file, view) = (&files[number], &views[number]);
        let picture = renderer.frame(view, notes).map_err(|error| error.of_view(file))?;
        if let Some(unseen) = &picture.unseen {
            let (first, count) = &mut *empty.borrow_mut();
            first.get_or_insert_with(|| (file, unseen.sentence()));
            *count += 1;
        }
        Ok((number, picture))
    });
    let pictures = write_behind(writers, frames, |(number, picture)| {
        let file = &files[number];
        let start = Instant::now();
        if let Some(folder) = file.parent().filter(|_| !target.is_standard) {
            std::fs::create_dir_all(folder).map_err(|error| Error::write(file, error))?;
        }
        let Picture { frame, report, read, .. } = picture;
        target.write(file, &frame)?;
        bars.advance(1);
        let write_ms = start.elapsed().as_secs_f64() * 1e3;
        let bits = arguments.file.json.as_ref().map(|_| frame.hashes());
        Ok(Written { number, file: file.clone(), report, read, bits, write_ms })
    });
    bars.end();
    let pictures = pictures?;
    if let (Some((first, unseen)), count) = empty.into_inner()
        && speaks
    {
        note(&format!("{} ({}, the first of {count} empty pictures)", unseen, first.display()));
    }
    Ok(pictures)
}

/// Returns the file of the picture `name`. On standard output it is only a name for messages.
fn file_of(arguments: &Arguments, target: &Target, name: &str) -> PathBuf {
    let file = format!("{name}.{}", target.format.name());
    if target.is_standard { file.into() } else { arguments.output.join(file) }
}

/// Prints notes and the summary or JSON of all pictures. `start` is the time at which the scene was
/// in memory.
fn tell(arguments: &Arguments, views: Vec<Written>, writers: NonZeroUsize, start: Instant) -> Result<()> {
    views.iter().for_each(|view| note_overflows(&view.report));
    note_cut(views.iter().map(|view| &view.report), arguments.options.levels.splats);
    let reports = Reports {
        writers: writers.get(),
        render_ms: views.iter().map(|view| view.report.total_ms).sum(),
        write_ms: views.iter().map(|view| view.write_ms).sum(),
        total_ms: start.elapsed().as_secs_f64() * 1e3,
        views,
    };
    match &arguments.file.json {
        Some(path) => write_json(path, &reports),
        None => {
            note(&summary(&reports, &arguments.output));
            Ok(())
        }
    }
}

/// Returns the output file and view of each camera.
///
/// # Errors
///
/// [`Error::Malformed`] if a lens is of a model that is not rendered, unless `--ignore-distortion`
/// is given, or an error of a view that the arguments contradict.
fn views(arguments: &Arguments, path: &Path, target: &Target) -> Result<Vec<(PathBuf, View)>> {
    let cameras = arguments.views.lens.read(path, arguments.camera.size)?;
    let view = |camera: cameras::NamedCamera| {
        let file = file_of(arguments, target, &camera.name);
        let view = View::of_file(&arguments.camera, camera.camera, path, arguments.views.lens.scale)
            .map_err(|error| error.of_view(&file))?;
        Ok((file, view))
    };
    cameras.into_iter().map(view).collect()
}

/// Fails, before anything is rendered, if a picture would overwrite an input or cannot be written.
fn check_outputs(arguments: &Arguments, inputs: &Files, target: &Target, files: &[PathBuf]) -> Result<()> {
    let cameras = arguments.views.cameras.as_deref();
    let of_cameras = cameras.map(cameras::files).unwrap_or_default();
    let read = arguments.files(inputs).chain(of_cameras.iter().map(Source::other));
    let json = arguments.file.json.as_deref();
    if target.is_standard {
        return outputs::check(read, json);
    }
    check_folder(&arguments.output, cameras)?;
    let pictures = files.iter().map(PathBuf::as_path);
    outputs::check_distinct(read, pictures.clone().chain(json))?;
    json.iter().try_for_each(|json| outputs::try_output(json))?;
    if let Ok(root) = arguments.output.canonicalize()
        && let Some(file) =
            pictures.clone().find(|file| !atomic::place_of(file).is_some_and(|at| at.starts_with(&root)))
    {
        let what = format!("a symbolic link leads out of {}", arguments.output.display());
        return Err(Error::write(file, std::io::Error::other(what)));
    }
    let folders: BTreeSet<&Path> = pictures.filter_map(Path::parent).collect();
    folders.into_iter().try_for_each(atomic::try_folder)
}

/// Fails if the output folder is that of the cameras or of a project's images, or if it cannot be
/// created.
///
/// Pictures have the names of the cameras' photographs, so in that folder they would overwrite
/// these.
fn check_folder(output: &Path, cameras: Option<&Path>) -> Result<()> {
    if output.metadata().is_ok_and(|output| !output.is_dir()) {
        return Err(Error::write(output, std::io::ErrorKind::NotADirectory.into()));
    }
    let or_current =
        |folder: &'_ Path| if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder.to_owned() };
    let beside = cameras.map(|cameras| match cameras.is_dir() {
        true => vec![cameras.to_owned(), cameras.join("images")],
        false => vec![or_current(cameras.parent().unwrap_or(Path::new("")))],
    });
    if let (Ok(output), Some(beside)) = (output.canonicalize(), beside)
        && beside.iter().any(|beside| beside.canonicalize().is_ok_and(|beside| output == beside))
    {
        return Err(Error::Usage(
            "the pictures would overwrite the cameras' photographs, which have the same names: choose another folder"
                .into(),
        ));
    }
    // The output folder is created, its parent is not.
    let folder = or_current(output.parent().unwrap_or(Path::new("")));
    folder.metadata().map(drop).map_err(|error| Error::write(output, error))
}

/// Returns the number of threads that write frames of `pixels` pixels with `maps`: at least 1.
fn writers(pixels: u64, maps: Maps) -> NonZeroUsize {
    let threads = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let frame = pixels * pixel_bytes(maps);
    let most = usize::try_from(MOST_WAITING / frame.max(1)).unwrap_or(usize::MAX);
    NonZeroUsize::new(threads.min(most)).unwrap_or(NonZeroUsize::MIN)
}

/// Returns one line: the number of pictures and the mean time of each.
fn summary(reports: &Reports, output: &Path) -> String {
    let count = reports.views.len();
    let each = |ms: f64| ms / count.max(1) as f64;
    format!(
        "{}: {count} pictures of {} surfels, {:.1} ms each (rendering {:.1}, at the same time encoding and writing {:.1})",
        named(output),
        reports.views.first().map_or(0, |view| view.report.surfels),
        each(reports.total_ms),
        each(reports.render_ms),
        each(reports.write_ms),
    )
}
