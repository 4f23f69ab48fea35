// Projects corners of triangles through a lens. Edges are straight between the images of their
// corners. Same interface as corner_pinhole.wgsl.
// Twin: src/passes/triangles.rs.
// #import camera_lens::{see}
// #import corner_*::{is_before}
// #import corners::{Corner}
// #import double::{Double}
// #import layout::{held}
// #import rows::{single}
// #import triangles::{Triangle}

// A corner that the lens does not see, or far outside the image, is all 0: its edges have no sides,
// so its triangles cover nothing.
fn corner_of(p: array<Double, 3>) -> Corner {
    let sight = see(p);
    let is_near = sight.radius_2 <= held.lens[6].y * held.lens[6].y;
    if (!sight.seen || !is_near || !(sight.depth.high >= held.near)) {
        return Corner(single(0.0), single(0.0), single(0.0), single(0.0), 0.0);
    }
    return Corner(sight.x, sight.y, single(1.0), sight.depth, 1.0 / sight.depth.high);
}

// Whether the triangle may have an image: the lens sees all of its corners.
fn has_image(triangle: Triangle) -> bool {
    return is_before(triangle.a) && is_before(triangle.b) && is_before(triangle.c);
}
