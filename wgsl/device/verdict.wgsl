// Decides whether a frame that stays on the device is complete: every count that its passes made
// has a largest value, which is the size of the buffer that it is for.
// Host side: src/render/record.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x41d4115684304f4f

// The counts of the frame, two words each.
@group(0) @binding(0) var<storage, read> frame_counts: array<vec2<u32>>;
// The number of counts; then for each the largest values of its two words, and the bit of `verdict`
// that larger ones set.
@group(0) @binding(1) var<storage, read> frame_limits: array<vec4<u32>>;
// 1 if the frame is complete, else 0; then the bits of what lacked room in any part of the frame.
@group(0) @binding(2) var<storage, read_write> verdict: array<u32>;

var<workgroup> lacking: atomic<u32>;

const JUDGES: u32 = 64u;

@compute @workgroup_size(JUDGES)
fn judge_frame(@builtin(local_invocation_index) local: u32) {
    for (var at = local; at < frame_limits[0].x; at += JUDGES) {
        let limit = frame_limits[at + 1u];
        if (any(frame_counts[at] > limit.xy)) {
            atomicOr(&lacking, limit.z);
        }
    }
    workgroupBarrier();
    if (local == 0u) {
        let all = verdict[1] | atomicLoad(&lacking);
        verdict[1] = all;
        verdict[0] = select(0u, 1u, all == 0u);
    }
}
