//! `epsplat render --cameras`: a picture for each camera. While one is rendered, earlier ones are
//! encoded and written.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Instant;

use epsplat::frame::Frame;
use epsplat::io::write_behind::write_behind;
use epsplat::io::{atomic, cameras};
use epsplat::passes::unseen::{Unseen, is_empty};
use epsplat::plan::RenderOptions as Settings;
use epsplat::render::{Backend, Renderer, Report, render};
use epsplat::scene::{Camera, Maps, Scene};
use epsplat::{Error, Progress, Result};
use serde::Serialize;

use super::super::outputs::Source;
use super::super::progress::Bars;
use super::super::{note, outputs, write_json};
use super::options::{for_scene, settings};
use super::output::{Format, note_cut, note_overflows};
use super::parts::{Part, Parts, Read};
use super::scene::scene;
use super::view::{DEFAULT_SIZE, View};
use super::{Arguments, backend, levels};

/// Limit of host memory for frames that wait for a writer or are being written, bytes.
///
/// A single larger frame is still written.
const MOST_WAITING: u64 = 1 << 30;

/// Returns the host memory of a frame while it is encoded and written, bytes per pixel: 48, plus 8
/// for each value of a map.
pub(super) fn pixel_bytes(maps: Maps) -> u64 {
    48 + 8 * maps.iter().map(|map| map.width() as u64).sum::<u64>()
}

/// The JSON report of a view's picture.
#[derive(Serialize)]
struct Picture {
    file: PathBuf,
    #[serde(flatten)]
    report: Report,
    /// Counts of what was read; None if the inputs were read whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    read: Option<Read>,
    /// Milliseconds of encoding and writing, while other pictures were rendered.
    write_ms: f64,
}

#[derive(Serialize)]
struct Reports {
    views: Vec<Picture>,
    /// Number of threads that encoded and wrote.
    writers: usize,
    /// Milliseconds of rendering, summed over all views.
    render_ms: f64,
    /// Milliseconds of encoding and writing, summed over all views.
    write_ms: f64,
    /// Milliseconds from the scene in host memory to the last written picture. For files that are
    /// read in part they start when the overview is in memory.
    total_ms: f64,
}

/// The scene of the views.
enum Shown<'a> {
    /// A scene that all views share.
    Whole(&'a Scene, Settings, Box<Renderer<&'a Scene, &'a Backend>>),
    /// Files that are read in part for each view.
    Parts {
        parts: Box<Parts>,
        settings: Settings,
        backend: &'a Backend,
        /// True once the notes of the first view are printed: the others' are not.
        told: bool,
        /// Number of frames in memory at once.
        frames: u64,
    },
}

/// A view's frame.
struct Shot {
    frame: Frame,
    report: Report,
    read: Option<Read>,
    /// Reason why the frame is empty, if it is.
    unseen: Option<Unseen>,
}

impl Shown<'_> {
    fn picture(&mut self, arguments: &Arguments, view: &View) -> Result<Shot> {
        let unseen = |scene: &Scene, camera: &Camera, settings: &Settings, frame: &Frame| {
            is_empty(frame, settings).then(|| Unseen::of(scene, camera, settings))
        };
        match self {
            Self::Whole(scene, settings, renderer) => {
                let (camera, _) = view.camera(scene, Camera::default_near(scene))?;
                let (frame, report) = renderer.frame(&camera, &())?;
                let unseen = unseen(scene, &camera, settings, &frame);
                Ok(Shot { frame, report, read: None, unseen })
            }
            Self::Parts { parts, settings, backend, told, frames } => {
                let (camera, _) = view.camera(parts.overview(), Camera::default_near(parts.overview()))?;
                let Part { made: (scene, preparation), settings, read } =
                    parts.scene(arguments, (&camera, *frames), settings, &())?;
                if !std::mem::replace(told, true) {
                    preparation.notes().iter().for_each(|line| note(line));
                }
                let (frame, report) = render(&scene, &camera, &settings, backend, &())?;
                let unseen = unseen(&scene, &camera, &settings, &frame);
                Ok(Shot { frame, report, read: Some(read), unseen })
            }
        }
    }
}

/// Renders a picture for each camera of the set at `path`.
pub(super) fn run(arguments: &Arguments, path: &Path) -> Result<()> {
    let maps = !arguments.options.maps.aov.is_empty();
    let format = arguments.camera.format.unwrap_or(if maps { Format::Exr } else { Format::Png });
    let settings = settings(arguments, format)?;
    let views = views(arguments, path, format)?;
    check_outputs(arguments, path, &views)?;
    let backend = backend(arguments)?;

    let bars = Bars::new();
    let parts = Parts::of(arguments, &settings, &bars)?;
    let (scene, settings) = match &parts {
        Some(_) => (Scene::default(), settings),
        None => {
            let (scene, preparation) = scene(arguments, &bars)?;
            preparation.notes().iter().for_each(|line| note(line));
            let settings = for_scene(arguments, settings, &scene)?;
            (levels::made(scene, &settings, &bars)?, settings)
        }
    };
    let largest = views.iter().map(|(_, view)| view.pixels()).max().unwrap_or(1);
    let writers = writers(largest, settings.maps);
    let mut shown = match parts {
        Some(parts) => {
            let frames = writers.get() as u64 + 1;
            Shown::Parts { parts: Box::new(parts), settings: settings.clone(), backend: &backend, told: false, frames }
        }
        None => Shown::Whole(&scene, settings.clone(), Box::new(Renderer::new(&scene, &settings, &backend)?)),
    };
    let start = Instant::now();
    bars.begin("rendering views", views.len() as u64);
    // The first empty picture with the reason, and the number of empty pictures.
    let empty = RefCell::new((None, 0));
    let frames = views.iter().map(|(file, view)| {
        let made = shown.picture(arguments, view).map_err(|error| error.of_view(file))?;
        if let Some(unseen) = &made.unseen {
            let (first, count) = &mut *empty.borrow_mut();
            first.get_or_insert_with(|| (file, unseen.sentence()));
            *count += 1;
        }
        Ok((file, made))
    });
    let pictures = write_behind(writers, frames, |(file, made)| {
        let start = Instant::now();
        if let Some(folder) = file.parent() {
            std::fs::create_dir_all(folder).map_err(|error| Error::write(file, error))?;
        }
        let Shot { frame, report, read, .. } = made;
        format.write(file, &frame)?;
        bars.advance(1);
        Ok(Picture { file: file.clone(), report, read, write_ms: start.elapsed().as_secs_f64() * 1e3 })
    });
    bars.end();
    let pictures = pictures?;
    if let (Some((first, unseen)), count) = empty.into_inner() {
        note(&format!("{} ({}, the first of {count} empty pictures)", unseen, first.display()));
    }
    tell(arguments, pictures, writers, start)
}

/// Prints notes and the summary or JSON of all pictures. `start` is when the scene was in memory.
fn tell(arguments: &Arguments, views: Vec<Picture>, writers: NonZeroUsize, start: Instant) -> Result<()> {
    views.iter().for_each(|view| note_overflows(&view.report));
    note_cut(views.iter().map(|view| &view.report), arguments.options.levels.splats);
    let reports = Reports {
        writers: writers.get(),
        render_ms: views.iter().map(|view| view.report.total_ms).sum(),
        write_ms: views.iter().map(|view| view.write_ms).sum(),
        total_ms: start.elapsed().as_secs_f64() * 1e3,
        views,
    };
    match &arguments.json {
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
/// [`Error::Malformed`] if a lens is distorted, unless `--ignore-distortion` is given, or an error
/// of a view that the arguments contradict.
fn views(arguments: &Arguments, path: &Path, format: Format) -> Result<Vec<(PathBuf, View)>> {
    let cameras = cameras::read(path, arguments.camera.size.unwrap_or(DEFAULT_SIZE))?;
    let distorted = cameras.iter().filter(|camera| camera.distortion.is_some());
    if let Some((first, (name, value))) = distorted.clone().find_map(|camera| Some((&camera.name, camera.distortion?)))
    {
        if !arguments.camera.ignore_distortion {
            return Err(Error::malformed(
                path,
                format!(
                    "the lens of {first} is distorted ({name} = {value}), which is not rendered: undistort the pictures, or give \
                     --ignore-distortion"
                ),
            ));
        }
        note(&format!("the lens distortion of {} cameras is left out", distorted.count()));
    }
    let view = |camera: cameras::NamedCamera| {
        let file = arguments.output.join(format!("{}.{}", camera.name, format.extension()));
        let view = View::of_file(arguments, camera.camera, path).map_err(|error| error.of_view(&file))?;
        Ok((file, view))
    };
    cameras.into_iter().map(view).collect()
}

/// Fails, before anything is rendered, if a picture would overwrite an input or cannot be written.
fn check_outputs(arguments: &Arguments, cameras: &Path, views: &[(PathBuf, View)]) -> Result<()> {
    check_folder(&arguments.output, cameras)?;
    let of_colmap = ["cameras.txt", "images.txt"].map(|name| cameras.join(name));
    let read = arguments.files().chain([Source::other(cameras)]).chain(of_colmap.iter().map(Source::other));
    let pictures = views.iter().map(|(file, _)| file.as_path());
    outputs::check_distinct(read, pictures.clone().chain(arguments.json.as_deref()))?;
    arguments.json.iter().try_for_each(|json| outputs::try_output(json))?;
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

/// Fails if the output folder is the cameras' own or cannot be created.
///
/// Pictures are named after the cameras' photographs and would overwrite them there.
fn check_folder(output: &Path, cameras: &Path) -> Result<()> {
    if output.metadata().is_ok_and(|output| !output.is_dir()) {
        return Err(Error::write(output, std::io::ErrorKind::NotADirectory.into()));
    }
    let or_current =
        |folder: &'_ Path| if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder.to_owned() };
    let beside = if cameras.is_dir() { cameras } else { cameras.parent().unwrap_or(Path::new("")) };
    if let (Ok(output), Ok(beside)) = (output.canonicalize(), or_current(beside).canonicalize())
        && output == beside
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

/// Returns the number of threads that write frames of so many pixels: at least 1.
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
        output.display(),
        reports.views.first().map_or(0, |view| view.report.surfels),
        each(reports.total_ms),
        each(reports.render_ms),
        each(reports.write_ms),
    )
}
