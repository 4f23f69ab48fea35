// Depths are written and compared in the fragment shader, bit for bit as the compute path does: the rasteriser keeps the
// nearest depth, the attribute pass reads it. Not as a `texture_depth_2d`: GLSL can only compare with those.

@group(0) @binding(19) var nearest_depth: texture_2d<f32>;

fn corner_depth(splat: Splat, image: vec2<f32>, index: u32) -> f32 {
    return 0.0;
}

// Scaling by a power of two is exact.
@fragment
fn raster_visibility(corner: Corner) -> @builtin(frag_depth) f32 {
    let fragment = fragment_of(corner);
    if (!fragment.hit) {
        discard;
    }
    return fragment.depth * depth_scale();
}

fn front_at(pixel: u32) -> f32 {
    let place = vec2<u32>(pixel % held.width, pixel / held.width + held_band.first_row);
    let depth = textureLoad(nearest_depth, place, 0).x;
    return select(depth / depth_scale(), bitcast<f32>(NOTHING ^ held.zero), depth == 1.0);
}

@fragment
fn raster_attributes(corner: Corner) -> Targets {
    let fragment = fragment_of(corner);
    let pixel = vec2<u32>(corner.position.xy);
    let place = pixel_index(pixel.x, pixel.y);
    let front = front_at(place);
    if (!is_shown(fragment, front, corner.radius)) {
        discard;
    }
    blend(place, fragment, front, carried(corner));
    return targets();
}
