// Surfels that curve out of their planes: paraboloids over their disks, intersected exactly. Rows
// a, b and c of a splat's record give U, V and W at a pixel; a_low is D. In the surfel's
// coordinates (u, v, w), the point (U, V, W) of the pixel's ray lies at the depth `depth` of the
// cap. Per longer half-axis of depth, the ray advances by spread (U, V, W) + D
// (src/passes/curved.rs).
// Same interface as flat.wgsl. Twins: src/scene/cap.rs, src/passes/curved.rs.
// #import attributes::{attribute_word}
// #import camera_orthographic|perspective::{Fragment, image_step, shear, spread_of, third_row}
// #import camera_orthographic|perspective::{toward, widening}
// #import clip::{CLIP_ROWS, cuts}
// #import double::{Double}
// #import filter|lowpass_none::{FILTERED, FILTER_ROWS, Filter}
// #import frame_*::{Frame, frame_holds_center, frame_normal, frame_of, frame_rows}
// #import layout::{AWAY, Splat, held}
// #import lowpass_*::{filtered}
// #import project::{CULL_BACK}
// #import records::{SplatRecord}
// #import rows::{Homography}
// #import vectors::{cross3, dot2, dot3, norm2, norm3}
// #import words|words_long::{each_word, words}

// The first of the three words of a surfel's attributes that hold its heights, world units.
override CAP_WORD: u32;

struct Cap {
    // The coefficients uu, uv and vv of the height (uu u^2 + 2 uv u v + vv v^2) / 2, in units of
    // the longer half-axis.
    heights: vec3<f32>,
    // The longer half-axis over the depth; 0 for an orthographic camera.
    spread: f32,
    // The longer half-axis, and the depth at which U, V and W are taken, device units.
    radius: f32,
    depth: f32,
    // A depth in front of all fragments of the cap.
    nearest: f32,
}

// The position of a fragment on its surfel.
struct Spot {
    uv: vec2<f32>,
    // Whether the fragment shows the surfel's back.
    away: bool,
}

// The change of the normal per unit of u and of v, where the centre's normal has length 1.
struct Bend {
    u: vec3<f32>,
    v: vec3<f32>,
}

// The greatest distance of a hit from the depth at which U, V and W are taken, in longer half-axes.
// No cap is higher than one longer half-axis.
const FARTHEST_HIT: f32 = 8.0;

fn world_heights(index: u32) -> vec3<f32> {
    return vec3<f32>(
        bitcast<f32>(attribute_word(index, CAP_WORD)),
        bitcast<f32>(attribute_word(index, CAP_WORD + 1u)),
        bitcast<f32>(attribute_word(index, CAP_WORD + 2u)),
    );
}

// The least and the greatest height over the unit disk; their interval includes 0.
fn extremes(heights: vec3<f32>) -> vec2<f32> {
    let mean = 0.25 * (heights.x + heights.z);
    let spread = norm2(vec2<f32>(0.25 * (heights.x - heights.z), 0.5 * heights.y));
    return vec2<f32>(min(mean - spread, 0.0), max(mean + spread, 0.0));
}

// The rows of the inverse of [s t n], n the unit normal of s and t.
fn inverse_of(s: vec3<f32>, t: vec3<f32>) -> array<vec3<f32>, 3> {
    let across = cross3(s, t);
    let size = norm3(across);
    let n = across / size;
    return array<vec3<f32>, 3>(cross3(t, n) / size, cross3(n, s) / size, n);
}

// Returns the cap of the surfel whose disk has the homography h, and replaces rows, extent and
// depths in h by those of the cap.
fn curve(h: ptr<function, Homography>, index: u32, center: array<Double, 3>, s: vec3<f32>, t: vec3<f32>) -> Cap {
    let frame = frame_of(center, s, t);
    let p = frame.p;
    let r = frame.radius;
    // In units of r, so that no product under- or overflows.
    let unit_s = frame.s / r;
    let unit_t = frame.t / r;
    let m = frame_rows(frame, unit_s, unit_t);
    let normal = frame_normal(frame, m);
    let heights = world_heights(index) * (held.unit / r);
    let height = extremes(heights) * r;
    let slope = norm2(vec2<f32>(frame.s.z, frame.t.z));
    let low_shift = normal * height.x;
    let high_shift = normal * height.y;
    // The rounding of these sums is less than 4 * 2^-24 of the magnitudes, a quarter of this
    // margin.
    let blur = 1e-6 * (abs(p.z) + slope + height.y - height.x);
    let depths = vec2<f32>(
        p.z - slope + min(low_shift.z, high_shift.z) - blur,
        p.z + slope + max(low_shift.z, high_shift.z) + blur,
    );
    (*h).turn = vec2<f32>(1.0, 0.0);
    (*h).low = vec2<f32>(1.0);
    (*h).high = vec2<f32>(0.0);
    if (!(depths.y >= held.near)) {
        (*h).centered = false;
        return Cap(vec3<f32>(0.0), 0.0, 0.0, 0.0, 0.0);
    }
    let centered = frame_holds_center(*h);
    (*h).centered = centered;
    let depth = select(max(held.near, depths.y), p.z, centered);
    let scale = widening(depth) / r;
    if (!centered) {
        (*h).anchor = vec2<i32>(vec2<u32>(held.width, held.height) / 2u);
    }
    // The step per pixel on the plane at that depth, and the point of the anchor's ray there
    // relative to the centre, both in units of r.
    let per_pixel = scale / frame.focal;
    var start = -(*h).offset * per_pixel;
    var start_z = 0.0;
    if (!centered) {
        let ray = (vec2<f32>((*h).anchor) + 0.5 - frame.principal) / frame.focal;
        start = (ray * depth - p.xy) / r;
        start_z = (depth - p.z) / r;
    }
    (*h).a = vec3<f32>(m[0].xy * per_pixel, dot2(m[0].xy, start) + m[0].z * start_z);
    (*h).b = vec3<f32>(m[1].xy * per_pixel, dot2(m[1].xy, start) + m[1].z * start_z);
    (*h).c = vec3<f32>(m[2].xy * per_pixel, dot2(m[2].xy, start) + m[2].z * start_z);
    // D, the part of the rays' advance that all pixels share.
    let forward = toward(p, depth);
    (*h).a_low = vec3<f32>(dot3(forward, m[0]), dot3(forward, m[1]), dot3(forward, m[2]));
    let extent = box_extent(*h, frame, array<vec3<f32>, 5>(p, frame.s, frame.t, low_shift, high_shift), depths);
    (*h).low = extent.xy;
    (*h).high = extent.zw;
    (*h).depth_low = depths.x;
    (*h).depth_high = depths.y;
    return Cap(heights, spread_of(r, depth), r, depth, max(depths.x, held.near) * (1.0 - 1e-5));
}

// The first and the last point of the image (xy, zw) that two sheared boxes around the cap have in
// common (Seen::extent in the twin). `disk` is p, s, t and the displacements of the centre to the
// cap's lowest and highest point; `depths` is the range of the cap's depths.
fn box_extent(h: Homography, frame: Frame, disk: array<vec3<f32>, 5>, depths: vec2<f32>) -> vec4<f32> {
    let along_ray = sheared_extent(h, frame, disk, depths, shear(disk[0]), h.centered);
    let straight = sheared_extent(h, frame, disk, depths, vec2<f32>(0.0), false);
    return vec4<f32>(max(along_ray.xy, straight.xy), min(along_ray.zw, straight.zw));
}

// The extent of the box that is sheared along the ray (ratio, 1). If `centered`, that ray passes
// through the cap's centre.
fn sheared_extent(
    h: Homography,
    frame: Frame,
    disk: array<vec3<f32>, 5>,
    depths: vec2<f32>,
    ratio: vec2<f32>,
    centered: bool,
) -> vec4<f32> {
    let p = disk[0];
    let rest = select(p.xy - ratio * p.z, vec2<f32>(0.0), centered);
    let s = disk[1].xy - ratio * disk[1].z;
    let t = disk[2].xy - ratio * disk[2].z;
    let low = disk[3].xy - ratio * disk[3].z;
    let high = disk[4].xy - ratio * disk[4].z;
    let longer = max(norm3(disk[1]), norm3(disk[2]));
    let half = sqrt(s * s + t * t) * (1.0 + 1e-6) + 1e-6 * (longer + max(abs(rest.x), abs(rest.y)));
    let first = rest - half + min(low, high);
    let last = rest + half + max(low, high);
    let before = max(depths, vec2<f32>(held.near));
    let middle = select(
        ratio * frame.focal + frame.principal,
        vec2<f32>(h.anchor) + 0.5 + h.offset,
        centered,
    );
    let margin = select(1.0, 0.0, centered);
    return vec4<f32>(
        middle + image_step(first, select(before.yy, before.xx, first < vec2<f32>(0.0)), frame.focal) - margin,
        middle + image_step(last, select(before.yy, before.xx, last > vec2<f32>(0.0)), frame.focal) + margin,
    );
}

// Whether the whole cap surely shows its back (Curve::faces_away in the twin).
fn is_back(h: Homography, cap: Cap) -> bool {
    let p = vec3<f32>(h.a_low[0], h.a_low[1], h.a_low[2]);
    let gradient = norm2(vec2<f32>(
        cap.heights.x * p.x + cap.heights.y * p.y,
        cap.heights.y * p.x + cap.heights.z * p.y,
    ));
    return p.z - extremes(cap.heights).y * cap.spread - gradient > 1e-6 * (1.0 + norm2(p.xy));
}

// Whether surfels are points that face the camera (facing.wgsl).
const FACES: bool = false;

// Rows of the cap in a splat's record (records.wgsl).
const CAP_ROWS: u32 = 2u;

fn with_cap(record: SplatRecord, cap: Cap) -> SplatRecord {
    var curved_ = record;
    let at = 4u + FILTER_ROWS + CLIP_ROWS;
    curved_[at] = words(bitcast<vec4<u32>>(vec4<f32>(cap.spread, cap.radius, cap.depth, cap.nearest)));
    curved_[at + 1u] = words(bitcast<vec4<u32>>(vec4<f32>(cap.heights, 0.0)));
    return curved_;
}

fn cap_in(record: SplatRecord) -> Cap {
    let at = 4u + FILTER_ROWS + CLIP_ROWS;
    let sizes = bitcast<vec4<f32>>(each_word(record[at]));
    let heights = bitcast<vec4<f32>>(each_word(record[at + 1u]));
    return Cap(heights.xyz, sizes.x, sizes.y, sizes.z, sizes.w);
}

// The bilinear form of the heights.
fn bent(heights: vec3<f32>, a: vec2<f32>, b: vec2<f32>) -> f32 {
    return heights.x * a.x * b.x + heights.y * (a.x * b.y + a.y * b.x) + heights.z * a.y * b.y;
}

// The point of a pixel's ray at the depth cap.depth + sigma cap.radius, as a fragment. `away` says
// whether it shows the cap's back.
fn on_cap(splat: Splat, start: vec3<f32>, step: vec3<f32>, sigma: f32, away: bool) -> Fragment {
    let uv = start.xy + sigma * step.xy;
    let rho2 = dot2(uv, uv);
    let depth = splat.cap.depth + splat.cap.radius * sigma;
    let hit = rho2 <= 1.0 && abs(sigma) <= FARTHEST_HIT && depth >= held.near && !(CULL_BACK && away)
        && !cuts(splat.clip, vec3<f32>(uv, 1.0));
    return Fragment(
        hit,
        select(held.farthest, depth, hit),
        select(3e38, rho2, hit),
        1.0,
        Spot(select(vec2<f32>(0.0), uv, hit), away),
    );
}

// The fragment of the pixel at d from the anchor: the nearer hit among the ray's two intersections.
fn met(splat: Splat, filter_: Filter, d: vec2<f32>) -> Fragment {
    let start = vec3<f32>(
        splat.a[0] * d.x + (splat.a[1] * d.y + splat.a[2]),
        splat.b[0] * d.x + (splat.b[1] * d.y + splat.b[2]),
        splat.c[0] * d.x + (splat.c[1] * d.y + splat.c[2]),
    );
    let heights = splat.cap.heights;
    let step = start * splat.cap.spread + vec3<f32>(splat.a_low[0], splat.a_low[1], splat.a_low[2]);
    let a = 0.5 * bent(heights, step.xy, step.xy);
    let b = bent(heights, start.xy, step.xy) - step.z;
    let c = 0.5 * bent(heights, start.xy, start.xy) - start.z;
    let discriminant = b * b - 4.0 * a * c;
    let root = sqrt(max(discriminant, 0.0));
    // Neither root cancels: q is the sum of two numbers of equal sign.
    let q = -0.5 * (b + select(-root, root, b >= 0.0));
    // The quadratic's slope has the sign of b at c / q and the opposite sign at q / a. The slope
    // tells which side of the cap the ray meets.
    let one = on_cap(splat, start, step, c / q, b < 0.0);
    let other = on_cap(splat, start, step, q / a, b >= 0.0);
    let nearer = other.hit && (!one.hit || other.depth < one.depth);
    var fragment = one;
    if (nearer) {
        fragment = other;
    }
    if (discriminant < 0.0) {
        fragment.hit = false;
        fragment.rho2 = 3e38;
    }
    return softened(fragment, splat, filter_, d, start, step);
}

// Applies the low-pass, whose own fragments lie on the plane that touches the cap at its centre.
fn softened(
    fragment: Fragment,
    splat: Splat,
    filter_: Filter,
    d: vec2<f32>,
    start: vec3<f32>,
    step: vec3<f32>,
) -> Fragment {
    if (!FILTERED) {
        return fragment;
    }
    // Seen edge-on, the plane counts as met at the centre's depth.
    let sigma = select(-start.z / step.z, 0.0, step.z == 0.0);
    let row = third_row(splat.cap.depth + splat.cap.radius * sigma);
    var round = filtered(fragment, vec3<f32>(0.0, 0.0, row), filter_, d);
    if (round.rho2 < fragment.rho2) {
        let away = (splat.bounds_last & AWAY) != 0u;
        // Where a clip line cuts off this point of the plane, or the plane's back is culled, the
        // cap itself may still show.
        if (cuts(splat.clip, vec3<f32>(start.xy + sigma * step.xy, 1.0)) || (CULL_BACK && away)) {
            return fragment;
        }
        round.spot = Spot(vec2<f32>(0.0), away);
    }
    return round;
}

fn is_away(splat: Splat, fragment: Fragment) -> bool {
    return fragment.spot.away;
}

// A depth in front of every fragment of the cap itself between the pixels `first` and `last`,
// relative to the anchor. A ray meets the plane at height h over the disk's plane at sigma = (h -
// W) / (D_w + spread W). While the divisor keeps its sign, sigma is monotonic in W and in h, so the
// least of its values at the four pairs of extremes is a lower bound.
fn nearest_on(splat: Splat, first: vec2<f32>, last: vec2<f32>) -> f32 {
    let cap = splat.cap;
    let row = vec2<f32>(splat.c[0], splat.c[1]);
    let low = min(row * first, row * last);
    let high = max(row * first, row * last);
    let most = max(abs(low), abs(high));
    let slack = 4e-6 * (most.x + most.y + abs(splat.c[2]));
    let w = vec2<f32>(low.x + low.y - slack, high.x + high.y + slack) + splat.c[2];
    let along = splat.a_low[2];
    let divisor = along + cap.spread * w;
    // If a divisor has lost its digits to cancellation, only the bound of the whole cap is certain.
    if (min(abs(divisor.x), abs(divisor.y)) < 1e-4 * abs(along) || divisor.x * divisor.y <= 0.0) {
        return cap.nearest;
    }
    // The margin of a thousandth allows for the error of a ray that grazes the cap.
    let heights = 1.001 * extremes(cap.heights);
    let sigma = min((heights.x - w) / divisor, (heights.y - w) / divisor);
    let nearest_sigma = min(sigma.x, sigma.y);
    let depth = cap.depth + cap.radius * (nearest_sigma - 1e-4 - 1e-2 * abs(nearest_sigma));
    return max(depth, cap.nearest);
}
