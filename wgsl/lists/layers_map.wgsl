// The map of the number of layers. Same interface as layers_map_absent.wgsl.
// #import image_*::{image}

override LAYERS_IMAGE: u32;

fn write_layers(out: u32, layers: u32) {
    image[out + LAYERS_IMAGE] = f32(layers);
}
