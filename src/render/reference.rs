//! Renders in f64 on the processor: the twins of the kernels draw the image in strips of rows, by
//! the steps of a plan without a device.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use rayon::prelude::*;

use super::report::Report;
use super::sequence;
use crate::frame::Frame;
use crate::gpu::Traffic;
use crate::passes::asks_for_order;
use crate::passes::join::Beside;
use crate::passes::order::order;
use crate::passes::resolve::Surface;
use crate::passes::select::{self, Wanted};
use crate::passes::splat::Splat;
use crate::passes::{
    MAP_PASSES, Strip, accumulate, individuals, layers, oit, project, resolve, sorted, triangles, visibility, winner,
};
use crate::plan::steps::{Step, Twin};
use crate::plan::{Facts, Plan, SceneNeeds, Settings, culls_back};
use crate::progress::Progress;
use crate::scene::{Blend, Camera, Cull, Samples, Scene};

/// Renders `scene`. The pixels of `camera` are the samples ([`Camera::sampled`]).
pub(super) fn frame(
    scene: &Scene,
    facts: &Facts,
    camera: &Camera,
    options: &Settings,
    progress: &dyn Progress,
) -> (Frame, Report) {
    let start = Instant::now();
    let plan = Plan::of_reference(facts, camera, options);
    let (before, of_bands) = twins(&plan);
    let spent = Spent::default();
    let mut splats = Vec::new();
    if before.contains(&Twin::Project) {
        splats = spent.timed("project", 1, || project::reference_all(scene, camera, options));
    }
    let (starts, members) = bin(&splats, &plan);
    let ranks = asks_for_order(&plan.needs).then(|| ranks(scene, facts, options));
    let corners = triangles::corners(scene, camera);
    progress.begin("rendering rows", camera.height.into());
    let one = |band: usize| {
        let (first_row, rows) = (plan.bands[band].first, plan.bands[band].rows);
        let splats: Vec<&Splat> =
            members[starts[band]..starts[band + 1]].iter().map(|&index| &splats[index as usize]).collect();
        let ranks = ranks.as_deref();
        let corners = &corners;
        let strip = Strip { splats, corners, ranks, first_row, rows, ..Strip::of((scene, facts), camera, options) };
        let frame = strip_by(&strip, &of_bands[band], &spent);
        let frame =
            if options.samples == Samples::ONE { frame } else { resolve::mean_of_samples(&frame, options.samples) };
        progress.advance(rows.into());
        frame
    };
    // Renders a few strips at a time: all of them at once would double the memory of the frame.
    let Samples { across, down } = options.samples;
    let image = Camera { width: camera.width / across, height: camera.height / down, ..camera.clone() };
    let mut frame = Frame::empty(&image, options.maps);
    let bands: Vec<usize> = (0..plan.bands.len()).collect();
    for group in bands.chunks(8 * rayon::current_num_threads()) {
        let strips: Vec<Frame> = group.par_iter().map(|band| one(*band)).collect();
        strips.into_iter().for_each(|strip| frame.append(strip));
    }
    progress.end();
    let drawn = splats.iter().map(|splat| u64::from(splat.copies)).sum();
    (
        frame,
        report(
            &image,
            plan.needs,
            (facts.surfels, drawn, facts.mesh.triangles),
            spent.passes(),
            start.elapsed().as_secs_f64() * 1e3,
        ),
    )
}

/// Returns the cut of `scene` that `camera` draws, and the options to draw it with; `None` if no
/// cut is drawn. `camera` has the pixels of the image, not the samples. The options settle whether
/// back faces are culled, because that depends on the whole scene and not on the cut.
pub(super) fn cut(scene: &Scene, facts: &Facts, camera: &Camera, options: &Settings) -> Option<(Scene, Settings)> {
    facts.nodes_of(options)?;
    let tree = scene.hierarchy.as_deref()?;
    let backs_out = culls_back(facts, camera, options);
    let cut = select::reference(scene, tree, camera, &Wanted::of(options, backs_out));
    let cull = if backs_out { Cull::Back } else { Cull::None };
    Some((cut.scene(scene, tree, options.draws_node_caps()), Settings { cull, ..options.clone() }))
}

/// Lists the twins of the steps of `plan`: those that run once, and those of each band.
fn twins(plan: &Plan) -> (Vec<Twin>, Vec<Vec<Twin>>) {
    let (mut before, mut of_bands) = (Vec::new(), vec![Vec::new(); plan.bands.len()]);
    for step in sequence::steps(plan) {
        let Step::Stage(stage) = step else { continue };
        match stage.twin {
            Some(Twin::Project) => before.push(Twin::Project),
            Some(twin) => of_bands[stage.band].push(twin),
            None => {}
        }
    }
    (before, of_bands)
}

/// Renders the rows of a strip by its `twins`.
fn strip_by(strip: &Strip<'_>, twins: &[Twin], spent: &Spent) -> Frame {
    let Strip { scene, camera, options, first_row, rows, .. } = *strip;
    let splats = || strip.splats.iter().copied();
    let (mut nearest, mut sums, mut shown) = (Vec::new(), Vec::new(), Vec::new());
    let pixels = camera.width as usize * rows as usize;
    // The nearest surface at each pixel among the separate inputs drawn so far.
    let mut kept = None;
    let mut frame = Frame::new(&Camera { height: rows, ..camera.clone() }, options.maps);
    fn beside<'a>(strip: &Strip<'_>, triangles: &'a [triangles::Shown]) -> Beside<'a> {
        let Strip { scene, largest_shorter, farthest, .. } = *strip;
        Beside { triangles, largest_shorter, farthest, coded: scene.encoded }
    }
    for twin in twins {
        spent.timed(twin.pass(), rayon::current_num_threads(), || match twin {
            Twin::Project => {}
            Twin::Visibility => nearest = visibility::reference(splats(), camera, options.low_pass, first_row, rows),
            Twin::Accumulate if options.blend == Blend::Nearest => {
                sums = winner::reference(splats(), scene, camera, options, (first_row, rows));
            }
            Twin::Accumulate => {
                sums = accumulate::reference(splats(), scene, camera, options, first_row, &nearest);
            }
            Twin::Oit => sums = oit::reference(strip),
            Twin::Layers => layers::reference(strip, &beside(strip, &shown), &mut frame),
            Twin::Sorted => sorted::reference(strip, &beside(strip, &shown), &mut frame),
            Twin::Individual(individual) => {
                let kept = kept.get_or_insert_with(|| vec![Surface::NOTHING; pixels]);
                individuals::keep_nearest(kept, individuals::reference(strip, *individual));
            }
            Twin::Triangles => shown = triangles::reference(strip),
            Twin::Resolve => {
                let blended = || resolve::surfaces(&sums, &nearest, (scene, camera, options), first_row);
                resolve::reference(&kept.take().unwrap_or_else(blended), &beside(strip, &shown), options, &mut frame);
            }
            Twin::Map(map) => {
                let own = MAP_PASSES.iter().filter(|own| own.map == *map);
                own.for_each(|own| (own.reference)(strip, &nearest, &beside(strip, &shown), &mut frame));
            }
        });
    }
    frame
}

/// The rank of each surfel in the order in which a device stores them.
fn ranks(scene: &Scene, facts: &Facts, options: &Settings) -> Vec<u32> {
    if facts.nodes_of(options).is_some() {
        // A cut is stored in tree order.
        return (0..scene.surfels.len() as u32).collect();
    }
    let mut ranks = vec![0; scene.surfels.len()];
    for (rank, index) in order(scene, &facts.core, None).into_iter().enumerate() {
        ranks[index as usize] = rank as u32;
    }
    ranks
}

/// Milliseconds by pass: thread time divided by the number of threads.
#[derive(Default)]
struct Spent(Mutex<BTreeMap<String, f64>>);

impl Spent {
    /// Runs `work`, one of `threads` equal shares of a pass, and adds its time to the pass.
    fn timed<T>(&self, pass: &str, threads: usize, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let made = work();
        let ms = start.elapsed().as_secs_f64() * 1e3 / threads as f64;
        // A panic cannot leave a sum half written, so a poisoned lock is still valid.
        let mut passes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *passes.entry(format!("{pass}_ms")).or_default() += ms;
        made
    }

    fn passes(self) -> BTreeMap<String, f64> {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

fn report(
    camera: &Camera,
    needs: SceneNeeds,
    (surfels, splats_drawn, triangles): (u64, u64, u64),
    passes: BTreeMap<String, f64>,
    total_ms: f64,
) -> Report {
    Report {
        backend: "reference",
        adapter: format!("{} processor threads", rayon::current_num_threads()),
        accumulator: "f64",
        overflows: 0,
        surfels,
        splats_drawn,
        cut: None,
        triangles,
        width: camera.width,
        height: camera.height,
        passes,
        clock: "wall",
        total_ms,
        compile_ms: 0.0,
        traffic: Traffic::default(),
        needs: needs.names(),
        tail: None,
        kernel: None,
    }
}

/// Sorts splats into the bands of `plan` by count, scan and place: band b has
/// `members[starts[b]..starts[b + 1]]`, in order.
fn bin(splats: &[Splat], plan: &Plan) -> (Vec<usize>, Vec<u32>) {
    let bands = plan.bands.len();
    let band_of = |row: u32| plan.bands.partition_point(|band| band.first <= row) - 1;
    let range = |splat: &Splat| band_of(splat.first[1])..=band_of(splat.last[1]);
    let mut starts = vec![0; bands + 1];
    for splat in splats {
        range(splat).for_each(|band| starts[band + 1] += 1);
    }
    for band in 0..bands {
        starts[band + 1] += starts[band];
    }
    let mut next = starts.clone();
    let mut members = vec![0; starts[bands]];
    for (index, splat) in splats.iter().enumerate() {
        for band in range(splat) {
            members[next[band]] = index as u32;
            next[band] += 1;
        }
    }
    (starts, members)
}
