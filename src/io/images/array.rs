//! Arrays of NumPy (`.npy`, version 1.0): C order, little endian.

use std::io::{self, Write};

use super::{Content, Image, Sink};
use crate::frame::Frame;
use crate::scene::Map;

/// Headers are padded to a multiple of this size, bytes.
const ALIGNMENT: usize = 64;

pub(super) fn encode(sink: &mut dyn Sink, image: &Image<'_>) -> io::Result<()> {
    let array = match image.content {
        Content::Map(map) => Array::of_map(image.frame, map),
        _ => Array::of_color(image.frame),
    };
    array.write(sink)
}

/// An array: rows from the top, pixels from the left, values of a pixel.
pub(super) struct Array<'a> {
    /// The type of the values: `<f4` or `<u4`.
    kind: &'static str,
    shape: String,
    /// The values; integers are stored in the bits of an f32.
    values: &'a [f32],
}

impl<'a> Array<'a> {
    pub fn of_color(frame: &'a Frame) -> Self {
        let shape = format!("({}, {}, 4)", frame.height, frame.width);
        Self { kind: "<f4", shape, values: bytemuck::cast_slice(&frame.color) }
    }

    /// The array of a map. Maps of one value a pixel have two dimensions.
    pub fn of_map(frame: &'a Frame, map: Map) -> Self {
        let kind = if map.row().numbers { "<u4" } else { "<f4" };
        let shape = match map.width() {
            1 => format!("({}, {})", frame.height, frame.width),
            width => format!("({}, {}, {width})", frame.height, frame.width),
        };
        Self { kind, shape, values: frame.map(map).unwrap_or_default() }
    }

    /// The header, with the magic bytes.
    fn header(&self) -> Vec<u8> {
        let text = format!("{{'descr': '{}', 'fortran_order': False, 'shape': {}, }}", self.kind, self.shape);
        let unpadded = 10 + text.len() + 1;
        let padding = unpadded.next_multiple_of(ALIGNMENT) - unpadded;
        let length = (text.len() + padding + 1) as u16;
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend(length.to_le_bytes());
        bytes.extend(text.as_bytes());
        bytes.resize(bytes.len() + padding, b' ');
        bytes.push(b'\n');
        bytes
    }

    /// The size of the file, bytes.
    #[cfg(feature = "arrays")]
    pub fn size(&self) -> u64 {
        self.header().len() as u64 + size_of_val(self.values) as u64
    }

    /// Writes the header and the values.
    pub fn write<W: Write + ?Sized>(&self, out: &mut W) -> io::Result<()> {
        out.write_all(&self.header())?;
        self.values.chunks(1 << 16).try_for_each(|part| {
            let bytes: Vec<[u8; 4]> = part.iter().map(|value| value.to_bits().to_le_bytes()).collect();
            out.write_all(bytes.as_flattened())
        })
    }
}
