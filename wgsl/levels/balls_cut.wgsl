// The bounding balls of the batches of a cut, by which cull.wgsl leaves out hidden ones. A cut
// changes from view to view, so select.wgsl encloses the balls of the nodes that it draws.
// Same interface as balls_own.wgsl.
// All loops end, by 1 of src/gpu/loops.rs: 0x178d32536afe3089
// #import judge::{CHILDREN_DRAWN}
// #import layout::{BATCH, TreeNode, page}
// #import select::{drawn_at}
// #import vectors::{norm3}

// For each batch of a branch's list of chosen surfels and nodes, the box of the balls that it is
// in: three words for its greatest coordinates, then three for its least ones, negated. The words
// order as the numbers do, and 0 is below all of them. `boxed` is the same buffer, read-only.
@group(0) @binding(77) var<storage, read_write> boxes: array<atomic<u32>>;
@group(0) @binding(83) var<storage, read> boxed: array<u32>;

const BOX_WORDS: u32 = 6u;
const SIGN: u32 = 0x80000000u;

fn sortable(number: f32) -> u32 {
    let bits = bitcast<u32>(number);
    return select(bits | SIGN, ~bits, (bits & SIGN) != 0u);
}

fn number_of(word: u32) -> f32 {
    return bitcast<f32>(select(~word, word ^ SIGN, (word & SIGN) != 0u));
}

// Encloses the balls of nodes for which the entries from `first` to before `end` are drawn. `high`
// are the greatest coordinates of the balls, `low` the least ones, negated.
fn enclose(high: vec3<f32>, low: vec3<f32>, first: u32, end: u32) {
    for (var box = first / BATCH; first < end && box * BATCH < end; box++) {
        for (var k = 0u; k < 3u; k++) {
            atomicMax(&boxes[box * BOX_WORDS + k], sortable(high[k]));
            atomicMax(&boxes[box * BOX_WORDS + 3u + k], sortable(low[k]));
        }
    }
}

// The radius of a ball around the node's centre that holds what is drawn for the node: the balls of
// its children may stick out of its own.
fn drawn_radius(node: TreeNode, fate: u32) -> f32 {
    return node.radius + select(0.0, max(node.children, 0.0), (fate & CHILDREN_DRAWN) != 0u);
}

fn batches_held() -> u32 {
    return (page.surfels + BATCH - 1u) / BATCH;
}

// The centre and the radius of a batch's ball. The margin covers the rounding of these lengths.
fn sphere_of(batch: u32) -> vec4<f32> {
    let word = drawn_at(batch * BATCH) / BATCH * BOX_WORDS;
    let high = vec3<f32>(number_of(boxed[word]), number_of(boxed[word + 1u]), number_of(boxed[word + 2u]));
    let low = -vec3<f32>(number_of(boxed[word + 3u]), number_of(boxed[word + 4u]), number_of(boxed[word + 5u]));
    let margin = 1e-6 * norm3(max(abs(low), abs(high)));
    return vec4<f32>(0.5 * (low + high), (0.5 + 1e-6) * norm3(high - low) + margin);
}
