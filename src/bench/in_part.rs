//! Prepares scenes from files of `epsplat lod` that do not fit in memory: only the cuts that a
//! study draws are read.

use std::path::Path;

use super::definition::{Definition, SceneEntry};
use super::judge::OF_REFERENCE;
use super::staging::{Staged, present};
use super::view::{cameras, footprint};
use crate::error::{Error, Result};
use crate::io::Input;
use crate::io::ply::Levels;
use crate::plan::Settings;
use crate::progress::Progress;
use crate::render::taken;
use crate::surfels::part;

/// Reads the part of `file` that the cuts of all configurations need from all cameras.
///
/// Each configuration draws the same cut from this part as it would from the whole file.
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
            "it has no levels of detail that can be read in parts: make such a file with epsplat lod",
        )
    })?;
    let cameras = cameras(entry.size.unwrap_or(definition.size), entry, &part::nothing(&levels))?;
    let options: Vec<Settings> =
        definition.configs_of(entry).map(|config| judged(definition.settings(config, entry))).collect();
    let views: Vec<_> =
        cameras.iter().flat_map(|camera| options.iter().map(move |options| (camera, options))).collect();
    let (scene, _) = taken(&levels, &views, |_| Ok(()), progress)?;
    // This mean is over the surfels that were read, not over the whole file.
    let footprint_px = footprint(&scene, &cameras);
    Ok(Staged { scene, cameras, surface: None, dressed: false, footprint_px })
}

/// Adds the maps that the f64 reference renders with, so that the part has all that the reference
/// draws.
///
/// The reference may take one sample where the configuration takes several, and may draw back faces
/// that the configuration culls.
fn judged(options: Settings) -> Settings {
    Settings { maps: options.maps.and(&OF_REFERENCE), ..options }
}
