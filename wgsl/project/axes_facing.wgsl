// The half-axes of a point that faces the camera: to the right and down in the image. Same
// interface as axes_own.wgsl.
// Twin: src/passes/facing.rs.
// #import camera_orthographic|perspective::{widening}
// #import layout::{Surfel, held}
// #import vectors::{norm3}

struct Axes {
    s: vec3<f32>,
    t: vec3<f32>,
    s_world: vec3<f32>,
    t_world: vec3<f32>,
}

// The limits of the radius in the image, in rows of samples.
override LEAST_RADIUS: f32;
override MOST_RADIUS: f32;

fn growth(radius: f32, depth: f32) -> f32 {
    let pixel = widening(max(depth, 0.0)) / min(held.intrinsics.x, held.intrinsics.y);
    return 1.00001 * max(LEAST_RADIUS, 0.5) * pixel;
}

fn half_axes(index: u32, surfel: Surfel, center: vec3<f32>) -> Axes {
    let depth = center.z;
    let s = vec3<f32>(surfel.s[0], surfel.s[1], surfel.s[2]) * held.unit;
    let t = vec3<f32>(surfel.t[0], surfel.t[1], surfel.t[2]) * held.unit;
    let row = widening(depth) / held.intrinsics.y;
    let limited = min(max(max(norm3(s), norm3(t)), LEAST_RADIUS * row), MOST_RADIUS * row);
    // The point is at least as large as a sample, so that at least one sample shows it.
    let r = max(limited, 0.5 * widening(depth) / min(held.intrinsics.x, held.intrinsics.y));
    return Axes(
        vec3<f32>(r, 0.0, 0.0),
        vec3<f32>(0.0, r, 0.0),
        held.rotation[0].xyz * r,
        held.rotation[1].xyz * r,
    );
}
