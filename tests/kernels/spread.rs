//! Fragments that are spread over the invocations of a workgroup and summed in its memory, as
//! graphics cards do. The f32 twin runs these kernels and counts what they do; llvmpipe takes
//! minutes to compile them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;
use crate::tiles::drawn;

use common::bits;
use common::scenes::{sphere, sphere_camera};
use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, KernelTally, Sources};
use epsplat::low_level::plan::{Optimisation, Organisation, Settings};
use epsplat::low_level::render::{Backend, Report, render};
use epsplat::low_level::scene::{Camera, Maps, Projection, Samples, Scene, Shading};

/// The twin with the kernels of a graphics card.
fn card() -> Gpu {
    let mut gpu = Gpu::open(Some("twin")).unwrap();
    (gpu.adapter.kind, gpu.adapter.max_compute_workgroup_storage_size) = ("discrete", 1 << 15);
    gpu
}

/// Draws a frame by scatter. Returns what its accumulate pass did.
fn scattered(
    gpu: Gpu,
    sources: Sources,
    (scene, camera): (&Scene, &Camera),
    options: &Settings,
) -> (Frame, Report, KernelTally) {
    let backend = Backend::Gpu { gpu: Box::new(gpu.clone()), sources };
    let options = Settings { organisation: Organisation::Scatter, ..options.clone() };
    let (frame, report) = render(scene, camera, &options, &backend, &()).unwrap();
    (frame, report, gpu.tally().unwrap().remove("accumulate").unwrap_or_default())
}

/// The same without spreading.
fn alone(of: (&Scene, &Camera), options: &Settings) -> (Frame, Report, KernelTally) {
    let options = Settings { without: vec![Optimisation::Spreading], ..options.clone() };
    scattered(card(), Sources::default(), of, &options)
}

#[test]
fn spreading_halves_the_atomics_and_doubles_the_lanes_at_work() {
    // With several threads the order of the listed batches changes from run to run, and the counts
    // change a little with it.
    rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(compare_counts);
}

fn compare_counts() {
    // As many surfels a pixel as 1,000,000 have at 1024x1024, with radii of 1.5 spacings.
    let (scene, camera) = (sphere(15_625, 1.5), sphere_camera(128, Projection::Pinhole));
    for shading in [Shading::Unlit, Shading::Lambert] {
        let options = Settings { shading, maps: Maps::NONE, ..Default::default() };
        let (expected, _, one_by_one) = alone((&scene, &camera), &options);
        let (frame, report, spread) = scattered(card(), Sources::default(), (&scene, &camera), &options);
        assert!(report.needs.contains(&"spreads") && report.needs.contains(&"cull"));
        assert!(bits(&frame) == bits(&expected), "{shading:?}: spreading changes bits");
        let [before, after] = [&one_by_one, &spread].map(|tally| tally.atomics["sums"]);
        println!("{shading:?}: {before} and {after} atomic operations on sums");
        for name in ["add_stored", "add_pair_stored", "flush", "deposit_one_stored", "footprint", "blend"] {
            let [before, after] =
                [&one_by_one, &spread].map(|tally| tally.calls.get(name).copied().unwrap_or_default());
            println!("{name}: {before:?} {:.3}, {after:?} {:.3}", before.at_work(), after.at_work());
        }
        assert!(2 * after < before, "{shading:?}: {before} and {after} atomic operations on sums");
        let [before, after] = [&one_by_one, &spread].map(|tally| tally.calls["footprint"]);
        assert_eq!(before.lanes, after.lanes);
        assert!(after.at_work() > 2.0 * before.at_work(), "{shading:?}: {before:?} and {after:?}");
    }
}

#[test]
fn spreading_changes_no_bit_of_any_form() {
    let mut spread = Vec::new();
    let always = ["unlit", "constant", "max", "radius"];
    for (k, (name, scene, camera, options)) in drawn().into_iter().enumerate() {
        if !always.contains(&name) && !common::takes(k, 6) {
            continue;
        }
        let (expected, ..) = alone((&scene, &camera), &options);
        let (frame, report, _) = scattered(card(), Sources::default(), (&scene, &camera), &options);
        assert!(bits(&frame) == bits(&expected), "{name}: spreading changes bits");
        // Terms of wide sums do not fit in one word.
        assert!(!report.needs.contains(&"spreads") || !report.needs.contains(&"wide-sums"), "{name}");
        spread.extend(report.needs.contains(&"spreads").then_some(name));
    }
    assert!(always.iter().all(|name| spread.contains(name)), "{spread:?}");
    // Samples, several pages, and a wider view with several bands.
    let (scene, camera) = (sphere(2000, 2.0), sphere_camera(41, Projection::Pinhole));
    let options = Settings { samples: Samples { across: 2, down: 4 }, ..Default::default() };
    let (expected, ..) = alone((&scene, &camera), &options);
    for most in [30_000, 100_000] {
        let gpu = card().with_buffer_limit(most);
        let (frame, report, _) = scattered(gpu, Sources::default(), (&scene, &camera), &options);
        assert!(report.needs.contains(&"spreads"));
        assert!(bits(&frame) == bits(&expected), "{most} bytes a buffer: spreading changes bits");
    }
}

/// Faults in the kernels show: carries that are dropped, and places that any block takes.
#[test]
fn a_fault_in_the_window_shows() {
    let (scene, camera) = (sphere(15_625, 1.5), sphere_camera(128, Projection::Pinhole));
    let options = Settings { shading: Shading::Unlit, maps: Maps::NONE, ..Default::default() };
    let (expected, ..) = alone((&scene, &camera), &options);
    for (from, to) in [
        ("let high = (carries >> (8u * (channel % 4u))) & 0xffu;", "let high = 0u & carries;"),
        ("if (atomicLoad(&window_owners[choice]) == own) {", "if (own != 0u) {"),
    ] {
        let faulty = Sources::default().replace("sums_window.wgsl", from, to).unwrap();
        let (frame, ..) = scattered(card(), faulty, (&scene, &camera), &options);
        assert!(bits(&frame) != bits(&expected), "{from}");
    }
}

/// Sums with upper words go to storage alike, whether two of them share a 64-bit number or not.
#[test]
fn deposits_are_the_same_with_and_without_64_bit_atomics() {
    let Some(gpu) = common::gpu() else { return };
    assert!(gpu.adapter.atomics_u64, "no adapter of the tests lacks 64-bit atomics");
    let (scene, camera) = (sphere(3000, 1.8), sphere_camera(90, Projection::Pinhole));
    let options = Settings { organisation: Organisation::Scatter, maps: Maps::ON_DEVICE, ..Default::default() };
    let frame = |call: &str, pairs: bool| {
        let plain = "add_pair_stored(pixel, channel, first, second);";
        let sources = Sources::default().replace("sums_direct.wgsl", plain, call).unwrap();
        let mut gpu = gpu.clone();
        gpu.adapter.atomics_u64 = pairs;
        let backend = Backend::Gpu { gpu: Box::new(gpu), sources };
        let (frame, report) = render(&scene, &camera, &options, &backend, &()).unwrap();
        assert_eq!(report.needs.contains(&"atomics-u64"), pairs);
        bits(&frame)
    };
    let added = frame("add_pair_stored(pixel, channel, first, second);", true);
    let deposited = "deposit_stored(pixel, channel, vec2<u32>(first, 0u), vec2<u32>(second, 0u));";
    assert!(frame(deposited, true) == added && frame(deposited, false) == added);
    // Terms of more than one word; words of ones carry in every possible place.
    for [first, second] in
        [["first, 1u", "second, 2u"], ["first, 3u", "0xffffffffu, 0u"], ["0xffffffffu, 1u", "second, 5u"]]
    {
        let call = format!("deposit_stored(pixel, channel, vec2<u32>({first}), vec2<u32>({second}));");
        let paired = frame(&call, true);
        assert!(paired == frame(&call, false), "{call}");
        assert!(paired != added, "{call}");
    }
}
