// All surfels are drawn. Same interface as select.wgsl.

fn is_filled(index: u32) -> bool {
    return true;
}

fn rank_of(index: u32) -> u32 {
    return page_first + index;
}
