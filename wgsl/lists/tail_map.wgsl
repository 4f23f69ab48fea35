// #import image_*::{image}

override TAIL_IMAGE: u32;

fn write_tail(out: u32, weight: f32) {
    image[out + TAIL_IMAGE] = weight;
}
