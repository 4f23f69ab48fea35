// Stage 3 for small splats, one invocation each. Same interface as accumulate_spread.wgsl.
// #import accumulate::{accumulate_splat}
// #import cull|cull_absent|cull_twice::{slot_of, surfel_in}
// #import epsilon_*::{radius_of}
// #import filter|lowpass_none::{filter_in}
// #import footprint::{is_large, reach}
// #import layout::{WORKGROUP, hold}
// #import occlusion::{hidden}
// #import raster|visibility::{projected}
// #import records::{splat_of}

@compute @workgroup_size(WORKGROUP)
fn accumulate(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let slot = slot_of(workgroup, workgroups, local);
    if (slot < arrayLength(&projected)) {
        let record = projected[slot];
        let splat = splat_of(record);
        let surfel = surfel_in(record, slot);
        let filter_ = filter_in(record);
        let pixels = reach(splat);
        if (!is_large(splat) && !hidden(splat, filter_, pixels, radius_of(surfel))) {
            accumulate_splat(surfel, splat, filter_, pixels, vec2<u32>(0u), 1u);
        }
    }
}
