// The rasteriser's depth test alone, one pass: the nearest fragment's terms replace those of others. Fragments write their own depth. Of
// those at one depth the first one drawn stays, so the order of the surfels shows.

@group(0) @binding(19) var nearest_depth: texture_2d<f32>;

fn corner_depth(splat: Splat, image: vec2<f32>, index: u32) -> f32 {
    return 0.0;
}

fn front_at(pixel: u32) -> f32 {
    let place = vec2<u32>(pixel % held.width, pixel / held.width + held_band.first_row);
    let depth = textureLoad(nearest_depth, place, 0).x;
    return select(depth / depth_scale(), bitcast<f32>(NOTHING ^ held.zero), depth == 1.0);
}

// Scaling by a power of two is exact.
@fragment
fn raster_nearest(corner: Corner) -> Seen {
    let fragment = fragment_of(corner);
    if (!fragment.hit) {
        discard;
    }
    blend(0u, fragment, 0.0, carried(corner));
    return seen(fragment.depth * depth_scale());
}
