//! Optimisations do not change a bit of the frame, alone or together, and are absent if a study
//! disables them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::bits;
use common::scenes::{crowded, sphere, sphere_camera};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::plan::{Optimisation, Settings};
use epsplat::low_level::render::{Backend, Report, render};
use epsplat::low_level::scene::{Camera, Epsilon, Maps, Projection, Scene};

fn options(without: &[Optimisation]) -> Settings {
    Settings {
        maps: Maps::ON_DEVICE,
        epsilon: Epsilon::Relative(0.02),
        without: without.to_vec(),
        ..Default::default()
    }
}

/// Returns two scenes, and whether each is culled: splats of many sizes, which are too few for
/// culling, and a closed surface of small splats, half of it hidden.
fn scenes() -> Vec<((Scene, Camera), bool)> {
    vec![(crowded().swap_remove(1), false), ((sphere(3000, 1.8), sphere_camera(90, Projection::Pinhole)), true)]
}

fn on(gpu: Gpu, sources: Sources) -> Backend {
    Backend::Gpu { gpu: Box::new(gpu), sources }
}

fn frame((scene, camera): &(Scene, Camera), without: &[Optimisation], backend: &Backend) -> (Frame, Report) {
    render(scene, camera, &options(without), backend, &()).unwrap()
}

#[test]
fn no_optimisation_shows() {
    let Some(gpu) = common::gpu() else { return };
    let long = gpu.adapter.integers_u64;
    let (pairs, sharing) = (gpu.adapter.atomics_u64, gpu.adapter.subgroups && gpu.adapter.kind == "software");
    let backend = Backend::gpu(gpu);
    for (scene, culled) in scenes() {
        let (expected, whole) = frame(&scene, &[], &backend);
        // The optimisations that are active by default.
        for (need, exists) in [("cull", culled), ("atomics-u64", pairs), ("long-words", long), ("gather", sharing)] {
            assert_eq!(whole.needs.contains(&need), exists, "{need}");
        }
        let each = Optimisation::ALL.map(|(optimisation, _)| vec![optimisation]);
        let all = Optimisation::ALL.map(|(optimisation, _)| optimisation).to_vec();
        for without in each.into_iter().chain([all]) {
            let (found, report) = frame(&scene, &without, &backend);
            assert!(bits(&found) == bits(&expected), "without {without:?} bits change");
            let left_out = |needs: &str| !report.needs.contains(&needs);
            for optimisation in without {
                match optimisation {
                    Optimisation::Culling => assert!(left_out("cull")),
                    Optimisation::Copies => assert!(left_out("copies")),
                    Optimisation::Pairs => assert!(left_out("atomics-u64")),
                    Optimisation::Spreading => assert!(left_out("spreads")),
                    Optimisation::LongWords => assert!(left_out("long-words")),
                    Optimisation::Splitting => assert!(!left_out("draws-projected")),
                    Optimisation::Gathering | Optimisation::Sharing => assert!(left_out("gather")),
                    Optimisation::Order
                    | Optimisation::Hiding
                    | Optimisation::UncountedLoops
                    | Optimisation::Division => {}
                }
            }
        }
    }
}

/// Disabling an optimisation really skips its code: if that code is broken, frames with and without
/// the optimisation differ.
#[test]
fn what_is_left_out_is_not_done() {
    let backend = |file: &str, from: &str, to: &str| {
        let gpu = common::gpu()?;
        Some(on(gpu, Sources::default().replace(file, from, to).unwrap()))
    };
    let Some(gpu) = common::gpu() else { return };
    let has_long = gpu.adapter.integers_u64;
    let (scene, _) = scenes().swap_remove(1);
    // All splats count as hidden.
    let all = "return front == 0u || reached > farthest_accepted(bitcast<f32>(front), radius);";
    let Some(hiding) = backend("occlusion.wgsl", all, "return true;") else { return };
    // The first stored surfel is moved out of view.
    let Some(first) = backend(
        "project.wgsl",
        "let surfel = surfel_at(index);",
        "var surfel = surfel_at(index); if (index == 0u) { surfel.center[2] = 1e9; }",
    ) else {
        return;
    };
    // The last component of every other surfel's first half-axis becomes 0.
    let odd = "array<f32, 3>(b.y, c.x, c.y)";
    let Some(long) = backend("words_long.wgsl", odd, "array<f32, 3>(b.y, c.x, select(c.y, 0.0, odd))") else { return };
    let backends = [(Optimisation::Hiding, hiding), (Optimisation::Order, first), (Optimisation::LongWords, long)];
    for (optimisation, backend) in backends {
        if optimisation == Optimisation::LongWords && !has_long {
            eprintln!("skipped: no 64-bit integers");
            continue;
        }
        let (with, _) = frame(&scene, &[], &backend);
        let (without, _) = frame(&scene, &[optimisation], &backend);
        assert!(bits(&with) != bits(&without), "{optimisation:?}");
    }
}
