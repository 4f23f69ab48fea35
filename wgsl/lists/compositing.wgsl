// Composites a pixel's list from front to back (layers.wgsl or sorted.wgsl): at once, or over
// several dispatches (long_lists.wgsl).
// #import fragments::{list_of}
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
}

fn begun(list: vec2<u32>) -> Compositing {
    return Compositing(shown_nothing(), vec2<f32>(-1.0), list.x, list.x, 0.0);
}

// Composites the list of the pixel (x, y), and writes the maps of its surfaces at `out`.
fn composite(pixel: u32, out: u32, x: u32, y: u32) -> Shown {
    let list = list_of(pixel);
    if (is_long(list)) {
        return composited(list);
    }
    return composite_on(begun(list), list.y, out, x, y).shown;
}
