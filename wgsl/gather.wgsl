// What a surfel of the cut has beside its shape goes with it (select.wgsl).
// All loops end, by 1 of src/gpu/loops.rs: 0xa014f95502787927

@group(0) @binding(83) var<storage, read> tree_attributes: array<u32>;

fn gather_attributes(from_: u32, to: u32) {
    for (var word = 0u; word < TREE_WORDS; word++) {
        gathered_attributes[to * ATTRIBUTE_WORDS + word] = tree_attributes[from_ * TREE_WORDS + word];
    }
}
