//! Random options: for the tests that render random pictures, and for random sets of needs.
//!
//! Most options keep their default, so that several features meet in one picture and few pictures
//! are refused.

use epsplat::low_level::plan::{Accumulator, Optimisation, Settings};
use epsplat::low_level::scene::composite::ALL_LAYERS;
use epsplat::low_level::scene::facing::POINT_SHAPES;
use epsplat::low_level::scene::{
    Blend, Composite, Cull, Epsilon, Facing, Join, Kernel, Light, LowPass, MAPS, Map, Maps, Outline, Samples, Scene,
    Shading, ShadingAt, Tail, gaussian,
};

use super::Random;

/// Whether each sum is one word, in which small weights have few digits.
pub fn has_few_digits(accumulator: Accumulator) -> bool {
    matches!(accumulator, Accumulator::Fixed32 | Accumulator::Packed64)
}

/// Returns one of `choices`.
pub fn pick<T: Copy>(random: &mut Random, choices: &[T]) -> T {
    choices[random.below(choices.len())]
}

/// Draws options for a picture of `scene`. They may be refused, for this scene or in combination.
pub fn sampled(scene: &Scene, random: &mut Random) -> Settings {
    let mut options = Settings {
        epsilon: epsilon(random),
        low_pass: pick(
            random,
            &[
                LowPass::None,
                LowPass::None,
                LowPass::None,
                LowPass::Max,
                LowPass::Max,
                LowPass::Ewa,
                LowPass::Gaussians,
            ],
        ),
        samples: samples(random),
        join: pick(random, &[Join::Corrected, Join::Nearest, Join::Blended]),
        cull: pick(random, &[Cull::Auto, Cull::Auto, Cull::None, Cull::Back]),
        shading: pick(random, &[Shading::Unlit, Shading::Unlit, Shading::Lambert, Shading::Phong]),
        maps: maps(random),
        separate: random.one_in(5),
        ..Settings::default()
    };
    options.kernel = match options.low_pass {
        LowPass::Gaussians => gaussian::KERNEL,
        _ => kernel(random),
    };
    if random.one_in(3) {
        options.composite = composite(random);
        options.tail = pick(random, &[Tail::Sum, Tail::None]);
    }
    if random.one_in(4) {
        options.opacity = random.between(0.0, 1.0) as f32;
    }
    if random.one_in(8) {
        options.facing = Some(Facing {
            shape: POINT_SHAPES[random.below(POINT_SHAPES.len())].1,
            pixels: [random.between(1.0, 4.0), random.between(5.0, 50.0)],
        });
        (options.low_pass, options.shading) = (LowPass::None, Shading::Unlit);
    }
    if random.one_in(10) {
        options.outline = Some(Outline::of_sides(3 + random.below(14) as u32).unwrap());
    }
    if random.one_in(10) {
        options.blend = Blend::Nearest;
    }
    if random.one_in(6) {
        options.accumulator = pick(random, &[Accumulator::Fixed32, Accumulator::Fixed64, Accumulator::Packed64]);
    }
    if options.facing.is_some() && has_few_digits(options.accumulator) {
        // Point sizes are in pixels, so only with one sample per pixel does the reference know the
        // weight of a sample.
        options.samples = Samples::ONE;
    }
    if random.one_in(4) {
        options.shading_at = ShadingAt::Splat;
    }
    if random.one_in(3) {
        options.lights = vec![Light::Headlight { intensity: 0.6 }, "1,2,3:0.7".parse().unwrap()];
    }
    if random.one_in(2) {
        options.background = [random.unit(), random.unit(), random.unit(), random.unit()].map(|c| c as f32);
    }
    if scene.encoded && random.one_in(2) {
        // The defaults for scenes of Gaussians.
        (options.composite, options.shading) = (Composite::Gaussians, Shading::Unlit);
        (options.kernel, options.low_pass) = (gaussian::KERNEL, LowPass::Gaussians);
    }
    options
}

/// Optimisations to leave out, each with a chance of 1 in 4.
pub fn without(random: &mut Random) -> Vec<Optimisation> {
    Optimisation::ALL.iter().filter(|_| random.one_in(4)).map(|(optimisation, _)| *optimisation).collect()
}

fn epsilon(random: &mut Random) -> Epsilon {
    match random.below(8) {
        0 => Epsilon::Relative(random.scale(1e-4, 0.3)),
        1 => Epsilon::Absolute(random.scale(1e-4, 0.5)),
        2 => Epsilon::Ray(random.scale(1e-4, 0.5)),
        3 => Epsilon::Radius(random.between(0.1, 3.0)),
        4 => Epsilon::Bounded { radius: random.between(0.1, 3.0), relative: random.scale(1e-3, 0.3) },
        _ => Settings::default().epsilon,
    }
}

fn kernel(random: &mut Random) -> Kernel {
    match random.below(8) {
        0 => Kernel::Gaussian { sigma: random.between(0.15, 1.0) },
        1 => Kernel::Ellipse { a: random.between(0.5, 8.0), n: random.between(1.0, 6.0), smooth: random.one_in(2) },
        2 => Kernel::Cone { power: random.between(0.3, 3.0) },
        3 => Kernel::Constant,
        _ => Settings::default().kernel,
    }
}

fn samples(random: &mut Random) -> Samples {
    let [across, down] = pick(random, &[[1, 1], [1, 1], [1, 1], [2, 2], [2, 4], [4, 4]]);
    Samples { across, down }
}

fn composite(random: &mut Random) -> Composite {
    match random.below(7) {
        0 => Composite::Layers(ALL_LAYERS),
        1 | 2 => Composite::Layers(1 + random.below(4) as u32),
        3 => Composite::Sorted,
        4 => Composite::Gaussians,
        5 => Composite::Weighted,
        _ => Composite::Moments,
    }
}

/// Draws maps: often none, otherwise mostly one alone, as the needs of a second map could hide a
/// fault of the first.
fn maps(random: &mut Random) -> Maps {
    let of_device: Vec<Map> = MAPS.iter().filter(|row| row.image_word.is_some()).map(|row| row.map).collect();
    let count = pick(random, &[0, 0, 1, 1, 1, 2, 3, 5]);
    let chosen: Vec<Map> = (0..count).map(|_| pick(random, &of_device)).collect();
    Maps::of(&chosen)
}
