//! Tries changes of the hot path, each alone against the default, on spheres of growing numbers of
//! surfels.
//!
//! Frames of a change and of the default take turns, two renderers at a time: a card whose clock
//! drifts slows both alike, and the largest sphere fits a small memory. The images of both must
//! have the same bits.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::changes::{self, By, Change};
use super::pace::{self, Limits, OfScene, Ring, Waited, waited};
use super::{Card, sphere};
use crate::error::{Error, Result};
use crate::gpu::AdapterDescription;
use crate::plan::{Facts, SceneNeeds, Settings, check};
use crate::render::{Backend, Renderer};
use crate::report::Summary;
use crate::scene::{Camera, Scene};

/// The fraction of the remaining time that the usual changes may use in a record.
const SHARE: f64 = 0.4;

/// Numbers of surfels: full run, quick run.
const SIZES: [&[u64]; 2] = [&[10_000, 100_000, 1_000_000, 10_000_000], &[2000]];

/// Side of the image, pixels: full run, quick run.
const SIDE: [u32; 2] = [1024, 128];

/// The most pairs of timed frames: full run, quick run.
const PAIRS: [usize; 2] = [21, 2];

/// The fewest pairs of timed frames, however long they take: full run, quick run.
const FEWEST_PAIRS: [usize; 2] = [3, 2];

/// Time after which a change gets no further pair.
const PAIRS_TIME: Duration = Duration::from_secs(4);

/// Frames of a block in flight: full run, quick run.
const BLOCK: [usize; 2] = [20, 4];

/// Warm-up of the default at each size: full run, quick run.
const WARM_UP: [Limits; 2] = [
    Limits { fewest: 2, frames: 200, time: Duration::from_secs(2) },
    Limits { fewest: 2, frames: 2, time: Duration::ZERO },
];

/// Warm-up of each change, whose compilation may have let the clock fall: full run, quick run.
const WARM_UP_OF_CHANGE: [Limits; 2] = [Limits { fewest: 2, frames: 60, time: Duration::from_millis(400) }, WARM_UP[1]];

/// The difference of a pass's times, as a fraction of the default's frame, above which it is named.
const NAMED: f64 = 0.01;

/// A change beside the default at one number of surfels.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// Number of surfels of the sphere.
    pub surfels: u64,
    /// The name of the change.
    pub change: String,
    /// Time of a frame of the default, until the caller has its last byte, milliseconds.
    pub default_ms: Summary,
    /// The same with the change; for frames in flight, the time per frame.
    pub ms: Summary,
    /// Quotients of the times of a frame with the change and of the frame of the default beside it.
    pub ratio: Summary,
    /// Quotient of the sums of the passes' median times, without what surrounds the passes;
    /// `None` for frames in flight.
    pub passes_ratio: Option<f64>,
    /// Median times of each pass, milliseconds: of the default, and with the change.
    pub passes: BTreeMap<String, [f64; 2]>,
    /// Whether the image has the bits of the default's.
    pub equal: bool,
    /// Whether both run the same compiled kernels, so that only the host's work can differ.
    pub same_kernels: bool,
}

impl Trial {
    /// The passes whose times differ by more than a hundredth of the default's frame, the largest
    /// difference first.
    pub fn changed(&self) -> Vec<(&str, [f64; 2])> {
        let frame = self.default_ms.median;
        let difference = |times: &[f64; 2]| (times[1] - times[0]).abs();
        let mut changed: Vec<(&str, [f64; 2])> =
            self.passes.iter().map(|(name, times)| (name.as_str(), *times)).collect();
        changed.retain(|(_, times)| difference(times) > NAMED * frame);
        changed.sort_by(|a, b| difference(&b.1).total_cmp(&difference(&a.1)));
        changed
    }
}

/// The step of a study: every change, and the configurations of the studies that were named.
pub(super) fn study(card: &mut Card<'_>) -> Result<()> {
    let mut all = [changes::all(), changes::of_studies(&card.asked.studies)?].concat();
    if card.asked.quick {
        let (tried, left): (Vec<_>, Vec<_>) = all.into_iter().partition(|change| change.quick);
        let left: Vec<_> = left.into_iter().map(|change| change.name).collect();
        card.leave_out(format!("changes, in a quick run: {}", left.join("; ")));
        all = tried;
    }
    try_all(card, &all, 1.0)
}

/// The step of a record: order, culling and organisation.
pub(super) fn usual(card: &mut Card<'_>) -> Result<()> {
    try_all(card, &changes::usual(), SHARE)
}

/// Tries `changes` at as many sizes as the fraction `share` of the remaining time allows.
fn try_all(card: &mut Card<'_>, changes: &[Change], share: f64) -> Result<()> {
    let (end, sizes) = (card.budget.share(share), SIZES[card.form()]);
    for (number, &surfels) in sizes.iter().enumerate() {
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            card.leave_out(format!("changes at {surfels} surfels: the time was over"));
            continue;
        }
        let deadline = Instant::now() + left / (sizes.len() - number) as u32;
        match at_size(card, surfels, changes, deadline) {
            Ok(()) => {}
            Err(limit @ Error::Limit { .. }) => card.leave_out(format!("changes at {surfels} surfels: {limit}")),
            Err(error) => card.problem(&format!("changes at {surfels} surfels"), error)?,
        }
        card.read_clocks(format!("after changes at {surfels} surfels"));
        card.write()?;
    }
    Ok(())
}

/// Tries `changes` on a sphere of `surfels` surfels until `deadline`.
fn at_size(card: &mut Card<'_>, surfels: u64, changes: &[Change], deadline: Instant) -> Result<()> {
    let form = card.form();
    let staged = sphere(surfels, None, SIDE[form], card.told.progress)?;
    let (scene, camera) = (&staged.scene, &staged.cameras[0]);
    let Card { backend, record, told, folder, .. } = card;
    let backend: &Backend = backend;
    let mut default = Renderer::new(scene, &Settings::default(), backend)?;
    pace::warm_up(&mut default, camera, WARM_UP[form])?;
    told.progress.begin(&format!("changes at {surfels} surfels"), changes.len() as u64);
    let (mut late, mut unfit) = (Vec::new(), Vec::new());
    for change in changes {
        if Instant::now() >= deadline {
            late.push(change.name.as_str());
            continue;
        }
        let tried = match &change.by {
            By::Settings(settings) => refused(&Facts::of(scene), &record.adapter, camera, settings).map_or_else(
                || with_settings((scene, settings, backend), &mut default, camera, form),
                |refusal| Err(Error::Usage(refusal.to_string())),
            ),
            By::InFlight(depth) => in_flight(backend, &mut default, camera, (*depth, form)),
        };
        told.progress.advance(1);
        match tried {
            Ok(trial) => record.changes.push(Trial { surfels, change: change.name.clone(), ..trial }),
            Err(error @ (Error::Limit { .. } | Error::Usage(_))) => unfit.push(format!("{}: {error}", change.name)),
            Err(Error::Gpu { adapter, what }) => {
                return Err(Error::Gpu { adapter, what: format!("{what} ({})", change.name) });
            }
            Err(error) => return Err(error),
        }
        record.write(folder)?;
    }
    told.progress.end();
    if !late.is_empty() {
        card.leave_out(format!("changes at {surfels} surfels, as the time was over: {}", late.join("; ")));
    }
    unfit.into_iter().for_each(|what| card.leave_out(format!("changes at {surfels} surfels: {what}")));
    Ok(())
}

/// Returns the reason why the adapter cannot draw the scene with `settings`, if there is one.
fn refused(facts: &Facts, adapter: &AdapterDescription, camera: &Camera, settings: &Settings) -> Option<Error> {
    check::on_adapter(adapter, &SceneNeeds::of(facts, adapter, camera, settings), camera).err()
}

/// Times frames with `settings` beside those of the default, and compares their bits.
fn with_settings(
    (scene, settings, backend): (&Scene, &Settings, &Backend),
    default: &mut OfScene<'_, '_>,
    camera: &Camera,
    form: usize,
) -> Result<Trial> {
    let mut changed = Renderer::new(scene, settings, backend)?;
    pace::warm_up(&mut changed, camera, WARM_UP_OF_CHANGE[form])?;
    let mut pairs = Pairs::default();
    let start = Instant::now();
    while goes_on(pairs.default.len(), start, form) {
        // Each is the first of a pair in turn.
        if pairs.default.len() % 2 == 0 {
            pairs.default.push(timed(default, camera)?);
            pairs.changed.push(timed(&mut changed, camera)?);
        } else {
            pairs.changed.push(timed(&mut changed, camera)?);
            pairs.default.push(timed(default, camera)?);
        }
    }
    Ok(pairs.trial(default.has_kernels_of(&changed)))
}

/// Times blocks of frames with `depth` frames in flight beside frames that are waited for, and
/// compares their bits.
fn in_flight(
    backend: &Backend,
    default: &mut OfScene<'_, '_>,
    camera: &Camera,
    (depth, form): (usize, usize),
) -> Result<Trial> {
    let Backend::Gpu { gpu, .. } = backend else {
        return Err(Error::Usage("the reference has no frames in flight".into()));
    };
    let ring = Ring::new(gpu, default, camera, depth)?;
    // The first block creates what frames in flight need.
    ring.fly(default, camera, depth + 1)?;
    let image = ring.image(default, camera)?;
    let (start, mut single, mut flown) = (Instant::now(), Vec::new(), Vec::new());
    let mut equal = true;
    while goes_on(single.len(), start, form) {
        let Waited { frame, ms, .. } = waited(default, camera)?;
        equal &= frame.hashes() == image.hashes();
        single.push(ms);
        flown.push(ring.fly(default, camera, BLOCK[form])?.ms);
    }
    Ok(Trial { equal, same_kernels: true, ..trial(&single, &flown) })
}

/// Whether another pair of frames is rendered after `pairs` of them.
fn goes_on(pairs: usize, start: Instant, form: usize) -> bool {
    pairs < FEWEST_PAIRS[form] || pairs < PAIRS[form] && start.elapsed() < PAIRS_TIME
}

/// Summarises times of the default and of a change, in milliseconds, that were measured in pairs.
fn trial(default: &[f64], changed: &[f64]) -> Trial {
    let ratios: Vec<f64> = default.iter().zip(changed).map(|(default, changed)| changed / default.max(1e-9)).collect();
    let [default_ms, ms, ratio] = [default, changed, &ratios].map(|values| Summary::of(values).unwrap_or_default());
    Trial {
        surfels: 0,
        change: String::new(),
        default_ms,
        ms,
        ratio,
        passes_ratio: None,
        passes: BTreeMap::new(),
        equal: false,
        same_kernels: false,
    }
}

/// The time of a frame, the times of its passes, and the bits of its image.
struct Timed {
    ms: f64,
    passes: BTreeMap<String, f64>,
    hashes: BTreeMap<&'static str, String>,
}

/// Renders a frame and waits for it.
fn timed(renderer: &mut OfScene<'_, '_>, camera: &Camera) -> Result<Timed> {
    let Waited { frame, report, ms } = waited(renderer, camera)?;
    Ok(Timed { ms, passes: report.passes, hashes: frame.hashes() })
}

/// Frames of the default and of a change, as many of each.
#[derive(Default)]
struct Pairs {
    default: Vec<Timed>,
    changed: Vec<Timed>,
}

impl Pairs {
    fn trial(&self, same_kernels: bool) -> Trial {
        let both = [&self.default, &self.changed];
        let [default, changed] = both.map(|frames| frames.iter().map(|frame| frame.ms).collect::<Vec<_>>());
        let names: BTreeSet<&String> = both.into_iter().flatten().flat_map(|frame| frame.passes.keys()).collect();
        let median = |frames: &[Timed], name: &str| {
            let times: Vec<f64> = frames.iter().map(|frame| frame.passes.get(name).copied().unwrap_or(0.0)).collect();
            Summary::of(&times).map_or(0.0, |summary| summary.median)
        };
        let passes: BTreeMap<String, [f64; 2]> = names
            .into_iter()
            .map(|name| (name.trim_end_matches("_ms").to_owned(), both.map(|frames| median(frames, name))))
            .collect();
        let [of_default, of_changed] = [0, 1].map(|which| passes.values().map(|times| times[which]).sum::<f64>());
        let hashes: Vec<_> = both.into_iter().flatten().map(|frame| &frame.hashes).collect();
        Trial {
            passes_ratio: (of_default > 0.0).then(|| of_changed / of_default),
            passes,
            equal: hashes.windows(2).all(|pair| pair[0] == pair[1]),
            same_kernels,
            ..trial(&default, &changed)
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn frame(ms: f64, accumulate: f64, bits: &str) -> Timed {
        let passes = BTreeMap::from([("project_ms".to_owned(), 1.0), ("accumulate_ms".to_owned(), accumulate)]);
        Timed { ms, passes, hashes: BTreeMap::from([("color", bits.to_owned())]) }
    }

    #[test]
    fn pairs_become_ratios_of_neighbours_and_name_the_passes_that_changed() {
        // The clock falls to half in the third pair: the ratio is the same.
        let times = [1.0, 1.0, 2.0];
        let frames = |factor: f64, bits| times.map(|slow| frame(4.0 * slow * factor, 2.0 * factor, bits)).into();
        let pairs = Pairs { default: frames(1.0, "a"), changed: frames(1.5, "a") };
        let trial = pairs.trial(false);
        assert_eq!((trial.ratio.median, trial.ratio.min, trial.ratio.max), (1.5, 1.5, 1.5));
        assert_eq!((trial.default_ms.median, trial.ms.median), (4.0, 6.0));
        assert_eq!((trial.passes_ratio, trial.equal), (Some(4.0 / 3.0), true));
        assert_eq!(trial.changed(), [("accumulate", [2.0, 3.0])]);
        // One frame with other bits is enough.
        let mut pairs = Pairs { default: frames(1.0, "a"), changed: frames(1.0, "a") };
        pairs.changed[1] = frame(4.0, 2.0, "b");
        assert!(!pairs.trial(true).equal);
        assert!(pairs.trial(true).changed().is_empty());
    }
}
