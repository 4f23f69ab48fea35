// What a pixel's list shows: layers.wgsl or sorted.wgsl composites it from front to back, at once, or in rounds (long_lists.wgsl).

// How far a list is composited.
struct Compositing {
    shown: Shown,
    // No layer has a fragment that is deeper than this, of a front and of a back.
    told: vec2<f32>,
    // The nearest fragment of those that are left, at which a surface starts; the end of the list when nothing more shows.
    first: u32,
    // Where a surface is begun, whose sums are there: the next fragment that may be of it, and how far it goes. Else not beyond `first`.
    key: u32,
    farthest: f32,
}

fn begun(list: vec2<u32>) -> Compositing {
    return Compositing(shown_nothing(), vec2<f32>(-1.0), list.x, list.x, 0.0);
}

// The maps of the pixel's surfaces are at `out`.
fn composite(pixel: u32, out: u32, x: u32, y: u32) -> Shown {
    let list = list_of(pixel);
    if (is_long(list)) {
        return composited(list);
    }
    return composite_on(begun(list), list.y, out, x, y).shown;
}
