"""A blending kernel of one's own in place of the built-in one, with its difference and its error.

    python swapped_kernel.py CLOUD
"""

import sys

import epsplat

# The weight of a fragment, by the square of its distance from the centre of its disk (0 to 1).
KERNEL = """
fn kernel_weight(rho2: f32) -> f32 {
    return (1.0 - rho2) * (1.0 - rho2);
}
"""

scene = epsplat.read(sys.argv[1])
swapped = {"wgsl": {"kernel_ellipse.wgsl": KERNEL}}

built_in = epsplat.Renderer(scene, 512, 512).render()
own = epsplat.Renderer(scene, 512, 512, **swapped).render()
# The reference evaluates the same kernel in f64.
exact = epsplat.Renderer(scene, 512, 512, backend="reference", **swapped).render()

print(f"difference to the built-in kernel: {epsplat.compare(own, built_in)['rmse']:.2e} (rmse)")
print(f"error against the f64 reference: {epsplat.compare(own, exact)['rmse']:.2e} (rmse)")
print(f"time: {own.reports[0]['total_ms']:.1f} ms, built-in {built_in.reports[0]['total_ms']:.1f} ms")
worst = epsplat.error_map(own, exact)[0]
print(f"worst pixel: {worst.max():.2e}")
