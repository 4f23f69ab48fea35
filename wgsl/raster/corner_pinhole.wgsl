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

// Whether the corner has an image.
fn is_before(corner: Corner) -> bool {
    return corner.depth.high >= held.near;
}

// The factor from the corner's position to its homogeneous image: one over its share.
fn homogeneous_depth(corner: Corner) -> Double {
    if (is_before(corner)) {
        return corner.depth;
    }
    return single(1.0);
}

// The depth for the rasteriser, which divides it by the corner's depth: 1 at the near depth, 0 at
// infinity.
fn clip_depth(corner: Corner) -> f32 {
    return held.near;
}

// The barycentric area of a pixel: the determinant of the change of the triangle's barycentric
// coordinates per column and row. `depth` is the triangle's depth there, and `of_depth` the sum of
// its corners' shared depths weighted by the areas of the opposite edges.
fn spread_of_parts(triangle: Triangle, depth: f32, of_depth: f32) -> f32 {
    let a = depth / homogeneous_depth(triangle.a).high;
    let b = depth / homogeneous_depth(triangle.b).high;
    let c = depth / homogeneous_depth(triangle.c).high;
    return a * b * c / of_depth;
}

// The corner's depth times its share.
fn shared_depth(corner: Corner) -> Double {
    if (is_before(corner)) {
        return single(1.0);
    }
    return corner.depth;
}
