// Evaluates a splat's record at a pixel. Every pass decides coverage, depth and rho by this file
// alone.
// Twin: src/passes/footprint.rs.
// #import camera_*::{within_lens}
// #import camera_orthographic|perspective::{Fragment}
// #import curved|facing|flat::{is_away, met}
// #import fade::{faded}
// #import filter|lowpass_none::{Filter}
// #import layout::{AWAY, Splat, held, held_band}
// #import side::{sided}

struct Rectangle {
    first: vec2<u32>,
    last: vec2<u32>,
}

fn bounds(splat: Splat) -> Rectangle {
    return Rectangle(
        vec2<u32>(splat.bounds_first & 0xffffu, splat.bounds_first >> 16u),
        vec2<u32>(splat.bounds_last & 0xffffu, (splat.bounds_last & ~AWAY) >> 16u),
    );
}

// The pixels of the band that the splat can reach; empty if `first` is past `last`.
fn reach(splat: Splat) -> Rectangle {
    let extent = bounds(splat);
    return Rectangle(
        vec2<u32>(extent.first.x, max(extent.first.y, held_band.first_row)),
        vec2<u32>(extent.last.x, min(extent.last.y, held_band.first_row + held_band.rows - 1u)),
    );
}

// A splat whose bounds hold more than LARGE pixels gets a workgroup, any other an invocation. One
// invocation with a hundred thousand pixels would hold up all others, and some drivers end its loop
// early: Mesa's llvmpipe silently does so after 65,535 rounds.
override LARGE: u32;

fn is_large(splat: Splat) -> bool {
    let extent = bounds(splat);
    let size = extent.last - extent.first + 1u;
    return all(extent.first <= extent.last) && size.x * size.y > LARGE;
}

// The queue of large splats, which project.wgsl wrote.
@group(0) @binding(13) var<storage, read> queued: array<u32>;
const QUEUE_START: u32 = 8u;
const TILE: u32 = 16u;

// The slot of the large splat at a place in the queue; past its end, a number that is no slot.
fn large_splat(place: u32) -> u32 {
    return select(0xffffffffu, queued[QUEUE_START + place], place < queued[0]);
}

fn footprint(splat: Splat, filter_: Filter, x: u32, y: u32) -> Fragment {
    let d = vec2<f32>(f32(i32(x) - splat.anchor_x), f32(i32(y) - splat.anchor_y));
    var fragment = within_lens(met(splat, filter_, d), x, y);
    fragment.depth = sided(fragment.depth, is_away(splat, fragment));
    return faded(fragment, splat.fade);
}

// A power of two that scales depths to (0, 1).
fn depth_scale() -> f32 {
    return 0.5 * bitcast<f32>(0x7f000000u - (bitcast<u32>(held.farthest) & 0x7f800000u));
}

// The number of pixels in the band; its buffers may be larger.
fn band_pixels() -> u32 {
    return held_band.rows * held.width;
}

// The index of the pixel in the band's buffers.
fn pixel_index(x: u32, y: u32) -> u32 {
    return (y - held_band.first_row) * held.width + x;
}
