// Disks in tiles. Same interface as tile_curved.wgsl.
// #import camera_orthographic|perspective::{rim}
// #import filter|lowpass_none::{Filter}
// #import footprint::{Rectangle}
// #import layout::{Splat}
// #import tile_filter::{filter_misses}
// #import tile_reach::{exceeds, span}

// Whether the splat has no fragment at `pixels`, which lie in its bounds: the splat's ellipse
// misses the corners of its bounds.
fn misses(splat: Splat, filter_: Filter, pixels: Rectangle) -> bool {
    let low = vec2<f32>(vec2<i32>(pixels.first) - vec2<i32>(splat.anchor_x, splat.anchor_y));
    let high = vec2<f32>(vec2<i32>(pixels.last) - vec2<i32>(splat.anchor_x, splat.anchor_y));
    let disk = span(
        vec2<f32>(splat.a[0] + splat.a_low[0], splat.b[0]),
        vec2<f32>(splat.a[1] + splat.a_low[1], splat.b[1]),
        vec2<f32>(splat.a[2] + splat.a_low[2], splat.b[2]),
        low,
        high,
    );
    let c = span(vec2<f32>(splat.c[0], 0.0), vec2<f32>(splat.c[1], 0.0), vec2<f32>(splat.c[2], 0.0), low, high);
    let most = c.middle.x + abs(c.right.x) + abs(c.down.x) + c.slack;
    return exceeds(disk, rim(most)) && filter_misses(filter_, low, high);
}
