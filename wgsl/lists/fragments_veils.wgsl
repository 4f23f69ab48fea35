// Visibility pass for lists whose fragments are composited one by one. It divides the scene's range
// of depths into steps. For each pixel and step it sums the number of fragments and their optical
// depth, -ln(1 - alpha). A list ends with the step behind which so little shows that nothing is
// ever composited there. The sums are integers, so the ends do not depend on the order of the
// fragments. Same interface as fragments_count.wgsl.
// Host side and proof: src/passes/veils.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x9b37ce054ecaded7
// #import accumulator_raster|visibility::{nearest}
// #import blend::{fragment_weight}
// #import camera_orthographic|perspective::{Fragment}
// #import color_*::{surfel_alpha}
// #import footprint::{band_pixels}
// #import fragments::{list_starts, pixels_start, starts}
// #import layout::{NOTHING, WORKGROUP, held, hold, linear_index}
// #import resolve::{OPACITY}
// #import sorted::{MOST_ALPHA}

// For each pixel and step, from the nearest on: the number of fragments and their optical depth.
@group(0) @binding(50) var<storage, read_write> veils: array<atomic<u32>>;

const VEILS: u32 = 16u;
// Units of the sums per optical depth of 1.
const VEIL_UNITS: f32 = 1024.0;
// The lower limit of 1 - alpha: for an alpha nearer to 1, the rounding of 1 - alpha would matter.
const LEAST_LEFT: f32 = 1e-3;

// A fragment with an alpha below LEAST_COUNTED is surely not listed, so it is not counted. One with
// an alpha below LEAST_HELD may not be listed, so it adds no optical depth.
override LEAST_COUNTED: f32;
override LEAST_HELD: f32;
// The optical depth behind which nothing more shows, in units of the sums.
override ENOUGH_HELD: u32;

// The surfel's alpha, which cover() passes to keep_nearest().
fn mark_of(surfel: u32) -> u32 {
    return bitcast<u32>(surfel_alpha(surfel));
}

// The step of a depth. Steps are equal ranges of the bits of depths, which order as the depths and
// grow about as their logarithms.
fn veil_of(depth: f32) -> u32 {
    let first = bitcast<u32>(held.first);
    let width = (max(bitcast<u32>(held.farthest), first) - first) / VEILS + 1u;
    return min((max(bitcast<u32>(depth), first) - first) / width, VEILS - 1u);
}

fn keep_nearest(pixel: u32, fragment: Fragment, mark: u32) {
    let alpha = fragment_weight(fragment) * OPACITY * bitcast<f32>(mark);
    if (alpha < LEAST_COUNTED) {
        return;
    }
    let at = 2u * (pixel * VEILS + veil_of(fragment.depth));
    let held_back = -log(max(1.0 - min(alpha, MOST_ALPHA), LEAST_LEFT));
    atomicAdd(&veils[at], 1u);
    if (alpha >= LEAST_HELD) {
        atomicAdd(&veils[at + 1u], u32(VEIL_UNITS * held_back));
    }
}

// Counts are stored, not depths: returns 1 if the pixel has a fragment, else NOTHING.
fn nearest_at(pixel: u32) -> u32 {
    return select(NOTHING, 1u, atomicLoad(&nearest[pixel]) != 0u);
}

// The word, after the starts of lists, from which on the last listed step of each pixel is stored.
fn ends_start() -> u32 {
    return pixels_start() + band_pixels() + 1u;
}

// Whether a fragment at that depth is listed.
fn is_before_end(pixel: u32, depth: f32) -> bool {
    return veil_of(depth) <= starts[ends_start() + pixel];
}

// Finds the last step that a pixel lists, and the number of its listed fragments. One invocation
// per pixel.
@compute @workgroup_size(WORKGROUP)
fn end_lists(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let pixel = linear_index(workgroup, workgroups, local);
    if (pixel >= band_pixels()) {
        return;
    }
    var count = 0u;
    var held_back = 0u;
    var last = VEILS - 1u;
    for (var veil = 0u; veil < VEILS; veil++) {
        let at = 2u * (pixel * VEILS + veil);
        count += atomicLoad(&veils[at]);
        held_back += min(atomicLoad(&veils[at + 1u]), ENOUGH_HELD);
        if (held_back >= ENOUGH_HELD) {
            last = veil;
            break;
        }
    }
    atomicStore(&nearest[pixel], count);
    list_starts[ends_start() + pixel] = last;
}
