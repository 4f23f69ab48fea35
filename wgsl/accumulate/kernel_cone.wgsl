// The kernel (1 - rho)^KERNEL_POWER. Twin: Kernel::weight in src/scene/kernel.rs.

override KERNEL_POWER: f32;

fn kernel_weight(rho2: f32) -> f32 {
    // The corners of square points lie past the rim.
    let height = max(1.0 - sqrt(rho2), 0.0);
    // Overrides are constants to the compiler, so one branch remains.
    if (KERNEL_POWER == 1.0) {
        return height;
    } else if (KERNEL_POWER == 1.5) {
        return height * sqrt(height);
    } else if (KERNEL_POWER == 2.0) {
        return height * height;
    } else {
        return pow(height, KERNEL_POWER);
    }
}
