// Depths are written and compared as in raster_exact.wgsl, of fragments that no layer before has (depth peeling: Everitt 2001).
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
fn shape_to_peel(@builtin(vertex_index) vertex: u32) -> Corner {
    var corner = corner_of(vertex);
    corner.radius = radius_of(corner.index);
    return corner;
}

@fragment
fn raster_visibility(corner: Corner) -> @builtin(frag_depth) f32 {
    let fragment = fragment_of(corner);
    if (!fragment.hit || is_peeled(fragment, corner.radius, vec2<u32>(corner.position.xy))) {
        discard;
    }
    return fragment.depth * depth_scale();
}

@fragment
fn raster_attributes(corner: Corner) -> Targets {
    let fragment = fragment_of(corner);
    let pixel = vec2<u32>(corner.position.xy);
    let place = pixel_index(pixel.x, pixel.y);
    let front = front_at(place);
    if (!is_shown(fragment, front, corner.radius, pixel) || is_peeled(fragment, corner.radius, pixel)) {
        discard;
    }
    blend(place, fragment, front, carried(corner));
    return targets();
}
