// The pinhole camera x = fx X/Z + cx: homography and bounds of a disk, and its evaluation at a
// pixel. Same interface as camera_orthographic.wgsl.
// Twins: src/passes/homography.rs and src/passes/footprint.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x595e57151ede850c
// #import curved|facing|flat::{Spot}
// #import double::{Double, product, quotient, sum, two_sum}
// #import layout::{Splat, held}
// #import project::{rotate}
// #import rows::{Homography, Rows, is_thin, minor, single, thin_rows, widen}
// #import vectors::{cross3, dot2, dot3, unit3}

fn image_of(position: Double, depth: Double, axis: u32) -> Double {
    let focal = Double(held.intrinsics[axis], held.intrinsics_low[axis]);
    let principal = Double(held.intrinsics[axis + 2u], held.intrinsics_low[axis + 2u]);
    return sum(product(focal, quotient(position, depth)), principal);
}

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

// The image of a half-axis at a centre in camera space, pixels, to first order in its length.
fn axis_image(center: vec3<f32>, axis: vec3<f32>) -> vec2<f32> {
    return (axis.xy - center.xy / center.z * axis.z) / center.z * held.intrinsics.xy;
}

// Whether a ball lies more than `margin` pixels outside the image: wholly beyond a plane through
// the eye and an edge of the image that is moved out by the margin. The test is also valid for a
// ball that reaches the eye's plane.
fn is_beside(center: vec3<f32>, radius: f32, margin: f32) -> bool {
    let before = held.intrinsics.zw + margin;
    let after = vec2<f32>(f32(held.width), f32(held.height)) + margin - held.intrinsics.zw;
    let along = held.intrinsics.xy * center.xy;
    let focal_2 = held.intrinsics.xy * held.intrinsics.xy;
    let first = along + before * center.z < -radius * sqrt(focal_2 + before * before);
    let last = along - after * center.z > radius * sqrt(focal_2 + after * after);
    return any(first) || any(last);
}

// The sine of half the angle that a ball subtends at this distance.
fn ball_sine(radius: f32, distance: f32) -> f32 {
    return min(radius / distance, 1.0);
}

// The part of the image that a ball in front of the camera covers: least x and y, greatest x and y,
// pixels. `nearest` is the ball's least depth. In X/Z and Y/Z, the image of a point of the ball
// differs from that of its centre by at most `turned`. The same holds for the linearised image that
// the low-pass uses for a disk in the ball, except for an error of second order, for which the
// square is added.
fn ball_extent(center: vec3<f32>, radius: f32, nearest: f32) -> vec4<f32> {
    let ratio = center.xy / center.z;
    let image = ratio * held.intrinsics.xy + held.intrinsics.zw;
    let turned = radius * sqrt(1.0 + ratio * ratio) / nearest;
    let extent = (turned + turned * turned) * held.intrinsics.xy;
    return vec4<f32>(image - extent, image + extent);
}

// The rows of a thin splat (rows.wgsl): t x p and p x s over p . (s x t), in doubled precision.
fn precise_rows(
    p: array<Double, 3>,
    s_world: vec3<f32>,
    t_world: vec3<f32>,
    offset_x: Double,
    offset_y: Double,
) -> Rows {
    let s = rotate(widen(s_world));
    let t = rotate(widen(t_world));
    let a_x = minor(t[1], p[2], t[2], p[1]);
    let a_y = minor(t[2], p[0], t[0], p[2]);
    let a_z = minor(t[0], p[1], t[1], p[0]);
    let away = sum(sum(product(s[0], a_x), product(s[1], a_y)), product(s[2], a_z));
    let per_x = quotient(single(1.0), product(away, Double(held.intrinsics.x, held.intrinsics_low.x)));
    let per_y = quotient(single(1.0), product(away, Double(held.intrinsics.y, held.intrinsics_low.y)));
    return thin_rows(
        product(a_x, per_x),
        product(a_y, per_y),
        product(minor(p[1], s[2], p[2], s[1]), per_x),
        product(minor(p[2], s[0], p[0], s[2]), per_y),
        offset_x,
        offset_y,
    );
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

fn scaled_homography(
    center: array<Double, 3>,
    s: vec3<f32>,
    t: vec3<f32>,
    s_world: vec3<f32>,
    t_world: vec3<f32>,
    near: f32,
    every: bool,
) -> Homography {
    let p = vec3<f32>(center[0].high, center[1].high, center[2].high);
    let slope = sqrt(s.z * s.z + t.z * t.z);
    let normal = cross3(s, t);
    let away = dot3(p, normal);
    var h: Homography;
    h.turn = vec2<f32>(1.0, 0.0);
    h.away = away;
    h.low = vec2<f32>(1.0);
    h.high = vec2<f32>(0.0);
    if (p.z + slope < near) {
        return h;
    }
    let focal = held.intrinsics.xy;
    // Edge-on, 1 / away is infinite. The rows are set to 0 instead and u to 2, outside the disk.
    let edge_on = away == 0.0;
    let scale = select(vec3<f32>(1.0 / (away * focal), 1.0 / away), vec3<f32>(0.0), edge_on);
    let a = cross3(t, p) * scale;
    let b = cross3(p, s) * scale;
    let c = normal * scale;
    if (p.z - slope >= near) {
        let x = image_of(center[0], center[2], 0u);
        let y = image_of(center[1], center[2], 1u);
        let image = vec2<f32>(x.high, y.high);
        // Beyond 2^22 the anchor's arithmetic is no longer exact, and the splat is far outside the
        // image.
        let reach = abs(image) < vec2<f32>(4194304.0);
        if (all(reach)) {
            let pixel = floor(image);
            // Relative to the centre of its pixel, the splat's centre keeps the digits that make
            // the image stable.
            let offset = (image - pixel) + vec2<f32>(x.low, y.low) - 0.5;
            h.anchor = vec2<i32>(pixel);
            h.a = vec3<f32>(a.xy, select(-dot2(a.xy, offset), 2.0 / p.z, edge_on));
            h.b = vec3<f32>(b.xy, -dot2(b.xy, offset));
            h.c = vec3<f32>(c.xy, 1.0 / p.z - dot2(c.xy, offset));
            if (is_thin(a.xy, b.xy)) {
                if (!every) {
                    h.rare = true;
                    return h;
                }
                let offset_x = two_sum(image.x - pixel.x - 0.5, x.low);
                let offset_y = two_sum(image.y - pixel.y - 0.5, y.low);
                let rows = precise_rows(center, s_world, t_world, offset_x, offset_y);
                h.a = rows.a;
                h.a_low = rows.a_low;
                h.b = rows.b;
        h.turn = rows.turn;
            }
            let ratio = p.xy / p.z;
            let s_x = s.xy - ratio * s.z;
            let t_x = t.xy - ratio * t.z;
            h.centered = true;
            h.offset = offset;
            h.s_image = focal * s_x / p.z;
            h.t_image = focal * t_x / p.z;
            h.depth_low = p.z - slope;
            h.depth_high = p.z + slope;
            let across = tangents(s_x.x, t_x.x, s.z, t.z, p.z, slope) * focal.x;
            let down = tangents(s_x.y, t_x.y, s.z, t.z, p.z, slope) * focal.y;
            h.low = image + vec2<f32>(across.x, down.x);
            h.high = image + vec2<f32>(across.y, down.y);
            return h;
        }
    }
    if (!every) {
        h.rare = true;
        return h;
    }
    // The disk reaches the near depth, or its centre lies far outside the image. There is no useful
    // centre pixel, so the homography is anchored at the middle of the image. The bounds are those
    // of the part of the disk beyond the near depth.
    h.anchor = vec2<i32>(vec2<u32>(held.width, held.height) / 2u);
    let d = vec3<f32>((vec2<f32>(h.anchor) + 0.5 - held.intrinsics.zw) / focal, 1.0);
    let unscaled = vec3<f32>(focal, 1.0);
    h.a = vec3<f32>(a.xy, dot3(a * unscaled, d));
    h.b = vec3<f32>(b.xy, dot3(b * unscaled, d));
    h.c = vec3<f32>(c.xy, dot3(c * unscaled, d));
    var end_0 = vec2<f32>(0.0);
    var end_1 = vec2<f32>(0.0);
    if (slope > 0.0) {
        let steepest = vec2<f32>(s.z, t.z) / slope;
        let along = clamp((near - p.z) / slope, -1.0, 1.0);
        let half = sqrt(max(0.0, 1.0 - along * along));
        end_0 = along * steepest + half * vec2<f32>(-steepest.y, steepest.x);
        end_1 = along * steepest - half * vec2<f32>(-steepest.y, steepest.x);
    }
    let across = clipped_extent(s.xz, t.xz, p.xz, end_0, end_1, near) * focal.x + held.intrinsics.z;
    let down = clipped_extent(s.yz, t.yz, p.yz, end_0, end_1, near) * focal.y + held.intrinsics.w;
    h.low = vec2<f32>(across.x, down.x) - 1.0;
    h.high = vec2<f32>(across.y, down.y) + 1.0;
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

// The direction, in world space and of unit length, of the ray through the centre of the pixel.
fn ray(x: u32, y: u32) -> vec3<f32> {
    let image = (vec2<f32>(f32(x), f32(y)) + 0.5 - held.intrinsics.zw) / held.intrinsics.xy;
    return unit3(image.x * held.rotation[0].xyz + image.y * held.rotation[1].xyz + held.rotation[2].xyz);
}

// The direction, of unit length, from the eye to the point `relative` to it; 0 at the eye itself.
fn ray_to(relative: vec3<f32>) -> vec3<f32> {
    return relative * inverseSqrt(max(dot3(relative, relative), 1e-36));
}

// The point at a depth on the ray through the centre of a pixel, relative to the eye, device units.
fn seen_at(x: u32, y: u32, depth: f32) -> vec3<f32> {
    let image = (vec2<f32>(f32(x), f32(y)) + 0.5 - held.intrinsics.zw) / held.intrinsics.xy * depth;
    return image.x * held.rotation[0].xyz + image.y * held.rotation[1].xyz + depth * held.rotation[2].xyz;
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

// The cosine between the ray through an image point and the camera's axis.
fn along_axis(image: vec2<f32>) -> f32 {
    let d = (image - held.intrinsics.zw) / held.intrinsics.xy;
    return inverseSqrt(1.0 + dot2(d, d));
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

// X/Z and Y/Z of the points that lie left of and above the image by 0.15 times its size, and right
// of and below it.
fn slope_limits() -> vec4<f32> {
    let size = vec2<f32>(f32(held.width), f32(held.height));
    let first = (-0.15 * size - held.intrinsics.zw) / held.intrinsics.xy;
    return vec4<f32>(first, (1.15 * size - held.intrinsics.zw) / held.intrinsics.xy);
}

// For 3D Gaussians (axes_conic.wgsl): X/Z and Y/Z at p, limited to a little more than the image, as
// the code of 3D Gaussian splatting limits them.
fn slope_in_view(p: vec3<f32>) -> vec2<f32> {
    let limits = slope_limits();
    return min(max(p.xy / p.z, limits.xy), limits.zw);
}

// The greatest absolute values of slope_in_view.
fn most_slope() -> vec2<f32> {
    let limits = slope_limits();
    return max(abs(limits.xy), abs(limits.zw));
}

// The image, pixels, of displacements `x` perpendicular to the camera's axis, at the given depths.
fn image_step(x: vec2<f32>, depths: vec2<f32>) -> vec2<f32> {
    return x / depths * held.intrinsics.xy;
}

// The value of a homography's third row at a depth.
fn third_row(depth: f32) -> f32 {
    return 1.0 / depth;
}
