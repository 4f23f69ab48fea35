// Adds an accepted fragment to its pixel's sums, in the attribute pass of the compute path
// (accumulate.wgsl) or of the rasteriser (raster.wgsl). Twin: src/passes/accumulate.rs.
// #import *::{Term, accumulate_depth, quantise, settle}
// #import camera_orthographic|perspective::{Fragment}
// #import color_*::{accumulate_color, color_of}
// #import copies::{hold_copies}
// #import count::{accumulate_count}
// #import curved|facing|flat::{Bend}
// #import epsilon_*::{radius_of}
// #import kernel_*::{kernel_weight}
// #import layout::{Splat}
// #import normal::{accumulate_normal}
// #import normal_*::{bend_of, normal_at, normal_of}
// #import oit::{accumulate_held_back}
// #import oit_*::{weight_before}
// #import texture::{Place, accumulate_stored_place, place_of}

// 2^-24; see LEAST_WEIGHT in src/scene/kernel.rs.
const LEAST_WEIGHT: f32 = 5.9604644775390625e-8;
// Kernel::floor in src/scene/kernel.rs.
override KERNEL_FLOOR: f32;

struct Attributes {
    color: vec4<f32>,
    normal: vec3<f32>,
    bend: Bend,
    // The shorter half-axis, device units; 0 if epsilon does not depend on it.
    radius: f32,
    // The texture coordinates.
    place: Place,
}

fn attributes_of(index: u32, splat: Splat) -> Attributes {
    hold_copies(index);
    return Attributes(color_of(index, splat), normal_of(index, splat), bend_of(index), radius_of(index), place_of(index));
}

// The attributes of a fragment from a list or from the rasteriser, neither of which draws textures.
fn attributes_without_place(color: vec4<f32>, normal: vec3<f32>, bend: Bend, radius: f32) -> Attributes {
    var nowhere: Place;
    return Attributes(color, normal, bend, radius, nowhere);
}

fn fragment_weight(fragment: Fragment) -> f32 {
    let unfiltered = clamp(kernel_weight(fragment.rho2), KERNEL_FLOOR, 1.0);
    return max(fragment.gain * unfiltered, LEAST_WEIGHT);
}

fn weight_of(fragment: Fragment) -> Term {
    return quantise(fragment_weight(fragment));
}

fn blend(pixel: u32, fragment: Fragment, front: f32, attributes: Attributes) {
    let weight = fragment_weight(fragment);
    accumulate_held_back(pixel, weight, attributes.color);
    let weighed = quantise(weight_before(pixel, fragment.depth, weight));
    accumulate_stored_place(pixel, weighed, attributes.place, fragment.depth);
    blend_weighted(pixel, weighed, fragment.depth, front, normal_at(attributes, fragment.spot), attributes);
}

// Adds all terms except texture coordinates. A weight of 0 adds nothing to any sum.
fn blend_weighted(
    pixel: u32,
    weight: Term,
    depth: f32,
    front: f32,
    normal: vec3<f32>,
    attributes: Attributes,
) {
    accumulate_color(pixel, weight, attributes.color);
    accumulate_normal(pixel, weight, normal);
    accumulate_depth(pixel, weight, depth, front);
    accumulate_count(pixel, weight);
    settle(pixel);
}
