// Every surfel is projected. Same interface as cull.wgsl.

fn surfel_of(workgroup: vec3<u32>, workgroups: vec3<u32>, local: u32) -> u32 {
    return linear_index(workgroup, workgroups, local);
}
