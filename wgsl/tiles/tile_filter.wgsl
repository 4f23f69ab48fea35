// The low-pass in tiles: the pixels where it adds nothing (tile_reach.wgsl).
// #import filter|lowpass_none::{Filter}
// #import tile_reach::{exceeds, span}

// Whether the filter adds no fragment between the pixels `low` and `high`, relative to the anchor.
fn filter_misses(filter_: Filter, low: vec2<f32>, high: vec2<f32>) -> bool {
    let center = vec2<f32>(filter_.center_x, filter_.center_y);
    let across = vec2<f32>(filter_.r_xx, 0.0);
    let down = vec2<f32>(filter_.r_xy, filter_.r_yy);
    return filter_.gain == 0.0 || exceeds(span(across, down, vec2<f32>(0.0), low - center, high - center), 1.0);
}
