// Fragments write and compare their depths in the shader, bit for bit as in the compute path. The
// depth test finds the nearest depth, and the attribute pass reads it (raster_own_depths.wgsl).
// #import *::{front_at}
// #import blend|winner_second::{blend}
// #import footprint::{depth_scale, pixel_index}
// #import raster::{ShapeCorner, carried, fragment_of}
// #import raster_peeled::{is_peeled}
// #import raster_targets_*::{Targets, targets}
// #import side::{is_shown}

// Scaling by a power of two is exact.
@fragment
fn raster_visibility(corner: ShapeCorner) -> @builtin(frag_depth) f32 {
    let fragment = fragment_of(corner);
    if (!fragment.hit || is_peeled(fragment, corner.radius, vec2<u32>(corner.position.xy))) {
        discard;
    }
    return fragment.depth * depth_scale();
}

@fragment
fn raster_attributes(corner: ShapeCorner) -> Targets {
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
