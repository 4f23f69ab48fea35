// Points that face the camera, in tiles. Same interface as tile_flat.wgsl.
// #import curved|facing|flat::{Bend, Cap}
// #import filter|lowpass_none::{Filter}
// #import footprint::{Rectangle}
// #import layout::{Splat}

// Points have no sides.
fn handed_side(own: u32, from_: u32) -> u32 {
    return 0u;
}

fn handed_cap(own: Cap, from_: u32) -> Cap {
    return own;
}

fn handed_bend(own: Bend, from_: u32) -> Bend {
    return own;
}

// Whether the splat has no fragment at `pixels`, which lie in its bounds. Points are not tested, as
// the test would save only a few pixels.
fn misses(splat: Splat, filter_: Filter, pixels: Rectangle) -> bool {
    return false;
}
