// Of fragments of one depth that comes first whose surfel does in the order in which they are stored, which depends on what they are and
// not on where they stood in their files.

// Surfels of the pages before this one.
@group(0) @binding(42) var<uniform> page_first: u32;

override FRAGMENT_RANK: u32;

fn write_rank(first: u32, surfel: u32) {
    fragments[first + FRAGMENT_RANK] = page_first + surfel;
}

fn precedes(a: vec2<u32>, b: vec2<u32>) -> bool {
    if (a.x != b.x) {
        return a.x < b.x;
    }
    return fragments[a.y * FRAGMENT_WORDS + FRAGMENT_RANK] < fragments[b.y * FRAGMENT_WORDS + FRAGMENT_RANK];
}
