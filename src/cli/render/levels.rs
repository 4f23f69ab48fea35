//! `epsplat render --lod`: levels of detail for a scene that comes without.

use clap::ValueEnum;
use epsplat::plan::RenderOptions;
use epsplat::scene::{DetailMeasure, Scene};
use epsplat::surfels::hierarchy;
use epsplat::{Error, Result};

use super::super::note;
use super::super::progress::Bars;

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum MeasureName {
    Area,
    Extent,
}

impl From<MeasureName> for DetailMeasure {
    fn from(name: MeasureName) -> Self {
        match name {
            MeasureName::Area => Self::Area,
            MeasureName::Extent => Self::Extent,
        }
    }
}

/// Gives `scene` levels of detail if a picture with `options` asks for some and it has none.
///
/// # Errors
/// [`Error::Usage`] for a scene that has none to give.
pub(super) fn made(mut scene: Scene, options: &RenderOptions, bars: &Bars) -> Result<Scene> {
    if options.detail.is_finest() || scene.hierarchy.is_some() {
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
