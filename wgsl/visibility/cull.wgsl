// The start of stage 1: chooses the batches of surfels that are projected. The near batches, in
// view and nearer than the middle of the scene, are projected and drawn first. Then follow the far
// batches in view that are not hidden behind what was drawn. A batch is left out only if none of
// its fragments could be nearest or within epsilon of the nearest, so no image changes. The splats
// of the listed batches are stored in slots, one batch after the other: batches that are left out
// take no memory.
// Host side and twin: src/passes/cull.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xb67ab5811d887c68
// #import accumulator_raster|front::{visible}
// #import ball::{Ball, FILTER_REACH, ball_at, reaches_near}
// #import balls_*::{batches_held, sphere_of}
// #import camera_*::{ball_extent}
// #import epsilon_*::{deepest_accepted}
// #import footprint::{Rectangle, band_pixels}
// #import layout::{BATCH, NOTHING, Splat, WORKGROUP, held, held_band, hold, linear_index}
// #import occlusion::{OCCLUSION_TILE, farthest_in, occlusion_tiles}
// #import project::{queue}
// #import records::{SplatRecord}
// #import select::{held_in, surfel_of}
// #import vectors::{norm3}
// #import words|words_long::{each_word}

// From word 0 on, the grid of workgroups over all listed batches, whose word 1 is their number.
// From LIST_FAR on, the grid over the far batches. From LIST_START on, the numbers of the batches,
// the near ones first. `drawn` is the same buffer, read-only.
@group(0) @binding(24) var<storage, read_write> surviving: array<atomic<u32>>;
@group(0) @binding(25) var<storage, read> drawn: array<u32>;
// The batches in view that are not near: how many there are, and their numbers.
@group(0) @binding(38) var<storage, read_write> rest: array<atomic<u32>>;

const LIST_FAR: u32 = 3u;
const LIST_START: u32 = 6u;

// A batch that touches more tiles counts as visible: one invocation should not scan a whole image.
const MOST_TILES: u32 = 4096u;

// A relative margin on depths for the rounding of rows c (src/passes/cull.rs).
const DEPTH_SLACK: f32 = 1e-3;

// The slot of this invocation's splat. Each row of the dispatch is a batch. The dispatch has the
// batches that were listed last, by turns from their first and their second half: the near half
// takes longer, and a CPU adapter gives each of its threads a range of rows.
fn slot_of(workgroup: vec3<u32>, workgroups: vec3<u32>, local: u32) -> u32 {
    let turn = select(0u, (workgroups.y + 1u) / 2u, workgroup.y % 2u == 1u) + workgroup.y / 2u;
    return (drawn[1] - workgroups.y + turn) * BATCH + workgroup.x * WORKGROUP + local;
}

// The place in its page of the surfel whose splat has this slot. Some slots of the last batch have
// places past the last surfel.
fn place_for(slot: u32) -> u32 {
    return drawn[LIST_START + slot / BATCH] * BATCH + slot % BATCH;
}

// Coordinates of an anchor are at most 2^22 (camera_pinhole.wgsl, camera_orthographic.wgsl), so its
// two words have 18 spare bits. They hold the number of the batch; a page has fewer than 2^16
// batches.
const SPARE: vec2<u32> = vec2<u32>(9u);

fn anchor_words(splat: Splat, place: u32) -> vec2<u32> {
    let anchor = bitcast<vec2<u32>>(vec2<i32>(splat.anchor_x, splat.anchor_y));
    let batch = place / BATCH;
    return ((anchor << SPARE) >> SPARE) | (vec2<u32>(batch, batch >> SPARE.x) << (32u - SPARE));
}

fn anchor_of(words: vec2<u32>) -> vec2<i32> {
    return bitcast<vec2<i32>>(words << SPARE) >> SPARE;
}

// The surfel whose splat is stored in a slot.
fn surfel_in(record: SplatRecord, slot: u32) -> u32 {
    let spare = each_word(record[0]).xy >> (32u - SPARE);
    return surfel_of((spare.x | spare.y << SPARE.x) * BATCH + slot % BATCH);
}

fn ball_of_batch(batch: u32) -> Ball {
    let sphere = sphere_of(batch);
    let relative = sphere.xyz * held.unit - held.eye.xyz;
    // The margin covers ten f32 roundings of these lengths.
    return ball_at(relative, sphere.w * held.unit + 1e-6 * (norm3(relative) + norm3(held.eye.xyz)));
}

// The pixels of the band that the ball may touch; empty if `first` is past `last`.
fn pixels_of(ball: Ball) -> Rectangle {
    let top = f32(held_band.first_row);
    let extent = ball_extent(ball.center, ball.radius, ball.nearest);
    // One more pixel on each side for the margin of the splats' own bounds, and one for rounding.
    let margin = FILTER_REACH + 2.0 + 1e-5 * (abs(extent.xy) + abs(extent.zw));
    let first = max(extent.xy - margin, vec2<f32>(0.0, top));
    let last = min(extent.zw + margin, vec2<f32>(f32(held.width), top + f32(held_band.rows)) - 1.0);
    if (!all(first <= last)) {
        return Rectangle(vec2<u32>(1u), vec2<u32>(0u));
    }
    return Rectangle(vec2<u32>(first), vec2<u32>(last));
}

fn list(batch: u32) {
    atomicStore(&surviving[LIST_START + atomicAdd(&surviving[1], 1u)], batch);
}

fn leave_out(batch: u32) {
    atomicAdd(&queue[1], held_in(batch));
}

// One invocation per batch.
@compute @workgroup_size(WORKGROUP)
fn cull_near(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let batch = linear_index(workgroup, workgroups, local);
    if (batch >= batches_held() || held_in(batch) == 0u) {
        return;
    }
    let ball = ball_of_batch(batch);
    let near = reaches_near(ball);
    let pixels = pixels_of(ball);
    if (ball.farthest < held.near || (!near && any(pixels.first > pixels.last))) {
        leave_out(batch);
    } else if (near || ball.center.z <= held.middle) {
        list(batch);
    } else {
        atomicStore(&rest[1u + atomicAdd(&rest[0], 1u)], batch);
    }
}

// Runs after the near batches are drawn. A tile with an empty pixel hides nothing. One invocation
// per tile.
@compute @workgroup_size(WORKGROUP)
fn occlude_open(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let tile = linear_index(workgroup, workgroups, local);
    let across = occlusion_tiles().x;
    _ = farthest_in(vec2<u32>(tile % across, tile / across), NOTHING);
}

// Runs after occlude_open(). One invocation per batch in `rest`; further invocations have no batch.
@compute @workgroup_size(WORKGROUP)
fn cull_far(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let place = linear_index(workgroup, workgroups, local);
    if (place >= atomicLoad(&rest[0])) {
        return;
    }
    let batch = atomicLoad(&rest[1u + place]);
    let ball = ball_of_batch(batch);
    if (behind(ball, pixels_of(ball))) {
        leave_out(batch);
    } else {
        list(batch);
        atomicAdd(&surviving[LIST_FAR + 1u], 1u);
    }
}

// Whether everything drawn so far at `pixels`, and epsilon behind it, lies in front of the ball.
fn behind(ball: Ball, pixels: Rectangle) -> bool {
    // Tiles are counted from the band's first row.
    let above = vec2<u32>(0u, held_band.first_row);
    let first = (pixels.first - above) / OCCLUSION_TILE;
    let last = (pixels.last - above) / OCCLUSION_TILE;
    let size = last - first + 1u;
    if (size.x * size.y > MOST_TILES) {
        return false;
    }
    let reached = ball.nearest * (1.0 - DEPTH_SLACK);
    let tiles = occlusion_tiles();
    let start = band_pixels();
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            // A tile with an empty pixel has +inf, which hides nothing.
            let front = bitcast<f32>(visible[start + y * tiles.x + x]);
            if (!(reached > deepest_accepted(front) * (1.0 + DEPTH_SLACK))) {
                return false;
            }
        }
    }
    return true;
}
