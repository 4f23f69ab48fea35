//! Plans of typical renders, step by step, without an adapter: a frame is planned before any device
//! is used.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use common::scenes::{sphere, sphere_camera};
use epsplat::low_level::gpu::AdapterDescription;
use epsplat::low_level::passes::fragments;
use epsplat::low_level::plan::known::Listed;
use epsplat::low_level::plan::steps::{Look, Over, Stage, Step};
use epsplat::low_level::plan::{
    Accumulator, Band, Facts, Fetch, Known, Optimisation, Organisation, Plan, Raster, SceneNeeds, Settings, check,
    page_surfels, tuning,
};
use epsplat::low_level::render::sequence::steps;
use epsplat::low_level::scene::{Blend, Camera, Colors, LowPass, Map, Maps, Projection, Scene, Shading};

/// A software adapter with all optional features, such as Mesa's.
fn software() -> AdapterDescription {
    AdapterDescription {
        kind: "software",
        atomics_u64: true,
        integers_u64: true,
        subgroups: true,
        ..AdapterDescription::core()
    }
}

fn planned(scene: &Scene, size: u32, adapter: &AdapterDescription, options: &Settings, known: &Known) -> Plan {
    Plan::of(&Facts::of(scene), adapter, &camera(size), options, known).unwrap()
}

fn camera(size: u32) -> Camera {
    sphere_camera(size, Projection::Pinhole)
}

/// Formats a stage: its pass, its kernels with their extents, its page if it has one, and its band
/// unless that is 0.
fn line(stage: &Stage) -> String {
    let runs: Vec<_> = stage
        .runs
        .iter()
        .map(|run| match run.over {
            Over::Once => run.kernel.name.to_owned(),
            over => format!("{}/{over:?}", run.kernel.name),
        })
        .collect();
    let place = stage.page.map_or_else(String::new, |page| format!(" page {page}"));
    let band = if stage.band > 0 { format!(" band {}", stage.band) } else { String::new() };
    format!("{}: {}{place}{band}", stage.pass, runs.join(", "))
}

/// The steps of a frame of one process, which exchanges nothing.
fn lines(plan: &Plan) -> Vec<String> {
    lines_with_exchanges(plan).into_iter().filter(|line| !line.starts_with("exchange")).collect()
}

fn lines_with_exchanges(plan: &Plan) -> Vec<String> {
    let step = |step: &Step| match step {
        Step::Exchange(what, band) => format!("exchange {what:?} of {band}"),
        Step::Stage(stage) => line(stage),
        Step::Select => "select".to_owned(),
        Step::Look(Look::Cut) => "look for a cut".to_owned(),
        Step::Look(Look::Slots(part)) => format!("look for slots of {part:?}"),
        Step::Look(Look::Fragments(band)) => format!("look for fragments of {band}"),
        Step::Look(Look::Lists(of, _)) => format!("look for lists of {of:?}"),
        Step::Large { by_tiles, by_workgroups } => {
            let all = |stages: &[Stage]| stages.iter().map(line).collect::<Vec<_>>().join(", then ");
            format!("{}, or {}", all(by_tiles), all(by_workgroups))
        }
        Step::Draw => "draw".to_owned(),
        Step::DrawTriangles => "draw triangles".to_owned(),
        Step::ReadBack(band) => format!("read back {band}"),
    };
    steps(plan).iter().map(step).collect()
}

const PROJECT: &str = "project: project/Slots(All), project_rare/Rare";
const RESOLVE: &str = "resolve: resolve/Covered";

/// The steps of scatter by a graphics card. A processor projects and draws by two kernels.
fn scattered() -> [&'static str; 7] {
    let [project, _, large, occlude, accumulate, accumulate_large, resolve, end] = split();
    [project, large, occlude, accumulate, accumulate_large, resolve, end]
}

/// The steps of scatter by a processor.
fn split() -> [&'static str; 8] {
    [
        PROJECT,
        "visibility: visibility/Slots(All)",
        "visibility: visibility_large/Large",
        "visibility: occlude/OcclusionBlocks",
        "accumulate: accumulate/Slots(All)",
        "accumulate: accumulate_large/Large",
        RESOLVE,
        "read back 0",
    ]
}

#[test]
fn few_surfels_on_core_webgpu_look_for_large_ones_once() {
    let (scene, core) = (sphere(1000, 1.5), AdapterDescription::core());
    let first = planned(&scene, 256, &core, &Settings::default(), &Known::default());
    assert_eq!(
        lines(&first),
        [
            PROJECT,
            "look for lists of Large",
            "bin: bin_count_large/Listing, bin_scan_large, bin_place_large/Listing page 0, then \
             visibility: tile_visibility/Tiles page 0, or visibility: visibility_large/Large",
            "visibility: occlude/OcclusionBlocks",
            "accumulate: accumulate/Slots(All)",
            "accumulate: tile_accumulate/Tiles page 0, or accumulate: accumulate_large/Large",
            RESOLVE,
            "read back 0",
        ]
    );
    // The first frame found no large splats.
    let known = Known { large: Some(false), ..Known::default() };
    assert_eq!(lines(&planned(&scene, 256, &core, &Settings::default(), &known)), scattered());
    // The first frame found some, and the lists have room for 100 entries.
    let known = Known { large: Some(true), entries: [Some(100), None], ..Known::default() };
    let second = lines(&planned(&scene, 256, &core, &Settings::default(), &known));
    let listed: Vec<_> = second.iter().filter(|line| line.contains("tile_") || line.starts_with("bin")).collect();
    assert_eq!((listed.len(), second.len()), (3, 8), "{second:?}");
    assert!(!second.iter().any(|line| line.contains("look") || line.contains("_large/Large")), "{second:?}");
}

/// Nearest depths are exchanged before anything depends on them, and sums when all are there.
#[test]
fn processes_exchange_what_each_surface_needs() {
    let (scene, core) = (sphere(1000, 1.5), AdapterDescription::core());
    let scatter = Settings { organisation: Organisation::Scatter, ..Settings::default() };
    let [project, large, occlude, accumulate, accumulate_large, resolve, end] = scattered();
    let (nearest, sums) = ("exchange Numbers(Nearest) of 0", "exchange Numbers(Sums) of 0");
    assert_eq!(
        lines_with_exchanges(&planned(&scene, 256, &core, &scatter, &Known::default())),
        [project, large, nearest, occlude, accumulate, accumulate_large, sums, resolve, end]
    );
    // Sums in registers, or of separate inputs, are not exchanged.
    let mut inputs = scene.clone();
    [0, 500].into_iter().for_each(|first| inputs.provenance.push(first, Vec::new(), None));
    let gathering = Known { touched_tiles: 3.0, ..Known::default() };
    let others =
        [(Settings::default(), gathering), (Settings { separate: true, ..Settings::default() }, Known::default())];
    for (options, known) in others {
        let plan = planned(&inputs, 256, &software(), &options, &known);
        assert_eq!(lines_with_exchanges(&plan), lines(&plan), "{options:?}");
    }
    // Other surfaces exchange other numbers. There are no 64-bit atomics.
    let nearest_alone = Settings { blend: Blend::Nearest, shading: Shading::Unlit, ..Settings::default() };
    let layers = Settings { composite: "layers".parse().unwrap(), opacity: 0.5, ..Settings::default() };
    let moments = Settings { composite: "moments".parse().unwrap(), ..Settings::default() };
    let common = "exchange Numbers(Common(\"moments\")) of 0";
    let surfaces: [(Settings, &[&str]); 3] = [
        (nearest_alone, &[nearest, "exchange Numbers(Winners) of 0"]),
        (layers, &["exchange Numbers(Counts) of 0", "exchange Fragments of 0"]),
        (moments, &[nearest, common, sums]),
    ];
    for (options, expected) in surfaces {
        let plan = planned(&scene, 256, &core, &options, &Known::default());
        let all = lines_with_exchanges(&plan);
        let exchanges: Vec<_> = all.iter().filter(|line| line.starts_with("exchange")).collect();
        assert_eq!(exchanges, expected, "{options:?}");
    }
}

#[test]
fn other_accumulators_and_scatter_have_no_tiles() {
    let (scene, software) = (sphere(1000, 1.5), software());
    let options = [
        Settings { accumulator: Accumulator::Fixed32, ..Settings::default() },
        Settings { accumulator: Accumulator::Fixed64, ..Settings::default() },
        Settings { organisation: Organisation::Scatter, low_pass: LowPass::Ewa, ..Settings::default() },
    ];
    for options in options {
        assert_eq!(lines(&planned(&scene, 256, &software, &options, &Known::default())), split());
        let merged = Settings { without: vec![Optimisation::Splitting], ..options };
        assert_eq!(lines(&planned(&scene, 256, &software, &merged, &Known::default())), scattered());
    }
}

#[test]
fn many_surfels_are_drawn_near_ones_first() {
    let (scene, core) = (sphere(20_000, 1.5), AdapterDescription::core());
    let options = Settings { organisation: Organisation::Scatter, ..Settings::default() };
    let culled = planned(&scene, 128, &core, &options, &Known::default());
    assert_eq!(
        lines(&culled)[..9],
        [
            "project: cull_near/Batches",
            "look for slots of Near",
            "project: project/Slots(Near)",
            "visibility: occlude_open/Occlusion",
            "project: cull_far/Batches",
            "look for slots of Far",
            "project: project/Slots(Far), project_rare/Rare",
            "visibility: visibility_large/Large",
            "visibility: occlude/OcclusionBlocks",
        ]
    );
    let split = lines(&planned(&scene, 128, &software(), &options, &Known::default()));
    let drawn = ["Near", "Far"].map(|part| {
        [format!("project: project/Slots({part}), project_rare/Rare"), format!("visibility: visibility/Slots({part})")]
    });
    assert!(drawn.iter().all(|pair| split.windows(2).any(|lines| lines == pair)), "{split:?}");
    let known = Known { slots: true, ..Known::default() };
    assert!(!lines(&planned(&scene, 128, &core, &options, &known)).iter().any(|line| line.starts_with("look")));
    // Culling does not pay with more than six pixels per surfel.
    assert!(!planned(&scene, 512, &core, &options, &Known::default()).needs.cull);
    let without = Settings { without: vec![Optimisation::Culling], ..options };
    assert_eq!(lines(&planned(&scene, 128, &core, &without, &Known::default())), scattered());
}

#[test]
fn tiles_of_a_software_adapter_gather_splats_that_are_not_tiny() {
    let (scene, options) = (sphere(1000, 1.5), Settings::default());
    let known = Known { touched_tiles: 3.0, ..Known::default() };
    let gathered = planned(&scene, 256, &software(), &options, &known);
    assert!(gathered.needs.surface.gathers() && gathered.sum_words == 0);
    assert_eq!(
        lines(&gathered)[6..],
        [
            "look for lists of Small",
            "bin: bin_count/Slots(All), bin_scan, bin_place/Slots(All) page 0",
            "accumulate: tile_resolve/CoveredEights page 0",
            "read back 0",
        ]
    );
    let tiny = Known { touched_tiles: 1.2, ..Known::default() };
    let crowded = Known { crowded: true, ..known.clone() };
    let nothing = Scene { surfels: vec![], colors: Colors::Constant([1.0; 4]), ..scene.clone() };
    assert!(!planned(&nothing, 256, &software(), &options, &known).needs.surface.gathers());
    let card = AdapterDescription { kind: "discrete", ..software() };
    assert!(!planned(&scene, 256, &software(), &options, &tiny).needs.surface.gathers());
    assert!(!planned(&scene, 256, &software(), &options, &crowded).needs.surface.gathers());
    assert!(!planned(&scene, 256, &card, &options, &known).needs.surface.gathers());
    let tile = Settings { organisation: Organisation::Tile, ..options };
    assert!(planned(&scene, 256, &card, &tile, &tiny).needs.surface.gathers());
}

#[test]
fn a_study_chooses_how_tiles_get_splats_and_which_are_large() {
    let (scene, camera) = (sphere(1000, 1.5), sphere_camera(256, Projection::Pinhole));
    let facts = Facts::of(&scene);
    let card = AdapterDescription { kind: "discrete", ..software() };
    let of = |adapter: &AdapterDescription, options: &Settings| {
        SceneNeeds::of(&facts, adapter, &camera, options).surface.fetch().unwrap()
    };
    let plain = Settings::default();
    assert_eq!((of(&card, &plain), of(&software(), &plain)), (Fetch::Staged, Fetch::Shared));
    for (fetch, _) in Fetch::ALL {
        let options = Settings { fetch: Some(fetch), ..Settings::default() };
        assert_eq!([&card, &software()].map(|adapter| of(adapter, &options)), [fetch; 2]);
    }
    let shared = Settings { fetch: Some(Fetch::Shared), ..Settings::default() };
    let refused = |adapter: &AdapterDescription| {
        check::on_adapter(adapter, &SceneNeeds::of(&facts, adapter, &camera, &shared), &camera).err()
    };
    assert!(refused(&card).is_none());
    assert!(refused(&AdapterDescription::core()).unwrap().to_string().contains("take --fetch staged"));
    let large = |options: &Settings| [true, false].map(|tiles| tuning::large(tiles, options));
    assert_eq!(large(&plain), [tuning::LARGE_BY_TILES, tuning::LARGE_BY_WORKGROUPS]);
    assert_eq!(large(&Settings { organisation: Organisation::Tile, ..Settings::default() })[0], 0);
    assert_eq!(large(&Settings { large: Some(40), organisation: Organisation::Tile, ..Settings::default() }), [40; 2]);
}

#[test]
fn small_buffers_make_bands_and_pages() {
    let scene = sphere(3000, 1.5);
    let small = AdapterDescription { max_storage_buffer_binding_size: 100_000, ..AdapterDescription::core() };
    let culled = Settings { maps: Maps::of(&[Map::Depth, Map::Normal, Map::Count]), ..Default::default() };
    let options = Settings { without: vec![Optimisation::Culling], ..culled.clone() };
    let known = Known { large: Some(true), entries: [Some(10), None], ..Known::default() };
    let plan = planned(&scene, 64, &small, &options, &known);
    assert_eq!((plan.bands.len(), plan.pages), (4, 3000_u64.div_ceil(page_surfels(&small, &plan.needs)) as usize));
    assert!(plan.pages > 1 && !plan.needs.surface.gathers() && !plan.projects_each_band);
    assert_eq!(plan.bands.iter().map(|band| band.rows).sum::<u32>(), 64);
    let lines = lines(&plan);
    // Bands share projected splats. Pages share the lists, so the lists are built for each page in
    // turn, and again for the second pass.
    assert_eq!(lines.iter().filter(|line| line.starts_with("project")).count(), 1);
    assert_eq!(lines.iter().filter(|line| line.starts_with("bin")).count(), 2 * plan.bands.len() * plan.pages);
    assert_eq!(lines.iter().filter(|line| line.starts_with("read back")).count(), 4);
    // With culling, each band selects and projects its own near and far batches.
    let plan = planned(&scene, 64, &small, &culled, &known);
    assert!(plan.needs.cull && plan.projects_each_band && plan.looks_for_slots && plan.bands.len() == 4);
    assert_eq!(self::lines(&plan).iter().filter(|line| line.starts_with("project")).count(), 4 * 4);
    // The pixel limit of Mesa's software adapter does not apply to a card. The image has 16 million
    // pixels of 16 bytes.
    let large = AdapterDescription { max_storage_buffer_binding_size: 1 << 30, ..AdapterDescription::core() };
    let large = AdapterDescription { max_buffer_size: 1 << 30, ..large };
    let bands_of = |kind| {
        let adapter = AdapterDescription { kind, ..large.clone() };
        planned(&scene, 4096, &adapter, &Settings { shading: Shading::Unlit, ..Default::default() }, &known).bands.len()
    };
    assert_eq!((bands_of("discrete"), bands_of("software")), (1, 2));
    // One row exceeds a buffer.
    let tiny = AdapterDescription { max_storage_buffer_binding_size: 1000, ..AdapterDescription::core() };
    let error = Plan::of(&Facts::of(&scene), &tiny, &camera(64), &options, &known).unwrap_err();
    assert!(error.to_string().contains("narrower image"), "{error}");
}

#[test]
fn copies_are_drawn_once_and_without_tiles() {
    let mut scene = sphere(10, 1.5);
    scene.surfels = vec![scene.surfels[0]; 5000];
    scene.colors = Colors::Constant([1.0; 4]);
    let plan = planned(&scene, 64, &software(), &Settings::default(), &Known::default());
    assert!(plan.needs.surface.copies() && !plan.needs.surface.tiles() && !plan.needs.cull && !plan.needs.atomics_u64);
    assert_eq!(lines(&plan), split());
    let tile = Settings { organisation: Organisation::Tile, ..Settings::default() };
    assert!(!planned(&scene, 64, &software(), &tile, &Known::default()).needs.surface.copies());
}

/// The plan counts and lists the fragments of transparent surfaces. If all surfaces are opaque, it
/// has no such steps.
#[test]
fn what_shows_through_is_listed() {
    let scene = sphere(1000, 1.5);
    let options = Settings { composite: "layers".parse().unwrap(), opacity: 0.5, ..Settings::default() };
    let plan = planned(&scene, 64, &software(), &options, &Known::default());
    assert_eq!(
        lines(&plan),
        [
            PROJECT,
            "visibility: visibility/Slots(All)",
            "visibility: visibility_large/Large",
            "visibility: occlude/OcclusionBlocks",
            "bin: fragments_of_rows/Rows, start_rows, start_pixels/Rows",
            "look for fragments of 0",
            "accumulate: list_fragments/Slots(All), list_fragments_large/Large",
            "sort: sort_fragments/Pixels",
            RESOLVE,
            "read back 0",
        ]
    );
    // An earlier frame has cut the bands by their number of fragments.
    let cuts = vec![Band::of(64, 0, 40), Band::of(64, 40, 24)];
    let cut = planned(&scene, 64, &software(), &options, &Known { cuts: Some(cuts.clone()), ..Known::default() });
    assert_eq!((cut.bands, cut.pages), (cuts, 1));
    let opaque = Settings { opacity: 1.0, ..options };
    let plain = Settings::default();
    let [opaque, plain] = [opaque, plain].map(|options| planned(&scene, 64, &software(), &options, &Known::default()));
    assert_eq!(opaque.needs, plain.needs);
}

/// A band with too many fragments is cut before the row that would exceed the limit.
#[test]
fn bands_are_cut_by_their_fragments() {
    let options = Settings { composite: "sorted".parse().unwrap(), opacity: 0.5, ..Settings::default() };
    let plan = planned(&sphere(1000, 1.5), 8, &software(), &options, &Known::default());
    let of = |rows: [u64; 8], most| {
        let starts: Vec<u64> = (0..=8).map(|row| rows[..row].iter().sum()).collect();
        let bands = fragments::cut(&plan, 0, &starts, most)?;
        let all: u32 = bands.iter().map(|band| band.rows).sum();
        assert_eq!(all, 8);
        Some(bands.iter().map(|band| (band.first, band.rows)).collect::<Vec<_>>())
    };
    assert_eq!(of([1; 8], 100), Some(vec![(0, 8)]));
    assert_eq!(of([1; 8], 3), Some(vec![(0, 3), (3, 3), (6, 2)]));
    assert_eq!(of([0, 5, 0, 0, 5, 5, 0, 1], 5), Some(vec![(0, 4), (4, 1), (5, 2), (7, 1)]));
    assert_eq!(of([0, 0, 0, 6, 0, 0, 0, 0], 5), None, "a band has at least one row");
    // Bands contain whole pixels of 2 x 2 samples.
    let options = Settings { samples: "4".parse().unwrap(), ..options };
    let plan = planned(&sphere(1000, 1.5), 8, &software(), &options, &Known::default());
    let bands = fragments::cut(&plan, 0, &[0, 1, 2, 3, 4, 5, 6, 7, 8], 3).unwrap();
    assert!(bands.iter().all(|band| band.rows == 2), "{bands:?}");
}

#[test]
fn the_rasteriser_projects_draws_and_resolves() {
    let scene = sphere(1000, 1.5);
    let options = Settings { raster: Some(Raster::default()), ..Settings::default() };
    let plan = planned(&scene, 64, &AdapterDescription::core(), &options, &Known::default());
    let resolve = "resolve: list_covered/Occlusion, resolve/Covered";
    assert_eq!(lines(&plan), [PROJECT, "draw", resolve, "read back 0"]);
    assert!(plan.needs.surface.by_triangles() && plan.sum_words == 0);
}

#[test]
fn sums_that_wrapped_are_fixed_from_then_on() {
    let options = Settings { accumulator: Accumulator::Fixed32, ..Settings::default() };
    let of = |known: &Known| planned(&sphere(1000, 1.5), 64, &software(), &options, known).needs;
    assert_eq!(of(&Known::default()).accumulator, Accumulator::Fixed32);
    let known = Known { overflows: 3, ..Known::default() };
    assert_eq!((of(&known).accumulator, of(&known).surface.tiles()), (Accumulator::Fixed, true));
}

#[test]
fn what_does_not_go_together_is_refused_by_one_rule() {
    let (scene, core) = (sphere(1000, 1.5), AdapterDescription::core());
    let refused = |options: Settings| {
        let known = Known::default();
        let facts = Facts::of(&scene);
        let error = Plan::of(&facts, &core, &camera(64), &options, &known).unwrap_err();
        error.to_string()
    };
    for (accumulator, what) in [(Accumulator::Packed64, "64-bit atomics"), (Accumulator::Float, "f32 atomic add")] {
        assert!(refused(Settings { accumulator, ..Settings::default() }).contains(what));
    }
    let raster = Raster { format: "rgba32float".parse().unwrap(), ..Raster::default() };
    assert!(refused(Settings { raster: Some(raster), ..Settings::default() }).contains("32-bit floats"));
    let check = |options: Settings| check::options(&options, false).map_err(|e| e.to_string());
    assert_eq!(check(Settings::default()), Ok(()));
    let tile = Settings { organisation: Organisation::Tile, ..Settings::default() };
    assert_eq!(check(tile.clone()), Ok(()));
    let other = Settings { accumulator: Accumulator::Cas, ..tile };
    let of_study = check::by_tiles(&other).unwrap_err().to_string();
    assert!(check(other) == Ok(()) && of_study.contains("accumulator fixed"), "{of_study}");
    let phong = Settings { shading: Shading::Phong, shininess: 1e6, ..Settings::default() };
    assert!(check(phong).unwrap_err().contains("shininess"));
    let maps = Maps::of(&[Map::Decision]);
    assert!(check(Settings { maps, ..Settings::default() }).unwrap_err().contains("reference"));
}

#[test]
fn knowledge_of_an_image_is_forgotten_with_its_size() {
    let mut known = Known { slots: true, large: Some(true), entries: [Some(3), Some(4)], ..Known::default() };
    assert_eq!(known.entries_of(Listed::Small), Some(4));
    known.forget_image();
    assert_eq!(known, Known { slots: true, ..Known::default() });
}
