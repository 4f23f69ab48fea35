// Surfels may curve, and then show their fronts though their planes face away. Same interface as
// backs_flat.wgsl.
// Twin: src/passes/select.rs.
// #import attributes::{ATTRIBUTE_WORDS}
// #import camera_*::{ball_sine}
// #import curved::{CAP_WORD, extremes}
// #import layout::{held}
// #import select::{chosen}
// #import vectors::{cross3, dot3, norm2, norm3}

// How far the product of ray and normal may be smaller on the cap of a surfel than on its plane:
// where the cap is highest, and steepest toward the eye (Curve::faces_away in
// src/passes/curved.rs). And the magnitude of the terms. The unit of both is |s x t|.
fn lean_of_surfel(record: u32, ray: vec3<f32>, s: vec3<f32>, t: vec3<f32>, distance: f32) -> vec2<f32> {
    let at = record * ATTRIBUTE_WORDS + CAP_WORD;
    let heights = bitcast<vec3<f32>>(vec3<u32>(chosen[at], chosen[at + 1u], chosen[at + 2u])) * held.unit;
    let across = cross3(s, t);
    let size = norm3(across);
    let n = across / max(size, 1e-30);
    let x = dot3(ray, cross3(t, n));
    let y = dot3(ray, cross3(n, s));
    let slope = norm2(vec2<f32>(heights.x * x + heights.y * y, heights.y * x + heights.z * y));
    let bend = abs(heights.x) + 2.0 * abs(heights.y) + abs(heights.z);
    return vec2<f32>(slope + size * ball_sine(extremes(heights).y, distance), bend * (norm3(s) + norm3(t)));
}
