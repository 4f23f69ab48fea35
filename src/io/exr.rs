//! OpenEXR: linear f32 in one part, with the channels of each map named after it.
//!
//! | channels | values |
//! |---|---|
//! | `R` `G` `B` `A` | the colour, straight alpha |
//! | `depth.Z` | world units, +inf for background |
//! | `normal.X` `normal.Y` `normal.Z` | world space |
//! | `weight.Y`, `count.Y`, `decision.Y` | |
//!
//! The channels follow from [`MAPS`]. Files of versions before 0.2.0 have a
//! part for each map; they are read too.

use std::path::Path;

use exr::meta::MetaData;
use exr::prelude::*;

use super::atomic::write_whole;
use super::image::check;
use super::images::Sink;
use super::input::check_regular;
use crate::error::Error as EpsplatError;
use crate::frame::Frame;
use crate::scene::{MAPS, Map};

type Outcome<T> = crate::error::Result<T>;

/// Writes the colour and all maps of `frame`.
pub fn write(path: &Path, frame: &Frame) -> Outcome<()> {
    write_whole(path, |file| encode(file, frame))
}

/// Encodes the colour and all maps of `frame`.
pub(super) fn encode(sink: &mut dyn Sink, frame: &Frame) -> std::io::Result<()> {
    let size = Vec2(frame.width as usize, frame.height as usize);
    // Scan lines in increasing order, so that equal frames give equal files.
    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let plane = |k: usize| FlatSamples::F32(frame.color.iter().map(|c| c[k]).collect());
    let colors = ["R", "G", "B", "A"].into_iter().enumerate();
    let mut channels: Vec<_> = colors.map(|(k, name)| AnyChannel::new(Text::new_or_panic(name), plane(k))).collect();
    for map in frame.maps().iter() {
        let plane = |k: usize| match (frame.numbers(map), frame.map(map)) {
            (Some(numbers), _) => FlatSamples::U32(numbers.iter().skip(k).step_by(map.width()).copied().collect()),
            (None, values) => {
                FlatSamples::F32(values.into_iter().flatten().skip(k).step_by(map.width()).copied().collect())
            }
        };
        let named = map.row().channels.iter().enumerate();
        channels.extend(named.map(|(k, name)| AnyChannel::new(Text::new_or_panic(channel_name(map, name)), plane(k))));
    }
    let channels = AnyChannels::sort(channels.into_iter().collect());
    let layer = Layer::new(size, LayerAttributes::default(), encoding, channels);
    let image = Image::from_layer(layer);
    image.write().to_buffered(sink).map_err(std::io::Error::other)
}

/// Returns the name of one of a map's channels.
fn channel_name(map: Map, channel: &str) -> String {
    format!("{}.{channel}", map.row().name)
}

/// Reads the channels that [`write()`] writes, in one part or in a part for each map; others are
/// ignored.
///
/// The colour is the part `color`, or else the first part with R, G and B.
pub fn read(path: &Path) -> Outcome<Frame> {
    // The exr crate wraps a missing file in its own error; checking first gives the usual message.
    check_regular(path).and_then(|()| std::fs::File::open(path).map(drop)).map_err(|e| EpsplatError::read(path, e))?;
    let unreadable = |e: Error| EpsplatError::malformed(path, format!("not a readable EXR: {e}"));
    let metadata = MetaData::read_from_file(path, false).map_err(unreadable)?;
    for header in &metadata.headers {
        // Each channel takes 4 bytes in the decoded image, and 4 in the frame.
        let channels: u64 = metadata.headers.iter().map(|header| header.channels.list.len() as u64).sum();
        check(path, (header.layer_size.0 as u64, header.layer_size.1 as u64), 8 * channels)?;
    }
    let image = read_all_flat_layers_from_file(path).map_err(unreadable)?;
    let size = image.attributes.display_window.size;
    let pixels = size.0 * size.1;
    let mut frame = Frame::of_colors(size.0 as u32, size.1 as u32, Vec::new());
    for layer in &image.layer_data {
        if layer.size != size {
            return Err(EpsplatError::malformed(path, "its layers differ in size"));
        }
        let part = layer.attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default();
        let channels = &layer.channel_data.list;
        for map in MAPS.iter().map(|row| row.map) {
            if let Some(values) = map_values(channels, map, part == map.row().name, pixels) {
                frame = frame.with(map, values);
            }
        }
        let is_first = frame.color.is_empty() && part.parse::<Map>().is_err();
        if let Some(colors) = (part == "color" || is_first).then(|| colors(channels, pixels)).flatten() {
            frame.color = colors;
        }
    }
    if frame.color.len() != pixels {
        return Err(EpsplatError::malformed(path, "it has no layer with the channels R, G and B"));
    }
    Ok(frame)
}

/// Returns the channel with this name, in capitals or not.
fn channel<'a>(channels: &'a [AnyChannel<FlatSamples>], name: &str) -> Option<&'a FlatSamples> {
    channels.iter().find(|channel| channel.name.eq_case_insensitive(name)).map(|channel| &channel.sample_data)
}

/// Returns the colours of a part; `None` if it lacks R, G or B. A missing alpha is 1.
fn colors(channels: &[AnyChannel<FlatSamples>], pixels: usize) -> Option<Vec<[f32; 4]>> {
    let plane = |name: &str| Some(channel(channels, name)?.values_as_f32().collect::<Vec<_>>());
    let (r, g, b) = (plane("R")?, plane("G")?, plane("B")?);
    let a = plane("A").unwrap_or_else(|| vec![1.0; pixels]);
    Some((0..pixels).map(|i| [r[i], g[i], b[i], a[i]]).collect())
}

/// Returns the values of a map; `None` if one of its channels is missing. The `part` may be that of
/// the map alone, whose channels are not prefixed.
fn map_values(channels: &[AnyChannel<FlatSamples>], map: Map, is_part: bool, pixels: usize) -> Option<Vec<f32>> {
    let plane = |name: &&str| -> Option<Vec<f32>> {
        let own = || is_part.then(|| channel(channels, name)).flatten();
        match channel(channels, &channel_name(map, name)).or_else(own)? {
            // A frame stores whole numbers as the bits of f32.
            FlatSamples::U32(numbers) if map.row().numbers => {
                Some(numbers.iter().copied().map(f32::from_bits).collect())
            }
            _ if map.row().numbers => None,
            samples => Some(samples.values_as_f32().collect()),
        }
    };
    let planes = map.row().channels.iter().map(plane).collect::<Option<Vec<_>>>()?;
    Some((0..pixels).flat_map(|pixel| planes.iter().map(move |plane| plane[pixel])).collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn every_map_comes_back_and_equal_frames_make_equal_files() {
        let ramp = |n: usize, k: f32| (0..n).map(|i| i as f32 * k).collect::<Vec<_>>();
        let n = 7 * 5;
        let mut depth = ramp(n, 0.1);
        depth[3] = f32::INFINITY;
        let color = ramp(n, 0.01).into_iter().map(|v| [v, 1.0 - v, -v, 0.5]).collect();
        let maps = MAPS.iter().map(|row| (row.map, ramp(n * row.map.width(), 1e-7)));
        let frame = maps.fold(Frame::of_colors(7, 5, color), |frame, (map, values)| frame.with(map, values));
        // Whole numbers whose bits are NaN as f32, such as the number of the background.
        let names = (0..2 * n as u32).map(|k| f32::from_bits(u32::MAX - k)).collect();
        let frame = frame.with(Map::Depth, depth).with(Map::Index, names);
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a.exr"), folder.path().join("b.exr"));
        write(&a, &frame).unwrap();
        write(&b, &frame).unwrap();
        assert_eq!(read(&a).unwrap(), frame);
        assert_eq!(std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
    }
}
