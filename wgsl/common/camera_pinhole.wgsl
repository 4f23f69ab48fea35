// The pinhole camera x = fx X/Z + cx: homography and bounds of a disk. With perspective.wgsl, the
// same interface as camera_orthographic.wgsl.
// Twin: src/passes/homography.rs.
// #import camera_orthographic|perspective::{Fragment}
// #import double::{Double, product, quotient, sum, two_sum}
// #import layout::{held}
// #import perspective::{chord, clipped_extent, tangents}
// #import project::{rotate}
// #import rows::{Homography, Rows, is_thin, minor, single, thin_rows, widen}
// #import vectors::{cross3, dot2, dot3, unit3}

fn image_of(position: Double, depth: Double, axis: u32) -> Double {
    let focal = Double(held.intrinsics[axis], held.intrinsics_low[axis]);
    let principal = Double(held.intrinsics[axis + 2u], held.intrinsics_low[axis + 2u]);
    return sum(product(focal, quotient(position, depth)), principal);
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
    let ends = chord(s.z, t.z, p.z, slope, near);
    let across = clipped_extent(s.xz, t.xz, p.xz, ends.xy, ends.zw, near) * focal.x + held.intrinsics.z;
    let down = clipped_extent(s.yz, t.yz, p.yz, ends.xy, ends.zw, near) * focal.y + held.intrinsics.w;
    h.low = vec2<f32>(across.x, down.x) - 1.0;
    h.high = vec2<f32>(across.y, down.y) + 1.0;
    return h;
}

// A fragment at the pixel (x, y), which such a camera always shows.
fn within_lens(fragment: Fragment, x: u32, y: u32) -> Fragment {
    return fragment;
}

// The direction, in world space and of unit length, of the ray through the centre of the pixel.
fn ray(x: u32, y: u32) -> vec3<f32> {
    let image = (vec2<f32>(f32(x), f32(y)) + 0.5 - held.intrinsics.zw) / held.intrinsics.xy;
    return unit3(image.x * held.rotation[0].xyz + image.y * held.rotation[1].xyz + held.rotation[2].xyz);
}

// The point at a depth on the ray through the centre of a pixel, relative to the eye, device units.
fn seen_at(x: u32, y: u32, depth: f32) -> vec3<f32> {
    let image = (vec2<f32>(f32(x), f32(y)) + 0.5 - held.intrinsics.zw) / held.intrinsics.xy * depth;
    return image.x * held.rotation[0].xyz + image.y * held.rotation[1].xyz + depth * held.rotation[2].xyz;
}

// The cosine between the ray through an image point and the camera's axis.
fn along_axis(image: vec2<f32>) -> f32 {
    let d = (image - held.intrinsics.zw) / held.intrinsics.xy;
    return inverseSqrt(1.0 + dot2(d, d));
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
