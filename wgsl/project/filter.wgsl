// The values that a low-pass adds to the record of a splat. The filter is centred on the splat and
// elliptical: rho^2 = |R x|^2 for x pixels from the centre, R upper triangular. Layout mirrored in
// src/gpu/layout.rs.
// #import records::{SplatRecord}
// #import vectors::{dot2}
// #import words|words_long::{each_word, words}

const FILTERED: bool = true;

struct Filter {
    // The splat's centre relative to the anchor's centre, pixels.
    center_x: f32,
    center_y: f32,
    // The range of depths on the disk, device units, to which the depths of filtered fragments are
    // clamped.
    depth_low: f32,
    depth_high: f32,
    r_xx: f32,
    r_xy: f32,
    r_yy: f32,
    // The factor on the kernel's weight; 0 if the splat has no filter. Disks that reach the near
    // depth have none, because they are large anyway.
    gain: f32,
}

// Rows of the filter in a splat's record (records.wgsl).
const FILTER_ROWS: u32 = 2u;

fn with_filter(record: SplatRecord, filter_: Filter) -> SplatRecord {
    var filtered_ = record;
    let place = vec4<f32>(filter_.center_x, filter_.center_y, filter_.depth_low, filter_.depth_high);
    filtered_[4] = words(bitcast<vec4<u32>>(place));
    filtered_[5] = words(bitcast<vec4<u32>>(vec4<f32>(filter_.r_xx, filter_.r_xy, filter_.r_yy, filter_.gain)));
    return filtered_;
}

fn filter_in(record: SplatRecord) -> Filter {
    let place = bitcast<vec4<f32>>(each_word(record[4]));
    let shape = bitcast<vec4<f32>>(each_word(record[5]));
    return Filter(place.x, place.y, place.z, place.w, shape.x, shape.y, shape.z, shape.w);
}

// The least depth of the fragments that the filter adds, device units.
fn least_filtered(filter_: Filter) -> f32 {
    return select(3e38, filter_.depth_low, filter_.gain > 0.0);
}

// The squared radius on the filter's ellipse.
fn filter_rho2(filter_: Filter, d: vec2<f32>) -> f32 {
    let x = d - vec2<f32>(filter_.center_x, filter_.center_y);
    let r = vec2<f32>(filter_.r_xx * x.x + filter_.r_xy * x.y, filter_.r_yy * x.y);
    return dot2(r, r);
}
