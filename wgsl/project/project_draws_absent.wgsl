// A kernel of its own draws the splats (visibility.wgsl). Same interface as project_draws.wgsl.
// #import filter|lowpass_none::{Filter}
// #import layout::{Splat}

fn draw_projected(splat: Splat, filter_: Filter, surfel: u32) {}
