// The axes in which caps (curved.wgsl) are intersected: those of the camera. Same interface as
// frame_lens.wgsl.
// Twin: src/passes/curved.rs.
// #import camera_orthographic|perspective::{holds_center}
// #import curved::{inverse_of}
// #import double::{Double}
// #import layout::{held}
// #import rows::{Homography}
// #import vectors::{norm3}

struct Frame {
    // The centre and the half-axes.
    p: vec3<f32>,
    s: vec3<f32>,
    t: vec3<f32>,
    // The longer half-axis.
    radius: f32,
    // Pixels per unit of X/Z and Y/Z (pinhole) or of X and Y.
    focal: vec2<f32>,
    principal: vec2<f32>,
}

fn frame_of(center: array<Double, 3>, s: vec3<f32>, t: vec3<f32>) -> Frame {
    let p = vec3<f32>(center[0].high, center[1].high, center[2].high);
    return Frame(p, s, t, max(norm3(s), norm3(t)), held.intrinsics.xy, held.intrinsics.zw);
}

// The rows of the inverse of [s t n], n the unit normal of s and t.
fn frame_rows(frame: Frame, s: vec3<f32>, t: vec3<f32>) -> array<vec3<f32>, 3> {
    return inverse_of(s, t);
}

// The unit normal, from these rows.
fn frame_normal(frame: Frame, rows: array<vec3<f32>, 3>) -> vec3<f32> {
    return rows[2];
}

fn frame_holds_center(h: Homography) -> bool {
    return holds_center(h);
}
