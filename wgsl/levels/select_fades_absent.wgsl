// A single cut. Same interface as select_fades.wgsl.
// #import layout::{held}
// #import select::{branch, chosen}

const ALL_CUTS: u32 = 1u;

const CHOSEN_WORDS: u32 = 1u;

fn cuts_that_reach(place: u32) -> u32 {
    return ALL_CUTS;
}

fn set_cuts_that_reach(place: u32, cuts: u32) {}

fn cuts_that_divide(size: f32) -> u32 {
    return select(ALL_CUTS, 0u, size < held.levels.x);
}

fn choose(at: u32, surfel: u32, first: u32, end: u32) {
    chosen[branch.chosen + 1u + at] = surfel;
}
