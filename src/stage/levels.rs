//! Builds levels of detail for a scene that has none.

use crate::error::{Error, Result};
use crate::plan::Settings;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::surfels::hierarchy;

/// Returns true if a picture with `settings` needs levels of detail and `scene` has none.
pub(super) fn lack(scene: &Scene, settings: &Settings) -> bool {
    !settings.detail.is_finest() && scene.hierarchy.is_none()
}

/// Builds levels of detail for `scene`.
///
/// # Errors
/// [`Error::Usage`] for a scene without surfels.
pub(super) fn made(scene: Scene, progress: &dyn Progress) -> Result<Scene> {
    if scene.surfels.is_empty() {
        return Err(Error::Usage(
            "--lod and --splats need surfels, and there are none: leave these options out".into(),
        ));
    }
    let (scene, _) = hierarchy::build(scene, progress)?;
    progress.note("levels of detail are built for this run only: `epsplat lod` writes them to a file");
    Ok(scene)
}
