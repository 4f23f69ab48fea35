// The half-axes of a surfel, camera and world space, device units: its own.

struct Axes {
    s: vec3<f32>,
    t: vec3<f32>,
    s_world: vec3<f32>,
    t_world: vec3<f32>,
}

// By how much the surfel is drawn larger than it is, at most, up to this depth.
fn growth(depth: f32) -> f32 {
    return 0.0;
}

fn half_axes(surfel: Surfel, depth: f32) -> Axes {
    // f32 serves for the half-axes of most splats; thin ones come back for more (rows.wgsl).
    let s_world = vec3<f32>(surfel.s[0], surfel.s[1], surfel.s[2]) * held.unit;
    let t_world = vec3<f32>(surfel.t[0], surfel.t[1], surfel.t[2]) * held.unit;
    return Axes(rotate_plain(s_world), rotate_plain(t_world), s_world, t_world);
}
