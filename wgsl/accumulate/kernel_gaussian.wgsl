// The kernel exp(-rho^2 / (2 sigma^2)), paper 000, Eq. 11. Twin: Kernel::weight in
// src/scene/kernel.rs.

// 1 / (2 sigma^2)
override KERNEL_FALL: f32;

fn kernel_weight(rho2: f32) -> f32 {
    return exp(-KERNEL_FALL * rho2);
}
