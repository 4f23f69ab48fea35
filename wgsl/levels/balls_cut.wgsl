// The bounding balls of the batches of a cut, by which cull.wgsl leaves out hidden ones. A cut
// changes from view to view, so select.wgsl encloses the balls of the nodes from which it chooses.
// Same interface as balls_own.wgsl.
// All loops end, by 1 of src/gpu/loops.rs: 0x1f9e3b8ae6675720
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

fn ordered(number: f32) -> u32 {
    let bits = bitcast<u32>(number);
    return select(bits | SIGN, ~bits, (bits & SIGN) != 0u);
}

fn number_of(word: u32) -> f32 {
    return bitcast<f32>(select(~word, word ^ SIGN, (word & SIGN) != 0u));
}

// Encloses what is drawn for a node, the entries from `first` to before `end` of the list.
fn enclose(node: TreeNode, fate: u32, first: u32, end: u32) {
    // The balls of children that are drawn may stick out of the node's ball.
    let radius = node.radius + select(0.0, max(node.children, 0.0), (fate & CHILDREN_DRAWN) != 0u);
    for (var box = first / BATCH; first < end && box * BATCH < end; box++) {
        for (var k = 0u; k < 3u; k++) {
            atomicMax(&boxes[box * BOX_WORDS + k], ordered(node.center[k] + radius));
            atomicMax(&boxes[box * BOX_WORDS + 3u + k], ordered(radius - node.center[k]));
        }
    }
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
