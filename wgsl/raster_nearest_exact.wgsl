// The rasteriser's depth test alone, one pass: the nearest fragment's terms replace those of others. Fragments write their own depth. Of
// those at one depth the first one drawn stays, so the order of the surfels shows.

// Scaling by a power of two is exact.
@fragment
fn raster_nearest(corner: ShapeCorner) -> Seen {
    let fragment = fragment_of(corner);
    if (!fragment.hit) {
        discard;
    }
    blend(0u, fragment, 0.0, carried(corner));
    return seen(fragment.depth * depth_scale());
}
