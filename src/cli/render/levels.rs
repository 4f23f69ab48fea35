//! `epsplat render --lod`: builds levels of detail for a scene that has none.

use epsplat::plan::RenderOptions as Settings;
use epsplat::scene::Scene;
use epsplat::surfels::hierarchy;
use epsplat::{Error, Result};

use super::super::note;
use super::super::progress::Bars;

/// Builds levels of detail for `scene` if `settings` need them and it has none.
///
/// # Errors
/// [`Error::Usage`] for a scene without surfels.
pub(super) fn made(mut scene: Scene, settings: &Settings, bars: &Bars) -> Result<Scene> {
    if settings.detail.is_finest() || scene.hierarchy.is_some() {
        return Ok(scene);
    }
    if scene.surfels.is_empty() {
        return Err(Error::Usage(
            "--lod and --splats need surfels, and there are none: leave these options out".into(),
        ));
    }
    (scene, _) = hierarchy::build(scene, bars)?;
    note("levels of detail are built for this run only: `epsplat lod` writes them to a file");
    Ok(scene)
}
