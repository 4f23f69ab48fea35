//! `epsplat render --lod`: levels of detail for a scene that comes without.

use epsplat::plan::RenderOptions as Settings;
use epsplat::scene::Scene;
use epsplat::surfels::hierarchy;
use epsplat::{Error, Result};

use super::super::note;
use super::super::progress::Bars;

/// Gives `scene` levels of detail if a picture with `settings` asks for some and it has none.
///
/// # Errors
/// [`Error::Usage`] for a scene that has none to give.
pub(super) fn made(mut scene: Scene, settings: &Settings, bars: &Bars) -> Result<Scene> {
    if settings.detail.is_finest() || scene.hierarchy.is_some() {
        return Ok(scene);
    }
    if scene.surfels.is_empty() {
        return Err(Error::Usage(
            "levels of detail are of surfels, and there are none: leave --lod and --splats out".into(),
        ));
    }
    (scene, _) = hierarchy::build(scene, bars)?;
    note("levels of detail are made for this picture: `epsplat lod` keeps them in a file");
    Ok(scene)
}
