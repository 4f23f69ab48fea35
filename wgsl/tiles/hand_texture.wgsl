// Textured surfels in columns: the texture coordinates of a surfel that another invocation fetched
// (tile.wgsl).
// #import texture::{Place}
// #import tile::{handed_vector}

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
