// A sphere. Same interface as shape_flat.wgsl.

fn rise(rho2: f32) -> f32 {
    return sqrt(max(1.0 - rho2, 0.0));
}
