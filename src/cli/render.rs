//! `epsplat render`: renders files to an image with its maps, or to one image for each camera.

mod arguments;
mod levels;
mod memory;
mod octrees;
mod options;
mod output;
mod parts;
mod scene;
mod tree;
mod view;
mod views;

use epsplat::gpu::Gpu;
use epsplat::passes::unseen::{Unseen, is_empty};
use epsplat::plan::RenderOptions as Settings;
use epsplat::render::{Backend, Report, render};
use epsplat::scene::Camera;
use epsplat::{Error, Result};
use serde::Serialize;

pub use self::arguments::Arguments;
use self::options::{for_scene, settings};
use self::output::{Format, note_cut, note_overflows, summary};
use self::parts::{Part, Parts, Read};
use self::scene::{Made, scene};
use self::view::{Seen, ToldView, View};
use super::progress::Bars;
use super::{note, outputs, write_json};

pub fn run(arguments: &Arguments) -> Result<()> {
    match &arguments.camera.cameras {
        Some(path) => views::run(arguments, path),
        None => one(arguments),
    }
}

/// Renders a single picture.
fn one(arguments: &Arguments) -> Result<()> {
    let format = Format::of(&arguments.output)?;
    let settings = settings(arguments, format)?;
    outputs::check(arguments.files(), [&arguments.output].into_iter().chain(&arguments.json))?;
    let view = View::of(arguments)?;
    let backend = backend(arguments)?;

    let bars = Bars::new();
    let Staged { made: (scene, preparation), settings, camera, seen, read } =
        staged(arguments, settings, &view, &bars)?;
    let view = ToldView::new(&camera, &seen, &scene, preparation.guessed_up);
    note(&view.sentence());
    view.warning().iter().for_each(|warning| note(warning));
    read.iter().for_each(|read| note(&read.sentence()));
    let (frame, report) = render(&scene, &camera, &settings, &backend, &bars)?;
    note_overflows(&report);
    note_cut([&report], arguments.options.levels.splats);
    if is_empty(&frame, &settings) {
        note(&Unseen::of(&scene, &camera, &settings).sentence());
    }
    format.write(&arguments.output, &frame)?;
    match &arguments.json {
        Some(path) => write_json(path, &Outcome { report: &report, view, read }),
        None => {
            note(&summary(&report, &arguments.output));
            Ok(())
        }
    }
}

/// The JSON report of a single picture.
#[derive(Serialize)]
struct Outcome<'a> {
    #[serde(flatten)]
    report: &'a Report,
    view: ToldView,
    /// Counts of what was read; None if the inputs were read whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    read: Option<Read>,
}

/// Everything needed to render a single picture.
struct Staged {
    made: Made,
    settings: Settings,
    camera: Camera,
    seen: Seen,
    /// Counts of what was read; None if the inputs were read whole.
    read: Option<Read>,
}

/// Reads the scene of a single picture: of files with levels of detail only the needed nodes.
fn staged(arguments: &Arguments, settings: Settings, view: &View, bars: &Bars) -> Result<Staged> {
    let told = |(_, preparation): &Made| preparation.notes().iter().for_each(|line| note(line));
    if let Some(mut parts) = Parts::of(arguments, &settings, bars)? {
        let (camera, seen) = view.camera(parts.overview(), Camera::default_near(parts.overview()))?;
        let Part { made, settings, read } = parts.scene(arguments, (&camera, 1), &settings, bars)?;
        told(&made);
        return Ok(Staged { made, settings, camera, seen, read: Some(read) });
    }
    let made = scene(arguments, bars)?;
    told(&made);
    let (scene, preparation) = made;
    let settings = for_scene(arguments, settings, &scene)?;
    let scene = levels::made(scene, &settings, bars)?;
    let (camera, seen) = view.camera(&scene, Camera::default_near(&scene))?;
    Ok(Staged { made: (scene, preparation), settings, camera, seen, read: None })
}

fn backend(arguments: &Arguments) -> Result<Backend> {
    if arguments.is_reference() {
        if arguments.device.adapter.is_some() {
            return Err(Error::Usage("--backend reference uses no adapter: leave --adapter out".into()));
        }
        return Ok(Backend::Reference);
    }
    match Gpu::open(arguments.device.adapter.as_deref()) {
        Ok(gpu) => {
            note(&format!("rendering on {} ({}, {})", gpu.adapter.name, gpu.adapter.api, gpu.adapter.kind));
            let gpu = if arguments.device.memory.is_some() { gpu.with_buffer_limit(memory::BUFFER) } else { gpu };
            Ok(Backend::gpu(gpu))
        }
        Err(Error::NoAdapter(why)) if arguments.backend().is_none() && arguments.device.adapter.is_none() => {
            note(&format!("rendering with the f64 reference on the processor: {why}"));
            Ok(Backend::Reference)
        }
        Err(error) => Err(error),
    }
}
