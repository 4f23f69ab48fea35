// The splats of a tile's list, one after the other. Same interface as splat_shared.wgsl.

const FETCHED: u32 = 1u;

fn hold_lane() {}

// Which of those that are fetched this invocation fetches.
fn fetcher() -> u32 {
    return 0u;
}

// Of those that are fetched, a bit for each that is wanted.
fn offered(wanted: bool) -> u32 {
    return select(0u, 1u, wanted);
}

fn farthest_in_tile(farthest: f32) -> f32 {
    return farthest;
}

// The word that the invocation which fetched `from_` has.
fn handed(word: u32, from_: u32) -> u32 {
    return word;
}
