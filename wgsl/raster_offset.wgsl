// The classic depth test: the quads' own depths, interpolated by the rasteriser, with those of the visibility pass moved
// away by epsilon (paper 000, section 5.3). Early depth tests stay on in the attribute pass; what they decide is not
// exact. `depth_order` is linear over the image of a plane,
// and largest in front.

// The visibility pass, whose depths are moved.
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
    // Outside the disk the sums gain nothing: no fragment is discarded, so that the depth test may come first.
    if (fragment.hit) {
        let pixel = vec2<u32>(corner.position.xy);
        blend(pixel_index(pixel.x, pixel.y), fragment, 0.0, carried(corner));
    }
    return targets();
}

// The nearest depth is not known here; depths are summed whole (depth_whole.wgsl).
fn front_at(pixel: u32) -> f32 {
    return 0.0;
}
