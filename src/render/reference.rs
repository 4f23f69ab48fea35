//! The sequence in f64 on the processor's threads: what the twins make of a scene, strip by strip.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use super::report::Report;
use crate::frame::Frame;
use crate::passes::splat::Splat;
use crate::passes::{accumulate, project, resolve, visibility};
use crate::plan::{Facts, RenderOptions, SceneNeeds};
use crate::progress::Progress;
use crate::scene::{Camera, Scene};

/// Rows that one thread of the reference works on at a time.
const REFERENCE_ROWS: u32 = 8;

/// Renders `scene`.
pub(super) fn frame(
    scene: &Scene,
    facts: &Facts,
    camera: &Camera,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> (Frame, Report) {
    let start = Instant::now();
    let splats = project::reference_all(scene, camera, options);
    let project_ms = start.elapsed().as_secs_f64() * 1e3;

    let bands = camera.height.div_ceil(REFERENCE_ROWS);
    let (starts, members) = bin(&splats, bands as usize);
    progress.begin("rendering rows", camera.height.into());
    let spent: [AtomicU64; 3] = Default::default();
    let strip = |band: u32| {
        let first_row = band * REFERENCE_ROWS;
        let rows = REFERENCE_ROWS.min(camera.height - first_row);
        let range = starts[band as usize]..starts[band as usize + 1];
        let splats = || members[range.clone()].iter().map(|&index| &splats[index as usize]);
        let clock = Instant::now();
        let lap = |stage: usize, from: f64| {
            let now = clock.elapsed().as_secs_f64();
            spent[stage].fetch_add(((now - from) * 1e9) as u64, Ordering::Relaxed);
            now
        };
        let nearest = visibility::reference(splats(), camera, options.low_pass, first_row, rows);
        let seen = lap(0, 0.0);
        let sums = accumulate::reference(splats(), scene, camera, options, first_row, &nearest);
        let summed = lap(1, seen);
        let strip = Camera { height: rows, ..camera.clone() };
        let mut frame = Frame::new(&strip, options.maps);
        resolve::reference(&sums, scene, camera, options, first_row, &mut frame);
        lap(2, summed);
        progress.advance(rows.into());
        frame
    };
    // A few strips at a time: all of them beside the frame would double its memory.
    let mut frame = Frame::empty(camera, options.maps);
    let group = 8 * rayon::current_num_threads() as u32;
    for first in (0..bands).step_by(group as usize) {
        let strips: Vec<Frame> = (first..bands.min(first + group)).into_par_iter().map(strip).collect();
        strips.into_iter().for_each(|strip| frame.append(strip));
    }
    progress.end();
    let drawn = splats.iter().map(|splat| u64::from(splat.copies)).sum();
    let threads = rayon::current_num_threads() as f64;
    let mut passes = BTreeMap::from([("project_ms".to_owned(), project_ms)]);
    for (stage, spent) in ["visibility_ms", "accumulate_ms", "resolve_ms"].into_iter().zip(&spent) {
        passes.insert(stage.to_owned(), spent.load(Ordering::Relaxed) as f64 * 1e-6 / threads);
    }
    let needs = SceneNeeds::of_picture(facts, camera, options);
    (frame, report(camera, needs, (facts.surfels, drawn), passes, start.elapsed().as_secs_f64() * 1e3))
}

fn report(
    camera: &Camera,
    needs: SceneNeeds,
    (surfels, splats_drawn): (u64, u64),
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
        width: camera.width,
        height: camera.height,
        passes,
        clock: "wall",
        total_ms,
        needs: needs.names(),
    }
}

/// The splats of each band of rows, by count, scan, place: `members[starts[b]..starts[b + 1]]` are band b's, in order.
fn bin(splats: &[Splat], bands: usize) -> (Vec<usize>, Vec<u32>) {
    let range = |splat: &Splat| (splat.first[1] / REFERENCE_ROWS) as usize..=(splat.last[1] / REFERENCE_ROWS) as usize;
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
