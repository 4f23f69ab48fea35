// The layers that the rasteriser has peeled so far: each new layer is composited behind the earlier
// ones.
// Host side: src/passes/peel.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x6f64d54604ba503e
// #import *::{front_at, resolve_color, sum_at}
// #import footprint::{band_pixels}
// #import layout::{NOTHING, WEIGHT_CHANNEL, WORKGROUP, held, hold, linear_index}
// #import normal::{resolve_normal}
// #import resolve::{shaded}
// #import resolve_lists::{Shown, with_behind}
// #import side::{SIDES, SIDE_BIT}

// Per pixel: the premultiplied colour (four words), the transmittance, the number of layers, and
// the nearest depths of the last peeled layer that shows its front and of the last one that shows
// its back (raster_peeled.wgsl).
@group(0) @binding(49) var<storage, read_write> peeled: array<u32>;

const PEELED_WORDS: u32 = 8u;
const PEELED_FRONTS: u32 = 6u;

fn composite(pixel: u32, out: u32, x: u32, y: u32) -> Shown {
    let at = pixel * PEELED_WORDS;
    let color = bitcast<vec4<f32>>(vec4<u32>(peeled[at], peeled[at + 1u], peeled[at + 2u], peeled[at + 3u]));
    let layers = peeled[at + 5u];
    // The buffer was cleared, so without a layer the transmittance is not stored yet.
    return Shown(color, select(bitcast<f32>(peeled[at + 4u]), 1.0, layers == 0u), layers, 0.0);
}

// One invocation per pixel.
@compute @workgroup_size(WORKGROUP)
fn peel(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let pixel = linear_index(workgroup, workgroups, local);
    if (pixel >= band_pixels()) {
        return;
    }
    let front = front_at(pixel);
    if (bitcast<u32>(front) == NOTHING) {
        return;
    }
    let at = pixel * PEELED_WORDS;
    peeled[at + PEELED_FRONTS + select(0u, bitcast<u32>(front) & SIDE_BIT, SIDES)] = bitcast<u32>(front);
    // A target of few bits may have rounded a faint layer to nothing; the layer counts as peeled
    // all the same.
    let weight = sum_at(pixel, WEIGHT_CHANNEL);
    if (weight == 0.0) {
        return;
    }
    let x = pixel % held.width;
    let y = pixel / held.width;
    let normal = resolve_normal(pixel, weight, front);
    let shown = with_behind(composite(pixel, 0u, x, y), shaded(resolve_color(pixel, weight), normal, x, y));
    let color = bitcast<vec4<u32>>(shown.color);
    for (var k = 0u; k < 4u; k++) {
        peeled[at + k] = color[k];
    }
    peeled[at + 4u] = bitcast<u32>(shown.transmittance);
    peeled[at + 5u] = shown.layers;
}
