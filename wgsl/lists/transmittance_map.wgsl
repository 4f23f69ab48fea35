// #import image_*::{image}

override TRANSMITTANCE_IMAGE: u32;

fn write_transmittance(out: u32, transmittance: f32) {
    image[out + TRANSMITTANCE_IMAGE] = transmittance;
}
