// One pass with the rasteriser's depth test alone: the nearest fragment's terms replace the others.
// Fragments write their own depth. At equal depths the first one drawn stays, so the image depends
// on the order of the surfels.
// #import blend|winner_second::{blend}
// #import footprint::{depth_scale}
// #import raster::{ShapeCorner, carried, fragment_of}
// #import raster_targets_*::{Seen, seen}

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
