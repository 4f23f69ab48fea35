// Fragments of the same depth are sorted by the ranks of their surfels: their order in the stored
// scene, or in the tree. Ranks depend on the surfels' values, not on their positions in files. Same
// interface as fragments_untied.wgsl.
// #import camera_orthographic|perspective::{Fragment}
// #import fragments::{FRAGMENT_ROWS, Record, fragments}
// #import fragments_*::{is_before_end}
// #import select::{rank_of}
// #import words|words_long::{each_word}

override FRAGMENT_RANK: u32;

const TIES: bool = true;

// Rules::least_alpha in src/passes/sorted.rs.
override LEAST_ALPHA: f32;

// Whether a fragment is listed. `alpha` is that of the fragment.
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
