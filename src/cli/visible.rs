//! `epsplat visible`: writes the points that cameras see.

use std::path::{Path, PathBuf};

use clap::Args;
use epsplat::io::cameras;
use epsplat::io::ply::{self, Column};
use epsplat::options::parse::size;
use epsplat::options::{DeviceOptions, Epsilon, InputOptions, LimitOptions, RenderOptions, SurfelOptions};
use epsplat::{CameraOptions, Files, Result, Scene, SceneOptions, View};
use serde::Serialize;

use super::cameras::LensArguments;
use super::inputs::help_of_all;
use super::outputs::Source;
use super::progress::Bars;
use super::{note, outputs, write_json};

/// Write the points that cameras see as PLY, each with the number of its views.
///
/// A camera sees a point that lies in its image if no surface lies in front of it by more than
/// epsilon. All inputs make the surfaces, as in `epsplat render`; their depth is that of the pixel
/// that the point falls on. Points keep their order and their coordinates, and the attribute
/// `views` is the number of cameras that see the point.
#[derive(Args)]
#[command(after_help = "Examples:\n  epsplat visible scan.laz --cameras transforms.json -o seen.ply\n  \
    epsplat visible cloud.ply --cameras project -o seen.ply --least 3 --scale 0.25 --json seen.json")]
pub struct Arguments {
    #[arg(required = true, help = help_of_all("Point clouds, or meshes, whose vertices are looked at"))]
    inputs: Vec<PathBuf>,
    /// Cameras: transforms.json, camera_path.json, cameras.json, a list, or COLMAP's folder
    #[arg(long, value_name = "PATH")]
    cameras: PathBuf,
    /// Size of the images of cameras that have none, in pixels [default: 1024x1024]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    /// Output file: .ply
    #[arg(short, long)]
    output: PathBuf,
    /// Depth tolerance within which a point belongs to the surface: rel:E, abs:E, ray:E or radius:K
    ///
    /// The forms are those of `epsplat render` [default: radius:1,rel:0.01]
    #[arg(long)]
    epsilon: Option<Epsilon>,
    /// Smallest number of views that a point is written for
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    least: u32,
    /// Write the number of points of each view as JSON, to a file or - for standard output
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    #[command(flatten)]
    lens: LensArguments,
    #[command(flatten)]
    reading: InputOptions,
    #[command(flatten)]
    limits: LimitOptions,
    #[command(flatten)]
    device: DeviceOptions,
}

/// A view in the JSON report.
#[derive(Serialize)]
struct Seen {
    /// The name of the camera's image.
    name: String,
    /// The number of points that the view sees.
    points: u64,
}

#[derive(Serialize)]
struct Report {
    /// The number of points of all inputs.
    points: usize,
    /// The number of points that are written.
    written: usize,
    views: Vec<Seen>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    ply::check_extension(&arguments.output)?;
    let files = Files::new(&arguments.inputs, &arguments.reading)?;
    let read = cameras::files(&arguments.cameras);
    let read = read.iter().map(Source::other).chain([Source::other(&arguments.cameras)]);
    outputs::check(Source::of(&files).chain(read), [&arguments.output].into_iter().chain(&arguments.json))?;
    let (names, views) = views(arguments)?;
    let bars = Bars::new();
    let surfels = SurfelOptions { limits: arguments.limits, ..SurfelOptions::default() };
    let scene = SceneOptions { input: arguments.reading.clone(), surfels, ..SceneOptions::default() };
    let scene = Scene::from_points(files.read(&bars)?, &scene);
    let mut options = RenderOptions::default();
    options.surface.epsilon = arguments.epsilon;
    let visible = scene.visible(&views, &options, &arguments.device, &bars).map_err(|error| files.named(error))?;
    let inputs = scene.points(&bars)?;
    let (points, counts) = visible.of_points(&inputs, arguments.least)?;
    ply::write_points_with(&arguments.output, &points, &[Column { name: "views", values: &counts }], &bars)?;
    let all: usize = inputs.iter().map(|points| points.positions.len()).sum();
    if visible.points.iter().all(|count| *count == 0) {
        note("warning: no view sees any of the points: the cameras may have other coordinates, or look elsewhere");
    }
    let written = points.positions.len();
    if let Some(path) = &arguments.json {
        let views = names.into_iter().zip(visible.points).map(|(name, points)| Seen { name, points }).collect();
        write_json(path, &Report { points: all, written, views })?;
    }
    let (count, output) = (views.len(), arguments.output.display());
    let of = if count == 1 { "1 view".into() } else { format!("{count} views") };
    note(&format!("{output}: {written} of {all} points are seen by at least {} of {of}", arguments.least));
    Ok(())
}

/// Returns the names and views of all cameras.
fn views(arguments: &Arguments) -> Result<(Vec<String>, Vec<View>)> {
    let options = CameraOptions { size: arguments.size, ..CameraOptions::default() };
    let cameras = arguments.lens.read(&arguments.cameras, arguments.size)?;
    let view = |camera: cameras::NamedCamera| {
        let view = View::of_file(&options, camera.camera, &arguments.cameras, arguments.lens.scale)
            .map_err(|error| error.of_view(Path::new(&camera.name)))?;
        Ok((camera.name, view))
    };
    let views: Vec<(String, View)> = cameras.into_iter().map(view).collect::<Result<_>>()?;
    Ok(views.into_iter().unzip())
}
