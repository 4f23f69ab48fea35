//! The memory layout that WGSL states must equal the Rust mirrors.
//!
//! Compares name, offset, size and scalar kind of every member of every struct in the bindings of
//! every reachable module, and the constants that both sides define.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod mirrors;

use crate::common;

use std::collections::{BTreeMap, BTreeSet};

use common::modules;
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::gpu::interface::reflect;
use epsplat::low_level::gpu::layout::{
    AWAY, BATCH, BLOCK_SIDE, COVERED_GRID, COVERED_GRID_OF_EIGHTS, COVERED_LIST, INNER, JUDGE_GRID, JUDGED, KIND_SHIFT,
    LEAF, LIST_ENDS, LIST_FAR, LIST_START, MOST_GROUPS, OCCLUSION_BLOCK, OCCLUSION_TILE, ONE, OTHER_BRANCH, QUEUE_GRID,
    QUEUE_LISTING, QUEUE_START, RUN, SPREAD_GRID, TILE, WORKGROUP,
};
use epsplat::low_level::gpu::sources::FILES;
use epsplat::low_level::passes;
use epsplat::low_level::plan::{Accumulator, COLOR_CHANNEL, PixelLayout, SceneNeeds, color_channels};
use epsplat::low_level::scene::camera::MAX_SIDE;
use epsplat::low_level::scene::kernel::{LEAST_AT_RIM, LEAST_WEIGHT};
use mirrors::{differences, elements, kept_as, mirrors, sums_of};
use naga::{AddressSpace, Expression, Literal, Module};

/// Reflects the first module of `needs`.
fn first_of(sources: &Sources, needs: &SceneNeeds) -> Module {
    reflect(&sources.join(&passes::modules(needs)[0].files)).unwrap().0
}

#[test]
fn mirrors_have_no_gaps() {
    for (name, mirror) in mirrors() {
        let mut next = 0;
        for member in &mirror.members {
            assert_eq!(member.offset, next, "{name}.{}", member.name);
            next += member.shape.bytes();
        }
        assert_eq!(next, mirror.size, "{name}");
    }
}

#[test]
fn every_binding_has_the_hosts_layout() {
    let mut seen = BTreeSet::new();
    for made in modules::different() {
        let (module, needs) = (&made.reflected().module, &made.needs);
        assert_eq!(
            differences(module, if made.of_tiles() { "fixed" } else { kept_as(needs) }),
            Vec::<String>::new(),
            "{}",
            needs.accumulator
        );
        let buffers = module.global_variables.iter().filter(|(_, v)| v.space != AddressSpace::Handle);
        seen.extend(buffers.filter_map(|(_, v)| v.binding.and(v.name.clone())));
    }
    let known: BTreeSet<String> = elements("fixed").keys().map(|name| (*name).to_owned()).collect();
    assert_eq!(seen, known, "buffers in WGSL, and in the host's list");
}

#[test]
fn a_changed_layout_is_noticed() {
    // Without culling no kernel uses `middle`, so the module stays valid.
    let needs = common::variants::plain();
    let broken = |from: &str, to: &str| {
        let sources = Sources::default().replace("layout.wgsl", from, to).unwrap();
        differences(&first_of(&sources, &needs), needs.accumulator.name()).join("; ")
    };
    let swapped =
        broken("    a: array<f32, 3>,\n    b: array<f32, 3>,\n", "    b: array<f32, 3>,\n    a: array<f32, 3>,\n");
    assert!(swapped.contains("Splat") && swapped.contains("\"a\""), "{swapped}");
    let renamed = broken("    middle: f32,\n", "    center: f32,\n");
    assert!(renamed.contains("View.center exists in WGSL only"), "{renamed}");
    assert!(renamed.contains("View.middle exists in Rust only"), "{renamed}");
    let exchanged = broken(
        "    farthest: f32,\n    // Depth of the centre of the scene's core (the box of nearly all points), device \
         units.\n    middle: f32,\n",
        "    middle: f32,\n    farthest: f32,\n",
    );
    assert!(exchanged.contains("\"farthest\"") && exchanged.contains("\"middle\""), "{exchanged}");
    let cut = Sources::default().replace("records.wgsl", "4u + FILTER_ROWS", "5u + FILTER_ROWS").unwrap();
    let cut = differences(&first_of(&cut, &needs), needs.accumulator.name()).join("; ");
    assert!(cut.contains("projected holds") && cut.contains("splats holds"), "{cut}");
    let longer = broken("    rows: u32,\n    padding_0: u32,\n", "    rows: u32,\n    padding_0: vec2<u32>,\n");
    assert!(longer.contains("Band"), "{longer}");
    let retyped = broken("    middle: f32,\n", "    middle: u32,\n");
    assert!(retyped.contains("middle") && retyped.contains("Uint"), "{retyped}");
    // The sums have another element type than the named accumulator's.
    let wide = SceneNeeds { accumulator: Accumulator::Fixed64, ..needs };
    let other = &first_of(&Sources::default(), &wide);
    assert_eq!(differences(other, "packed64"), Vec::<String>::new());
    for name in ["fixed", "float"] {
        let sums = differences(other, name).join("; ");
        assert!(sums.contains("sums holds"), "{sums}");
    }
}

#[test]
fn binding_numbers_are_unique_over_all_files() {
    let mut numbers: BTreeMap<u32, BTreeSet<String>> = BTreeMap::new();
    let mut names: BTreeMap<String, BTreeSet<u32>> = BTreeMap::new();
    for made in modules::different() {
        for (_, variable) in made.reflected().module.global_variables.iter() {
            if let (Some(binding), Some(name)) = (&variable.binding, &variable.name) {
                assert_eq!(binding.group, 0, "{name}");
                numbers.entry(binding.binding).or_default().insert(name.clone());
                names.entry(name.clone()).or_default().insert(binding.binding);
            }
        }
    }
    assert!(numbers.len() >= 14);
    assert!(numbers.values().all(|names| names.len() == 1), "{numbers:?}");
    assert!(names.values().all(|numbers| numbers.len() == 1), "{names:?}");
}

fn constant(module: &Module, name: &str) -> Option<f64> {
    let (_, constant) = module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name))?;
    match module.global_expressions[constant.init] {
        Expression::Literal(Literal::U32(value)) => Some(f64::from(value)),
        Expression::Literal(Literal::F32(value)) => Some(f64::from(value)),
        ref other => panic!("{name} is {other:?}"),
    }
}

#[test]
fn constants_agree() {
    for made in modules::different() {
        let (module, needs, tiles) = (&made.reflected().module, made.needs, made.of_tiles());
        let constant = |name| constant(module, name);
        for (name, value) in [
            ("WORKGROUP", WORKGROUP),
            ("TILE", TILE),
            ("BATCH", BATCH),
            ("QUEUE_START", QUEUE_START),
            ("QUEUE_GRID", QUEUE_GRID),
            ("QUEUE_LISTING", QUEUE_LISTING),
            ("COVERED_LIST", COVERED_LIST),
            ("COVERED_GRID", COVERED_GRID),
            ("COVERED_GRID_OF_EIGHTS", COVERED_GRID_OF_EIGHTS),
            ("MOST_GROUPS", MOST_GROUPS),
            ("AWAY", AWAY),
            ("NOTHING", f32::INFINITY.to_bits()),
            ("WEIGHT_CHANNEL", 0),
        ] {
            assert_eq!(constant(name), Some(f64::from(value)), "{name}");
        }
        let tile = needs.surface.raster().is_none().then_some(f64::from(OCCLUSION_TILE));
        assert_eq!(constant("OCCLUSION_TILE"), tile);
        assert_eq!(constant("OCCLUSION_BLOCK"), tile.map(|_| f64::from(OCCLUSION_BLOCK)));
        let of_tiles = [("BLOCK_SIDE", BLOCK_SIDE), ("LIST_ENDS", LIST_ENDS)];
        let of_batches = [("LIST_START", LIST_START), ("LIST_FAR", LIST_FAR)];
        let of_cuts = [
            ("RUN", RUN),
            ("JUDGED", JUDGED),
            ("JUDGE_GRID", JUDGE_GRID),
            ("SPREAD_GRID", SPREAD_GRID),
            ("KIND_SHIFT", KIND_SHIFT),
            ("INNER", INNER),
            ("LEAF", LEAF),
            ("OTHER_BRANCH", OTHER_BRANCH),
        ];
        for (exists, constants) in [(tiles, &of_tiles[..]), (needs.cull, &of_batches), (needs.levels, &of_cuts)] {
            for &(name, value) in constants {
                assert_eq!(constant(name), exists.then_some(f64::from(value)), "{name}");
            }
        }
        let blends = needs.weighs();
        assert_eq!(constant("LEAST_WEIGHT"), blends.then_some(LEAST_WEIGHT));
        let colors = blends && color_channels(&needs) > 0;
        assert_eq!(constant("COLOR_CHANNEL"), colors.then_some(f64::from(COLOR_CHANNEL)));
        let one = match needs.accumulator {
            _ if !needs.surface.sums_by_compute() && needs.surface.lists().is_none() => None,
            Accumulator::Fixed if !needs.wide_sums => Some(f64::from(ONE)),
            _ => None,
        };
        assert_eq!(constant("ONE"), one, "{}", needs.accumulator);
        for entry in module.entry_points.iter().filter(|entry| entry.stage == naga::ShaderStage::Compute) {
            let Some(kernel) = made.kernels.iter().find(|kernel| kernel.name == entry.name) else { continue };
            assert_eq!(entry.workgroup_size, kernel.workgroup, "{}", entry.name);
        }
    }
    // The least weights are whole numbers of units; constants derived from them match.
    assert_eq!((f64::from(ONE) * LEAST_AT_RIM).fract(), 0.0);
    const { assert!(LEAST_WEIGHT * (1u64 << 40) as f64 == 65_536.0) };
    // A word packs a pixel's column (low 16 bits), its row (above) and the flag `AWAY` (above the
    // row).
    assert_eq!((MAX_SIDE - 1) << 16 & AWAY, 0);
    const { assert!(MAX_SIDE - 1 <= 0xffff) };
    // A batch number fits in the spare bits of anchors (cull.wgsl).
    const { assert!(MOST_GROUPS < 1 << 18) };
    // The fixed-point scale `ONE` is defined once; no kernel repeats its value.
    let repeated = FILES.iter().map(|(_, text)| text.matches(&ONE.to_string()).count()).sum::<usize>();
    assert_eq!(repeated, 1);
}

#[test]
fn the_hosts_room_for_a_pixels_sums_is_the_devices() {
    for needs in common::variants::all_needs() {
        let (channels, row) = (PixelLayout::of(needs).channels, needs.accumulator.row());
        let (shapes, halves) = sums_of(row.name);
        let bytes = channels as usize * halves as usize * shapes[0].bytes() / 2;
        assert_eq!(bytes, 4 * (channels * row.words) as usize, "{}", row.name);
    }
}
