// Cuts that fade into each other (src/scene/fade.rs), numbered from the finest. The cuts that reach
// a node are the finest ones, and the second half of `frontier` stores their number. Each chosen
// surfel or node has a second word: the range of the cuts that draw it. Same interface as
// select_fades_absent.wgsl.
// #import attributes::{attributes}
// #import layout::{held, page}
// #import select::{branch, chosen, drawn_at, frontier}

const ALL_CUTS: u32 = 64u;

// Words of a chosen surfel or node.
const CHOSEN_WORDS: u32 = 2u;

fn cuts_that_reach(place: u32) -> u32 {
    return frontier[arrayLength(&frontier) / 2u + place];
}

fn set_cuts_that_reach(place: u32, cuts: u32) {
    frontier[arrayLength(&frontier) / 2u + place] = cuts;
}

// The number of cuts that divide a node of this size; they are the finest ones. Each cut divides
// nodes from a limit of size on. The limits are evenly spaced, from half of the largest on.
fn cuts_that_divide(size: f32) -> u32 {
    let steps = f32(ALL_CUTS);
    return u32(clamp(floor(steps * (2.0 * (size / held.levels.x) - 1.0) + 1.0), 0.0, steps));
}

fn choose(at: u32, surfel: u32, first: u32, end: u32) {
    let word = branch.chosen + 1u + CHOSEN_WORDS * at;
    chosen[word] = surfel;
    chosen[word + 1u] = first | (end << 8u);
}

fn fade_word(index: u32, place: u32) -> u32 {
    return attributes[page.chosen + 2u + CHOSEN_WORDS * drawn_at(place)];
}
