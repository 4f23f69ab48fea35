// Depth peeling (Everitt 2001): fragments that belong to earlier layers are not drawn again.
// Host side: src/passes/peel.rs.
// #import camera_orthographic|perspective::{Fragment}
// #import epsilon_*::{radius_of}
// #import footprint::{pixel_index}
// #import peeled::{PEELED_FRONTS, PEELED_WORDS}
// #import raster::{ShapeCorner, shape_corner}
// #import select::{surfel_of}
// #import side::{SIDES, SIDE_BIT, is_shown}

// The buffer `peeled` of peeled.wgsl, read-only. Per pixel it has, among others, the nearest depth
// of the last peeled layer that shows its front and of the last one that shows its back; 0 if there
// is none.
@group(0) @binding(48) var<storage, read> told: array<u32>;

// Whether the fragment belongs to an earlier layer: it is no farther than the last peeled layer of
// the same side accepts.
fn is_peeled(fragment: Fragment, radius: f32, pixel: vec2<u32>) -> bool {
    let side = select(0u, bitcast<u32>(fragment.depth) & SIDE_BIT, SIDES);
    let front = told[pixel_index(pixel.x, pixel.y) * PEELED_WORDS + PEELED_FRONTS + side];
    return front != 0u && is_shown(fragment, bitcast<f32>(front), radius, pixel);
}

@vertex
fn shape_to_peel(@builtin(vertex_index) vertex: u32) -> ShapeCorner {
    var corner = shape_corner(vertex);
    corner.radius = radius_of(surfel_of(corner.index));
    return corner;
}
