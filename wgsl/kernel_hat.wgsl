// 1 - rho. Twin: Kernel::weight in src/scene/options.rs.
fn kernel_weight(rho2: f32) -> f32 {
    return 1.0 - sqrt(rho2);
}
