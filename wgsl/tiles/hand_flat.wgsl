// Disks in columns: the parts of a splat that another invocation fetched (tile.wgsl). Same
// interface as hand_curved.wgsl.
// #import curved|facing|flat::{Bend, Cap}
// #import side::{SIDES}
// #import splat_*::{handed}

// bounds_last, whose AWAY bit is_away() reads if a pixel shows one side.
fn handed_side(own: u32, from_: u32) -> u32 {
    var last = 0u;
    if (SIDES) {
        last = handed(own, from_);
    }
    return last;
}

fn handed_cap(own: Cap, from_: u32) -> Cap {
    return own;
}

fn handed_bend(own: Bend, from_: u32) -> Bend {
    return own;
}
