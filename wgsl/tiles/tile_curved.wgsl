// Caps in tiles. Same interface as tile_flat.wgsl.
// #import curved::{extremes}
// #import filter|lowpass_none::{Filter}
// #import footprint::{Rectangle}
// #import layout::{Splat}
// #import tile_filter::{filter_misses}
// #import tile_reach::{exceeds, longest, span}

// Whether the splat has no fragment at `pixels`, which lie in its bounds. A ray meets the plane of
// a height h over the disk's plane where (u, v) (D_w + spread W) = (U, V) D_w - W (D_u, D_v) + h N,
// with N = (D_u, D_v) + spread (U, V); both sides are affine in the pixel. The cap lies between its
// least and its largest height, so the right side for the mean of these heights is off by at most
// half their difference times |N|.
fn misses(splat: Splat, filter_: Filter, pixels: Rectangle) -> bool {
    let low = vec2<f32>(vec2<i32>(pixels.first) - vec2<i32>(splat.anchor_x, splat.anchor_y));
    let high = vec2<f32>(vec2<i32>(pixels.last) - vec2<i32>(splat.anchor_x, splat.anchor_y));
    let along = vec3<f32>(splat.a_low[0], splat.a_low[1], splat.a_low[2]);
    let heights = extremes(splat.cap.heights);
    let middle = 0.5 * (heights.x + heights.y);
    let spread = splat.cap.spread;
    let x = vec3<f32>(splat.a[0], splat.b[0], splat.c[0]);
    let y = vec3<f32>(splat.a[1], splat.b[1], splat.c[1]);
    let rest = vec3<f32>(splat.a[2], splat.b[2], splat.c[2]);
    let turn = span(spread * x.xy, spread * y.xy, along.xy + spread * rest.xy, low, high);
    let scale = span(vec2<f32>(spread * x.z, 0.0), vec2<f32>(spread * y.z, 0.0), vec2<f32>(along.z + spread * rest.z, 0.0), low, high);
    var at = span(
        x.xy * along.z - x.z * along.xy + middle * spread * x.xy,
        y.xy * along.z - y.z * along.xy + middle * spread * y.xy,
        rest.xy * along.z - rest.z * along.xy + middle * (along.xy + spread * rest.xy),
        low,
        high,
    );
    // These rows are differences, which round relative to the magnitude of the products.
    let most = max(abs(low), abs(high));
    let size = abs(x) * most.x + abs(y) * most.y + abs(rest);
    let sideways = abs(along.x) + abs(along.y);
    at.slack += 4e-6 * (size.x + size.y) * (abs(along.z) + abs(middle) * spread)
        + 4e-6 * sideways * (size.z + abs(middle));
    // Where a ray touches the cap, its root is exact only to the square root of f32's precision: a
    // margin of a thousandth covers that.
    return exceeds(at, 1.001 * (longest(scale) + 0.5 * (heights.y - heights.x) * longest(turn)))
        && filter_misses(filter_, low, high);
}
