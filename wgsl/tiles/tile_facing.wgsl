// Points that face the camera, in tiles. Same interface as tile_flat.wgsl.
// #import filter|lowpass_none::{Filter}
// #import footprint::{Rectangle}
// #import layout::{Splat}

// Whether the splat has no fragment at `pixels`, which lie in its bounds. Points are not tested, as
// the test would save only a few pixels.
fn misses(splat: Splat, filter_: Filter, pixels: Rectangle) -> bool {
    return false;
}
