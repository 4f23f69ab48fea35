//! The share of a scene that one of several processes reads.

use std::ops::Range;

use super::tree::asks_for_all;
use super::whole::Made;
use super::{Request, View};
use crate::error::Result;
use crate::network::Network;
use crate::plan::Settings;
use crate::progress::Progress;
use crate::scene::{Composite, Scene, Share};
use crate::surfels::part::surfels;
use crate::surfels::{Preparation, hierarchy};

/// Reads the surfels of the process's share, with the facts about all. Returns None in all
/// processes if surfels of a share may depend on other points, or if an option or the view needs
/// all surfels. Where fragments are sorted, the place of each surfel in the order of all decides
/// between fragments of one depth.
pub(super) fn own(
    request: &Request<'_>,
    (network, view): (&dyn Network, &View),
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Option<Made>> {
    let sorts = matches!(settings.composite, Composite::Sorted | Composite::Gaussians);
    if sorts || asks_for_all(request).is_some() || request.surfels().radius_scale.is_some() {
        return Ok(None);
    }
    let made = match of_levels(request, network, progress)? {
        Some(made) => Some(made),
        None => match request.files().surfels()? {
            Some(files) => hierarchy::out_of_core::share(&files, network, progress)?,
            None => None,
        },
    };
    let needs_all = |scene: &Scene| {
        let whole = scene.part_of.as_ref();
        view.is_framed() && whole.is_some_and(|whole| whole.is_framed_by_radii())
    };
    Ok(made.filter(|(scene, _)| !needs_all(scene)))
}

/// Reads the share of a file of `epsplat lod`, which states the facts about all of its surfels;
/// None if the input is no such file.
fn of_levels(request: &Request<'_>, network: &dyn Network, progress: &dyn Progress) -> Result<Option<Made>> {
    let Some(levels) = request.files().levels()? else { return Ok(None) };
    let share = Share::new(network.rank() as u32 + 1, network.size() as u32)?;
    let own = share.pieces(levels.whole.surfels as usize).map(|piece| piece.start as u32..piece.end as u32);
    let scene = surfels(&levels, &own.collect::<Vec<Range<u32>>>(), progress)?;
    let count = scene.surfels.len() as u64;
    Ok(Some((scene, Preparation { points: count, surfels: count, ..Preparation::default() })))
}
