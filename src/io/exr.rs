//! OpenEXR: linear f32, with each map as a named layer of one file.
//!
//! | layer | channels |
//! |---|---|
//! | `color` | R G B A, straight alpha |
//! | `depth` | Z, world units, +inf for background |
//! | `normal` | X Y Z, world space |
//! | `weight`, `count`, `decision` | Y |
//!
//! The layers follow from [`MAPS`](crate::scene::MAPS).

use std::path::Path;

use exr::meta::MetaData;
use exr::prelude::*;

use super::atomic::write_whole;
use super::image::check;
use super::input::check_regular;
use crate::error::Error as EpsplatError;
use crate::frame::Frame;
use crate::scene::Map;

type Outcome<T> = crate::error::Result<T>;

/// Writes the colour and all maps of `frame`.
pub fn write(path: &Path, frame: &Frame) -> Outcome<()> {
    let size = Vec2(frame.width as usize, frame.height as usize);
    // Scan lines in increasing order, so that equal frames give equal files.
    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let layer = |name: &str, channels: Vec<AnyChannel<FlatSamples>>| {
        let channels = AnyChannels::sort(channels.into_iter().collect());
        Layer::new(size, LayerAttributes::named(Text::new_or_panic(name)), encoding, channels)
    };
    let channel = |name: &str, values: Vec<f32>| AnyChannel::new(Text::new_or_panic(name), FlatSamples::F32(values));
    let plane = |k: usize| frame.color.iter().map(|c| c[k]).collect::<Vec<_>>();
    let mut layers = vec![layer(
        "color",
        vec![channel("R", plane(0)), channel("G", plane(1)), channel("B", plane(2)), channel("A", plane(3))],
    )];
    for map in frame.maps().iter() {
        let plane = |k: usize| match (frame.numbers(map), frame.map(map)) {
            (Some(numbers), _) => FlatSamples::U32(numbers.iter().skip(k).step_by(map.width()).copied().collect()),
            (None, values) => {
                FlatSamples::F32(values.into_iter().flatten().skip(k).step_by(map.width()).copied().collect())
            }
        };
        let channels = map.row().channels.iter().enumerate();
        let channels = channels.map(|(k, name)| AnyChannel::new(Text::new_or_panic(name), plane(k)));
        layers.push(layer(map.row().name, channels.collect()));
    }
    let bounds = IntegerBounds::from_dimensions(size);
    let image = Image::from_layers(ImageAttributes::new(bounds), layers);
    write_whole(path, |file| image.write().to_buffered(file).map_err(std::io::Error::other))
}

/// Reads the layers that [`write()`] writes; other layers are ignored.
///
/// The colour is the layer `color`, or else the first layer with R, G and B.
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
        let name = layer.attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default();
        let is_whole = name.parse::<Map>().is_ok_and(|map| map.row().numbers);
        let channel = |name: &str| -> Option<Vec<f32>> {
            let channel = layer.channel_data.list.iter().find(|c| c.name.eq_case_insensitive(name))?;
            Some(match &channel.sample_data {
                // A frame stores whole numbers as the bits of f32.
                FlatSamples::U32(numbers) if is_whole => numbers.iter().copied().map(f32::from_bits).collect(),
                _ if is_whole => return None,
                samples => samples.values_as_f32().collect(),
            })
        };
        if let Ok(map) = name.parse::<Map>() {
            if let Some(planes) = map.row().channels.iter().map(|name| channel(name)).collect::<Option<Vec<_>>>() {
                let values = (0..pixels).flat_map(|pixel| planes.iter().map(move |plane| plane[pixel]));
                frame = frame.with(map, values.collect());
            }
            continue;
        }
        if name != "color" && !frame.color.is_empty() {
            continue;
        }
        if let (Some(r), Some(g), Some(b)) = (channel("R"), channel("G"), channel("B")) {
            let a = channel("A").unwrap_or_else(|| vec![1.0; pixels]);
            frame.color = (0..pixels).map(|i| [r[i], g[i], b[i], a[i]]).collect();
        }
    }
    if frame.color.len() != pixels {
        return Err(EpsplatError::malformed(path, "it has no layer with the channels R, G and B"));
    }
    Ok(frame)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::MAPS;

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
