//! Formats of rendered images: one row of a table and one file each.

mod array;
mod depth;
#[cfg(feature = "textures")]
mod jpeg;
mod raw;
#[cfg(feature = "geotiff")]
pub mod tiff;
#[cfg(feature = "arrays")]
mod zipped;

use std::io::{self, Cursor, Seek, Write};
use std::path::Path;
use std::str::FromStr;

use super::atomic::write_whole;
use super::place::Place;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::scene::{Map, Maps};

/// A format of images: a row of the table.
#[derive(Clone, Copy, Debug)]
pub struct ImageFormat(&'static Row);

/// The data of an image that a file gets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Content {
    /// The colour alone.
    Color,
    /// One map in place of the colour.
    Map(Map),
    /// The depth as 16-bit integers: depth times this scale, rounded; 0 where nothing is visible.
    ScaledDepth(f64),
    /// The colour and all maps.
    All,
}

/// An image to write: a frame and the part of it that the file gets.
#[derive(Clone, Copy)]
pub struct Image<'a> {
    /// The colour and the maps.
    pub frame: &'a Frame,
    /// The part that is written.
    pub content: Content,
    /// Where the image lies on the earth, if it is a map.
    pub place: Option<&'a Place>,
}

/// A file or memory that images are encoded into.
pub trait Sink: Write + Seek {}

impl<T: Write + Seek> Sink for T {}

/// The name, content and writer of a format.
#[derive(Debug)]
struct Row {
    name: &'static str,
    extensions: &'static [&'static str],
    /// The content of a file without maps.
    about: &'static str,
    /// Whether several images in one stream can be told apart.
    streams: bool,
    /// The extension of a world file beside the image, which gives a map its place; None if the
    /// format holds the place itself, or other programs read no such file.
    world: Option<&'static str>,
    /// The content for these maps and this depth scale.
    content: fn(Maps, Option<f64>) -> Result<Content, &'static str>,
    encode: fn(&mut dyn Sink, &Image<'_>) -> io::Result<()>,
}

/// All formats that this build writes.
static FORMATS: &[Row] = &[
    Row {
        name: "png",
        extensions: &["png"],
        about: "8-bit sRGB, straight alpha",
        streams: true,
        world: Some("pgw"),
        content: depth::content,
        encode: depth::encode,
    },
    #[cfg(feature = "exr")]
    Row {
        name: "exr",
        extensions: &["exr"],
        about: "linear f32, with every map as channels",
        streams: false,
        world: None,
        content: |_, scale| whole(scale),
        encode: |sink, image| super::exr::encode(sink, image.frame),
    },
    #[cfg(feature = "textures")]
    Row {
        name: "jpg",
        extensions: &["jpg", "jpeg"],
        about: "8-bit sRGB over white, quality 95",
        streams: true,
        world: Some("jgw"),
        content: |maps, scale| color_alone(maps, scale, "a JPEG holds no maps: use an .exr or .npz output with --aov"),
        encode: jpeg::encode,
    },
    Row {
        name: "npy",
        extensions: &["npy"],
        about: "linear f32 (H, W, 4), or with one map of --aov that map",
        streams: true,
        world: None,
        content: |maps, scale| color_or_map(maps, scale, "an .npy file holds one array: give one map, or use .npz"),
        encode: array::encode,
    },
    #[cfg(feature = "arrays")]
    Row {
        name: "npz",
        extensions: &["npz"],
        about: "an array for the colour and for each map, by name",
        streams: false,
        world: None,
        content: |_, scale| whole(scale),
        encode: zipped::encode,
    },
    #[cfg(feature = "geotiff")]
    Row {
        name: "tif",
        extensions: &["tif", "tiff"],
        about: "8-bit sRGB, straight alpha, or with one map of --aov that map in f32",
        streams: false,
        world: None,
        content: tiff::content,
        encode: tiff::encode,
    },
    Row {
        name: "raw",
        extensions: &["raw", "rgba"],
        about: "four bytes a pixel, as a PNG has them, without a header",
        streams: true,
        world: None,
        content: |maps, scale| {
            color_alone(maps, scale, "raw frames hold no maps: use an .exr or .npz output with --aov")
        },
        encode: raw::encode,
    },
];

/// The fault of a depth scale that nothing uses.
const UNUSED_SCALE: &str = "--depth-scale is for a .png of depth: give it with --aov depth and a .png output";

#[cfg(any(feature = "arrays", feature = "exr"))]
fn whole(scale: Option<f64>) -> Result<Content, &'static str> {
    if scale.is_some() { Err(UNUSED_SCALE) } else { Ok(Content::All) }
}

fn color_alone(maps: Maps, scale: Option<f64>, fault: &'static str) -> Result<Content, &'static str> {
    match (maps.is_empty(), scale) {
        (_, Some(_)) => Err(UNUSED_SCALE),
        (true, None) => Ok(Content::Color),
        (false, None) => Err(fault),
    }
}

fn color_or_map(maps: Maps, scale: Option<f64>, fault: &'static str) -> Result<Content, &'static str> {
    match (scale, maps.len(), maps.iter().next()) {
        (Some(_), ..) => Err(UNUSED_SCALE),
        (None, 0, _) => Ok(Content::Color),
        (None, 1, Some(map)) => Ok(Content::Map(map)),
        _ => Err(fault),
    }
}

impl PartialEq for ImageFormat {
    fn eq(&self, other: &Self) -> bool {
        self.0.name == other.0.name
    }
}

impl ImageFormat {
    /// PNG, the default.
    pub const PNG: Self = Self(&FORMATS[0]);

    /// The names of all formats.
    pub fn names() -> impl Iterator<Item = &'static str> {
        FORMATS.iter().map(|row| row.name)
    }

    /// Returns the format that a file's extension (upper or lower case) names.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if no format has the extension.
    pub fn of_path(path: &Path) -> Result<Self> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        let row = FORMATS.iter().find(|row| row.extensions.contains(&extension.as_str()));
        row.map(Self).ok_or_else(|| {
            let all: Vec<_> = FORMATS.iter().map(|row| format!(".{}", row.extensions[0])).collect();
            let (last, others) = all
                .split_last()
                .map_or((String::new(), String::new()), |(last, others)| (last.clone(), others.join(", ")));
            Error::Usage(format!("the output must end in {others} or {last}, {} does not", path.display()))
        })
    }

    /// The name of the format, which is also its usual extension.
    pub fn name(self) -> &'static str {
        self.0.name
    }

    /// One line about the files of this format.
    pub fn about(self) -> &'static str {
        self.0.about
    }

    /// Whether several images in one stream can be told apart.
    pub fn streams(self) -> bool {
        self.0.streams
    }

    /// The extension of the world file beside a map.
    pub fn world(self) -> Option<&'static str> {
        self.0.world
    }

    /// Returns the content of a file of an image with `maps`, by a scale of depths if one is given.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if the format cannot store the maps.
    pub fn content(self, maps: Maps, depth_scale: Option<f64>) -> Result<Content> {
        (self.0.content)(maps, depth_scale).map_err(|fault| Error::Usage(fault.into()))
    }

    /// Writes an image to the file at `path`, which appears whole or not at all.
    ///
    /// # Errors
    ///
    /// [`Error::Write`] where the system cannot write, or if a value does not fit the format.
    pub fn write(self, path: &Path, image: &Image<'_>) -> Result<()> {
        write_whole(path, |file| (self.0.encode)(file, image))
    }

    /// Encodes an image in memory.
    ///
    /// # Errors
    ///
    /// As [`write`](Self::write), with `path` as the name of the output.
    pub fn encoded(self, path: &Path, image: &Image<'_>) -> Result<Vec<u8>> {
        let mut bytes = Cursor::new(Vec::new());
        (self.0.encode)(&mut bytes, image).map_err(|error| Error::write(path, error))?;
        Ok(bytes.into_inner())
    }
}

impl FromStr for ImageFormat {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let row = FORMATS.iter().find(|row| row.name == text);
        row.map(Self).ok_or_else(|| {
            let names = Self::names().collect::<Vec<_>>().join(", ");
            Error::Usage(format!("images are written as {names}, not as {text:?}"))
        })
    }
}
