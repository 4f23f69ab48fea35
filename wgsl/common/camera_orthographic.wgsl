// The orthographic camera x = fx X + cx. Same interface as camera_pinhole.wgsl.
// Twins: src/passes/homography.rs and src/passes/footprint.rs.
// #import curved|facing|flat::{Spot}
// #import double::{Double, product, quotient, sum, two_sum}
// #import footprint::{depth_scale}
// #import layout::{Splat, held}
// #import project::{rotate}
// #import rows::{Homography, Rows, is_thin, minor, negative, single, thin_rows, widen}
// #import vectors::{dot2, dot3}

fn image_of(position: Double, axis: u32) -> Double {
    let focal = Double(held.intrinsics[axis], held.intrinsics_low[axis]);
    let principal = Double(held.intrinsics[axis + 2u], held.intrinsics_low[axis + 2u]);
    return sum(product(focal, position), principal);
}

fn axis_image(center: vec3<f32>, axis: vec3<f32>) -> vec2<f32> {
    return axis.xy * held.intrinsics.xy;
}

fn is_beside(center: vec3<f32>, radius: f32, margin: f32) -> bool {
    let extent = ball_extent(center, radius, 0.0);
    let size = vec2<f32>(f32(held.width), f32(held.height));
    return any(extent.zw < vec2<f32>(-margin)) || any(extent.xy > size + margin);
}

fn ball_sine(radius: f32, distance: f32) -> f32 {
    return 0.0;
}

// The part of the image that a ball covers: least x and y, greatest x and y, pixels.
fn ball_extent(center: vec3<f32>, radius: f32, nearest: f32) -> vec4<f32> {
    let image = center.xy * held.intrinsics.xy + held.intrinsics.zw;
    let extent = radius * held.intrinsics.xy;
    return vec4<f32>(image - extent, image + extent);
}

// The rows of a thin splat (rows.wgsl): those of the inverse of [s t], in doubled precision.
fn precise_rows(s_world: vec3<f32>, t_world: vec3<f32>, offset_x: Double, offset_y: Double) -> Rows {
    let s = rotate(widen(s_world));
    let t = rotate(widen(t_world));
    let away = minor(s[0], t[1], s[1], t[0]);
    let per_x = quotient(single(1.0), product(away, Double(held.intrinsics.x, held.intrinsics_low.x)));
    let per_y = quotient(single(1.0), product(away, Double(held.intrinsics.y, held.intrinsics_low.y)));
    return thin_rows(
        product(t[1], per_x),
        product(negative(t[0]), per_y),
        product(negative(s[1]), per_x),
        product(s[0], per_y),
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
    var h: Homography;
    h.turn = vec2<f32>(1.0, 0.0);
    let p_z = center[2].high;
    h.away = s.x * t.y - s.y * t.x;
    h.low = vec2<f32>(1.0);
    h.high = vec2<f32>(0.0);
    let x = image_of(center[0], 0u);
    let y = image_of(center[1], 1u);
    let image = vec2<f32>(x.high, y.high);
    let slope = sqrt(s.z * s.z + t.z * t.z);
    let focal = held.intrinsics.xy;
    // Edge-on, 1 / away is infinite. The rows are set to 0 instead and u to 2, outside the disk.
    let edge_on = h.away == 0.0;
    let scale = select(1.0 / (h.away * focal), vec2<f32>(0.0), edge_on);
    // Coordinates of the anchor are limited to 2^22, up to which whole numbers are exact. The pixel
    // of a centre farther outside would be no better an anchor for the pixels of the image.
    let pixel = clamp(floor(image), vec2<f32>(-4194304.0), vec2<f32>(4194303.0));
    let offset = (image - pixel) + vec2<f32>(x.low, y.low) - 0.5;
    h.anchor = vec2<i32>(pixel);
    h.offset = offset;
    if (p_z + slope < held.near) {
        return h;
    }
    let a = vec2<f32>(t.y, -t.x) * scale;
    let b = vec2<f32>(-s.y, s.x) * scale;
    let c = s.z * a + t.z * b;
    h.a = vec3<f32>(a, select(-dot2(a, offset), 2.0, edge_on));
    h.b = vec3<f32>(b, -dot2(b, offset));
    h.c = vec3<f32>(c, p_z - dot2(c, offset));
    if (is_thin(a, b)) {
        if (!every) {
            h.rare = true;
            return h;
        }
        let offset_x = two_sum(image.x - pixel.x - 0.5, x.low);
        let offset_y = two_sum(image.y - pixel.y - 0.5, y.low);
        let rows = precise_rows(s_world, t_world, offset_x, offset_y);
        h.a = rows.a;
        h.a_low = rows.a_low;
        h.b = rows.b;
        h.turn = rows.turn;
    }
    h.centered = true;
    h.s_image = focal * s.xy;
    h.t_image = focal * t.xy;
    h.depth_low = p_z - slope;
    h.depth_high = p_z + slope;
    let extent = focal * sqrt(s.xy * s.xy + t.xy * t.xy);
    h.low = image - extent;
    h.high = image + extent;
    return h;
}

struct Fragment {
    hit: bool,
    depth: f32,
    rho2: f32,
    gain: f32,
    spot: Spot,
}

fn intersect(abc: vec3<f32>) -> Fragment {
    let rho2 = dot2(abc.xy, abc.xy);
    var spot: Spot;
    return Fragment(rho2 <= 1.0 && abc.z >= held.near, abc.z, rho2, 1.0, spot);
}

fn homogeneous(abc: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(abc.xy, 1.0);
}

fn rim(most: f32) -> f32 {
    return 1.0;
}

fn nearest_between(low: f32, high: f32) -> f32 {
    return low;
}

fn plane_depth(abc: vec3<f32>, low: f32, high: f32) -> f32 {
    return clamp(abc.z, low, high);
}

// A fragment at the pixel (x, y), which such a camera always shows.
fn within_lens(fragment: Fragment, x: u32, y: u32) -> Fragment {
    return fragment;
}

fn ray(x: u32, y: u32) -> vec3<f32> {
    return held.rotation[2].xyz;
}

fn ray_to(relative: vec3<f32>) -> vec3<f32> {
    return held.rotation[2].xyz;
}

fn seen_at(x: u32, y: u32, depth: f32) -> vec3<f32> {
    let image = (vec2<f32>(f32(x), f32(y)) + 0.5 - held.intrinsics.zw) / held.intrinsics.xy;
    return image.x * held.rotation[0].xyz + image.y * held.rotation[1].xyz + depth * held.rotation[2].xyz;
}

fn area_in_pixel(normal: vec3<f32>, point: vec3<f32>, depth: f32) -> f32 {
    let facing = max(abs(dot3(normal, held.rotation[2].xyz)), 1e-30);
    return dot3(normal, normal) / facing / (held.intrinsics.x * held.intrinsics.y);
}

fn homogeneous_row(splat: Splat) -> vec3<f32> {
    return vec3<f32>(0.0, 0.0, 1.0);
}

// For the rasteriser's depth test; see camera_pinhole.wgsl.
fn depth_of(c: f32) -> f32 {
    return clamp(c, held.near, held.farthest);
}

fn depth_order(z: f32) -> f32 {
    return 1.0 - z * depth_scale();
}

fn along_axis(image: vec2<f32>) -> f32 {
    return 1.0;
}

// For caps (curved.wgsl): see camera_pinhole.wgsl.
fn holds_center(h: Homography) -> bool {
    return true;
}

fn widening(depth: f32) -> f32 {
    return 1.0;
}

fn toward(p: vec3<f32>, depth: f32) -> vec3<f32> {
    return vec3<f32>(0.0, 0.0, 1.0);
}

fn spread_of(r: f32, depth: f32) -> f32 {
    return 0.0;
}

fn shear(p: vec3<f32>) -> vec2<f32> {
    return vec2<f32>(0.0);
}

fn slope_in_view(p: vec3<f32>) -> vec2<f32> {
    return vec2<f32>(0.0);
}

fn most_slope() -> vec2<f32> {
    return vec2<f32>(0.0);
}

fn image_step(x: vec2<f32>, depths: vec2<f32>, focal: vec2<f32>) -> vec2<f32> {
    return x * focal;
}

fn third_row(depth: f32) -> f32 {
    return depth;
}
