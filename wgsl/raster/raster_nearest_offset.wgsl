// One pass with the rasteriser's depth test alone, by interpolated depths: the fastest use of the
// rasteriser. Same interface as raster_nearest_exact.wgsl.
// #import blend|winner_second::{blend}
// #import camera_orthographic|perspective::{depth_of, depth_order}
// #import layout::{Splat}
// #import raster::{ShapeCorner, carried, fragment_of}
// #import raster_targets_*::{Targets, targets}
// #import vectors::{dot3}

fn corner_depth(splat: Splat, image: vec2<f32>, index: u32) -> f32 {
    let d = vec3<f32>(image - 0.5 - vec2<f32>(f32(splat.anchor_x), f32(splat.anchor_y)), 1.0);
    return depth_order(depth_of(dot3(vec3<f32>(splat.c[0], splat.c[1], splat.c[2]), d)));
}

fn front_at(pixel: u32) -> f32 {
    return 0.0;
}

@fragment
fn raster_nearest(corner: ShapeCorner) -> Targets {
    let fragment = fragment_of(corner);
    if (!fragment.hit) {
        discard;
    }
    blend(0u, fragment, 0.0, carried(corner));
    return targets();
}
