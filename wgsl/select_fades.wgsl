// Cuts that fade into each other (src/scene/fade.rs): what is come to is in the first so many of them, which the second half of the frontier says,
// and what is chosen in those of its fade, which the second half of that list says. Same interface as select_fades_absent.wgsl.

const ALL_CUTS: u32 = 64u;

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

fn choose_fade(place: u32, first: u32, end: u32) {
    chosen[arrayLength(&chosen) / 2u + place] = first | (end << 8u);
}

fn gather_fade(place: u32, to: u32) {
    gathered_attributes[to * ATTRIBUTE_WORDS + FADE_WORD] = chosen[arrayLength(&chosen) / 2u + place];
}
