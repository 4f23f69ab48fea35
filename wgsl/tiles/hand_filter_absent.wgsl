// #import filter|lowpass_none::{Filter}

fn handed_filter(own: Filter, from_: u32) -> Filter {
    return own;
}
