//! Frames without a header: four bytes a pixel, sRGB with straight alpha.

use std::io;

use super::{Image, Sink};
use crate::io::png::srgb_bytes;

pub(super) fn encode(sink: &mut dyn Sink, image: &Image<'_>) -> io::Result<()> {
    sink.write_all(&srgb_bytes(&image.frame.color))
}
