//! `epsplat render --part`: draws one part of a picture for `epsplat merge`.

use std::path::Path;

use epsplat::io::images::ImageFormat;

use epsplat::{Error, Files, Part, Renderer, Result, Scene, Share, View, merge_files};

use super::super::outputs::Source;
use super::super::progress::Bars;
use super::super::{note, outputs};
use super::Arguments;
use super::target::STANDARD;

/// Draws the part `share`.
pub(super) fn run(arguments: &Arguments, share: Share) -> Result<()> {
    check(arguments)?;
    let files = Files::new(&arguments.inputs, &arguments.scene.input)?;
    Renderer::check_part(&files, &arguments.scene, &arguments.options, &arguments.device)?;
    let within = &arguments.part.within;
    outputs::check(arguments.files(&files).chain(within.iter().map(Source::other)), [&arguments.output])?;
    let view = View::new(&arguments.camera)?;
    // Depths are read first, so that a missing one ends the run before anything is drawn.
    let within = if within.is_empty() { None } else { Some(merge_files(within)?) };
    within.as_ref().map_or(Ok(()), Part::check_whole)?;
    let scene = Scene::of_files(files, &arguments.scene)?;

    let bars = Bars::new();
    let renderer = Renderer::new(&scene, &arguments.options, &arguments.device, &bars)?;
    let part = renderer.part(&view, share, within.as_ref(), &bars)?;
    let bytes = part.bytes();
    part.write(&arguments.output)?;
    let holds = if part.holds_depths() { "nearest depths" } else { "sums" };
    note(&format!("{}: {holds} of part {share}, {} bytes", arguments.output.display(), bytes.len()));
    Ok(())
}

/// Rejects what `epsplat merge` does, and what has no parts.
fn check(arguments: &Arguments) -> Result<()> {
    let Arguments { output, views, camera, file, .. } = arguments;
    let usage = |what: &str| Err(Error::Usage(what.to_owned()));
    if views.cameras.is_some() || views.turntable.is_some() {
        return usage("--part draws one view: leave --cameras and --turntable out, and draw the parts of each view");
    }
    if camera.pixel_size.is_some() {
        return usage("--part draws pictures, not maps with a place on the earth: leave --pixel-size out");
    }
    if file.format.is_some() || file.depth_scale.is_some() {
        return usage("a part is no image: give --format and --depth-scale to epsplat merge");
    }
    if file.json.is_some() {
        return usage("a part has no report: give --json to epsplat merge");
    }
    if output == Path::new(STANDARD) {
        return usage("a part is a file for other processes: name it, as in -o depth-1.part");
    }
    if ImageFormat::of_path(output).is_ok() {
        let path = output.display();
        return usage(&format!("{path} is the name of an image, and a part is none: name it as in -o depth-1.part"));
    }
    Ok(())
}
