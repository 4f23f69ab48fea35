// Stage 0 of cuts of which hidden batches are left out (cull.wgsl): the ball of each batch of what was copied (select.wgsl). Twin: ball in
// src/passes/cull.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x7141d9a8a3fdf948

@group(0) @binding(85) var<storage, read_write> made_balls: array<vec4<f32>>;

// Room for roundings of f32 in a ball, relative.
const BALL_SLACK: f32 = 1e-5;

// Of the box of a batch's centres, and the largest distance of what it has, as words that order as the numbers do.
var<workgroup> box_low: array<atomic<u32>, 3>;
var<workgroup> box_high: array<atomic<u32>, 3>;
var<workgroup> farthest_word: atomic<u32>;

fn word_of_number(value: f32) -> u32 {
    let bits = bitcast<u32>(value);
    return bits ^ select(0x80000000u, 0xffffffffu, (bits >> 31u) == 1u);
}

fn number_of_word(word: u32) -> f32 {
    return bitcast<f32>(word ^ select(0xffffffffu, 0x80000000u, (word >> 31u) == 1u));
}

// The longer half-axis of the ellipse whose half-axes need not be perpendicular, device units.
fn longest_of(surfel: Surfel) -> f32 {
    let s = vector(surfel.s) * held.unit;
    let t = vector(surfel.t) * held.unit;
    let difference = dot(s, s) - dot(t, t);
    let product = 2.0 * dot(s, t);
    return sqrt(0.5 * (dot(s, s) + dot(t, t) + sqrt(difference * difference + product * product)));
}

// One workgroup a batch.
@compute @workgroup_size(WORKGROUP)
fn select_balls(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold_view();
    let batch = workgroup.y * workgroups.x + workgroup.x;
    // Of a batch with room left its last surfel stands for what is not there.
    let size = select(0u, batch_size(batch), batch < arrayLength(&made_balls));
    let index = min(batch * BATCH + min(local, max(size, 1u) - 1u), surfels_held() - 1u);
    let surfel = surfel_at(index);
    let center = vector(surfel.center);
    // Workgroup memory starts at 0, which no number's word is below: what is kept of the least is how far it is from the greatest word.
    for (var k = 0u; k < 3u; k++) {
        atomicMax(&box_low[k], ~word_of_number(center[k]));
        atomicMax(&box_high[k], word_of_number(center[k]));
    }
    workgroupBarrier();
    var middle: vec3<f32>;
    for (var k = 0u; k < 3u; k++) {
        let low = number_of_word(~atomicLoad(&box_low[k]));
        middle[k] = low + (number_of_word(atomicLoad(&box_high[k])) - low) * 0.5;
    }
    let radius = length((center - middle) * held.unit) + longest_of(surfel) + cap_height(index) * held.unit;
    atomicMax(&farthest_word, bitcast<u32>(radius));
    workgroupBarrier();
    if (local == 0u && batch < arrayLength(&made_balls)) {
        // Nothing is nowhere.
        let reach = bitcast<f32>(atomicLoad(&farthest_word)) * held.world * (1.0 + BALL_SLACK);
        made_balls[batch] = vec4<f32>(middle, select(-1e30, reach, size > 0u));
    }
}
