// Resolves a pixel whose surfaces show through each other: composites the pixel's list (layers.wgsl
// or sorted.wgsl) over the background. Same interface as resolve_surface.wgsl.
// Twin: src/passes/layers.rs.
// #import compositing|peeled::{composite}
// #import image_*::{write_color}
// #import layout::{held, held_band}
// #import maps::{write_layers, write_no_surfaces, write_tail, write_transmittance}
// #import resolve::{IMAGE_WORDS, over, premultiplied_sample}

// LEAST_TRANSMITTANCE in src/scene/composite.rs.
const LEAST_TRANSMITTANCE: f32 = 9.31322574615478515625e-10;

// The result of compositing so far, from front to back.
struct Shown {
    // Premultiplied.
    color: vec4<f32>,
    transmittance: f32,
    layers: u32,
    // If the last layer is a tail, how much it shows: alpha times transmittance; else 0.
    tail: f32,
}

fn shown_nothing() -> Shown {
    return Shown(vec4<f32>(0.0), 1.0, 0u, 0.0);
}

// Composites a straight colour behind what is shown.
fn with_behind(shown: Shown, straight: vec4<f32>) -> Shown {
    let shows = shown.transmittance * straight.a;
    return Shown(
        shown.color + shows * vec4<f32>(straight.rgb, 1.0),
        shown.transmittance * (1.0 - straight.a),
        shown.layers + 1u,
        0.0,
    );
}

// Returns a straight colour.
fn over_background(shown: Shown) -> vec4<f32> {
    let alpha = shown.color.a;
    let color = select(vec3<f32>(0.0), shown.color.rgb / alpha, alpha > 0.0);
    return over(vec4<f32>(color, alpha), held.background);
}

fn resolve_pixel(sums_of: u32, pixel: u32, x: u32, y: u32) {
    let out = pixel * IMAGE_WORDS;
    let shown = composite(pixel, out, x, y);
    write_tail(out, shown.tail);
    write_color(out, over_background(shown));
    write_transmittance(out, shown.transmittance);
    write_layers(out, shown.layers);
    write_no_surfaces(out, shown.layers);
}

// Pictures with several samples have no maps, so this writes none.
fn sample_color(sums_of: u32, sample: u32, x: u32, row: u32) -> vec4<f32> {
    return premultiplied_sample(over_background(composite(sample, 0u, x, row + held_band.first_row)));
}
