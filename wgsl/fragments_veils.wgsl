// What the visibility pass keeps of a pixel that gets a list of fragments which are composited one by one: in steps of depth, how many there
// are and how much they hold back, as optical depth, -ln(1 - alpha). The list ends with the step by which so little shows through that what
// lies behind is never composited: sums of integers say so in any order. Same interface as fragments_count.wgsl.
// Host side and proof: src/passes/veils.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x9b37ce054ecaded7

// Of each pixel and step, from the nearest on: fragments, and what they hold back.
@group(0) @binding(50) var<storage, read_write> veils: array<atomic<u32>>;

const VEILS: u32 = 16u;
// Of an optical depth of 1.
const VEIL_UNITS: f32 = 1024.0;
// No fragment counts for more: nearer to an alpha of 1 its rounding would show.
const LEAST_LEFT: f32 = 1e-3;

// Fragments that are fainter are not listed, so they are not counted, and those that may not be hold nothing back.
override LEAST_COUNTED: f32;
override LEAST_HELD: f32;
// Of units, with which nothing more shows.
override ENOUGH_HELD: u32;

// The alpha, with which cover() hands it on.
fn mark_of(surfel: u32) -> u32 {
    return bitcast<u32>(surfel_alpha(surfel));
}

// Bits of positive depths are in their order, and as far apart as their logarithms, about.
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

// Of a pixel that has anything something that is not nothing, as there is no nearest depth.
fn nearest_at(pixel: u32) -> u32 {
    return select(NOTHING, 1u, atomicLoad(&nearest[pixel]) != 0u);
}

// After the lists' starts: the last step that each pixel lists.
fn ends_start() -> u32 {
    return pixels_start() + band_pixels() + 1u;
}

// Whether a fragment of that depth is listed.
fn is_before_end(pixel: u32, depth: f32) -> bool {
    return veil_of(depth) <= starts[ends_start() + pixel];
}

// How many fragments a pixel lists. One invocation a pixel.
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
