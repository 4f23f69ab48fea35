// Of fragments of one depth that comes first whose surfel does in the order in which they are stored, or in that of the tree, which depends on what they are and
// not on where they stood in their files.

override FRAGMENT_RANK: u32;

const TIES: bool = true;

// Rules in src/passes/sorted.rs.
override LEAST_ALPHA: f32;

// By the alpha of a fragment.
fn is_listed(pixel: u32, fragment: Fragment, alpha: f32) -> bool {
    return alpha >= LEAST_ALPHA && is_before_end(pixel, fragment.depth);
}

fn with_rank(record: Record, surfel: u32) -> Record {
    var ranked = record;
    ranked[FRAGMENT_RANK] = rank_of(surfel);
    return ranked;
}

fn rank_at(at: u32) -> u32 {
    return each_word(fragments[at * FRAGMENT_ROWS + FRAGMENT_RANK / 4u])[FRAGMENT_RANK % 4u];
}

fn precedes(a: vec2<u32>, b: vec2<u32>) -> bool {
    if (a.x != b.x) {
        return a.x < b.x;
    }
    return rank_at(a.y) < rank_at(b.y);
}
