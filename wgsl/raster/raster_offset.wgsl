// The classic depth test: the rasteriser interpolates the depths of the quads, and the visibility
// pass moves depths back by epsilon (paper 000, section 5.3). The attribute pass can use early
// depth tests, but the decisions of these tests are not exact. `depth_order` is linear over the
// image of a plane and largest in front.
// #import blend|winner_second::{blend}
// #import camera_orthographic|perspective::{depth_of, depth_order}
// #import epsilon_*::{farthest_shown, radius_of}
// #import footprint::{pixel_index}
// #import layout::{Splat}
// #import raster::{ShapeCorner, carried, fragment_of}
// #import raster_targets_*::{Targets, targets}
// #import select::{surfel_of}
// #import vectors::{dot3}

// Set in the visibility pass, which moves depths.
override MOVED: bool;

fn corner_depth(splat: Splat, image: vec2<f32>, index: u32) -> f32 {
    let d = vec3<f32>(image - 0.5 - vec2<f32>(f32(splat.anchor_x), f32(splat.anchor_y)), 1.0);
    let z = depth_of(dot3(vec3<f32>(splat.c[0], splat.c[1], splat.c[2]), d));
    if (!MOVED) {
        return depth_order(z);
    }
    return depth_order(farthest_shown(z, radius_of(surfel_of(index)), image));
}

@fragment
fn raster_visibility(corner: ShapeCorner) {
    if (!fragment_of(corner).hit) {
        discard;
    }
}

@fragment
fn raster_attributes(corner: ShapeCorner) -> Targets {
    let fragment = fragment_of(corner);
    // Fragments outside the disk add nothing to the sums. None is discarded, so the depth test may
    // run before the shader.
    if (fragment.hit) {
        let pixel = vec2<u32>(corner.position.xy);
        blend(pixel_index(pixel.x, pixel.y), fragment, 0.0, carried(corner));
    }
    return targets();
}

// The nearest depth is unknown here, so depths are summed whole (depth_whole.wgsl).
fn front_at(pixel: u32) -> f32 {
    return 0.0;
}
