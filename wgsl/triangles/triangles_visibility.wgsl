// The visibility pass of triangles: the nearest one at every pixel; at equal depths, the one with
// the greatest index. One invocation per triangle; one workgroup for each large triangle, and for
// each rare one, for which f32 is not enough. Twin: src/passes/triangles.rs.
// All loops end, by 1, 2 of src/gpu/loops.rs: 0x4d6bde282b7d3568
// #import corner_*::{has_image, homogeneous_depth, is_before}
// #import corners::{Corner}
// #import cutout::{shows}
// #import footprint::{QUEUE_START, Rectangle, TILE, pixel_index}
// #import layout::{WORKGROUP, held, held_band, hold, kept_depth, linear_index}
// #import project::{QUEUE_GRID, rows_of}
// #import triangles::{Crossing, Triangle, cross_plainly, cross_precisely, is_plain, triangle_at}
// #import triangles::{triangles_held}
// #import triangles_*::{keep_triangle}
// #import vectors::{dot2}

// Queues, in the layout of the queue of large splats (project.wgsl): the number of triangles, a
// grid with one workgroup for each, and their indices.
@group(0) @binding(56) var<storage, read_write> large_triangles: array<atomic<u32>>;
@group(0) @binding(57) var<storage, read> queued_triangles: array<u32>;
@group(0) @binding(63) var<storage, read_write> rare_triangles: array<atomic<u32>>;
@group(0) @binding(64) var<storage, read> listed_triangles: array<u32>;

// Triangles that may touch more pixels than this get a workgroup.
const LARGE_TRIANGLE: u32 = 1024u;

// The range of image coordinates that the triangle reaches along an axis, pixels. If the near depth
// cuts the triangle, the ends of the cut count too.
fn reach_along(triangle: Triangle, axis: u32) -> vec2<f32> {
    let a = place_along(triangle.a, axis);
    let b = place_along(triangle.b, axis);
    let c = place_along(triangle.c, axis);
    if (is_before(triangle.a) && is_before(triangle.b) && is_before(triangle.c)) {
        let reach = vec2<f32>(min(min(a, b), c), max(max(a, b), c));
        return reach + vec2<f32>(-1.0, 1.0) * (1e-4 + 2.5e-7 * max(abs(reach.x), abs(reach.y)));
    }
    var reach = vec2<f32>(3e38, -3e38);
    reach = with_edge(reach, triangle.a, triangle.b, vec2<f32>(a, b));
    reach = with_edge(reach, triangle.b, triangle.c, vec2<f32>(b, c));
    return with_edge(reach, triangle.c, triangle.a, vec2<f32>(c, a));
}

fn place_along(corner: Corner, axis: u32) -> f32 {
    return select(corner.y.high, corner.x.high, axis == 0u);
}

// Extends the range by the part of an edge past the near depth. The margin at a cut covers the
// rounding of a sum of these magnitudes.
fn with_edge(reach: vec2<f32>, from_: Corner, to: Corner, places: vec2<f32>) -> vec2<f32> {
    var wider = reach;
    if (is_before(from_)) {
        wider = vec2<f32>(min(wider.x, places.x - 1.0), max(wider.y, places.x + 1.0));
    }
    if (is_before(from_) != is_before(to)) {
        let images = places * vec2<f32>(homogeneous_depth(from_).high, homogeneous_depth(to).high);
        let t = clamp((held.near - from_.depth.high) / (to.depth.high - from_.depth.high), 0.0, 1.0);
        let cut = (images.x + t * (images.y - images.x)) / held.near;
        let blur = 1.0 + 4e-6 * (abs(images.x) + abs(images.y)) / held.near;
        wider = vec2<f32>(min(wider.x, cut - blur), max(wider.y, cut + blur));
    }
    return wider;
}

// The pixels of the band that the triangle can reach; empty if a first one lies past a last one.
fn reach_of(triangle: Triangle) -> Rectangle {
    let across = reach_along(triangle, 0u);
    let down = reach_along(triangle, 1u);
    let low = vec2<f32>(0.0, f32(held_band.first_row));
    let high = vec2<f32>(f32(held.width), f32(held_band.first_row + held_band.rows)) - 1.0;
    let first = clamp(ceil(vec2<f32>(across.x, down.x) - 0.5), low, high + 1.0);
    let last = clamp(floor(vec2<f32>(across.y, down.y) - 0.5), low - 1.0, high);
    // Negated, so that NaN gives an empty range.
    if (!(all(first <= last) && has_image(triangle))) {
        return Rectangle(vec2<u32>(1u), vec2<u32>(0u));
    }
    return Rectangle(vec2<u32>(first), vec2<u32>(last));
}

// Whether f32 is not enough for the barycentric coordinates. In f32 they err by 2^-23 times the
// squared length of an edge over twice the area. In an ill-formed triangle this error moves depths
// by more than the rounding of f32 may, or it is so large that the coordinates are arbitrary.
fn is_ill_formed(triangle: Triangle) -> bool {
    let a = vec2<f32>(triangle.a.x.high, triangle.a.y.high);
    let b = vec2<f32>(triangle.b.x.high, triangle.b.y.high) - a;
    let c = vec2<f32>(triangle.c.x.high, triangle.c.y.high) - a;
    let depths = vec3<f32>(triangle.a.depth.high, triangle.b.depth.high, triangle.c.depth.high);
    let nearest_depth = min(min(depths.x, depths.y), depths.z);
    let span = max(max(depths.x, depths.y), depths.z) - nearest_depth;
    let area = abs(b.x * c.y - b.y * c.x);
    let length_2 = max(dot2(b, b), dot2(c, c));
    return !(length_2 * span <= 4.0 * area * nearest_depth && area > 1e-6 * length_2);
}

fn is_rare(triangle: Triangle) -> bool {
    return !(is_plain(triangle.a) && is_plain(triangle.b) && is_plain(triangle.c)) || is_ill_formed(triangle);
}

fn keep_crossing(crossed: Crossing, triangle: Triangle, number: u32, at: vec2<u32>) {
    if (crossed.hit && shows(triangle, number, vec2<f32>(at) + 0.5)) {
        keep_triangle(pixel_index(at.x, at.y), kept_depth(bitcast<u32>(crossed.depth)), number);
    }
}

// The order in a queue depends on the schedule, but nothing later depends on that order.
fn draw_small(number: u32, queues: bool) {
    if (number >= triangles_held()) {
        return;
    }
    let triangle = triangle_at(number);
    let pixels = reach_of(triangle);
    if (any(pixels.first > pixels.last)) {
        return;
    }
    if (is_rare(triangle)) {
        if (queues) {
            atomicStore(&rare_triangles[QUEUE_START + atomicAdd(&rare_triangles[0], 1u)], number);
        }
        return;
    }
    let size = pixels.last - pixels.first + 1u;
    if (size.x * size.y > LARGE_TRIANGLE) {
        if (queues) {
            atomicStore(&large_triangles[QUEUE_START + atomicAdd(&large_triangles[0], 1u)], number);
        }
        return;
    }
    var at = pixels.first;
    while (at.y <= pixels.last.y) {
        keep_crossing(cross_plainly(triangle, vec2<f32>(at) + 0.5), triangle, number, at);
        at.x++;
        at = select(at, vec2<u32>(pixels.first.x, at.y + 1u), at.x > pixels.last.x);
    }
}

fn draw_large(place: u32, local: vec2<u32>) {
    if (place >= queued_triangles[0]) {
        return;
    }
    let number = queued_triangles[QUEUE_START + place];
    let triangle = triangle_at(number);
    let pixels = reach_of(triangle);
    for (var y = pixels.first.y + local.y; y <= pixels.last.y; y += TILE) {
        for (var x = pixels.first.x + local.x; x <= pixels.last.x; x += TILE) {
            let at = vec2<u32>(x, y);
            keep_crossing(cross_plainly(triangle, vec2<f32>(at) + 0.5), triangle, number, at);
        }
    }
}

fn draw_rare(place: u32, local: vec2<u32>) {
    if (place >= listed_triangles[0]) {
        return;
    }
    let number = listed_triangles[QUEUE_START + place];
    let triangle = triangle_at(number);
    let pixels = reach_of(triangle);
    for (var y = pixels.first.y + local.y; y <= pixels.last.y; y += TILE) {
        for (var x = pixels.first.x + local.x; x <= pixels.last.x; x += TILE) {
            let at = vec2<u32>(x, y);
            keep_crossing(cross_precisely(triangle, vec2<f32>(at) + 0.5), triangle, number, at);
        }
    }
}

@compute @workgroup_size(WORKGROUP)
fn draw_triangles(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    draw_small(linear_index(workgroup, workgroups, local), true);
}

@compute @workgroup_size(1)
fn arrange_triangles() {
    let large = rows_of(atomicLoad(&large_triangles[0]));
    let rare_ = rows_of(atomicLoad(&rare_triangles[0]));
    for (var k = 0u; k < 3u; k++) {
        atomicStore(&large_triangles[QUEUE_GRID + k], large[k]);
        atomicStore(&rare_triangles[QUEUE_GRID + k], rare_[k]);
    }
}

@compute @workgroup_size(TILE, TILE)
fn draw_large_triangles(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    hold();
    draw_large(workgroup.y * workgroups.x + workgroup.x, local.xy);
}

@compute @workgroup_size(TILE, TILE)
fn draw_rare_triangles(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    hold();
    draw_rare(workgroup.y * workgroups.x + workgroup.x, local.xy);
}
