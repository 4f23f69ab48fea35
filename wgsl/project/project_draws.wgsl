// Splats are drawn into the nearest depths as soon as they are projected, by the invocation that
// still holds them: no kernel reads all records for that. Same interface as
// project_draws_absent.wgsl.
// Host side: src/passes/project.rs.
// #import filter|lowpass_none::{Filter}
// #import layout::{Splat}
// #import visibility::{draw_small_splat}

fn draw_projected(splat: Splat, filter_: Filter, surfel: u32) {
    draw_small_splat(splat, filter_, surfel);
}
