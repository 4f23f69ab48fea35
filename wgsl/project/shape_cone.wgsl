// A cone. Same interface as shape_flat.wgsl.

fn rise(rho2: f32) -> f32 {
    return 1.0 - sqrt(rho2);
}
