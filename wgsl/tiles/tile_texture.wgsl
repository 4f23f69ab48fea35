// Tiles of textured surfels: more channels, and the texture coordinates of a surfel that another
// invocation fetched (tile.wgsl). Same interface as tile_plain.wgsl.
// #import *::{CHANNELS}
// #import accumulator_fixed_pairs|tile_sums::{show_pair}
// #import texture::{Place}
// #import tile::{handed_vector}

const MOST_CHANNELS: u32 = 18u;

// Reads the channels that only textured surfels have.
fn show_rest(slot: u32) {
    if (CHANNELS > 12u) { show_pair(slot, 12u); }
    if (CHANNELS > 14u) { show_pair(slot, 14u); }
    if (CHANNELS > 16u) { show_pair(slot, 16u); }
}

fn handed_place(own: Place, from_: u32) -> Place {
    let center = handed_vector(vec3<f32>(own.center, own.reach_2), from_);
    return Place(
        center.xy,
        center.z,
        handed_vector(own.position, from_),
        handed_vector(own.u_slope, from_),
        handed_vector(own.v_slope, from_),
    );
}
