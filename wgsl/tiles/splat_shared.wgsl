// The eight invocations of a tile fetch eight splats of the tile's list, one each, and exchange
// them. Software adapters would otherwise read each word of a splat again for every invocation.
// Subgroups have at least eight invocations (src/gpu/adapter.rs) with consecutive local indices.
// Same interface as splat_plain.wgsl.

const FETCHED: u32 = 8u;

// The place of this invocation in its subgroup.
var<private> lane: u32;

fn hold_lane() {
    lane = subgroupExclusiveAdd(1u);
}

// Which of the FETCHED splats this invocation fetches.
fn fetcher() -> u32 {
    return lane & 7u;
}

// A bit for each fetched splat that is wanted.
fn offered(wanted: bool) -> u32 {
    return (subgroupBallot(wanted).x >> (lane & 24u)) & 0xffu;
}

fn farthest_in_tile(farthest: f32) -> f32 {
    return subgroupMax(farthest);
}

// The value that `word` has in the invocation that fetched splat `from_`.
fn handed(word: u32, from_: u32) -> u32 {
    return subgroupShuffle(word, (lane & 24u) | from_);
}
