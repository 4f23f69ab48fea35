// The half-axes of a surfel as given, in camera and world space, device units. Same interface as
// axes_facing.wgsl and axes_conic.wgsl.
// #import layout::{Surfel, held}
// #import project::{rotate_plain}

struct Axes {
    s: vec3<f32>,
    t: vec3<f32>,
    s_world: vec3<f32>,
    t_world: vec3<f32>,
}

// An upper bound on how much a surfel's drawn radius exceeds its given one, which is at most
// `radius`, at any depth up to `depth`; device units.
fn growth(radius: f32, depth: f32) -> f32 {
    return 0.0;
}

// `center` is the centre in camera space, device units.
fn half_axes(index: u32, surfel: Surfel, center: vec3<f32>) -> Axes {
    // Plain f32 suffices for most splats; the half-axes of thin ones are rotated again in doubled
    // precision (rows.wgsl).
    let s_world = vec3<f32>(surfel.s[0], surfel.s[1], surfel.s[2]) * held.unit;
    let t_world = vec3<f32>(surfel.t[0], surfel.t[1], surfel.t[2]) * held.unit;
    return Axes(rotate_plain(s_world), rotate_plain(t_world), s_world, t_world);
}
