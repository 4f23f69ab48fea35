// Every surfel has one colour: nothing is stored, nothing is summed, and it comes out exactly.

fn color_of(index: u32) -> vec4<f32> {
    return vec4<f32>(0.0);
}

fn accumulate_color(word: u32, weight: u32, color: vec4<f32>) {}

fn resolve_color(word: u32, weight: f32) -> vec4<f32> {
    return view.color_low;
}
