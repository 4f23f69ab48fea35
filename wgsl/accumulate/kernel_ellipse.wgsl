// The kernel psi_E(rho) = exp(-a rho^n) (paper 000, Eq. 12). KERNEL_STEP is 0, or exp(-a) for a
// kernel that ends at 0. Twin: Kernel::weight in src/scene/kernel.rs.

override KERNEL_A: f32;
override KERNEL_N: f32;
override KERNEL_STEP: f32;

fn kernel_weight(rho2: f32) -> f32 {
    var power: f32;
    // Overrides are constants to the compiler, so one branch remains.
    if (KERNEL_N == 2.0) {
        power = rho2;
    } else if (KERNEL_N == 3.0) {
        power = rho2 * sqrt(rho2);
    } else if (KERNEL_N == 4.0) {
        power = rho2 * rho2;
    } else {
        power = pow(rho2, 0.5 * KERNEL_N);
    }
    return (exp(-KERNEL_A * power) - KERNEL_STEP) / (1.0 - KERNEL_STEP);
}
