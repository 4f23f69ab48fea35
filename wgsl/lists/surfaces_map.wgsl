// The map of the depth and alpha of the nearest composited surfaces.
// All loops end, by 1 of src/gpu/loops.rs: 0x1c9f1128f46445c5
// #import image_*::{image}
// #import layout::{NOTHING, held}

override SURFACES_IMAGE: u32;

// SURFACES in src/scene/maps.rs.
const SURFACES: u32 = 8u;

// `depth` is in device units.
fn write_surface(out: u32, number: u32, depth: f32, alpha: f32) {
    if (number < SURFACES) {
        image[out + SURFACES_IMAGE + 2u * number] = depth * held.world;
        image[out + SURFACES_IMAGE + 2u * number + 1u] = alpha;
    }
}

// Fills the surfaces from `first` on, which do not exist: depth +inf, alpha 0.
fn write_no_surfaces(out: u32, first: u32) {
    for (var number = first; number < SURFACES; number++) {
        image[out + SURFACES_IMAGE + 2u * number] = bitcast<f32>(NOTHING ^ held.zero);
        image[out + SURFACES_IMAGE + 2u * number + 1u] = 0.0;
    }
}
