// A paraboloid on a square: 1 - (u^2 + v^2), down to -1 at the corners (Schuetz and Wimmer 2015,
// section III). In place of shape_flat.wgsl, with `facing = "square"`.

fn rise(rho2: f32) -> f32 {
    return 1.0 - rho2;
}
