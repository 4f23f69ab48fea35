// The splats of a tile's list, eight at a time, for software adapters, which would otherwise read
// each word again for every invocation: the eight invocations of a tile fetch one splat each and
// exchange them. Subgroups have at least eight invocations (src/gpu/adapter.rs) with consecutive
// local indices. Same interface as splat_plain.wgsl.

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

// The word that the invocation which fetched splat `from_` holds.
fn handed(word: u32, from_: u32) -> u32 {
    return subgroupShuffle(word, (lane & 24u) | from_);
}
