//! `epsplat render --lod`: the cut that is drawn in place of all surfels.

use std::sync::Arc;

use clap::ValueEnum;
use epsplat::passes::select::{self, Wanted};
use epsplat::plan::{Facts, RenderOptions, culls_back};
use epsplat::scene::{Camera, Cull, Detail, DetailMeasure, Hierarchy, Map, Maps, Scene};
use epsplat::surfels::hierarchy;
use epsplat::{Error, Result};

use super::super::note;
use super::super::progress::Bars;
use super::Arguments;

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum MeasureName {
    Area,
    Extent,
}

/// Levels of detail, and how fine a cut is wanted.
pub(super) struct Levels {
    hierarchy: Arc<Hierarchy>,
    /// Of the whole scene, which say whether its backs are left out.
    facts: Facts,
    detail: Detail,
    measure: DetailMeasure,
}

impl Levels {
    /// Those of `scene`, which are made if it has none; None if no cut is wanted.
    ///
    /// # Errors
    /// [`Error::Usage`] for what does not go with a cut.
    pub fn of(arguments: &Arguments, scene: &mut Scene, bars: &Bars) -> Result<Option<Self>> {
        let Some(detail) = arguments.lod.filter(|detail| !detail.is_finest()) else { return Ok(None) };
        let refused = [
            (
                arguments.facing.is_some(),
                "points that face the camera have a size each and no levels of detail: leave --lod out",
            ),
            (arguments.separate, "levels of detail are of all inputs together: leave --separate or --lod out"),
            (
                Maps::of(&arguments.aov).has(Map::Index),
                "the map index names points, and nodes are none: leave one of the map and --lod out",
            ),
            (scene.surfels.is_empty(), "levels of detail are of surfels, and there are none: leave --lod out"),
        ];
        if let Some((_, what)) = refused.into_iter().find(|(refused, _)| *refused) {
            return Err(Error::Usage(what.into()));
        }
        let hierarchy = match &scene.hierarchy {
            Some(known) => known.clone(),
            None => {
                let (ordered, made) = hierarchy::build(std::mem::take(scene), bars)?;
                *scene = ordered;
                note("levels of detail are made for this picture: `epsplat lod` keeps them in a file");
                made
            }
        };
        let measure = match arguments.lod_measure {
            MeasureName::Area => DetailMeasure::Area,
            MeasureName::Extent => DetailMeasure::Extent,
        };
        Ok(Some(Self { hierarchy, facts: Facts::of(scene), detail, measure }))
    }

    /// What is drawn of `scene` in the view of `camera`, with which options, and what that is.
    pub fn cut(&self, scene: &Scene, camera: &Camera, options: &RenderOptions) -> (Scene, RenderOptions, String) {
        let backs_out = culls_back(&self.facts, camera, options);
        let wanted = Wanted::of(self.detail, self.measure, backs_out, options);
        let cut = select::reference(&self.hierarchy, scene.origin, camera, &wanted);
        // What is in view does not say whether the eye is outside of the scene.
        let cull = if backs_out { Cull::Back } else { Cull::None };
        let surfels: usize = cut.surfels.iter().map(|range| range.len()).sum();
        let what = format!("cut: {} nodes and {surfels} of {} surfels", cut.nodes.len(), scene.surfels.len());
        (cut.scene(scene, &self.hierarchy), RenderOptions { cull, ..options.clone() }, what)
    }
}
