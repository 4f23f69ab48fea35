// The low-pass in columns: the filter of a splat that another invocation fetched (tile.wgsl).
// #import filter|lowpass_none::{Filter}
// #import tile::{handed_number}

fn handed_filter(own: Filter, from_: u32) -> Filter {
    return Filter(
        handed_number(own.center_x, from_),
        handed_number(own.center_y, from_),
        handed_number(own.depth_low, from_),
        handed_number(own.depth_high, from_),
        handed_number(own.r_xx, from_),
        handed_number(own.r_xy, from_),
        handed_number(own.r_yy, from_),
        handed_number(own.gain, from_),
    );
}
