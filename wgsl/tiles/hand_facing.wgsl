// Points that face the camera, in columns. Same interface as hand_flat.wgsl.
// #import curved|facing|flat::{Bend, Cap}

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
