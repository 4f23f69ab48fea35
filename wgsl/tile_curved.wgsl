// Caps in tiles: of a splat that another invocation fetched (tile.wgsl).

// bounds_last, whose AWAY bit softened() reads wherever there is a low-pass; without one sides are
// those of the roots.
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
        // Asked for by the one that fetched it alone.
        0.0,
    );
}

fn handed_bend(own: Bend, from_: u32) -> Bend {
    return Bend(handed_vector(own.u, from_), handed_vector(own.v, from_));
}

// Whether the splat has no fragment at `pixels`, which lie in its bounds: that is not looked at.
fn misses(splat: Splat, filter_: Filter, pixels: Rectangle) -> bool {
    return false;
}
