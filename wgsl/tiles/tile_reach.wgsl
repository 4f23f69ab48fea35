// Decides whether a splat may have fragments in a square of pixels. The tests are conservative, so
// no image depends on them.
// #import filter|lowpass_none::{Filter}
// #import footprint::{Rectangle, reach}
// #import layout::{Splat}
// #import occlusion::{HIDES, nearest_reached}
// #import tile_*::{misses}
// #import vectors::{dot2}

// An affine map over a rectangle of pixels: its value at the middle, and its changes toward the
// right and the lower edge.
struct Span {
    middle: vec2<f32>,
    right: vec2<f32>,
    down: vec2<f32>,
    // A bound on its rounding at any of the pixels.
    slack: f32,
}

fn span(x: vec2<f32>, y: vec2<f32>, rest: vec2<f32>, low: vec2<f32>, high: vec2<f32>) -> Span {
    let middle = 0.5 * (low + high);
    let half = 0.5 * (high - low);
    let most = max(abs(low), abs(high));
    let magnitude = abs(x) * most.x + abs(y) * most.y + abs(rest);
    return Span(x * middle.x + y * middle.y + rest, x * half.x, y * half.y, 4e-6 * (magnitude.x + magnitude.y));
}

// The largest distance of a value of the map from its value at the middle: the map is affine, so it
// occurs at a corner.
fn half_width(s: Span) -> f32 {
    let one = s.right + s.down;
    let other = s.right - s.down;
    return s.slack + sqrt(max(dot2(one, one), dot2(other, other)));
}

// An upper bound on the length of the map's values.
fn longest(s: Span) -> f32 {
    return (sqrt(dot2(s.middle, s.middle)) + half_width(s)) * (1.0 + 2e-6);
}

// Whether all values of the map are longer than `length`.
fn exceeds(s: Span, length: f32) -> bool {
    let shortest = length + half_width(s);
    return dot2(s.middle, s.middle) * (1.0 - 2e-6) > shortest * shortest;
}

// Whether the splat may have a fragment no deeper than `deepest` in the square of `side` pixels
// whose first pixel is `first`.
fn reaches(splat: Splat, filter_: Filter, first: vec2<u32>, side: u32, deepest: f32) -> bool {
    let extent = reach(splat);
    let pixels = Rectangle(max(extent.first, first), min(extent.last, first + (side - 1u)));
    return all(pixels.first <= pixels.last)
        && (HIDES == 0u || nearest_reached(splat, filter_, pixels) <= deepest)
        && !misses(splat, filter_, pixels);
}
