// Cuts that fade into each other (src/scene/fade.rs): what is come to is in the first so many of them, which the second half of the frontier says,
// and what is chosen in those of its fade, which follows its number. Same interface as select_fades_absent.wgsl.

const ALL_CUTS: u32 = 64u;

// Words of what is chosen.
const CHOSEN_WORDS: u32 = 2u;

fn cuts_that_reach(place: u32) -> u32 {
    return frontier[arrayLength(&frontier) / 2u + place];
}

fn set_cuts_that_reach(place: u32, cuts: u32) {
    frontier[arrayLength(&frontier) / 2u + place] = cuts;
}

// In how many cuts, the first ones, a node that is seen so large is divided: their sizes are evenly far from each other, from half of the largest on.
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
