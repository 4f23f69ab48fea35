// All surfels are drawn. Same interface as select.wgsl.

fn is_filled(index: u32) -> bool {
    return true;
}

fn batch_size(batch: u32) -> u32 {
    return min(BATCH, surfels_held() - batch * BATCH);
}

fn rank_of(index: u32) -> u32 {
    return page.first + index;
}
