// A corner of triangles as the pinhole camera sees it. Same interface as corner_orthographic.wgsl. Twin: src/passes/triangles.rs.

// Before the near depth a corner is its image, and what it shares of a depth is one over its own; else it is its homogeneous image, which
// has no quotient, and shares as it is.
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

// What times the corner's place gives its homogeneous image: one over its share.
fn homogeneous_depth(corner: Corner) -> Double {
    if (is_before(corner)) {
        return corner.depth;
    }
    return single(1.0);
}

// A rasteriser's: 1 at the near depth, 0 infinitely far away, where it is divided by the depth.
fn clip_depth(corner: Corner) -> f32 {
    return held.near;
}

// How much of a triangle's parts a pixel has at `depth`, where the mean of the corners' shared depths by areas is `of_depth`: the determinant of
// the parts by columns and rows.
fn spread_of_parts(triangle: Triangle, depth: f32, of_depth: f32) -> f32 {
    let a = depth / homogeneous_depth(triangle.a).high;
    let b = depth / homogeneous_depth(triangle.b).high;
    let c = depth / homogeneous_depth(triangle.c).high;
    return a * b * c / of_depth;
}

// Its depth times its share.
fn shared_depth(corner: Corner) -> Double {
    if (is_before(corner)) {
        return single(1.0);
    }
    return corner.depth;
}
