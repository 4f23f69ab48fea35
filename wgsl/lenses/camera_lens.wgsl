// A camera whose lens is no pinhole (lens_*.wgsl). A splat is projected by a pinhole of its own:
// one whose axis is the ray through the splat's centre, and whose image agrees with that of the
// lens at the centre, in place and in first derivatives. With perspective.wgsl, the same interface
// as camera_pinhole.wgsl.
// Twin: src/passes/homography.rs.
// #import camera_orthographic|perspective::{Fragment}
// #import distortion|lens_sphere::{shows_plane}
// #import double::{Double, product, quotient, sum, two_sum}
// #import layout::{held}
// #import lens_*::{plane_ray, see_plane}
// #import perspective::{chord, clipped_extent, tangents}
// #import project::{rotate}
// #import rows::{Homography, Rows, is_thin, minor, negative, single, thin_rows, widen}
// #import vectors::{cross3, dot2, dot3, unit3}

// A point as the lens sees it, with the first derivatives at it.
struct Sight {
    seen: bool,
    // The point of the plane in focal lengths; after see(), the image point in pixels.
    x: Double,
    y: Double,
    depth: Double,
    // The squared radius before the distortion, in focal lengths; 0 for a whole sphere.
    radius_2: f32,
    // The depth times the change of x and of y per unit of length along each axis of camera space.
    across: vec3<f32>,
    down: vec3<f32>,
    // The change of the depth per unit of length along each axis.
    axis: vec3<f32>,
}

fn in_pixels(plane: Double, axis: u32) -> Double {
    let focal = Double(held.intrinsics[axis], held.intrinsics_low[axis]);
    let principal = Double(held.intrinsics[axis + 2u], held.intrinsics_low[axis + 2u]);
    return sum(product(focal, plane), principal);
}

// A point of camera space in the image.
fn see(p: array<Double, 3>) -> Sight {
    var sight = see_plane(p);
    sight.x = in_pixels(sight.x, 0u);
    sight.y = in_pixels(sight.y, 1u);
    sight.across *= held.intrinsics.x;
    sight.down *= held.intrinsics.y;
    return sight;
}

// A vector in the axes of the splat's own pinhole.
fn own_axes(sight: Sight, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot3(sight.across, v), dot3(sight.down, v), dot3(sight.axis, v));
}

// A doubled dot product with a vector that counts as exact.
fn dot_doubled(row: vec3<f32>, v: array<Double, 3>) -> Double {
    return sum(sum(product(single(row.x), v[0]), product(single(row.y), v[1])), product(single(row.z), v[2]));
}

// The rows of a thin splat (rows.wgsl), as of camera_pinhole.wgsl with p = (0, 0, depth). Errors of
// the derivatives move the image of the disk as a whole, and less than its size times 2^-22.
fn precise_rows(
    sight: Sight,
    s_world: vec3<f32>,
    t_world: vec3<f32>,
    offset_x: Double,
    offset_y: Double,
) -> Rows {
    let s = rotate(widen(s_world));
    let t = rotate(widen(t_world));
    let s_x = dot_doubled(sight.across, s);
    let s_y = dot_doubled(sight.down, s);
    let t_x = dot_doubled(sight.across, t);
    let t_y = dot_doubled(sight.down, t);
    let per = quotient(single(1.0), minor(s_x, t_y, t_x, s_y));
    return thin_rows(
        product(t_y, per),
        product(negative(t_x), per),
        product(negative(s_y), per),
        product(s_x, per),
        offset_x,
        offset_y,
    );
}

fn scaled_homography(
    center: array<Double, 3>,
    s_camera: vec3<f32>,
    t_camera: vec3<f32>,
    s_world: vec3<f32>,
    t_world: vec3<f32>,
    near: f32,
    every: bool,
) -> Homography {
    var h: Homography;
    h.turn = vec2<f32>(1.0, 0.0);
    h.low = vec2<f32>(1.0);
    h.high = vec2<f32>(0.0);
    let sight = see(center);
    let depth = sight.depth.high;
    let image = vec2<f32>(sight.x.high, sight.y.high);
    // A splat whose centre has no image, or one far outside, shows nothing. Beyond 2^22 the
    // anchor's arithmetic is no longer exact, and the splat is far outside the image.
    let is_near = sight.radius_2 <= held.lens[6].y * held.lens[6].y;
    if (!(sight.seen && is_near && depth >= near && all(abs(image) < vec2<f32>(4194304.0)))) {
        return h;
    }
    let s = own_axes(sight, s_camera);
    let t = own_axes(sight, t_camera);
    h.away = depth * (s.x * t.y - s.y * t.x);
    // Edge-on, 1 / away is infinite. The rows are set to 0 instead and u to 2, outside the disk.
    let edge_on = h.away == 0.0;
    let scale = select(1.0 / h.away, 0.0, edge_on);
    let a = vec2<f32>(t.y, -t.x) * (depth * scale);
    let b = vec2<f32>(-s.y, s.x) * (depth * scale);
    let c = cross3(s, t).xy * scale;
    let pixel = floor(image);
    let offset = (image - pixel) + vec2<f32>(sight.x.low, sight.y.low) - 0.5;
    h.anchor = vec2<i32>(pixel);
    h.a = vec3<f32>(a, select(-dot2(a, offset), 2.0 / depth, edge_on));
    h.b = vec3<f32>(b, -dot2(b, offset));
    h.c = vec3<f32>(c, 1.0 / depth - dot2(c, offset));
    if (is_thin(a, b)) {
        if (!every) {
            h.rare = true;
            return h;
        }
        let offset_x = two_sum(image.x - pixel.x - 0.5, sight.x.low);
        let offset_y = two_sum(image.y - pixel.y - 0.5, sight.y.low);
        let rows = precise_rows(sight, s_world, t_world, offset_x, offset_y);
        h.a = rows.a;
        h.a_low = rows.a_low;
        h.b = rows.b;
        h.turn = rows.turn;
    }
    let slope = sqrt(s.z * s.z + t.z * t.z);
    h.centered = true;
    h.offset = offset;
    h.s_image = s.xy / depth;
    h.t_image = t.xy / depth;
    h.depth_low = depth - slope;
    h.depth_high = depth + slope;
    if (depth - slope >= near) {
        let across = tangents(s.x, t.x, s.z, t.z, depth, slope);
        let down = tangents(s.y, t.y, s.z, t.z, depth, slope);
        h.low = image + vec2<f32>(across.x, down.x);
        h.high = image + vec2<f32>(across.y, down.y);
        return h;
    }
    if (!every) {
        h.rare = true;
        return h;
    }
    // The disk reaches the near depth; the bounds are those of its part beyond. The low-pass is for
    // small splats.
    h.centered = false;
    let ends = chord(s.z, t.z, depth, slope, near);
    let p = vec2<f32>(0.0, depth);
    let across = clipped_extent(s.xz, t.xz, p, ends.xy, ends.zw, near);
    let down = clipped_extent(s.yz, t.yz, p, ends.xy, ends.zw, near);
    h.low = image + vec2<f32>(across.x, down.x) - 1.0;
    h.high = image + vec2<f32>(across.y, down.y) + 1.0;
    return h;
}

// The point of the plane at an image point.
fn plane_of(image: vec2<f32>) -> vec2<f32> {
    return (image - held.intrinsics.zw) / held.intrinsics.xy;
}

// A fragment at the pixel (x, y). Beyond its image a lens shows nothing.
fn within_lens(fragment: Fragment, x: u32, y: u32) -> Fragment {
    var kept = fragment;
    kept.hit = fragment.hit && shows_plane(plane_of(vec2<f32>(f32(x), f32(y)) + 0.5));
    return kept;
}

// The point of depth 1 on the ray through an image point, in world axes relative to the eye. Where
// the lens shows nothing, it is that of Optics::ray in src/scene/optics/inverse.rs.
fn ray_at(image: vec2<f32>) -> vec3<f32> {
    let d = plane_ray(plane_of(image));
    return d.x * held.rotation[0].xyz + d.y * held.rotation[1].xyz + d.z * held.rotation[2].xyz;
}

// The direction, in world space and of unit length, of the ray through the centre of the pixel.
fn ray(x: u32, y: u32) -> vec3<f32> {
    return unit3(ray_at(vec2<f32>(f32(x), f32(y)) + 0.5));
}

// The point at a depth on the ray through the centre of a pixel, relative to the eye, device units.
fn seen_at(x: u32, y: u32, depth: f32) -> vec3<f32> {
    return depth * ray_at(vec2<f32>(f32(x), f32(y)) + 0.5);
}

// The depth gained per unit of length along the ray through an image point.
fn along_axis(image: vec2<f32>) -> f32 {
    let d = ray_at(image);
    return inverseSqrt(dot3(d, d));
}
