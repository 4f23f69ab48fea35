// The part that a pinhole (camera_pinhole.wgsl) and other lenses (camera_lens.wgsl) share: rays
// that start at the eye, and rows that are (u/z, v/z, 1/z). Same interface as
// camera_orthographic.wgsl.
// Twins: src/passes/homography.rs and src/passes/footprint.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x502c4730b0840c34
// #import camera_*::{scaled_homography}
// #import curved|facing|flat::{Spot}
// #import double::{Double}
// #import layout::{Splat, held}
// #import rows::{Homography}
// #import vectors::{dot2, dot3}

// The extent along one image axis of a disk wholly in front of the camera, as X/Z relative to that
// of its centre. The lines X/Z = k (also relative) that touch the disk's boundary satisfy its conic
// k^2 D + 2 k B - E = 0, with E >= 0 and D > 0.
fn tangents(s: f32, t: f32, s_z: f32, t_z: f32, p_z: f32, slope: f32) -> vec2<f32> {
    let e = s * s + t * t;
    let b = s * s_z + t * t_z;
    let d = (p_z - slope) * (p_z + slope);
    let root = sqrt(b * b + d * e);
    // Each root is computed in the form that does not cancel. If `far` is 0, so is the extent.
    let far = abs(b) + root;
    let near = select(0.0, e / far, far > 0.0);
    return select(vec2<f32>(-near, far / d), vec2<f32>(-far / d, near), b >= 0.0);
}

// The disk coordinates (u, v) of both ends of a disk's chord at the depth `near`.
fn chord(s_z: f32, t_z: f32, p_z: f32, slope: f32, near: f32) -> vec4<f32> {
    if (!(slope > 0.0)) {
        return vec4<f32>(0.0);
    }
    let steepest = vec2<f32>(s_z, t_z) / slope;
    let along = clamp((near - p_z) / slope, -1.0, 1.0);
    let half = sqrt(max(0.0, 1.0 - along * along));
    let beside = vec2<f32>(-steepest.y, steepest.x);
    return vec4<f32>(along * steepest + half * beside, along * steepest - half * beside);
}

// The extent along one image axis, as X/Z, of a disk that crosses the depth `near`. Only the part
// of the disk from that depth on counts: the extent is bounded by the tangents that touch this
// part, and by the ends of the disk's chord at `near`. Vectors are (x or y, z); `end_0` and `end_1`
// are (u, v) of the chord's ends.
fn clipped_extent(
    s: vec2<f32>,
    t: vec2<f32>,
    p: vec2<f32>,
    end_0: vec2<f32>,
    end_1: vec2<f32>,
    near: f32,
) -> vec2<f32> {
    let chord_0 = (p.x + end_0.x * s.x + end_0.y * t.x) / near;
    let chord_1 = (p.x + end_1.x * s.x + end_1.y * t.x) / near;
    // The ends of the chord err by the rounding of a sum of these magnitudes.
    let blur = 1e-6 * (abs(p.x) + abs(s.x) + abs(t.x)) / near;
    var extent = vec2<f32>(min(chord_0, chord_1) - blur, max(chord_0, chord_1) + blur);
    let a = s.y * s.y + t.y * t.y - p.y * p.y;
    let b = s.x * s.y + t.x * t.y - p.x * p.y;
    let c = s.x * s.x + t.x * t.x - p.x * p.x;
    let discriminant = b * b - a * c;
    if (discriminant >= 0.0) {
        let q = b + select(-1.0, 1.0, b >= 0.0) * sqrt(discriminant);
        let roots = vec2<f32>(q / a, c / q);
        for (var i = 0u; i < 2u; i++) {
            let k = roots[i];
            let line = vec3<f32>(s.x - k * s.y, t.x - k * t.y, p.x - k * p.y);
            let depth = p.y - (line.x * s.y + line.y * t.y) / line.z;
            // The factor 0.5 allows for rounding; a tangent too many only widens the bounds. NaN
            // fails the test.
            if (depth >= 0.5 * near) {
                extent = vec2<f32>(min(extent.x, k), max(extent.y, k));
            }
        }
    }
    return extent;
}

fn homography(
    center: array<Double, 3>,
    s: vec3<f32>,
    t: vec3<f32>,
    s_world: vec3<f32>,
    t_world: vec3<f32>,
    every: bool,
) -> Homography {
    // Lengths are scaled by about 1 / distance of the splat, so that none of their products under-
    // or overflows, however small the splat is in the scene. The scale is a power of two, so
    // scaling is exact.
    let largest = max(max(abs(center[0].high), abs(center[1].high)), abs(center[2].high));
    let scale = bitcast<f32>(0x7f000000u - (bitcast<u32>(max(largest, 1e-30)) & 0x7f800000u));
    var scaled: array<Double, 3>;
    for (var i = 0u; i < 3u; i++) {
        scaled[i] = Double(center[i].high * scale, center[i].low * scale);
    }
    var h = scaled_homography(scaled, s * scale, t * scale, s_world * scale, t_world * scale, held.near * scale, every);
    // The rows have the unit of an inverse length.
    h.a *= scale;
    h.a_low *= scale;
    h.b *= scale;
    h.c *= scale;
    h.depth_low /= scale;
    h.depth_high /= scale;
    return h;
}

struct Fragment {
    // False outside the disk and in front of the near depth.
    hit: bool,
    // Camera-space z, device units.
    depth: f32,
    // The squared radius on the unit disk.
    rho2: f32,
    // The factor on the kernel's weight.
    gain: f32,
    spot: Spot,
}

// Intersects a pixel's ray with the splat's disk. `abc` is (u/z, v/z, 1/z) there: the products of
// the splat's rows with the pixel relative to the anchor (layout.wgsl).
fn intersect(abc: vec3<f32>) -> Fragment {
    let reached = dot2(abc.xy, abc.xy) <= abc.z * abc.z && abc.z > 0.0;
    let depth = 1.0 / abc.z;
    let uv = abc.xy * depth;
    // Behind the camera rho is infinite.
    let rho2 = select(3e38, dot2(uv, uv), abc.z > 0.0);
    var spot: Spot;
    return Fragment(reached && depth >= held.near, depth, select(rho2, min(rho2, 1.0), reached), 1.0, spot);
}

// (u, v, 1) times a factor that is positive in front of the camera.
fn homogeneous(abc: vec3<f32>) -> vec3<f32> {
    return abc;
}

// The greatest length of (u/z, v/z) on the part of the disk where 1/z is at most `most`.
fn rim(most: f32) -> f32 {
    return max(most, 0.0);
}

// The least depth of the fragments for which row c has values between `low` and `high`.
fn nearest_between(low: f32, high: f32) -> f32 {
    return select(3e38, 1.0 / high, high > 0.0);
}

// The depth of the splat's plane, clamped to [low, high].
fn plane_depth(abc: vec3<f32>, low: f32, high: f32) -> f32 {
    return 1.0 / clamp(abc.z, 1.0 / high, 1.0 / low);
}

// The direction, of unit length, from the eye to the point `relative` to it; 0 at the eye itself.
fn ray_to(relative: vec3<f32>) -> vec3<f32> {
    return relative * inverseSqrt(max(dot3(relative, relative), 1e-36));
}

// How much of a quantity that is spread over a plane lies in one pixel. The plane passes through
// `point` (relative to the eye) with the normal `normal`, whose length is the quantity per unit of
// area. Device units. The result is 0 at depth 0, which stands for an empty pixel.
fn area_in_pixel(normal: vec3<f32>, point: vec3<f32>, depth: f32) -> f32 {
    let facing = max(abs(dot3(normal, point / max(depth, held.near))), 1e-30);
    return dot3(normal, normal) / facing * (depth / held.intrinsics.x) * (depth / held.intrinsics.y);
}

// The third row of the matrix that maps an image point to (u, v, 1), up to a factor.
fn homogeneous_row(splat: Splat) -> vec3<f32> {
    return vec3<f32>(splat.c[0], splat.c[1], splat.c[2]);
}

// For the rasteriser's depth test (raster_offset.wgsl): the depth for a value of row c.
fn depth_of(c: f32) -> f32 {
    return 1.0 / max(c, 1.0 / held.farthest);
}

// For the rasteriser's depth test: a measure of depth that is linear over the image of a plane, in
// [0, 1], and largest in front.
fn depth_order(z: f32) -> f32 {
    return min(held.near / z, 1.0);
}

// For caps (curved.wgsl), like the functions that follow: whether the anchor's pixel contains the
// splat's centre.
fn holds_center(h: Homography) -> bool {
    return h.centered;
}

// The width of the view at `depth`, relative to that at depth 1.
fn widening(depth: f32) -> f32 {
    return depth;
}

// The part of a ray's advance per unit of depth that all pixels share (D in src/passes/curved.rs).
fn toward(p: vec3<f32>, depth: f32) -> vec3<f32> {
    return p / depth;
}

// A length r over the depth; 0 for an orthographic camera.
fn spread_of(r: f32, depth: f32) -> f32 {
    return r / depth;
}

// X/Z and Y/Z at p; 0 in front of the near depth.
fn shear(p: vec3<f32>) -> vec2<f32> {
    return select(vec2<f32>(0.0), p.xy / p.z, p.z > held.near);
}

// The image, pixels, of displacements `x` perpendicular to the camera's axis, at the given depths.
fn image_step(x: vec2<f32>, depths: vec2<f32>, focal: vec2<f32>) -> vec2<f32> {
    return x / depths * focal;
}

// The value of a homography's third row at a depth.
fn third_row(depth: f32) -> f32 {
    return 1.0 / depth;
}
