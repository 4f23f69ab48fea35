// #import image_*::{image}
// #import layout::{NOTHING, held}
// #import texture::{mean_place}

override TEXZ_IMAGE: u32;

fn place_of_sums(sums_of: u32, weight: f32) -> vec2<f32> {
    return mean_place(sums_of, weight);
}

// `depth` is in device units.
fn write_texz(out: u32, place: vec2<f32>, depth: f32) {
    image[out + TEXZ_IMAGE] = place.x;
    image[out + TEXZ_IMAGE + 1u] = place.y;
    image[out + TEXZ_IMAGE + 2u] = depth * held.world;
}

fn write_no_texz(out: u32) {
    image[out + TEXZ_IMAGE] = 0.0;
    image[out + TEXZ_IMAGE + 1u] = 0.0;
    image[out + TEXZ_IMAGE + 2u] = bitcast<f32>(NOTHING ^ held.zero);
}
