//! OpenEXR: linear f32, each map a named layer of one file.
//!
//! | layer | channels |
//! |---|---|
//! | `color` | R G B A, straight alpha |
//! | `depth` | Z, world units, +inf where nothing is |
//! | `normal` | X Y Z, world space |
//! | `weight`, `count`, `decision` | Y |

use std::path::Path;

use exr::meta::MetaData;
use exr::prelude::*;

use super::atomic::write_whole;
use super::image::check;
use crate::error::Error as EpsplatError;
use crate::frame::Frame;

type Outcome<T> = crate::error::Result<T>;

/// Writes all maps of `frame`.
pub fn write(path: &Path, frame: &Frame) -> Outcome<()> {
    let size = Vec2(frame.width as usize, frame.height as usize);
    // Scan lines in order, so that equal frames make equal files.
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
    if let Some(depth) = &frame.depth {
        layers.push(layer("depth", vec![channel("Z", depth.clone())]));
    }
    if let Some(normal) = &frame.normal {
        let plane = |k: usize| normal.iter().map(|n| n[k]).collect::<Vec<_>>();
        layers.push(layer("normal", vec![channel("X", plane(0)), channel("Y", plane(1)), channel("Z", plane(2))]));
    }
    for (name, map) in [("weight", &frame.weight), ("count", &frame.count), ("decision", &frame.decision)] {
        if let Some(map) = map {
            layers.push(layer(name, vec![channel("Y", map.clone())]));
        }
    }
    let bounds = IntegerBounds::from_dimensions(size);
    let image = Image::from_layers(ImageAttributes::new(bounds), layers);
    write_whole(path, |file| image.write().to_buffered(file).map_err(std::io::Error::other))
}

/// Reads the layers that [`write()`] writes. The colour is the layer `color`, or the first with R, G and B if none is
/// called so; others are ignored.
pub fn read(path: &Path) -> Outcome<Frame> {
    // exr reports a missing file as an I/O error of its own kind; asking first keeps the sentence plain.
    std::fs::File::open(path).map_err(|e| EpsplatError::read(path, e))?;
    let unreadable = |e: Error| EpsplatError::malformed(path, format!("not a readable EXR: {e}"));
    let metadata = MetaData::read_from_file(path, false).map_err(unreadable)?;
    for header in &metadata.headers {
        // Four bytes a channel as it is read, and as many in the frame.
        let channels: u64 = metadata.headers.iter().map(|header| header.channels.list.len() as u64).sum();
        check(path, (header.layer_size.0 as u64, header.layer_size.1 as u64), 8 * channels)?;
    }
    let image = read_all_flat_layers_from_file(path).map_err(unreadable)?;
    let size = image.attributes.display_window.size;
    let pixels = size.0 * size.1;
    let mut frame = Frame {
        width: size.0 as u32,
        height: size.1 as u32,
        color: Vec::new(),
        depth: None,
        normal: None,
        weight: None,
        count: None,
        decision: None,
    };
    for layer in &image.layer_data {
        if layer.size != size {
            return Err(EpsplatError::malformed(path, "its layers differ in size"));
        }
        let channel = |name: &str| -> Option<Vec<f32>> {
            let channel = layer.channel_data.list.iter().find(|c| c.name.eq_case_insensitive(name))?;
            Some(channel.sample_data.values_as_f32().collect())
        };
        let name = layer.attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default();
        match name.as_str() {
            "depth" => frame.depth = channel("Z"),
            "normal" => {
                if let (Some(x), Some(y), Some(z)) = (channel("X"), channel("Y"), channel("Z")) {
                    frame.normal = Some((0..pixels).map(|i| [x[i], y[i], z[i]]).collect());
                }
            }
            "weight" => frame.weight = channel("Y"),
            "count" => frame.count = channel("Y"),
            "decision" => frame.decision = channel("Y"),
            name => {
                if name != "color" && !frame.color.is_empty() {
                    continue;
                }
                if let (Some(r), Some(g), Some(b)) = (channel("R"), channel("G"), channel("B")) {
                    let a = channel("A").unwrap_or_else(|| vec![1.0; pixels]);
                    frame.color = (0..pixels).map(|i| [r[i], g[i], b[i], a[i]]).collect();
                }
            }
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

    #[test]
    fn every_map_comes_back_and_equal_frames_make_equal_files() {
        let ramp = |n: usize, k: f32| (0..n).map(|i| i as f32 * k).collect::<Vec<_>>();
        let n = 7 * 5;
        let mut depth = ramp(n, 0.1);
        depth[3] = f32::INFINITY;
        let frame = Frame {
            width: 7,
            height: 5,
            color: ramp(n, 0.01).into_iter().map(|v| [v, 1.0 - v, -v, 0.5]).collect(),
            depth: Some(depth),
            normal: Some(ramp(n, 0.02).into_iter().map(|v| [v, 0.0, 1.0]).collect()),
            weight: Some(ramp(n, 3.0)),
            count: Some(ramp(n, 1.0)),
            decision: Some(ramp(n, 1e-7)),
        };
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a.exr"), folder.path().join("b.exr"));
        write(&a, &frame).unwrap();
        write(&b, &frame).unwrap();
        assert_eq!(read(&a).unwrap(), frame);
        assert_eq!(std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
    }
}
