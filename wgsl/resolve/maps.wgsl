// The maps of a pixel, which follow its colour in the image. A map that was not requested has no
// words in the image, and its values are not written. The numbers of
// fragments (count.wgsl) and of points (index.wgsl) have files of their own.
// All loops end, by 1 of src/gpu/loops.rs: 0x80bf639daa06c917
// #import image_*::{write_value}
// #import layout::{NOTHING, held}

// The first word of each map in a pixel of the image, or NO_MAP.
override DEPTH_IMAGE: u32;
override NORMAL_IMAGE: u32;
override WEIGHT_IMAGE: u32;
override TRANSMITTANCE_IMAGE: u32;
override LAYERS_IMAGE: u32;
override TAIL_IMAGE: u32;
override TEXZ_IMAGE: u32;
override SURFACES_IMAGE: u32;

// NO_MAP in src/plan/pixel.rs.
const NO_MAP: u32 = 0xffffffffu;

// SURFACES in src/scene/maps.rs.
const SURFACES: u32 = 8u;

// Writes the `k`th value of the map at `word`.
fn write_map(out: u32, word: u32, k: u32, value: f32) {
    if (word != NO_MAP) {
        write_value(out + word + k, value);
    }
}

// An empty pixel has depth +inf.
fn no_depth() -> f32 {
    return bitcast<f32>(NOTHING ^ held.zero);
}

// Converts a depth from device units to world units, and writes it.
fn write_depth(out: u32, depth: f32) {
    write_map(out, DEPTH_IMAGE, 0u, depth * held.world);
}

fn write_no_depth(out: u32) {
    write_map(out, DEPTH_IMAGE, 0u, no_depth());
}

fn write_normal(out: u32, normal: vec3<f32>) {
    for (var k = 0u; k < 3u; k++) {
        write_map(out, NORMAL_IMAGE, k, normal[k]);
    }
}

fn write_weight(out: u32, weight: f32) {
    write_map(out, WEIGHT_IMAGE, 0u, weight);
}

fn write_transmittance(out: u32, transmittance: f32) {
    write_map(out, TRANSMITTANCE_IMAGE, 0u, transmittance);
}

// The number of layers.
fn write_layers(out: u32, layers: u32) {
    write_map(out, LAYERS_IMAGE, 0u, f32(layers));
}

fn write_tail(out: u32, weight: f32) {
    write_map(out, TAIL_IMAGE, 0u, weight);
}

fn write_texz(out: u32, place: vec2<f32>, depth: f32) {
    write_map(out, TEXZ_IMAGE, 0u, place.x);
    write_map(out, TEXZ_IMAGE, 1u, place.y);
    write_map(out, TEXZ_IMAGE, 2u, depth * held.world);
}

fn write_no_texz(out: u32) {
    write_map(out, TEXZ_IMAGE, 0u, 0.0);
    write_map(out, TEXZ_IMAGE, 1u, 0.0);
    write_map(out, TEXZ_IMAGE, 2u, no_depth());
}

// Writes the depth and alpha of a composited surface. Surfaces are numbered from the nearest; the
// map holds the first SURFACES of them.
fn write_surface(out: u32, number: u32, depth: f32, alpha: f32) {
    if (number < SURFACES) {
        write_map(out, SURFACES_IMAGE, 2u * number, depth * held.world);
        write_map(out, SURFACES_IMAGE, 2u * number + 1u, alpha);
    }
}

// Fills the surfaces from `first` on, which do not exist: depth +inf, alpha 0.
fn write_no_surfaces(out: u32, first: u32) {
    for (var number = first; number < SURFACES; number++) {
        write_map(out, SURFACES_IMAGE, 2u * number, no_depth());
        write_map(out, SURFACES_IMAGE, 2u * number + 1u, 0.0);
    }
}
