// Composites a pixel's list from front to back (layers.wgsl or sorted.wgsl): at once, or over
// several dispatches (long_lists.wgsl).
// #import fragments::{list_of}
// #import join_lists::{with_triangle}
// #import layers|sorted::{composite_on}
// #import long_lists::{composited, is_long}
// #import resolve_lists::{Shown, shown_nothing}

// The state of compositing a list.
struct Compositing {
    shown: Shown,
    // The depths up to which layers have consumed the fragments that show a front (x) or a back
    // (y).
    told: vec2<f32>,
    // The nearest remaining fragment, at which a surface starts; the end of the list if nothing
    // more shows.
    first: u32,
    // While a surface is being summed, `key` is the next fragment that may belong to the surface,
    // and `farthest` is the depth up to which the surface reaches so far. Otherwise `key` is not
    // beyond `first`.
    key: u32,
    farthest: f32,
    // Whether the pixel's triangle is among what is shown.
    joined: bool,
}

fn begun(list: vec2<u32>) -> Compositing {
    return Compositing(shown_nothing(), vec2<f32>(-1.0), list.x, list.x, 0.0, false);
}

// Composites the list of the pixel (x, y), and writes the maps of its surfaces at `out`.
fn composite(pixel: u32, out: u32, x: u32, y: u32) -> Shown {
    let list = list_of(pixel);
    if (is_long(list)) {
        return composited(list);
    }
    return composite_on(begun(list), list.y, out, x, y).shown;
}

// Composites the pixel's triangle behind what is shown.
fn with_joined(before: Compositing, depth: f32, out: u32, x: u32, y: u32) -> Compositing {
    var so_far = before;
    so_far.joined = true;
    so_far.shown = with_triangle(so_far.shown, depth, out, x, y);
    return so_far;
}
