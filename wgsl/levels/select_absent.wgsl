// All surfels are drawn. Same interface as select.wgsl.
// #import layout::{BATCH, page}
// #import words|words_long::{surfels_held}

fn places_held() -> u32 {
    return surfels_held();
}

fn surfel_of(place: u32) -> u32 {
    return place;
}

fn is_filled(place: u32) -> bool {
    return true;
}

// The number of surfels in a batch of the page.
fn held_in(batch: u32) -> u32 {
    return min(BATCH, surfels_held() - batch * BATCH);
}

fn rank_of(index: u32) -> u32 {
    return page.first + index;
}
