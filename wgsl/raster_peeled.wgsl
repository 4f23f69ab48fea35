// The fragments that layers before this one have, which are drawn no more (depth peeling: Everitt 2001).
// Host side: src/passes/peel.rs.

// Per pixel, of peeled.wgsl: the nearest depths of the last fronts and of the last backs that were peeled, or 0.
@group(0) @binding(48) var<storage, read> told: array<u32>;

// Of the fragment's side: what lies farther than the last layer accepts is left.
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
