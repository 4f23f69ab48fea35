//! The settings of a picture, from the arguments and the scene.

use epsplat::options::Suggested;
use epsplat::plan::{RenderOptions as Settings, check};
use epsplat::scene::{Blend, Colors, Composite, Scene};
use epsplat::{Error, Result};

use super::super::note;
use super::Arguments;
use super::output::Format;

/// Returns the settings of a scene that has no Gaussians, before anything is read.
pub(super) fn settings(arguments: &Arguments, format: Format) -> Result<Settings> {
    if !arguments.options.maps.aov.is_empty() && format == Format::Png {
        return Err(Error::Usage("a PNG holds no maps: use an .exr output with --aov".into()));
    }
    let settings = settled(arguments, false)?;
    if arguments.surfels.textures.is_empty() {
        return Ok(settings);
    }
    if arguments.options.points.facing.is_some() {
        return Err(Error::Usage("--facing leaves points no plane to paint: leave it or --texture out".into()));
    }
    // In transparent pictures surfels have their texture's mean colour (scene.rs), so that the
    // check is that of an opaque picture.
    let opaque = Settings { composite: Composite::Opaque, ..settings.clone() };
    check::textured(&opaque, arguments.is_reference())?;
    Ok(settings)
}

/// Returns the settings for a scene. Gaussians are drawn by the rules of their training, unless the
/// options say otherwise.
///
/// # Errors
/// [`Error::Usage`] for options that cannot be used with Gaussians.
pub(super) fn for_scene(arguments: &Arguments, settings: Settings, scene: &Scene) -> Result<Settings> {
    if settings.blend == Blend::Nearest && matches!(scene.colors, Colors::Linear(_)) {
        note("--blend nearest stores 8-bit colours: finer ones are rounded, and values above white are clamped");
    }
    if !scene.encoded {
        return Ok(settings);
    }
    let settings = settled(arguments, true)?;
    // --facing, the rasteriser and --blend nearest never draw the Gaussians' own kernel.
    let has_kernel = settings.facing.is_none() && settings.raster.is_none() && settings.blend != Blend::Nearest;
    if has_kernel && arguments.options.replaces_gaussians() {
        note("warning: --kernel takes the place of the Gaussians' own: leave it out for pictures as they were trained");
    }
    Ok(settings)
}

fn settled(arguments: &Arguments, gaussians: bool) -> Result<Settings> {
    let suggested = Suggested {
        gaussians,
        shading: None,
        views: arguments.camera.cameras.is_some(),
        one_input: arguments.is_one_file(),
    };
    let settings = arguments.options.settle(arguments.backend(), suggested);
    arguments.options.check(arguments.backend(), &settings)?;
    Ok(settings)
}
