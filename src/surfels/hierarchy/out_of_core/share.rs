//! A share of a scene from files of surfels, for processes that draw together: each reads only its
//! own points, and all of them agree on the facts of the whole scene, on which every bit depends.

use ciborium::Value;

use super::loaded;
use super::sources::{Among, Read, Sources, is_no_share, no_share};
use super::survey::Survey;
use crate::io::ply::Rows;
use crate::network::{Network, joined};
use crate::scene::scene::{core_of, core_step};
use crate::scene::{LevelFacts, Scene, Whole, core_and_box, framed_within};
use crate::surfels::Preparation;
use crate::{Error, Progress, Result};

/// Builds the share of this process of the surfels of all points of `files`. The scene has the
/// facts about all of them ([`Scene::part_of`]). Each surfel has the bits that
/// [`build`](crate::surfels::build()) gives it.
///
/// Returns None in all processes if surfels of a share depend on other points: because an attribute
/// is missing, or coordinates are not usable.
///
/// # Errors
///
/// [`Error::Read`] from the system, as [`Error::Process`] and, in the other processes,
/// [`Error::OtherProcess`].
pub fn share(files: &[Rows], network: &dyn Network, progress: &dyn Progress) -> Result<Option<(Scene, Preparation)>> {
    let sources = Sources { files, progress, among: Some(Among(network)) };
    match made(&sources) {
        Err(error) if is_no_share(&error) => Ok(None),
        Err(Error::Usage(_) | Error::EmptyScene(_) | Error::Malformed { .. }) => {
            // The others may wait for a result of this process.
            joined::<Value>(network, Ok(None), |one, _| one).map(|_| None)
        }
        made => made.map(Some),
    }
}

fn made(sources: &Sources<'_>) -> Result<(Scene, Preparation)> {
    let survey = Survey::of(sources)?;
    let count = survey.preparation.surfels;
    if survey.preparation.dropped_non_finite > 0 {
        return Err(Error::Usage("some points are not usable".into()));
    }
    let pieces = sources.pieces();
    let own = pieces.iter().map(|(_, piece)| piece.end - piece.start).sum();
    let scene = loaded(&survey, (own, &pieces), Survey::part, sources.progress);
    // All processes learn whether one could not read its share, by the number of surfels.
    let held = scene.as_ref().map(|scene| scene.surfels.len() as u64);
    let all = sources.joined(held.map_err(|_| no_share()), |one, other| one + other)?;
    let scene = scene?;
    if all != count {
        return Err(Error::Usage("the files changed while they were read".into()));
    }
    let place = |k: usize| (scene.center(k), f64::from(scene.surfels[k].radius()));
    let read = |surfels: std::ops::Range<usize>| Ok(surfels.map(place).collect());
    let places = Read::new(count as usize, std::iter::once(0..scene.surfels.len()).collect(), read, sources.among);
    let (bounds, (body, framed, strays)) = places.made(|places| {
        let (core, bounds) = core_and_box(places);
        (bounds, framed_within(core, bounds, places))
    })?;
    let whole = Whole {
        surfels: u32::try_from(count).map_err(|_| Error::Usage("there are too many surfels".into()))?,
        nodes: 0,
        origin: scene.origin,
        bounds,
        body,
        core: core_of(sampled(sources, &scene, count)?.into_iter()).unwrap_or(bounds),
        framed,
        color: survey.range,
        largest_radius: survey.largest_radius,
        largest_shorter: survey.largest_shorter,
        levels: LevelFacts::default(),
        has: survey.has,
    };
    let preparation = Preparation { strays, ..survey.preparation };
    Ok((Scene { part_of: Some(Box::new(whole)), ..scene }, preparation))
}

/// The centres of every n-th surfel of all, those that decide [`Scene::core`].
fn sampled(sources: &Sources<'_>, scene: &Scene, count: u64) -> Result<Vec<[f32; 3]>> {
    let step = core_step(count as usize) as u64;
    let (mut held, mut own) = (0, Vec::new());
    for (first, _, piece) in sources.numbered() {
        let length = piece.end - piece.start;
        let skipped = (step - first % step) % step;
        let chosen = (skipped..length).step_by(step as usize);
        own.extend(chosen.map(|k| scene.surfels[held + k as usize].center));
        held += length as usize;
    }
    sources.joined(Ok(own), |mut one, other| {
        one.extend(other);
        one
    })
}
