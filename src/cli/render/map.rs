//! `epsplat render --pixel-size`: renders a map with its place on the earth.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use epsplat::io::atomic::write_whole;
use epsplat::io::images::tiff::{self, Layout};
use epsplat::io::place::{GeoKeys, Place};
use epsplat::low_level::scene::camera::MAX_PIXELS;
use epsplat::{Error, Files, Frame, Grid, Progress, Renderer, Report, Result, Scene, Survey};
use serde::Serialize;

use super::super::progress::Bars;
use super::super::{note, outputs, write_json};
use super::Arguments;
use super::output::{named, note_overflows, summary};
use super::target::Target;

/// The JSON report of a map.
#[derive(Serialize)]
struct Outcome<'a> {
    #[serde(flatten)]
    report: &'a Report,
    grid: &'a Grid,
    /// Number of images that were rendered and joined.
    tiles: u64,
    /// A hash of the colour's and of each map's bits; None for a map that was never whole in
    /// memory.
    #[serde(skip_serializing_if = "Option::is_none")]
    bits: Option<BTreeMap<&'static str, String>>,
}

/// The most pixels in a row or column of a JPEG.
const LONGEST_JPEG: u32 = 65_535;

/// Renders a map.
pub(super) fn run(arguments: &Arguments, target: &Target) -> Result<()> {
    let files = Files::new(&arguments.inputs, &arguments.scene.input)?;
    Renderer::check(&files, &arguments.scene, &arguments.options, &arguments.device)?;
    let world = world_file(arguments, target);
    let written = [&arguments.output].into_iter().chain(&world).chain(&arguments.file.json);
    outputs::check(arguments.files(&files), written)?;
    let keys = keys(&files)?;
    let scene = Scene::of_files(files, &arguments.scene)?;

    let bars = Bars::new();
    let mut renderer = Renderer::new(&scene, &arguments.options, &arguments.device, &bars)?;
    let grid = renderer.grid(&arguments.camera)?;
    if target.format.name() == "jpg" && grid.columns.max(grid.rows) > LONGEST_JPEG {
        let what = format!(
            "a JPEG has at most {LONGEST_JPEG} pixels in a row, and this map has {}x{}",
            grid.columns, grid.rows
        );
        return Err(Error::Usage(format!("{what}: write a .tif, or give a larger --pixel-size")));
    }
    let place = Place { left: grid.left, top: grid.top, pixel: grid.pixel, keys };
    describe(&grid);
    let streams = target.format.name() == "tif" && !target.is_standard;
    let (survey, bits) = if streams {
        in_bands(arguments, target, (&grid, &place), &mut renderer, &bars)?
    } else {
        whole(arguments, target, (&grid, &place), &mut renderer, &bars)?
    };
    if let Some(path) = &world {
        write_whole(path, |file| std::io::Write::write_all(file, place.world_file().as_bytes()))?;
    }
    tell(arguments, &grid, &survey, bits)
}

/// Prints the size and the corners of a map.
fn describe(grid: &Grid) {
    let Grid { left, top, pixel, columns, rows, .. } = *grid;
    let (right, bottom) = (left + f64::from(columns) * pixel, top - f64::from(rows) * pixel);
    note(&format!("map: {columns}x{rows} pixels of {pixel}, --bounds {left},{bottom},{right},{top}"));
}

/// Prints notes and the summary or JSON of a map.
fn tell(
    arguments: &Arguments,
    grid: &Grid,
    survey: &Survey,
    bits: Option<BTreeMap<&'static str, String>>,
) -> Result<()> {
    let Survey { report, tiles, unseen } = survey;
    note_overflows(report);
    unseen.iter().for_each(|unseen| note(&unseen.sentence()));
    match &arguments.file.json {
        Some(path) => write_json(path, &Outcome { report, grid, tiles: *tiles, bits }),
        None => {
            note(&match tiles {
                1 => summary(report, &arguments.output),
                _ => format!("{}: {tiles} images joined, {:.1} ms", named(&arguments.output), report.total_ms),
            });
            Ok(())
        }
    }
}

/// Returns the coordinate system of the inputs, empty with a note if it is not known.
fn keys(files: &Files) -> Result<GeoKeys> {
    let keys = files.geo_keys()?;
    if keys.is_none() {
        note(
            "the inputs name no common coordinate system with GeoTIFF keys or an EPSG code: the map has its position without one",
        );
    }
    Ok(keys.unwrap_or_default())
}

/// Returns the path of the world file beside the image, if the format has one.
fn world_file(arguments: &Arguments, target: &Target) -> Option<PathBuf> {
    let extension = target.format.world().filter(|_| !target.is_standard)?;
    Some(arguments.output.with_extension(extension))
}

type Made = (Survey, Option<BTreeMap<&'static str, String>>);

/// Renders a map and writes its bands as they come.
fn in_bands(
    arguments: &Arguments,
    target: &Target,
    (grid, place): (&Grid, &Place),
    renderer: &mut Renderer,
    progress: &dyn Progress,
) -> Result<Made> {
    let content = target.content();
    let layout = Layout { width: grid.columns, height: grid.rows, content, place: Some(place) };
    // The error of a frame, which the writer can pass on only as text.
    let (mut failed, mut made) = (None, None);
    let mut bits = None;
    let written = write_whole(&arguments.output, |file| {
        tiff::write(file, &layout, |rows| {
            let survey = renderer.map(grid, progress, |band| {
                bits = (band.height == grid.rows).then(|| band.hashes());
                rows(&band).map_err(|error| Error::write(&arguments.output, error))
            });
            survey.map(|survey| made = Some(survey)).map_err(|error| {
                failed = Some(error);
                std::io::Error::other("a frame failed")
            })
        })
    });
    match (failed, written, made) {
        (Some(error), ..) | (None, Err(error), _) => Err(error),
        (None, Ok(()), Some(survey)) => Ok((survey, bits)),
        (None, Ok(()), None) => Err(Error::Usage("a map needs at least one pixel".into())),
    }
}

/// Renders a map whole, and writes it.
fn whole(
    arguments: &Arguments,
    target: &Target,
    (grid, place): (&Grid, &Place),
    renderer: &mut Renderer,
    progress: &dyn Progress,
) -> Result<Made> {
    let Grid { columns, rows, .. } = *grid;
    if u64::from(columns) * u64::from(rows) > MAX_PIXELS {
        return Err(Error::Usage(format!(
            "a map of {columns}x{rows} has more than {MAX_PIXELS} pixels, which only a .tif file may have: give one, a larger \
             --pixel-size, or --bounds"
        )));
    }
    let mut all: Option<Frame> = None;
    let survey = renderer.map(grid, progress, |band| {
        match &mut all {
            Some(all) => all.append(band),
            None => all = Some(band),
        }
        Ok(())
    })?;
    let frame = all.unwrap_or_else(|| Frame::of_colors(0, 0, Vec::new()));
    target.write_map(Path::new(&arguments.output), &frame, Some(place))?;
    Ok((survey, Some(frame.hashes())))
}
