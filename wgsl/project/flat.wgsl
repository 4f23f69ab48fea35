// Flat surfels: disks, intersected by their homographies. Scans without radii are curved instead.
// Same interface as curved.wgsl and facing.wgsl. Twin: `met` in src/passes/footprint.rs.
// #import camera_orthographic|perspective::{Fragment, intersect, nearest_between}
// #import clip::{clipped}
// #import double::{Double}
// #import filter|lowpass_none::{Filter}
// #import layout::{AWAY, Splat}
// #import lowpass_*::{filtered}
// #import records::{SplatRecord}
// #import rows::{Homography}

struct Cap {
    nothing: u32,
}

struct Spot {
    nothing: u32,
}

struct Bend {
    nothing: u32,
}

fn curve(h: ptr<function, Homography>, index: u32, center: array<Double, 3>, s: vec3<f32>, t: vec3<f32>) -> Cap {
    return Cap(0u);
}

fn is_back(h: Homography, cap: Cap) -> bool {
    return h.away > 0.0;
}

// Whether surfels are points that face the camera (facing.wgsl).
const FACES: bool = false;

const CAP_ROWS: u32 = 0u;

fn with_cap(record: SplatRecord, cap: Cap) -> SplatRecord {
    return record;
}

fn cap_in(record: SplatRecord) -> Cap {
    return Cap(0u);
}

fn met(splat: Splat, filter_: Filter, d: vec2<f32>) -> Fragment {
    let abc = vec3<f32>(
        // The leading parts of a thin splat sum exactly only if they are summed before the trailing
        // parts, so the order matters (rows.wgsl).
        (splat.a[0] * d.x + (splat.a[1] * d.y + splat.a[2]))
            + (splat.a_low[0] * d.x + (splat.a_low[1] * d.y + splat.a_low[2])),
        splat.b[0] * d.x + (splat.b[1] * d.y + splat.b[2]),
        splat.c[0] * d.x + (splat.c[1] * d.y + splat.c[2]),
    );
    return clipped(filtered(intersect(abc), abc, filter_, d), splat.clip, abc);
}

fn is_away(splat: Splat, fragment: Fragment) -> bool {
    return (splat.bounds_last & AWAY) != 0u;
}

// A depth in front of every fragment of the disk between the pixels `first` and `last`, which are
// relative to the anchor. The low-pass is not included.
fn nearest_on(splat: Splat, first: vec2<f32>, last: vec2<f32>) -> f32 {
    let c = vec2<f32>(splat.c[0], splat.c[1]);
    let low = min(c * first, c * last);
    let high = max(c * first, c * last);
    // The two products and two sums of `met` round by less than 4 * 2^-24 of these magnitudes, a
    // sixteenth of this slack.
    let most = max(abs(low), abs(high));
    let slack = 4e-6 * (most.x + most.y + abs(splat.c[2]));
    return nearest_between(low.x + low.y + splat.c[2] - slack, high.x + high.y + splat.c[2] + slack);
}
