//! The rows of pictures that several processes cannot draw together, each with what to do instead.

use super::{Clash, SceneClash, first, usage};
use crate::error::Result;
use crate::plan::{Accumulator, ColorNeed, Facts, Settings, composited};
use crate::scene::{Blend, Composite, Map};

/// Combinations of options that processes cannot draw together, for every scene.
const OPTIONS: [Clash; 6] = [
    Clash {
        applies: |_, device| !device,
        sentence: "parts of a picture are integer sums of compute kernels: leave --backend reference out",
    },
    Clash {
        applies: |options, _| options.raster.is_some(),
        sentence: "the rasteriser leaves no sums that parts could add: leave --backend raster out",
    },
    Clash {
        applies: |options, _| options.accumulator != Accumulator::Fixed,
        sentence: "parts are added by the accumulator fixed: leave --accumulator out",
    },
    Clash {
        applies: |options, _| options.separate,
        sentence: "parts blend the surfels of all inputs: leave --separate out",
    },
    Clash {
        applies: |options, _| !options.detail.is_finest(),
        sentence: "parts are shares of all surfels, not of a level of detail: leave --lod and --splats out",
    },
    Clash {
        applies: |options, _| options.maps.iter().any(|map| map.row().numbers),
        sentence: "the map index names one surfel of all parts, which no sum tells: leave it out",
    },
];

/// Combinations of options that processes cannot draw together through files.
const OPTIONS_OF_FILES: [Clash; 4] = [
    Clash {
        applies: |options, _| !options.sources.is_empty(),
        sentence: "files of parts carry no kernels, and a picture needs the same in all of them: leave --source out",
    },
    Clash {
        applies: |options, _| !matches!(options.composite, Composite::Opaque | Composite::Gaussians),
        sentence: "surfaces behind the nearest one need all fragments of a pixel in one process, and a part has some: \
                   leave --composite out",
    },
    Clash {
        applies: |options, _| options.blend == Blend::Nearest,
        sentence: "--blend nearest adds nothing that parts could sum: leave it out, or take --epsilon abs:0",
    },
    Clash {
        applies: |options, _| options.maps.has(Map::Surfaces),
        sentence: "the map surfaces needs all fragments of a pixel in one process: leave it out",
    },
];

/// Combinations of scenes and options that processes cannot draw together through files.
const SCENES_OF_FILES: [SceneClash; 2] = [
    SceneClash {
        applies: |facts, options, _| composited(facts, options) != Composite::Opaque,
        sentence: "Gaussians are sorted in one process, and a part has some of them: take --flatten and --composite opaque",
    },
    SceneClash {
        applies: |facts, _, _| facts.colors == ColorNeed::Textured,
        sentence: "painted surfels take their colours from an image, which files of parts do not carry: leave --texture out, or \
               draw meshes as triangles",
    },
];

/// Fails with the sentence of the first row that applies.
fn first_scene(clashes: &[SceneClash], facts: &Facts, options: &Settings) -> Result<()> {
    match clashes.iter().find(|clash| (clash.applies)(facts, options, true)) {
        Some(clash) => usage(clash.sentence),
        None => Ok(()),
    }
}

/// Rejects options with which several processes cannot draw a picture together.
///
/// # Errors
/// [`Error::Usage`](crate::Error::Usage).
pub fn options_of_ranks(options: &Settings, reference: bool) -> Result<()> {
    first(&OPTIONS, options, !reference)
}

/// Rejects options with which several processes cannot draw a picture together through files.
///
/// # Errors
/// [`Error::Usage`](crate::Error::Usage).
pub fn options_of_parts(options: &Settings, reference: bool) -> Result<()> {
    first(&OPTIONS, options, !reference)?;
    first(&OPTIONS_OF_FILES, options, !reference)
}

/// Rejects pictures that several processes cannot draw together through files.
///
/// # Errors
/// [`Error::Usage`](crate::Error::Usage).
pub fn files_of_parts(facts: &Facts, options: &Settings) -> Result<()> {
    options_of_parts(options, false)?;
    first_scene(&SCENES_OF_FILES, facts, options)
}
