// All surfels are drawn. Same interface as select.wgsl.
// #import layout::{page}
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

fn rank_of(index: u32) -> u32 {
    return page.first + index;
}
