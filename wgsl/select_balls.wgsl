// Stage 0 of cuts of which hidden batches are left out (cull.wgsl): the ball of each batch of what was chosen (select.wgsl). As ball in
// src/passes/cull.rs, but for the middle.
// All loops end, by 1 of src/gpu/loops.rs: 0x38b9b152cd1b32dc

@group(0) @binding(85) var<storage, read_write> made_balls: array<vec4<f32>>;

// Room for roundings of f32 in a ball, relative.
const BALL_SLACK: f32 = 1e-5;

// Surfels of a batch that an invocation reads, and invocations that read one.
const BALL_PART: u32 = 8u;
const READERS: u32 = BATCH / BALL_PART;

// Of what each invocation reads: the centre of a surfel, and the largest distance of a rim.
var<workgroup> sampled: array<vec3<f32>, WORKGROUP>;
var<workgroup> farthest: array<f32, WORKGROUP>;

// The longer half-axis of the ellipse whose half-axes need not be perpendicular, device units.
fn longest_of(surfel: Surfel) -> f32 {
    let s = vector(surfel.s) * held.unit;
    let t = vector(surfel.t) * held.unit;
    let difference = dot3(s, s) - dot3(t, t);
    let product = 2.0 * dot3(s, t);
    return sqrt(0.5 * (dot3(s, s) + dot3(t, t) + sqrt(difference * difference + product * product)));
}

// READERS invocations a batch.
@compute @workgroup_size(WORKGROUP)
fn select_balls(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold_view();
    let invocation = linear_index(workgroup, workgroups, local);
    let batch = invocation / READERS;
    let reader = invocation % READERS;
    let size = select(0u, batch_size(batch), batch < arrayLength(&made_balls));
    // Of a batch with room left its last surfel stands for what is not there.
    let last = min(batch * BATCH + max(size, 1u) - 1u, places_held() - 1u);
    let first = batch * BATCH + reader;
    // Those of one surfel of each reader, from all over the batch, tell its middle well enough.
    sampled[local] = vector(surfel_at(surfel_of(min(first + reader * READERS, last))).center);
    workgroupBarrier();
    var low = sampled[local];
    var high = low;
    for (var k = local - reader; k < local - reader + READERS; k++) {
        low = min(low, sampled[k]);
        high = max(high, sampled[k]);
    }
    let middle = low + (high - low) * 0.5;
    var radius = 0.0;
    for (var k = 0u; k < BALL_PART; k++) {
        let index = surfel_of(min(first + k * READERS, last));
        let surfel = surfel_at(index);
        let distance = norm3((vector(surfel.center) - middle) * held.unit);
        radius = max(radius, distance + longest_of(surfel) + cap_height(index) * held.unit);
    }
    farthest[local] = radius;
    workgroupBarrier();
    if (reader == 0u && batch < arrayLength(&made_balls)) {
        for (var k = local; k < local + READERS; k++) {
            radius = max(radius, farthest[k]);
        }
        // Nothing is nowhere.
        let reach = radius * held.world * (1.0 + BALL_SLACK);
        made_balls[batch] = vec4<f32>(middle, select(-1e30, reach, size > 0u));
    }
}
