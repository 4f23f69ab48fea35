// Points that face the camera: shapes (shape_*.wgsl) that rise from a plane parallel to the image,
// around an axis along the view (Schuetz and Wimmer 2015, section III). Same interface as
// flat.wgsl.
// Twin: src/passes/facing.rs.
// #import camera_orthographic|perspective::{Fragment, homogeneous, intersect, nearest_between}
// #import double::{Double}
// #import filter|lowpass_none::{Filter}
// #import layout::{Splat, held}
// #import records::{SplatRecord}
// #import rows::{Homography}
// #import shape_*::{rise}
// #import vectors::{dot2}

struct Cap {
    nothing: u32,
}

struct Spot {
    nothing: u32,
}

struct Bend {
    nothing: u32,
}

override SQUARE: bool;

// Whether surfels are points that face the camera.
const FACES: bool = true;

fn curve(h: ptr<function, Homography>, index: u32, center: array<Double, 3>, s: vec3<f32>, t: vec3<f32>) -> Cap {
    return Cap(0u);
}

fn is_back(h: Homography, cap: Cap) -> bool {
    return false;
}

const CAP_ROWS: u32 = 0u;

fn with_cap(record: SplatRecord, cap: Cap) -> SplatRecord {
    return record;
}

fn cap_in(record: SplatRecord) -> Cap {
    return Cap(0u);
}

// The radius, device units. In a disk parallel to the image, row a (u, or u/z for a pinhole)
// changes by 1 / (r fx) per pixel.
fn radius_across(splat: Splat) -> f32 {
    return 1.0 / (splat.a[0] * held.intrinsics.x);
}

fn largest2(lengths: vec2<f32>) -> f32 {
    let largest = max(abs(lengths.x), abs(lengths.y));
    return largest * largest;
}

fn met(splat: Splat, filter_: Filter, d: vec2<f32>) -> Fragment {
    let change = vec2<f32>(splat.a[0], splat.b[1]);
    let abc = vec3<f32>(change * d + vec2<f32>(splat.a[2], splat.b[2]), splat.c[2]);
    let flat_ = intersect(abc);
    let uv = homogeneous(abc);
    // All divisors are the same at every pixel of the splat, so a pixel needs no division. It needs
    // no root, because squares are compared.
    let beside = abs(uv.xy) * (1.0 / uv.z);
    // A point always shows at the pixel that it lies in, like a square of that pixel's size.
    let own = abs(uv.xy) * (2.0 / change);
    let rho2 = select(min(dot2(beside, beside), largest2(own)), largest2(beside), SQUARE);
    // The corners of squares are beyond the shape's rim, where a study may let it fall further.
    let depth = flat_.depth - rise(select(rho2, dot2(beside, beside), SQUARE)) * radius_across(splat);
    var spot: Spot;
    return Fragment(rho2 <= 1.0 && depth >= held.near, depth, rho2, 1.0, spot);
}

fn is_away(splat: Splat, fragment: Fragment) -> bool {
    return false;
}

// A depth in front of every fragment of the splat.
fn nearest_on(splat: Splat, first: vec2<f32>, last: vec2<f32>) -> f32 {
    let slack = 4e-6 * abs(splat.c[2]);
    let ahead = rise(0.0) * radius_across(splat);
    return nearest_between(splat.c[2] - slack, splat.c[2] + slack) - ahead * (1.0 + 1e-5);
}
