// Projects corners of triangles by the orthographic camera. Corners have an image at any depth.
// Same interface as corner_pinhole.wgsl.
// Twin: src/passes/triangles.rs.
// #import camera_*::{image_of}
// #import corners::{Corner}
// #import double::{Double}
// #import layout::{held}
// #import rows::{single}
// #import triangles::{Triangle}

fn corner_of(p: array<Double, 3>) -> Corner {
    return Corner(image_of(p[0], 0u), image_of(p[1], 1u), single(1.0), p[2], 1.0);
}

fn is_before(corner: Corner) -> bool {
    return true;
}

fn homogeneous_depth(corner: Corner) -> Double {
    return single(1.0);
}

// The depth for the rasteriser: 1 at the near depth, 0 beyond everything in the scene.
fn clip_depth(corner: Corner) -> f32 {
    let beyond = 2.0 * held.farthest - held.near;
    // If nothing lies beyond the near depth, everything is clipped.
    return (beyond - corner.depth.high) / max(beyond - held.near, 1e-30);
}

fn spread_of_parts(triangle: Triangle, depth: f32, of_depth: f32) -> f32 {
    return depth / of_depth;
}

fn shared_depth(corner: Corner) -> Double {
    return corner.depth;
}

fn has_image(triangle: Triangle) -> bool {
    return true;
}
