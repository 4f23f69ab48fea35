// Stage 1: projects every surfel to a splat, once. One invocation per surfel. Large splats are
// queued, and so are the rare surfels that take longer (thin splats, disks that reach the near
// depth). Queued ones are processed together later, so that the other invocations of a subgroup
// need not wait. Where project_draws.wgsl is part of the module, the invocation also draws the
// splat's nearest depths, which is stage 2.
// Twin: src/passes/project.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xf75e6d161ada379d
// #import around::{around, is_again}
// #import axes_*::{half_axes}
// #import camera_orthographic|perspective::{homography}
// #import center|center_doubled::{relative_center}
// #import clip::{clip_of}
// #import copies::{copies_of}
// #import cull|cull_absent|cull_twice::{place_for, slot_of}
// #import curved|facing|flat::{curve, is_back}
// #import double::{Double, product, sum}
// #import fade::{fade_of}
// #import footprint::{QUEUE_START, is_large}
// #import layout::{AWAY, Splat, WORKGROUP, held, hold, linear_index}
// #import lowpass_*::{low_pass}
// #import project_draws::{draw_projected}
// #import records::{SplatRecord, splat_record}
// #import select::{is_filled, places_held, surfel_of}
// #import vectors::{dot3}
// #import words|words_long::{surfel_at}

@group(0) @binding(3) var<storage, read_write> splats: array<SplatRecord>;
// The queue of large splats. Word 0 counts them; word 1 counts all surfels out of view. The three
// words from QUEUE_GRID on are a grid with one workgroup per large splat. The three from
// QUEUE_LISTING on are a grid with one workgroup per LISTED_AT_ONCE large splats. The splats' slots
// follow from QUEUE_START on. Both grids grow with the queue, so that no dispatch has to write
// them; beyond GRID_ROW workgroups their last row has spare ones.
@group(0) @binding(4) var<storage, read_write> queue: array<atomic<u32>>;

// The queue of rare surfels, in the same layout; its grid is that of project_rare(). `listed` is
// the same buffer, read-only.
@group(0) @binding(21) var<storage, read_write> rare: array<atomic<u32>>;
@group(0) @binding(22) var<storage, read> listed: array<u32>;

// Whether surfels that face away are left out.
override CULL_BACK: bool;

const QUEUE_GRID: u32 = 2u;
const QUEUE_LISTING: u32 = 5u;
// Large splats that one workgroup lists (bin.wgsl).
const LISTED_AT_ONCE: u32 = 8u;
const MOST_GROUPS: u32 = 65535u;
// Workgroups in a row of a grid that grows with its list. Long rows have more spare workgroups.
const GRID_ROW: u32 = 128u;

var<workgroup> group_unseen: atomic<u32>;

// Rotates from world to camera axes, in doubled precision.
fn rotate(world: array<Double, 3>) -> array<Double, 3> {
    var camera: array<Double, 3>;
    for (var row = 0u; row < 3u; row++) {
        let high = held.rotation[row];
        let low = held.rotation_low[row];
        camera[row] = sum(
            sum(product(Double(high.x, low.x), world[0]), product(Double(high.y, low.y), world[1])),
            product(Double(high.z, low.z), world[2]),
        );
    }
    return camera;
}

fn rotate_plain(world: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(
        dot3(held.rotation[0].xyz, world),
        dot3(held.rotation[1].xyz, world),
        dot3(held.rotation[2].xyz, world),
    );
}

// The order in a queue depends on the schedule, but nothing later depends on that order.
fn queue_large(slot: u32) {
    let place = atomicAdd(&queue[0], 1u);
    atomicStore(&queue[QUEUE_START + place], slot);
    if (place < GRID_ROW) {
        atomicMax(&queue[QUEUE_GRID], place + 1u);
    }
    if (place % GRID_ROW == 0u) {
        atomicMax(&queue[QUEUE_GRID + 1u], place / GRID_ROW + 1u);
        atomicStore(&queue[QUEUE_GRID + 2u], 1u);
    }
    let group = place / LISTED_AT_ONCE;
    if (place % LISTED_AT_ONCE == 0u && group < GRID_ROW) {
        atomicMax(&queue[QUEUE_LISTING], group + 1u);
    }
    if (place % (LISTED_AT_ONCE * GRID_ROW) == 0u) {
        atomicMax(&queue[QUEUE_LISTING + 1u], group / GRID_ROW + 1u);
        atomicStore(&queue[QUEUE_LISTING + 2u], 1u);
    }
}

fn queue_rare(slot: u32) {
    let place = atomicAdd(&rare[0], 1u);
    atomicStore(&rare[QUEUE_START + place], slot);
    let group = place / WORKGROUP;
    if (place % WORKGROUP == 0u && group < GRID_ROW) {
        atomicMax(&rare[QUEUE_GRID], group + 1u);
    }
    if (place % (WORKGROUP * GRID_ROW) == 0u) {
        atomicMax(&rare[QUEUE_GRID + 1u], group / GRID_ROW + 1u);
        atomicStore(&rare[QUEUE_GRID + 2u], 1u);
    }
}

// The outcomes of projecting a surfel.
const OUT_OF_VIEW: u32 = 0u;
const IN_VIEW: u32 = 1u;
const RARE: u32 = 2u;

// Projects the surfel of a slot and writes its splat. If the surfel is rare and `every` is false,
// writes nothing and returns RARE.
fn project_into(slot: u32, every: bool) -> u32 {
    let place = place_for(slot);
    let index = surfel_of(place);
    let surfel = surfel_at(index);
    let center = rotate(relative_center(index, surfel));
    let axes = half_axes(index, surfel, vec3<f32>(center[0].high, center[1].high, center[2].high));
    var h = homography(center, axes.s, axes.t, axes.s_world, axes.t_world, every);
    if (h.rare) {
        return RARE;
    }
    let cap = curve(&h, index, center, axes.s, axes.t);
    let filter_ = low_pass(&h);
    around(&h, slot);

    // The bounds are conservative: the margin covers the rounding of the extent, and the footprint
    // decides which pixels are covered.
    let size = vec2<f32>(f32(held.width), f32(held.height));
    let margin = 0.01 + 1e-5 * (abs(h.low) + abs(h.high));
    let first = max(ceil(h.low - margin - 0.5), vec2<f32>(0.0));
    let last = min(floor(h.high + margin - 0.5), size - 1.0);
    let exists = place < places_held() && is_filled(place);
    let faces = !(CULL_BACK && is_back(h, cap));
    let visible = exists && faces && all(first <= last);

    var splat: Splat;
    splat.bounds_first = 0xffffffffu;
    splat.bounds_last = 0u;
    if (visible) {
        splat.anchor_x = h.anchor.x;
        splat.anchor_y = h.anchor.y;
        splat.bounds_first = u32(first.x) | (u32(first.y) << 16u);
        splat.bounds_last = u32(last.x) | (u32(last.y) << 16u) | select(0u, AWAY, h.away > 0.0);
        splat.a = array<f32, 3>(h.a.x, h.a.y, h.a.z);
        splat.b = array<f32, 3>(h.b.x, h.b.y, h.b.z);
        splat.c = array<f32, 3>(h.c.x, h.c.y, h.c.z);
        splat.clip = clip_of(index, h.turn);
        splat.cap = cap;
        splat.fade = fade_of(index, place);
        splat.a_low = array<f32, 3>(h.a_low.x, h.a_low.y, h.a_low.z);
    }
    if (visible && is_large(splat)) {
        queue_large(slot);
    }
    splats[slot] = splat_record(splat, place, filter_);
    draw_projected(splat, filter_, index);
    return select(OUT_OF_VIEW, IN_VIEW, visible || !exists || is_again(slot));
}

// Counts the surfels out of view, because they are fewer than those in view. Copies count too.
fn count_unseen(local: u32, slot: u32, unseen: bool) {
    if (unseen) {
        atomicAdd(&group_unseen, copies_of(surfel_of(place_for(slot))));
    }
    workgroupBarrier();
    let all_unseen = atomicLoad(&group_unseen);
    if (local == 0u && all_unseen > 0u) {
        atomicAdd(&queue[1], all_unseen);
    }
}

@compute @workgroup_size(WORKGROUP)
fn project(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let slot = slot_of(workgroup, workgroups, local);
    var fate = IN_VIEW;
    if (slot < arrayLength(&splats)) {
        fate = project_into(slot, false);
    }
    if (fate == RARE) {
        queue_rare(slot);
    }
    count_unseen(local, slot, fate == OUT_OF_VIEW);
}

@compute @workgroup_size(WORKGROUP)
fn project_rare(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let place = linear_index(workgroup, workgroups, local);
    var slot = 0u;
    var fate = IN_VIEW;
    if (place < listed[0]) {
        slot = listed[QUEUE_START + place];
        fate = project_into(slot, true);
    }
    count_unseen(local, slot, fate == OUT_OF_VIEW);
}

// The number of workgroups that together have at least this many invocations.
fn groups_of(invocations: u32) -> u32 {
    return (invocations + WORKGROUP - 1u) / WORKGROUP;
}

// The grid of this number of workgroups, with at most MOST_GROUPS in a row.
fn rows_of(groups: u32) -> vec3<u32> {
    let rows = (groups + MOST_GROUPS - 1u) / MOST_GROUPS;
    return vec3<u32>((groups + max(rows, 1u) - 1u) / max(rows, 1u), rows, 1u);
}
