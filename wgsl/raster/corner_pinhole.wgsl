// Projects corners of triangles by the pinhole camera. Same interface as corner_orthographic.wgsl.
// Twin: src/passes/triangles.rs.
// #import camera_*::{image_of}
// #import corners::{Corner}
// #import double::{Double, product, sum}
// #import layout::{held}
// #import rows::{single}
// #import triangles::{Triangle}

// Projects a corner. From the near depth on, the corner's position is its image point and its share
// is 1 / depth. In front of the near depth, the position is the homogeneous image, which needs no
// division, and the share is 1.
fn corner_of(p: array<Double, 3>) -> Corner {
    if (p[2].high >= held.near) {
        return Corner(image_of(p[0], p[2], 0u), image_of(p[1], p[2], 1u), single(1.0), p[2], 1.0 / p[2].high);
    }
    return Corner(homogeneous_of(p[0], p[2], 0u), homogeneous_of(p[1], p[2], 1u), p[2], p[2], 1.0);
}

fn homogeneous_of(position: Double, depth: Double, axis: u32) -> Double {
    let focal = Double(held.intrinsics[axis], held.intrinsics_low[axis]);
    let principal = Double(held.intrinsics[axis + 2u], held.intrinsics_low[axis + 2u]);
    return sum(product(focal, position), product(principal, depth));
}

// Whether the triangle may have an image.
fn has_image(triangle: Triangle) -> bool {
    return true;
}
