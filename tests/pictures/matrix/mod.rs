//! Random combinations of options: all forms give the same bits, and these match the f64 reference.
//!
//! A seed chooses shapes, colours, filters, samples, composites, joins, maps, accumulators and
//! organisations. Each combination is drawn in every organisation and in another form: another
//! order of surfels, small buffers, an adapter without some features, or without some
//! optimisations. The reference judges the pixels that rounding does not decide.
//!
//! The device draws `EPSPLAT_MATRIX_FRAMES` frames, starting with the combination of seed
//! `EPSPLAT_MATRIX_SEED`:
//!
//! ```text
//! EPSPLAT_MATRIX_FRAMES=4000 EPSPLAT_MATRIX_SEED=1000 \
//!   cargo test --release --test pictures matrix::every -- --nocapture
//! ```
//!
//! Options that the checks refuse are counted by their error, and other options are chosen instead.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod judge;

use std::collections::BTreeMap;

use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::{Gpu, Sources};
use epsplat::low_level::plan::{Accumulator, Facts, Organisation, Settings, check};
use epsplat::low_level::render::{Backend, render};
use epsplat::low_level::scene::{Camera, Colors, Map, Maps, Samples, Scene, Shading};

use judge::Digits;

use crate::common;
use common::any_scene::{self, Sampled};
use common::{Random, any_options};

/// Frames that the device draws by default.
const FRAMES: usize = 80;

/// Views per combination.
const VIEWS: usize = 3;

/// Combinations that are drawn before the frames are counted.
const AT_ONCE: u64 = 8;

/// Threads that draw.
const WORKERS: usize = 2;

/// Attempts to choose options that the checks accept; one in a few succeeds.
const DRAWS: usize = 400;

/// Two devices: one with all features of the adapter, one with core WebGPU only.
struct Devices {
    whole: Gpu,
    core: Gpu,
}

/// A scene, a view, and options that the checks accept.
struct Combination {
    seed: u64,
    sampled: Sampled,
    options: Settings,
    random: Random,
}

/// The outcome of several combinations.
#[derive(Default)]
struct Tally {
    combinations: usize,
    frames: usize,
    pixels: usize,
    undecided: usize,
    /// Frames of which some pixel is compared with moved scenes ([`judge::moved`]).
    moved: usize,
    /// Sets of options chosen; `refused` counts those that the checks refused, by error.
    drawn: usize,
    refused: BTreeMap<String, usize>,
    failures: Vec<String>,
}

impl Tally {
    fn and(mut self, other: Self) -> Self {
        self.combinations += other.combinations;
        self.frames += other.frames;
        self.pixels += other.pixels;
        self.undecided += other.undecided;
        self.moved += other.moved;
        self.drawn += other.drawn;
        other.refused.into_iter().for_each(|(why, count)| *self.refused.entry(why).or_default() += count);
        self.failures.extend(other.failures);
        self
    }

    /// Prints the counts, and each refusal with its share of the chosen sets of options.
    fn print(&self) {
        let refused: usize = self.refused.values().sum();
        eprintln!(
            "{} combinations, {} frames, {} judged by moved scenes, {:.1} % of {} pixels left to rounding; {refused} \
             of {} drawn options refused",
            self.combinations,
            self.frames,
            self.moved,
            100.0 * self.undecided as f64 / self.pixels.max(1) as f64,
            self.pixels,
            self.drawn,
        );
        let mut sorted: Vec<_> = self.refused.iter().collect();
        sorted.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
        for (why, count) in sorted {
            eprintln!("  {:6.2} %  {why}", 100.0 * *count as f64 / self.drawn.max(1) as f64);
        }
    }
}

fn checked(scene: &Scene, options: &Settings) -> epsplat::Result<()> {
    check::options(options, false)?;
    check::scene(&Facts::of(scene), options, false)
}

/// Returns the combination of a seed: chooses options until the checks accept some.
fn combination(seed: u64, tally: &mut Tally) -> Option<Combination> {
    let mut random = Random(seed);
    let sampled = any_scene::sampled(&mut random);
    for _ in 0..DRAWS {
        let options = any_options::sampled(&sampled.scene, &mut random);
        tally.drawn += 1;
        match checked(&sampled.scene, &options) {
            Ok(()) => return Some(Combination { seed, sampled, options, random }),
            Err(why) => *tally.refused.entry(why.to_string()).or_default() += 1,
        }
    }
    tally.failures.push(format!("seed {seed}: nothing goes with {:?}", sampled.about));
    None
}

/// Chooses another form of a combination, which must give the same bits.
fn another_form(combination: &mut Combination, devices: &Devices) -> (&'static str, Scene, Settings, Gpu) {
    let Combination { sampled: Sampled { scene, .. }, options, random, .. } = combination;
    let (scene, options, whole) = (scene.clone(), options.clone(), devices.whole.clone());
    match random.below(5) {
        0 => ("another order", any_scene::shuffled(&scene, random), options, whole),
        1 => ("small buffers", scene, options, whole.with_buffer_limit([300_000, 900_000][random.below(2)])),
        2 => ("core WebGPU", scene, options, devices.core.clone()),
        3 => {
            let mut lacking = whole;
            (lacking.adapter.subgroups, lacking.adapter.atomics_u64) = (random.one_in(2), random.one_in(2));
            ("an adapter that lacks some", scene, options, lacking)
        }
        _ => ("no optimisations", scene, Settings { without: any_options::without(random), ..options }, whole),
    }
}

/// Draws a combination in all its forms and views, and judges it.
fn drawn(mut combination: Combination, devices: &Devices, sources: &Sources, tally: &mut Tally) {
    let form = another_form(&mut combination, devices);
    let views = views(&mut combination);
    let Combination { seed, sampled: Sampled { scene, about, .. }, options, .. } = &combination;
    let mut forms = vec![form];
    for (name, organisation) in [("scatter", Organisation::Scatter), ("tile", Organisation::Tile)] {
        let other = Settings { organisation, ..options.clone() };
        match checked(scene, &other) {
            Ok(()) => forms.push((name, scene.clone(), other, devices.whole.clone())),
            // Other accumulators do not support every organisation.
            Err(_) if options.accumulator != Accumulator::Fixed => {}
            Err(why) => *tally.refused.entry(format!("by {name}: {why}")).or_default() += 1,
        }
    }
    tally.combinations += 1;
    for camera in &views {
        let wrong = wrong((scene, camera, options), &forms, (&devices.whole, sources), tally);
        if !wrong.is_empty() {
            let size = (camera.width, camera.height, camera.projection);
            let failure = format!("seed {seed}: {about:?}, {size:?}, {options:?}:\n    {}", wrong.join("\n    "));
            // Failures are printed at once, because the test can take long.
            eprintln!("{failure}");
            tally.failures.push(failure);
            return;
        }
    }
}

/// The combination's view, and copies of it that are shifted by up to 3 pixels and scaled by up to
/// 10 %.
///
/// Kernels are compiled once for all of them.
fn views(combination: &mut Combination) -> Vec<Camera> {
    let Combination { sampled: Sampled { camera, .. }, random, .. } = combination;
    let mut another = || {
        let [x, y, zoom] = [random.between(-3.0, 3.0), random.between(-3.0, 3.0), random.between(0.9, 1.1)];
        Camera { cx: camera.cx + x, cy: camera.cy + y, fx: camera.fx * zoom, fy: camera.fy * zoom, ..camera.clone() }
    };
    let others: Vec<Camera> = (1..VIEWS).map(|_| another()).collect();
    std::iter::once(camera.clone()).chain(others).collect()
}

/// Describes the faults of one view: differences from the reference, and between its forms.
fn wrong(
    (scene, camera, options): (&Scene, &Camera, &Settings),
    forms: &[(&'static str, Scene, Settings, Gpu)],
    (whole, sources): (&Gpu, &Sources),
    tally: &mut Tally,
) -> Vec<String> {
    let on = |gpu: &Gpu| Backend::Gpu { gpu: Box::new(gpu.clone()), sources: sources.clone() };
    let frame = |scene: &Scene, options: &Settings, backend: &Backend| -> Result<Frame, String> {
        render(scene, camera, options, backend, &()).map(|(frame, _)| frame).map_err(|error| error.to_string())
    };
    let own = frame(scene, options, &on(whole));
    let (own, reference) = match own.and_then(|own| Ok((own, of_reference(scene, camera, options)?))) {
        Ok(both) => both,
        Err(why) => return vec![why],
    };
    tally.frames += 1;
    tally.pixels += own.color.len();
    tally.undecided += judge::undecided(&reference);
    let digits = match digits(scene, camera, options) {
        Ok(digits) => digits,
        Err(why) => return vec![why],
    };
    let painted = matches!(scene.colors, Colors::Textured(_));
    let mut apart = judge::wrong(&own, &reference, &[], &digits, painted);
    if !apart.is_empty() {
        tally.moved += 1;
        let moved: Result<Vec<Frame>, String> =
            judge::moved(scene, camera).iter().map(|(scene, camera)| of_reference(scene, camera, options)).collect();
        match moved {
            Ok(moved) => apart = judge::wrong(&own, &reference, &moved, &digits, painted),
            Err(why) => return vec![why],
        }
    }
    let mut wrong = Vec::new();
    wrong.extend((!apart.is_empty()).then(|| format!("reference: {apart}")));
    for (name, scene, options, gpu) in forms {
        // Another order changes the surfels' numbers, so the index map is not compared.
        let but = (*name == "another order").then_some(Map::Index);
        tally.frames += 1;
        match frame(scene, options, &on(gpu)) {
            // Another form may use atomics that its adapter lacks.
            Err(why) if why.contains("which this adapter lacks") => {
                *tally.refused.entry(format!("by {name}: {why}")).or_default() += 1;
            }
            Err(why) => wrong.push(format!("{name}: {why}")),
            Ok(other) => {
                let apart = judge::bits_apart(&own, &other, but);
                wrong.extend((!apart.is_empty()).then(|| format!("{name}: {apart}")));
            }
        }
    }
    wrong
}

/// The reference's frame with the map of decisions.
fn of_reference(scene: &Scene, camera: &Camera, options: &Settings) -> Result<Frame, String> {
    let options = Settings { maps: options.maps.and(&[Map::Decision]), ..options.clone() };
    let drawn = render(scene, camera, &options, &Backend::Reference, &());
    drawn.map(|(frame, _)| frame).map_err(|error| error.to_string())
}

/// The errors that a sum's few digits explain: 0 where sums have many digits.
fn digits(scene: &Scene, camera: &Camera, options: &Settings) -> Result<Digits, String> {
    if !any_options::has_few_digits(options.accumulator) {
        return Ok(Digits { color: vec![0.0; camera.pixels()], maps: vec![0.0; camera.pixels()] });
    }
    let (low, high) = scene.color_range();
    let span = (0..4).map(|k| f64::from(high[k].max(0.0) - low[k].min(0.0))).fold(1.0, f64::max);
    // Light multiplies colours. A highlight changes `shininess` times as fast as the normal, whose
    // components span 2.
    let light: f64 = options.lights.iter().map(|light| f64::from(light.intensity())).sum();
    let lit = match options.shading {
        Shading::Unlit => span,
        Shading::Lambert => span * (1.0 + 3.0 * light),
        Shading::Phong => span * (1.0 + 3.0 * light) + 2.0 * light * f64::from(options.shininess),
    };
    let of_scene = (options.accumulator.row(), scene.surfels.len() as u64, lit.max(2.0));
    let maps = Maps::of(&[Map::Count, Map::Weight]);
    let one = Settings { samples: Samples::ONE, maps, accumulator: Accumulator::Fixed, ..options.clone() };
    let of = |Samples { across, down }: Samples| -> Result<Vec<f32>, String> {
        let sampled = camera.sampled(Samples { across, down }).map_err(|error| error.to_string())?;
        let frame = render(scene, &sampled, &one, &Backend::Reference, &()).map_err(|error| error.to_string())?.0;
        Ok(judge::of_sums(&frame, [across as usize, down as usize], of_scene))
    };
    // Maps are taken at the pixel's centre.
    Ok(Digits { color: of(options.samples)?, maps: of(Samples::ONE)? })
}

fn devices() -> Option<Devices> {
    Some(Devices { whole: common::gpu()?, core: common::core_gpu()? })
}

/// The tally of the combinations of `seeds`.
fn of_seeds(seeds: &[u64], devices: &Devices) -> Tally {
    let mut tally = Tally::default();
    for seed in seeds {
        if let Some(combination) = combination(*seed, &mut tally) {
            drawn(combination, devices, &Sources::default(), &mut tally);
        }
    }
    tally
}

fn number(name: &str, unless_given: u64) -> u64 {
    std::env::var(name).map_or(unless_given, |text| text.parse().unwrap_or_else(|_| panic!("{name} is {text:?}")))
}

#[test]
fn every_combination_is_drawn_alike_and_right() {
    let Some(devices) = devices() else { return };
    let frames = number("EPSPLAT_MATRIX_FRAMES", FRAMES as u64) as usize;
    let mut seed = number("EPSPLAT_MATRIX_SEED", 1);
    let (mut tally, devices) = (Tally::default(), &devices);
    while tally.frames < frames {
        let seeds: Vec<u64> = (seed..seed + AT_ONCE).collect();
        // Threads without a pool: a waiting thread of a pool would start another render.
        let workers = seeds.chunks(AT_ONCE as usize / WORKERS).map(|seeds| move || of_seeds(seeds, devices));
        let tallies = std::thread::scope(|scope| {
            let running: Vec<_> = workers.map(|worker| scope.spawn(worker)).collect();
            running.into_iter().map(|worker| worker.join().unwrap()).collect::<Vec<_>>()
        });
        tally = tallies.into_iter().fold(tally, Tally::and);
        if frames > FRAMES {
            eprintln!("seeds to {}: {} combinations, {} frames", seed + AT_ONCE - 1, tally.combinations, tally.frames);
        }
        seed += AT_ONCE;
    }
    tally.print();
    assert!(tally.failures.is_empty(), "{} failed:\n{}", tally.failures.len(), tally.failures.join("\n"));
    assert!(tally.undecided * 4 < tally.pixels, "the reference decides too little");
}

/// Pixels that once strayed from the reference: sums of few digits, normals that nearly cancel, and
/// caps at their outlines.
#[test]
fn what_once_strayed_is_judged_right() {
    let Some(devices) = devices() else { return };
    let tally = of_seeds(&[12059, 10889, 11473, 13033, 14012], &devices);
    assert!(tally.failures.is_empty() && tally.combinations == 5, "{}", tally.failures.join("\n"));
}

/// The checks refuse less than three quarters of the options that are drawn. Each refusal is
/// printed with its share.
#[test]
fn refusals_are_counted() {
    let mut tally = Tally::default();
    (0..2000).for_each(|seed| drop(combination(seed, &mut tally)));
    tally.print();
    let refused: usize = tally.refused.values().sum();
    assert!(tally.failures.is_empty() && 4 * refused < 3 * tally.drawn, "{refused} of {}", tally.drawn);
}

/// A fault in one organisation, or of 2 % in a formula that all share, is found within 24
/// combinations that it can affect.
#[test]
fn a_fault_is_found() {
    let Some(devices) = devices() else { return };
    let curved = |of: &Combination| {
        let filtered = of.options.low_pass == epsplat::low_level::scene::LowPass::Max && of.options.maps != Maps::NONE;
        filtered && of.sampled.about.contains(&"caps") && of.sampled.scene.oriented
    };
    type Fits<'a> = &'a dyn Fn(&Combination) -> bool;
    let blended = |of: &Combination| {
        of.options.join == epsplat::low_level::scene::Join::Blended && of.sampled.about.contains(&"triangles")
    };
    let faults: [(&str, &str, &str, Fits<'_>); 4] = [
        ("hand_curved.wgsl", "if (FILTERED)", "if (false)", &curved),
        ("covered.wgsl", "LIST_EMPTY != 0u ||", "false ||", &|of| of.options.maps.has(Map::TexZ)),
        ("curved.wgsl", "let a = 0.5 * bent", "let a = 0.51 * bent", &|of| of.sampled.about.contains(&"caps")),
        ("join_blended.wgsl", "clamp(0.5 +", "clamp(0.51 +", &blended),
    ];
    for (_, (file, from, to, fits)) in faults.into_iter().enumerate().filter(|(k, _)| common::takes(*k, 2)) {
        let sources = Sources::default().replace(file, from, to).unwrap();
        let found =
            (0..4000).filter_map(|seed| combination(seed, &mut Tally::default())).filter(|of| fits(of)).take(24);
        let is_found = found.into_iter().any(|of| {
            let mut tally = Tally::default();
            drawn(of, &devices, &sources, &mut tally);
            !tally.failures.is_empty()
        });
        assert!(is_found, "{file}: {from}");
    }
}
