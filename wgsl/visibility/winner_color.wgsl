// A pixel has the colour of its nearest fragment. Same interface as winner_constant.wgsl.
// #import nearest_color|winner_second::{winning_word}
// #import srgb::{premultiplied_of}

fn resolve_color(pixel: u32, weight: f32) -> vec4<f32> {
    return premultiplied_of(winning_word(pixel));
}
