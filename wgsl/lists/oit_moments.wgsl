// Order-independent transparency by moments: a fragment's weight is multiplied by the transmittance
// in front of it, as estimated from the moments of all fragments (Muenstermann et al. 2018). The
// visibility pass sums the moments. Same interface as nearest_depth.wgsl and oit_weighted.wgsl.
// Twin: src/passes/moments.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x162af31a4e26f963
// #import *::{front_at}
// #import accumulator_raster|visibility::{nearest}
// #import blend::{fragment_weight}
// #import camera_orthographic|perspective::{Fragment}
// #import color_*::{surfel_alpha}
// #import layout::{kept_depth}
// #import oit::{depth_fraction, held_back}
// #import resolve::{OPACITY}

// Five 64-bit sums per pixel, low word first, in two's complement.
@group(0) @binding(51) var<storage, read_write> moments: array<atomic<u32>>;

const MOMENTS: u32 = 5u;
// 2^26 units for an optical depth of 1. The optical depth of a fragment is at most 28.
const MOMENT_UNITS: f32 = 67108864.0;
// MIXED and OF_OWN in the twin.
const MIXED: f32 = 0.00006103515625;
const OF_OWN: f32 = 0.25;
// LEAST_SPREAD and LEAST_MASS in the twin.
const LEAST_SPREAD: f32 = 1e-6;
const LEAST_MASS: f32 = 1.52587890625e-5;

// Maps a depth to [-1, 1].
fn moment_place(depth: f32) -> f32 {
    return 2.0 * depth_fraction(depth) - 1.0;
}

// The surfel's alpha, which cover() passes to keep_nearest().
fn mark_of(surfel: u32) -> u32 {
    return bitcast<u32>(surfel_alpha(surfel));
}

fn add_moment(word: u32, value: f32) {
    let term = i32(round(value * MOMENT_UNITS));
    let bits = bitcast<u32>(term);
    let before = atomicAdd(&moments[word], bits);
    let high = select(0, 1, before + bits < before) - select(0, 1, term < 0);
    if (high != 0) {
        atomicAdd(&moments[word + 1u], bitcast<u32>(high));
    }
}

fn keep_nearest(pixel: u32, fragment: Fragment, mark: u32) {
    var term = held_back(fragment_weight(fragment) * OPACITY * bitcast<f32>(mark));
    let place = moment_place(fragment.depth);
    for (var k = 0u; k < MOMENTS; k++) {
        add_moment(2u * (pixel * MOMENTS + k), term);
        term *= place;
    }
    atomicMax(&nearest[pixel], kept_depth(bitcast<u32>(fragment.depth)));
}

fn nearest_at(pixel: u32) -> u32 {
    return kept_depth(atomicLoad(&nearest[pixel]));
}

fn moment_at(pixel: u32, moment: u32) -> f32 {
    let word = 2u * (pixel * MOMENTS + moment);
    var low = atomicLoad(&moments[word]);
    var high = atomicLoad(&moments[word + 1u]);
    let negative = high >= 0x80000000u;
    if (negative) {
        high = ~high + select(0u, 1u, low == 0u);
        low = ~low + 1u;
    }
    let value = f32(high) * 4294967296.0 + f32(low);
    return select(value, -value, negative) / MOMENT_UNITS;
}

// The fraction of the mass that counts as in front of `place`, from moments 1 to 4 of unit mass.
fn mass_before(b: vec4<f32>, place: f32) -> f32 {
    let mean = b.x;
    let second = max(b.y - mean * mean, LEAST_SPREAD);
    let third = b.z - mean * (3.0 * b.y - 2.0 * mean * mean);
    let fourth = b.w - mean * (4.0 * b.z - mean * (6.0 * b.y - 3.0 * mean * mean));
    let x = place - mean;
    // The polynomial whose zeros are the two other places with mass; at x its value is 1 over the
    // mass there.
    let rest = max(fourth - second * second - third * third / second, LEAST_SPREAD * second);
    let c2 = (x * x - second - third / second * x) / rest;
    let c1 = (x - third * c2) / second;
    let c0 = 1.0 - second * c2;
    let own = 1.0 / (c0 + x * (c1 + x * c2));
    // One of the two other places may be infinitely far away; it then has no mass.
    let divisor = select(c2, 1e-12, abs(c2) < 1e-12);
    let half = -0.5 * c1 / divisor;
    let product = c0 / divisor;
    let root = sqrt(max(half * half - product, 0.0));
    let larger = half + select(root, -root, half < 0.0);
    let other = product / larger;
    // The masses at the two other places follow from total mass 1 and first moment 0.
    let of_larger = (-own * x - other * (1.0 - own)) / (larger - other);
    let of_other = 1.0 - own - of_larger;
    let before = OF_OWN * own + select(0.0, of_larger, larger < x) + select(0.0, of_other, other < x);
    return clamp(before, 0.0, 1.0);
}

fn weight_before(pixel: u32, depth: f32, weight: f32) -> f32 {
    let mass = moment_at(pixel, 0u);
    let sums = vec4<f32>(moment_at(pixel, 1u), moment_at(pixel, 2u), moment_at(pixel, 3u), moment_at(pixel, 4u));
    if (mass < LEAST_MASS) {
        return weight;
    }
    let b = sums / mass * (1.0 - MIXED) + vec4<f32>(0.0, 0.375, 0.0, 0.375) * MIXED;
    let before = mass_before(b, moment_place(depth)) - mass_before(b, moment_place(front_at(pixel)));
    return weight * exp(-mass * max(before, 0.0));
}
