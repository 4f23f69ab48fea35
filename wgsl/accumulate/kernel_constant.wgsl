// The constant kernel. Twin: Kernel::weight in src/scene/kernel.rs.

fn kernel_weight(rho2: f32) -> f32 {
    return 1.0;
}
