// Caps in columns: the cap of a splat that another invocation fetched (tile.wgsl). Same interface
// as hand_flat.wgsl.
// #import curved|facing|flat::{Bend, Cap}
// #import filter|lowpass_none::{FILTERED}
// #import splat_*::{handed}
// #import tile::{handed_number, handed_vector}

// bounds_last, whose AWAY bit softened() reads if there is a low-pass. Without one the root of the
// intersection tells the side.
fn handed_side(own: u32, from_: u32) -> u32 {
    var last = 0u;
    if (FILTERED) {
        last = handed(own, from_);
    }
    return last;
}

fn handed_cap(own: Cap, from_: u32) -> Cap {
    return Cap(
        handed_vector(own.heights, from_),
        handed_number(own.spread, from_),
        handed_number(own.radius, from_),
        handed_number(own.depth, from_),
        // Only the invocation that fetched the splat reads `nearest`.
        0.0,
    );
}

fn handed_bend(own: Bend, from_: u32) -> Bend {
    return Bend(handed_vector(own.u, from_), handed_vector(own.v, from_));
}
