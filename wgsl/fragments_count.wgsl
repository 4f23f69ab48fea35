// What the visibility pass keeps of the fragments of a pixel that gets a list of them: how many they are. Same interface as
// nearest_depth.wgsl. Host side: src/passes/fragments.rs.

fn mark_of(surfel: u32) -> u32 {
    return 0u;
}

fn keep_nearest(pixel: u32, fragment: Fragment, mark: u32) {
    atomicAdd(&nearest[pixel], 1u);
}

// Of a pixel that has anything something that is not nothing, as there is no nearest depth.
fn nearest_at(pixel: u32) -> u32 {
    return select(NOTHING, 1u, atomicLoad(&nearest[pixel]) != 0u);
}

// All are listed.
fn is_before_end(pixel: u32, depth: f32) -> bool {
    return true;
}
