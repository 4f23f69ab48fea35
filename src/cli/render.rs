//! `epsplat render`: renders files to an image with its maps, or to one image for each camera.

pub(super) mod arguments;
mod dealt;
mod map;
mod output;
mod part;
mod ranks;
pub(super) mod target;
mod views;

use std::collections::BTreeMap;

use epsplat::low_level::network::mpi::Mpi;
use epsplat::{Files, Picture, ReadReport, Renderer, Report, Result, Scene, View, ViewReport};
use serde::Serialize;

pub use self::arguments::Arguments;
use self::output::{note_cut, note_overflows, summary};
use self::target::Target;
use super::progress::Bars;
use super::{note, outputs, write_json};

pub fn run(arguments: &Arguments) -> Result<()> {
    if let Some(share) = arguments.part.part {
        return part::run(arguments, share);
    }
    if let Some(mpi) = Mpi::join()? {
        return ranks::run(arguments, mpi);
    }
    if arguments.views.cameras.is_some() || arguments.views.turntable.is_some() {
        let target = Target::of_many(arguments)?;
        return target.closed_is_done(views::run(arguments, &target));
    }
    let target = Target::of_one(arguments)?;
    let render = if arguments.camera.pixel_size.is_some() { map::run } else { one };
    target.closed_is_done(render(arguments, &target))
}

/// Renders a single picture.
fn one(arguments: &Arguments, target: &Target) -> Result<()> {
    let files = Files::new(&arguments.inputs, &arguments.scene.input)?;
    Renderer::check(&files, &arguments.scene, &arguments.options, &arguments.device)?;
    outputs::check(arguments.files(&files), [&arguments.output].into_iter().chain(&arguments.file.json))?;
    let view = View::new(&arguments.camera)?;
    let scene = Scene::of_files(files, &arguments.scene)?;

    let bars = Bars::new();
    let mut renderer = Renderer::ahead(&scene, &arguments.options, &arguments.device, &view, &bars)?;
    let Picture { frame, report, view, read, unseen, .. } = renderer.frame(&view, &bars)?;
    note_overflows(&report);
    note_cut([&report], arguments.options.levels.splats);
    unseen.iter().for_each(|unseen| note(&unseen.sentence()));
    target.write(&arguments.output, &frame)?;
    match &arguments.file.json {
        Some(path) => write_json(path, &Outcome { report: &report, view, read, bits: frame.hashes() }),
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
    view: ViewReport,
    /// Numbers of nodes, points and bytes that were read; None if the inputs were read whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    read: Option<ReadReport>,
    /// A hash of the colour's and of each map's bits ([`Frame::hashes`](epsplat::Frame::hashes)).
    bits: BTreeMap<&'static str, String>,
}
