//! Shared by the kernel tests: the adapter, all sets of needs, seeded numbers, scenes, and the
//! derived error bounds.

#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod command;
pub mod enclosure;
pub mod gaussians;
pub mod judged;
pub mod levels;
pub mod meshes;
pub mod modules;
mod random;
pub mod scenes;

pub use random::Random;

use std::sync::{Mutex, OnceLock, PoisonError};

use epsplat::low_level::frame::Frame;
use epsplat::low_level::gpu::Gpu;
use epsplat::low_level::gpu::layout::{ONE, View};
use epsplat::low_level::plan::{
    ACCUMULATORS, Accumulator, AccumulatorRow, BlendFormat, ColorNeed, EpsilonForm, Facts, Lists, MeshNeeds, Oit,
    Raster, RasterDepth, SceneNeeds, Settings, Sides, Winner, check,
};
use epsplat::low_level::scene::facing::POINT_SHAPES;
use epsplat::low_level::scene::{Join, KernelShape, LowPass, Map, Maps, Projection, Samples, Shading};

/// One unit of a sum of the accumulator `fixed`, as a fraction of a full weight.
pub const UNIT: f64 = 1.0 / ONE as f64;

/// Opens the adapter under test; `None`, with a line on stderr, if there is none and none is
/// required.
pub fn gpu() -> Option<Gpu> {
    open(std::env::var("EPSPLAT_TEST_ADAPTER").ok().as_deref(), "EPSPLAT_REQUIRE_ADAPTER")
}

/// The same adapter, limited to the features that every WebGPU implementation has.
pub fn core_gpu() -> Option<Gpu> {
    static CORE: OnceLock<Gpu> = OnceLock::new();
    let open = || Gpu::open_core(std::env::var("EPSPLAT_TEST_ADAPTER").ok().as_deref()).unwrap();
    gpu().map(|_| CORE.get_or_init(open).clone())
}

/// Opens an OpenGL adapter even if there are others; `None` as for [`gpu`].
pub fn opengl() -> Option<Gpu> {
    open(Some("gl"), "EPSPLAT_REQUIRE_OPENGL")
}

/// Opens the device of this name once for all tests of a program; otherwise most time would go to
/// compiling the same kernels.
fn open(name: Option<&str>, required: &str) -> Option<Gpu> {
    static OPENED: Mutex<Vec<(Option<String>, Gpu)>> = Mutex::new(Vec::new());
    // A poisoned lock means that another test panicked while opening a device; the list is intact.
    let mut opened = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, gpu)) = opened.iter().find(|(known, _)| known.as_deref() == name) {
        return Some(gpu.clone());
    }
    match Gpu::open(name) {
        Ok(gpu) => {
            opened.push((name.map(str::to_owned), gpu.clone()));
            Some(gpu)
        }
        Err(error) if std::env::var(required).is_ok_and(|v| v == "1") => panic!("{required}=1, but {error}"),
        Err(_) => {
            eprintln!("skipped: no adapter{}", name.map_or_else(String::new, |name| format!(" called {name}")));
            None
        }
    }
}

/// The adapter, limited so that `fixed` runs the kernel in `file`: without 64-bit atomics, or
/// without subgroups for gathering tiles, where those would select another kernel.
pub fn gpu_for(file: &str) -> Option<Gpu> {
    let mut gpu = gpu()?;
    gpu.adapter.subgroups &= !file.starts_with("accum");
    gpu.adapter.atomics_u64 &=
        !["accumulator_fixed.wgsl", "accumulator_fixed_wide.wgsl", "terms_wide.wgsl"].contains(&file);
    Some(gpu)
}

/// The accumulators that the adapter can run; each other one is reported on stderr.
pub fn accumulators(gpu: &Gpu) -> Vec<&'static AccumulatorRow> {
    let able = |row: &&AccumulatorRow| {
        check::sums(&gpu.adapter, row.of).inspect_err(|why| eprintln!("skipped: {why}")).is_ok()
    };
    ACCUMULATORS.iter().filter(able).collect()
}

/// A sample of the sets of needs that renders have.
///
/// It has every combination of the eight bits that say what is blended and written, with the first
/// accumulator and one kernel, and a dozen for each combination of accumulator, kernel and form of
/// epsilon, each time others. All values that can be combined occur in pairs
/// (`tests/kernels/shaders.rs`).
pub fn all_needs() -> Vec<SceneNeeds> {
    let shapes = [KernelShape::Gaussian, KernelShape::Ellipse, KernelShape::Cone, KernelShape::Constant];
    let mut base = base_needs();
    let unmapped: Vec<_> = base.iter().copied().filter(|needs| needs.maps.is_empty()).collect();
    base.extend(unmapped.iter().map(|needs| {
        let (gather, doubled, long_words) = (needs.tiles, !needs.doubled, !needs.long_words);
        SceneNeeds { samples: SAMPLED, gather, doubled, long_words, ..*needs }
    }));
    let mut all = base.clone();
    let mut next = 0;
    for row in ACCUMULATORS {
        for kernel in shapes {
            for epsilon in [EpsilonForm::Depth, EpsilonForm::Radius, EpsilonForm::Ray] {
                for _ in 0..12 {
                    // The step is coprime to the number of needs, so all are reached.
                    next = (next + 101) % base.len();
                    let low_pass = [LowPass::None, LowPass::Max, LowPass::Ewa][next % 3];
                    let accumulator = row.of;
                    let tiles = accumulator == Accumulator::Fixed;
                    let gather = tiles && next % 2 == 0;
                    all.push(SceneNeeds { accumulator, tiles, gather, kernel, epsilon, low_pass, ..base[next] });
                    if accumulator == Accumulator::Fixed {
                        for (wide_sums, atomics_u64) in [(true, false), (false, true), (true, true)] {
                            let next = base[next];
                            all.push(SceneNeeds { wide_sums, atomics_u64, kernel, epsilon, low_pass, ..next });
                            if next.color != ColorNeed::Textured {
                                let next =
                                    SceneNeeds { copies: true, tiles: false, gather: false, cull: false, ..next };
                                all.push(SceneNeeds { wide_sums, kernel, epsilon, low_pass, ..next });
                            }
                        }
                    }
                }
            }
        }
    }
    let rastered: Vec<_> = base.iter().filter(|needs| needs.color != ColorNeed::Textured).collect();
    // Needs of the rasteriser, with as many targets as the sums require.
    for (step, (depth, _)) in (0..240).zip(RasterDepth::ALL.iter().cycle()) {
        let (kernel, base) = (shapes[step / 2 % 4], rastered[(step * 101) % rastered.len()]);
        let low_pass = [LowPass::None, LowPass::Max, LowPass::Ewa][step / 3 % 3];
        let raster = Some(Raster { format: BlendFormat::ALL[step / 7 % 3].0, depth: *depth });
        let triangles = step / 2 % 2 == 0;
        let unknown = base.sides == Sides::Nearest && *depth != RasterDepth::Exact;
        all.push(SceneNeeds {
            raster,
            triangles,
            kernel,
            low_pass,
            epsilon: [EpsilonForm::Depth, EpsilonForm::Radius, EpsilonForm::Ray][step % 5 % 3],
            sides: if unknown { Sides::Both } else { base.sides },
            cull: false,
            tiles: false,
            gather: false,
            maps: base.maps.but(&[Map::Index]).beside(Maps::COMPOSITED),
            ..*base
        });
    }
    let planes: Vec<_> = all
        .iter()
        .copied()
        .filter(|needs| !needs.normal && !needs.lit_splats && needs.color != ColorNeed::Textured)
        .collect();
    for (step, needs) in planes.iter().step_by(3).enumerate() {
        let shape = POINT_SHAPES[step % POINT_SHAPES.len()].1;
        if needs.raster.is_some_and(|raster| raster.depth != RasterDepth::Exact && shape.rises()) {
            continue;
        }
        all.push(SceneNeeds {
            facing: Some(shape),
            low_pass: LowPass::None,
            sides: Sides::None,
            cull_back: false,
            clips: false,
            outline: false,
            curved: false,
            ..*needs
        });
    }
    let unblended: Vec<_> = all.iter().copied().filter(shows_nearest).collect();
    for (step, needs) in unblended.iter().enumerate() {
        let winners: &[Winner] = match (needs.raster, needs.color) {
            (Some(_), _) => &[Winner::Rasterised],
            (None, ColorNeed::Constant) => &[Winner::Depth],
            (None, _) => &[Winner::Once, Winner::Second],
        };
        all.push(SceneNeeds {
            winner: Some(winners[step % winners.len()]),
            tiles: false,
            gather: false,
            copies: false,
            atomics_u64: false,
            subgroups: false,
            wide_sums: false,
            epsilon: EpsilonForm::Depth,
            kernel: KernelShape::Constant,
            low_pass: LowPass::None,
            accumulator: Accumulator::Fixed,
            sides: Sides::None,
            ..*needs
        });
    }
    all.extend(listed(&all));
    all.extend(order_free(&all));
    all.extend(peeled(&all));
    all.extend(beside_triangles(&all));
    all.extend(kept_apart(&all));
    all.extend(cut(&all));
    for needs in &mut all {
        needs.outline &= needs.low_pass == LowPass::None;
        needs.gather &= needs.may_gather();
    }
    all
}

/// These needs with all splats kept and each drawn by itself.
fn scattered(needs: &SceneNeeds) -> SceneNeeds {
    SceneNeeds { tiles: false, gather: false, subgroups: false, cull: false, ..*needs }
}

/// Needs of renders with transparent surfaces in fragment lists, for a third of the candidates.
fn listed(all: &[SceneNeeds]) -> Vec<SceneNeeds> {
    let fits = |needs: &&SceneNeeds| {
        let fixed = needs.accumulator == Accumulator::Fixed && needs.raster.is_none() && needs.winner.is_none();
        fixed && !needs.copies && needs.color != ColorNeed::Textured
    };
    let of = |(step, needs): (usize, &SceneNeeds)| {
        let maps = [
            &[][..],
            &[Map::Transmittance, Map::Tail],
            &[Map::Layers],
            &[Map::Transmittance, Map::Layers, Map::Surfaces],
            &[Map::Tail, Map::Surfaces, Map::Layers],
        ];
        let lit = needs.shading != Shading::Unlit;
        let lists = [Lists::Layers, Lists::Sorted][step % 2];
        // Sorted fragments have no tail.
        let others: &[Map] = if lists == Lists::Sorted { &[Map::Tail] } else { &[] };
        SceneNeeds {
            lists: Some(lists),
            veils: step % 6 == 1,
            long_lists: step % 7 < 3,
            maps: if needs.samples == Samples::ONE { Maps::of(maps[step / 2 % 5]).but(others) } else { Maps::NONE },
            normal: lit && !needs.lit_splats,
            own_normals: needs.own_normals && lit,
            atomics_u64: false,
            ..scattered(needs)
        }
    };
    all.iter().filter(fits).step_by(3).enumerate().map(of).collect()
}

/// Needs of order-independent transparency, which sums all fragments of a pixel, for a third of the
/// candidates.
fn order_free(all: &[SceneNeeds]) -> Vec<SceneNeeds> {
    let fits = |needs: &&SceneNeeds| {
        let stored = needs.raster.is_none() && needs.winner.is_none() && needs.lists.is_none();
        let of_words = matches!(needs.accumulator, Accumulator::Fixed32 | Accumulator::Packed64);
        let textured = needs.color == ColorNeed::Textured;
        // Only splats can be lit, not pixels.
        stored && !of_words && !needs.copies && !textured && (needs.lit_splats || needs.shading == Shading::Unlit)
    };
    let of = |(step, needs): (usize, &SceneNeeds)| {
        let maps = [&[][..], &[Map::Transmittance]];
        SceneNeeds {
            oit: Some([Oit::Weighted, Oit::Moments][step % 2]),
            wide_sums: needs.accumulator == Accumulator::Fixed,
            epsilon: EpsilonForm::All,
            maps: if needs.samples == Samples::ONE { Maps::of(maps[step / 2 % 2]) } else { Maps::NONE },
            normal: false,
            own_normals: needs.own_normals && needs.lit_splats,
            sides: if needs.sides == Sides::None { Sides::None } else { Sides::Both },
            ..scattered(needs)
        }
    };
    all.iter().filter(fits).step_by(3).enumerate().map(of).collect()
}

/// Needs of renders that draw triangles beside splats, for a third of the candidates.
fn beside_triangles(all: &[SceneNeeds]) -> Vec<SceneNeeds> {
    let drawn = |needs: &SceneNeeds| {
        let exact = needs.raster.is_some_and(|raster| raster.depth == RasterDepth::Exact);
        exact && needs.winner.is_none() && needs.peels.is_none()
    };
    let opaque =
        |needs: &&SceneNeeds| (needs.raster.is_none() && needs.lists.is_none() && needs.oit.is_none()) || drawn(needs);
    let of = |(step, needs): (usize, &SceneNeeds)| {
        let join = [Join::Corrected, Join::Nearest, Join::Blended][step % 3];
        let [normals, colored, once, textured] = [1, 2, 4, 8].map(|bit| (step / 3) & bit != 0);
        let doubled = step % 7 < 3;
        let once = once && needs.raster.is_none();
        SceneNeeds {
            mesh: Some(MeshNeeds { join, normals, colored, textured, doubled, once, coded: step % 5 < 2 }),
            maps: needs.maps.but(&[Map::Index]),
            ..*needs
        }
    };
    all.iter().filter(opaque).step_by(3).enumerate().map(of).collect()
}

/// Needs of renders that do not blend different inputs, for a fifth of the candidates.
fn kept_apart(all: &[SceneNeeds]) -> Vec<SceneNeeds> {
    let opaque = |needs: &&SceneNeeds| needs.raster.is_none() && needs.lists.is_none() && needs.oit.is_none();
    let blended = |needs: &&SceneNeeds| needs.winner.is_none() && !needs.copies;
    let of = |needs: &SceneNeeds| {
        let maps = needs.maps.but(&[Map::Index]);
        SceneNeeds { separate: true, cull: false, maps, ..*needs }
    };
    all.iter().filter(opaque).filter(blended).step_by(5).map(of).collect()
}

/// Needs of renders of cuts of levels of detail, for a third of the candidates.
fn cut(all: &[SceneNeeds]) -> Vec<SceneNeeds> {
    let of_disks = |needs: &&SceneNeeds| needs.facing.is_none() && !needs.separate && !needs.maps.has(Map::Index);
    let with_colors =
        |needs: &&SceneNeeds| matches!(needs.color, ColorNeed::Constant | ColorNeed::Srgb8 | ColorNeed::Linear);
    let of = |(step, needs): (usize, &SceneNeeds)| {
        let fades = step % 2 == 0 && needs.sums_by_compute() && needs.oit.is_none();
        // A few fades have no levels: they come with the scene.
        let levels = !fades || step % 16 > 0;
        let node_caps = levels && needs.curved && step % 4 < 3;
        SceneNeeds { levels, fades, node_caps, cull: needs.cull && !levels, ..*needs }
    };
    let disks = all.iter().filter(of_disks).filter(with_colors).filter(|needs| !needs.copies);
    disks.step_by(3).enumerate().map(of).collect()
}

/// Needs of the rasteriser that peels layers.
fn peeled(all: &[SceneNeeds]) -> Vec<SceneNeeds> {
    let exact = |needs: &&SceneNeeds| needs.raster.is_some_and(|raster| raster.depth == RasterDepth::Exact);
    let of = |needs: &SceneNeeds| {
        let lit = needs.shading != Shading::Unlit;
        let (normal, own_normals) = (lit && !needs.lit_splats, needs.own_normals && lit);
        SceneNeeds { peels: Some(3), maps: Maps::NONE, normal, own_normals, ..*needs }
    };
    all.iter().filter(exact).filter(|needs| needs.winner.is_none()).map(of).collect()
}

/// Whether a render with `needs` could show only the nearest fragments.
fn shows_nearest(needs: &SceneNeeds) -> bool {
    let kept = needs.maps.beside(Maps::COMPOSITED).but(&[Map::Depth]).is_empty();
    let colors = matches!(needs.color, ColorNeed::Constant | ColorNeed::Srgb8);
    let exact = needs.raster.is_none_or(|raster| raster.depth == RasterDepth::Exact);
    kept && colors && !needs.normal && !needs.lit_splats && (exact || needs.maps.is_empty())
}

/// Several samples, with different counts across and down.
const SAMPLED: Samples = Samples { across: 2, down: 4 };

fn base_needs() -> Vec<SceneNeeds> {
    let (scene, camera) = scenes::stack(1, 1.0);
    let plain = SceneNeeds::of_picture(&Facts::of(&scene), &camera, &Settings::default());
    let mut all = Vec::new();
    for bits in 0..1u32 << 8 {
        let bit = |k: u32| bits >> k & 1 == 1;
        // Bits that are nearly independent of the others.
        let mixed = |k: u32| bits.wrapping_mul(0x9e37_79b9) >> k & 1 == 1;
        let (lit, normal_map, sides, alpha) = (bit(0), bit(1), bit(2), bit(3));
        let lit_splats = lit && mixed(24);
        let normal = (lit && !lit_splats) || normal_map;
        let shading = match (lit, bits.count_ones() % 2 == 0) {
            (false, _) => Shading::Unlit,
            (true, true) => Shading::Lambert,
            (true, false) => Shading::Phong,
        };
        let harmonics = ColorNeed::Harmonics(1 + bits % 3);
        for color in [ColorNeed::Constant, ColorNeed::Srgb8, ColorNeed::Linear, ColorNeed::Textured, harmonics] {
            let of_one = color == ColorNeed::Constant;
            let rare = color == harmonics && !(lit_splats || bits % 3 == 0);
            if rare || alpha && of_one || lit_splats && (of_one || color == ColorNeed::Textured) {
                continue;
            }
            let projection = if bit(4) { Projection::Pinhole } else { Projection::Orthographic };
            let wanted = [(1, Map::Normal), (5, Map::Depth), (6, Map::Count), (7, Map::Weight)];
            let wanted = wanted.into_iter().filter(|(k, _)| bit(*k)).map(|(_, map)| map);
            let wanted = wanted.chain((bits % 3 == 1).then_some(Map::Index));
            let painted = color == ColorNeed::Textured;
            let wanted = wanted.chain((painted && (bits & 0b1110_0010 != 0) && bits % 5 < 2).then_some(Map::TexZ));
            let some = bits & 0b1110_0010 != 0;
            let wanted = wanted.chain((some && bits % 5 == 1).then_some(Map::Transmittance));
            let wanted = wanted.chain((some && bits % 7 == 1).then_some(Map::Layers));
            let wanted: Vec<Map> = wanted.chain((some && mixed(22) && mixed(21)).then_some(Map::Tail)).collect();
            all.push(SceneNeeds {
                projection,
                accumulator: Accumulator::Fixed,
                wide_sums: false,
                atomics_u64: false,
                long_words: bits.count_ones() % 4 < 2,
                doubled: bits.count_ones() % 5 < 2,
                tiles: bits * 37 / 8 % 4 == 0,
                gather: bits * 37 / 8 % 8 == 0,
                // Both values occur with both values of each other field.
                subgroups: bits.count_ones() % 3 == 0,
                cull: bits * 29 / 16 % 2 == 0,
                raster: None,
                triangles: false,
                kernel: KernelShape::Ellipse,
                epsilon: EpsilonForm::Depth,
                color,
                alpha,
                normal,
                sides: if sides && !mixed(27) { Sides::Nearest } else { Sides::None },
                own_normals: (normal || lit_splats) && mixed(26),
                clips: mixed(28),
                outline: mixed(28) && mixed(23),
                curved: mixed(25),
                cull_back: mixed(27),
                samples: Samples::ONE,
                shading,
                lit_splats,
                maps: Maps::of(&wanted),
                ..plain
            });
        }
    }
    all
}

/// The frame's bits: float equality would equate -0 and 0, and a NaN never equals itself.
pub fn bits(frame: &Frame) -> Vec<u32> {
    let maps = [Map::Normal, Map::Depth, Map::Weight, Map::Count].into_iter().filter_map(|map| frame.map(map));
    frame.color.iter().flatten().chain(maps.flatten()).map(|value| value.to_bits()).collect()
}

/// Length of the depth interval behind the nearest depth `front` that the device measures, world
/// units.
pub fn depth_span(view: &View, front: f64) -> f64 {
    let world = f64::from(view.world);
    let of_radius = (f64::from(view.epsilon_deepest) * f64::from(view.world)).min(front * f64::from(view.epsilon_most));
    let absolute = f64::from(view.epsilon_absolute) * f64::from(view.world);
    let deepest = front * (1.0 + f64::from(view.epsilon_relative)) + absolute.max(of_radius);
    deepest.min(f64::from(view.farthest) * world) - front
}
