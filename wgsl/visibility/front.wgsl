// The nearest depths that the visibility pass stored.
// #import layout::{kept_depth}

@group(0) @binding(7) var<storage, read> visible: array<u32>;

fn front_at(pixel: u32) -> f32 {
    return bitcast<f32>(kept_depth(visible[pixel]));
}
