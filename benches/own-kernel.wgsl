// Wendland's C2 function, a smooth kernel that ends at 0: the weight at the squared distance
// `rho2` from a disk's centre, in radii squared. benches/own-kernel.toml puts it in the place of
// kernel_ellipse.wgsl.
fn kernel_weight(rho2: f32) -> f32 {
    let rho = sqrt(rho2);
    let rest = max(1.0 - rho, 0.0);
    return rest * rest * rest * rest * (4.0 * rho + 1.0);
}
