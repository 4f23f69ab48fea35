// Each invocation of a tile fetches the splats of the tile's list by itself, one at a time. Same
// interface as splat_shared.wgsl.

const FETCHED: u32 = 1u;

fn hold_lane() {}

// Which of the FETCHED splats this invocation fetches.
fn fetcher() -> u32 {
    return 0u;
}

// A bit for each fetched splat that is wanted.
fn offered(wanted: bool) -> u32 {
    return select(0u, 1u, wanted);
}

fn farthest_in_tile(farthest: f32) -> f32 {
    return farthest;
}

// The value that `word` has in the invocation that fetched splat `from_`.
fn handed(word: u32, from_: u32) -> u32 {
    return word;
}
