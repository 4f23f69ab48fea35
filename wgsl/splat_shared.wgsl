// The splats of a tile's list, eight at a time, for software adapters, which would read each word again for every invocation:
// the eight invocations of a tile fetch one each, and hand them around. Subgroups have at least eight (src/gpu/device.rs), with
// consecutive local indices.

const FETCHED: u32 = 8u;

// This invocation's place in its subgroup.
var<private> lane: u32;

fn hold_lane() {
    lane = subgroupExclusiveAdd(1u);
}

// Which of those that are fetched this invocation fetches.
fn fetcher() -> u32 {
    return lane & 7u;
}

// Of those that are fetched, a bit for each that is wanted.
fn offered(wanted: bool) -> u32 {
    return (subgroupBallot(wanted).x >> (lane & 24u)) & 0xffu;
}

fn farthest_in_tile(farthest: f32) -> f32 {
    return subgroupMax(farthest);
}

// The word that the invocation which fetched `from_` has.
fn handed(word: u32, from_: u32) -> u32 {
    return subgroupShuffle(word, (lane & 24u) | from_);
}
