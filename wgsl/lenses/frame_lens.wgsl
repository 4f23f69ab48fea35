// The axes in which caps (curved.wgsl) are intersected: those of the splat's own pinhole
// (camera_lens.wgsl). They are not perpendicular, so the normal is an axis of its own. Same
// interface as frame_plain.wgsl.
// Twin: src/passes/curved.rs.
// #import camera_lens::{own_axes, see}
// #import double::{Double}
// #import layout::{held}
// #import rows::{Homography}
// #import vectors::{cross3, dot3, norm3, unit3}

struct Frame {
    p: vec3<f32>,
    s: vec3<f32>,
    t: vec3<f32>,
    radius: f32,
    focal: vec2<f32>,
    principal: vec2<f32>,
    normal: vec3<f32>,
}

fn frame_of(center: array<Double, 3>, s: vec3<f32>, t: vec3<f32>) -> Frame {
    let sight = see(center);
    let is_near = sight.radius_2 <= held.lens[6].y * held.lens[6].y;
    let shows = sight.seen && is_near && sight.depth.high >= held.near;
    let p = vec3<f32>(0.0, 0.0, select(-1e30, sight.depth.high, shows));
    let radius = max(norm3(s), norm3(t));
    let normal = own_axes(sight, unit3(cross3(s / radius, t / radius)));
    let image = vec2<f32>(sight.x.high, sight.y.high);
    return Frame(p, own_axes(sight, s), own_axes(sight, t), radius, vec2<f32>(1.0), image, normal);
}

// The rows of the inverse of [s t n], n the image of the unit normal.
fn frame_rows(frame: Frame, s: vec3<f32>, t: vec3<f32>) -> array<vec3<f32>, 3> {
    let n = frame.normal;
    let size = dot3(s, cross3(t, n));
    return array<vec3<f32>, 3>(cross3(t, n) / size, cross3(n, s) / size, cross3(s, t) / size);
}

fn frame_normal(frame: Frame, rows: array<vec3<f32>, 3>) -> vec3<f32> {
    return frame.normal;
}

// The anchor's pixel always has the centre.
fn frame_holds_center(h: Homography) -> bool {
    return true;
}
