//! How a frame lies in a buffer on the device.

use std::collections::BTreeMap;

use super::encode::no_device;
use super::{Backend, encoded};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::plan::{NO_MAP, PixelLayout};
use crate::scene::{Camera, MAPS, Map};

/// The values of the colour or of a map in a buffer of u32 words: value `k` of the pixel in column
/// `x` and row `y` is the word `first + (y * width + x) * stride + k`, counted from the byte at
/// which the frame starts. The values are f32, except those of integer maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plane {
    /// The word of the first pixel's first value.
    pub first: u32,
    /// Words from one pixel to the next.
    pub stride: u32,
    /// Values per pixel.
    pub values: u32,
}

/// How a frame lies in a buffer on the device: records of a few words for each pixel, row by row
/// from the top. Maps that are made with other options than the colour (with several samples per
/// pixel, or in transparent pictures) have records of their own behind those of the colour.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameLayout {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Size of the frame, bytes.
    pub bytes: u64,
    /// Linear RGB and straight alpha, in the first four words.
    pub color: Plane,
    /// The maps.
    pub maps: BTreeMap<Map, Plane>,
    /// Whether the colours are sRGB codes from 0 to 1, as those of Gaussians, and not linear.
    pub codes: bool,
}

/// The device of a backend.
pub(super) fn on_device(backend: &Backend) -> Result<&Gpu> {
    match backend {
        Backend::Gpu { gpu, .. } => Ok(gpu),
        Backend::Reference => Err(no_device()),
    }
}

impl FrameLayout {
    /// The layout of a frame of `camera` whose parts have `pixels`; the first has the colour.
    pub(super) fn new(camera: &Camera, codes: bool, pixels: &[PixelLayout]) -> Result<Self> {
        let color = Plane { first: 0, stride: 4, values: 4 };
        let (&Camera { width, height, .. }, maps) = (camera, BTreeMap::new());
        let mut layout = Self { width, height, bytes: 0, color, maps, codes };
        pixels.iter().try_for_each(|pixel| layout.add(pixel))?;
        Ok(layout)
    }

    fn add(&mut self, pixel: &PixelLayout) -> Result<()> {
        let stride = pixel.image_words;
        let too_large = || Error::Usage("the frame has too many words for a buffer: choose a smaller image".into());
        let first = u32::try_from(self.bytes / 4).map_err(|_| too_large())?;
        if first == 0 {
            self.color.stride = stride;
        }
        for (row, word) in MAPS.iter().zip(pixel.map_words).filter(|(_, word)| *word != NO_MAP) {
            let plane = Plane { first: first + word, stride, values: row.map.width() as u32 };
            self.maps.insert(row.map, plane);
        }
        self.bytes += 4 * u64::from(stride) * u64::from(self.width) * u64::from(self.height);
        Ok(())
    }

    /// Checks that `buffer` takes the frame from byte `first` on.
    pub(super) fn check(&self, buffer: &wgpu::Buffer, first: u64) -> Result<()> {
        let fault = if !buffer.usage().contains(wgpu::BufferUsages::COPY_DST) {
            "lacks the usage COPY_DST".to_owned()
        } else if !first.is_multiple_of(4) {
            format!("is to be written from byte {first} on, which is no multiple of 4")
        } else if buffer.size() < first.saturating_add(self.bytes) {
            format!("has {} bytes, but the frame has {} from byte {first} on", buffer.size(), self.bytes)
        } else {
            return Ok(());
        };
        Err(Error::Usage(format!("the buffer for the frame {fault}: make it by the renderer's layout")))
    }

    /// Returns the frame whose bytes a program has read back.
    ///
    /// # Errors
    /// [`Error::Usage`] if there are too few bytes.
    pub fn frame(&self, bytes: &[u8]) -> Result<Frame> {
        if (bytes.len() as u64) < self.bytes {
            return Err(Error::Usage(format!("the frame has {} bytes, not {}", self.bytes, bytes.len())));
        }
        let pixels = self.width as usize * self.height as usize;
        let word = |word: usize| bytemuck::pod_read_unaligned::<f32>(&bytes[4 * word..4 * word + 4]);
        let value =
            |plane: &Plane, pixel: usize, k: usize| word(plane.first as usize + pixel * plane.stride as usize + k);
        let color = (0..pixels).map(|pixel| std::array::from_fn(|k| value(&self.color, pixel, k))).collect();
        let mut frame = Frame::of_colors(self.width, self.height, color);
        for (map, plane) in &self.maps {
            let values = (0..pixels).flat_map(|pixel| (0..map.width()).map(move |k| value(plane, pixel, k)));
            frame = frame.with(*map, values.collect());
        }
        if self.codes {
            encoded::decode(&mut frame);
        }
        Ok(frame)
    }
}
