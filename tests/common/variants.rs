//! Random sets of needs: random options that the checks accept, planned for random scenes, views
//! and adapters. Only the checks decide which options go together; no test repeats that.

use std::collections::HashSet;
use std::ops::Range;
use std::sync::LazyLock;

use epsplat::low_level::gpu::AdapterDescription;
use epsplat::low_level::plan::{
    ACCUMULATORS, Accumulator, BlendFormat, ColorNeed, Facts, Known, Organisation, Plan, Raster, RasterDepth,
    SceneNeeds, Settings, Splats, Surface, check,
};
use epsplat::low_level::scene::{Camera, Detail, Form, KernelShape, LevelFacts, Optics, Projection, Scene};

use super::any_options::{self, pick};
use super::any_scene::{self, Sampled};
use super::{Random, any_options::without};

/// The seeds of the random scenes. Every need occurs often enough among their renders.
const SEEDS: Range<u64> = 100..400;

/// The number of random renders of each scene.
const PICTURES: usize = 120;

/// One in this many renders is kept even if its needs show no new pair of values.
const REGULAR: usize = 20;

/// The needs of a selection of the random renders. Every pair of values that occurs together in any
/// of them also occurs here.
pub fn all_needs() -> &'static [SceneNeeds] {
    static ALL: LazyLock<Vec<SceneNeeds>> = LazyLock::new(|| {
        let (mut kept, mut known, mut pairs) = (Vec::new(), HashSet::new(), [HashSet::new(), HashSet::new()]);
        let mut drawn = 0;
        for seed in SEEDS {
            let (mut random, mut lenses) = (Random(seed), Random(seed + 1_000_000));
            let Sampled { scene, camera, .. } = any_scene::sampled(&mut random);
            let facts = Facts::of(&scene);
            for _ in 0..PICTURES {
                let both = picture(&scene, facts.clone(), &camera, (&mut random, &mut lenses));
                let Some((plain, lensed)) = both else { continue };
                drawn += 1;
                // Pictures through lenses have pairs of their own, and add to the others.
                let each = [(Some(plain), REGULAR), (lensed, 10 * REGULAR)];
                for ((needs, regular), pairs) in each.into_iter().zip(&mut pairs) {
                    let Some(needs) = needs else { continue };
                    let values = values(&needs);
                    let mut news = 0;
                    for (k, a) in values.iter().enumerate() {
                        news += values[..k].iter().filter(|b| pairs.insert((a.clone(), (*b).clone()))).count();
                    }
                    if (news > 0 || drawn % regular == 0) && known.insert(needs) {
                        kept.push(needs);
                    }
                }
            }
        }
        kept
    });
    &ALL
}

/// Needs of the plainest picture: splats are scattered into sums of `fixed`, without a cut.
pub fn plain() -> SceneNeeds {
    let is_plain = |needs: &&SceneNeeds| {
        let scattered = needs.surface == Surface::Blended { splats: Splats::Scattered, separate: false };
        let fixed = needs.accumulator == Accumulator::Fixed && !needs.wide_sums && !needs.atomics_u64;
        scattered && fixed && needs.kernel == KernelShape::Ellipse && !needs.cull && !needs.levels
    };
    *all_needs().iter().find(is_plain).expect("some picture is plain")
}

/// The value of each need: the names of the chosen alternatives, and whether each optional need is
/// set.
fn values(needs: &SceneNeeds) -> Vec<String> {
    let surface = &needs.surface;
    let set = needs.names().into_iter().map(String::from);
    let left_out = needs.flags().into_iter().filter(|(on, _)| !on).map(|(_, name)| format!("no {name}"));
    let alternatives = [
        needs.accumulator.name().to_string(),
        format!("epsilon {:?}", needs.epsilon),
        format!("sides {:?}", needs.sides),
        format!("winner {:?}", surface.winner()),
        format!("fetch {:?}", surface.fetch()),
        format!("triangle per splat {}", surface.by_triangles()),
        format!("once {:?}", needs.mesh.map(|mesh| mesh.once)),
    ];
    set.chain(left_out).chain(alternatives).collect()
}

/// The needs of a random render of a scene, and of some again through a lens or as 3D Gaussians;
/// `None` if its options are refused.
fn picture(
    scene: &Scene,
    mut facts: Facts,
    camera: &Camera,
    (random, lenses): (&mut Random, &mut Random),
) -> Option<(SceneNeeds, Option<SceneNeeds>)> {
    let mut options = Settings {
        organisation: pick(random, &[Organisation::Auto, Organisation::Tile, Organisation::Scatter]),
        ..any_options::sampled(scene, random)
    };
    if random.one_in(4) {
        options.accumulator = ACCUMULATORS[random.below(ACCUMULATORS.len())].of;
    }
    if random.one_in(4) {
        options.without = without(random);
    }
    if random.one_in(4) {
        let (format, depth) = (pick(random, &BlendFormat::ALL).0, pick(random, &RasterDepth::ALL).0);
        options.raster = Some(Raster { format, depth });
    }
    change(&mut facts, &mut options, random);
    check::options(&options, false).ok()?;
    check::scene(&facts, &options, false).ok()?;
    let (adapter, sizes) = (adapter(random), sizes(random));
    let needs = |facts: &Facts, camera: &Camera| {
        Plan::of(facts, &adapter, camera, &options, &sizes).ok().map(|plan| plan.needs)
    };
    let of = |camera: &Camera| needs(&facts, camera);
    let through = lensed(camera, lenses).filter(|camera| check::lens(&facts, camera, &options, false).is_ok());
    // Where 3D Gaussians may be drawn, they take the place of a lens.
    let solid = Facts { solid: true, ..facts.clone() };
    let as_solid = || check::scene(&solid, &options, false).ok().and_then(|()| needs(&solid, camera));
    Some((of(camera)?, through.as_ref().and_then(of).or_else(as_solid)))
}

/// The camera with a lens, in one of four renders.
fn lensed(camera: &Camera, random: &mut Random) -> Option<Camera> {
    let forms = [Form::Perspective, Form::Fisheye, Form::Equirectangular];
    let form = pick(random, &forms);
    let optics = Some(Optics::of(form).with_radial([-0.1, 0.0, 0.0, 0.0]));
    (random.one_in(4) && camera.projection == Projection::Pinhole).then(|| Camera { optics, ..camera.clone() })
}

/// Gives the facts what small scenes do not have: many surfels, levels of detail, fades, and low
/// digits of triangle corners.
fn change(facts: &mut Facts, options: &mut Settings, random: &mut Random) {
    if random.one_in(2) {
        let factor = random.scale(1.0, 1e5) as u64;
        facts.surfels *= factor;
        facts.individuals.iter_mut().for_each(|surfels| *surfels *= factor);
    }
    facts.mesh.doubled = random.one_in(2);
    facts.copies = random.one_in(4);
    // Levels of detail exclude textures, harmonics, points that face the camera and separate
    // inputs.
    let of_colors = matches!(facts.colors, ColorNeed::Constant | ColorNeed::Srgb8 | ColorNeed::Linear);
    if of_colors && facts.surfels > 0 && random.one_in(4) {
        (options.facing, options.separate) = (None, false);
        options.detail_fades = random.one_in(2);
        match random.one_in(8) {
            true => facts.fades = true,
            false => {
                let radius = facts.largest_radius;
                let levels = LevelFacts { largest_radius: radius, largest_shorter: radius, caps: random.one_in(2) };
                (facts.levels, options.detail) = (Some(levels), Detail::Pixels(2.0));
            }
        }
    }
}

/// An adapter with some of the optional features.
fn adapter(random: &mut Random) -> AdapterDescription {
    let kind = pick(random, &["software", "discrete"]);
    AdapterDescription {
        kind,
        max_compute_workgroup_storage_size: if kind == "discrete" { 1 << 15 } else { 1 << 14 },
        atomics_u64: random.one_in(2),
        integers_u64: random.one_in(2),
        subgroups: random.one_in(2),
        atomics_f32: true,
        blends_f32: true,
        vertex_storage: true,
        max_color_attachment_bytes_per_sample: 128,
        ..AdapterDescription::core()
    }
}

/// Random values of sizes that earlier frames may have measured.
fn sizes(random: &mut Random) -> Known {
    Known {
        touched_tiles: pick(random, &[0.0, 100.0]),
        veiled: random.one_in(2),
        longest_list: pick(random, &[0, 5000]),
        crowded: random.one_in(4),
        ..Known::default()
    }
}
