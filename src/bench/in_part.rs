//! Scenes of files of `epsplat lod` that no memory has room for: what a study's cuts take of one is read.

use std::path::Path;

use super::definition::{Definition, SceneEntry};
use super::judge::OF_REFERENCE;
use super::staging::{Staged, present};
use super::view::{cameras, footprint};
use crate::error::{Error, Result};
use crate::io::Input;
use crate::io::ply::Levels;
use crate::plan::RenderOptions;
use crate::progress::Progress;
use crate::render::taken;
use crate::surfels::part;

/// The part of the scene's file that the cuts of all of its configurations take from its cameras: each draws of it what it would of the whole.
pub(super) fn stage(
    definition: &Definition,
    entry: &SceneEntry,
    file: &Path,
    progress: &dyn Progress,
) -> Result<Staged> {
    let path = present(definition, entry, file)?;
    let levels = Levels::open(Input::open(&path, None)?)?.ok_or_else(|| {
        Error::malformed(
            &path,
            "it has no levels of detail that can be read in parts: epsplat lod makes a file that has",
        )
    })?;
    let cameras = cameras(entry.size.unwrap_or(definition.size), entry, &part::nothing(&levels))?;
    let options: Vec<RenderOptions> =
        definition.configs_of(entry).map(|config| judged(definition.settings(config, entry))).collect();
    let views: Vec<_> =
        cameras.iter().flat_map(|camera| options.iter().map(move |options| (camera, options))).collect();
    let (scene, _) = taken(&levels, &views, |_| Ok(()), progress)?;
    // Of the surfels that were read.
    let footprint_px = footprint(&scene, &cameras);
    Ok(Staged { scene, cameras, surface: None, dressed: false, footprint_px })
}

/// What a configuration draws, and what the reference that it is compared with draws beside that: the reference may take one sample where the configuration takes
/// several, and backs that the configuration leaves out.
fn judged(options: RenderOptions) -> RenderOptions {
    RenderOptions { maps: options.maps.and(&OF_REFERENCE), ..options }
}
