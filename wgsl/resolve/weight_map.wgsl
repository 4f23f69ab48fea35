// #import image_*::{image}

override WEIGHT_IMAGE: u32;

fn write_weight(out: u32, weight: f32) {
    image[out + WEIGHT_IMAGE] = weight;
}
