//! The format of a render's images, and where they are written.

use std::io::{ErrorKind, IsTerminal, Write};
use std::path::Path;

use epsplat::io::images::{Content, Image, ImageFormat};
use epsplat::io::place::Place;
use epsplat::{Error, Frame, Maps, Result};

use super::Arguments;
use super::arguments::FileArguments;

/// The path that stands for standard output.
pub(in super::super) const STANDARD: &str = "-";

/// The format and content of images, and whether they go to standard output.
pub(in super::super) struct Target {
    pub format: ImageFormat,
    content: Content,
    pub is_standard: bool,
}

impl Target {
    /// Returns the target of a single image.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if name, format and maps do not go together.
    pub fn of_one(arguments: &Arguments) -> Result<Self> {
        Self::of_picture(&arguments.output, &arguments.file, Maps::of(&arguments.options.maps.aov))
    }

    /// Returns the target of the image at `path` with `maps`.
    ///
    /// # Errors
    ///
    /// As [`Target::of_one`].
    pub fn of_picture(path: &Path, file: &FileArguments, maps: Maps) -> Result<Self> {
        let format = match (file.format, path == Path::new(STANDARD)) {
            (given, true) => given.unwrap_or(ImageFormat::PNG),
            (None, false) => ImageFormat::of_path(path)?,
            (Some(given), false) => match ImageFormat::of_path(path) {
                Ok(named) if named != given => {
                    return Err(Error::Usage(format!(
                        "{} names another format than --format {}: leave one of them out",
                        path.display(),
                        given.name()
                    )));
                }
                _ => given,
            },
        };
        Self::of_format((path, file), format, maps)
    }

    /// Returns the target of many images.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if format and maps do not go together.
    pub fn of_many(arguments: &Arguments) -> Result<Self> {
        let file = &arguments.file;
        let plain = arguments.options.maps.aov.is_empty() || file.depth_scale.is_some();
        let is_standard = arguments.output == Path::new(STANDARD);
        let default = || if plain || is_standard { Ok(ImageFormat::PNG) } else { "exr".parse() };
        let format = file.format.map_or_else(default, Ok)?;
        if is_standard && !format.streams() {
            return Err(Error::Usage(format!(
                "several {} images cannot be told apart on standard output: give --format raw, png, jpg or npy, or a folder",
                format.name()
            )));
        }
        Self::of_format((&arguments.output, file), format, Maps::of(&arguments.options.maps.aov))
    }

    fn of_format((path, file): (&Path, &FileArguments), format: ImageFormat, maps: Maps) -> Result<Self> {
        let content = format.content(maps, file.depth_scale)?;
        let is_standard = path == Path::new(STANDARD);
        if is_standard && std::io::stdout().is_terminal() {
            return Err(Error::Usage(
                "standard output is a terminal, which shows no image: give a file, or a pipe as in '-o - | program'"
                    .into(),
            ));
        }
        if is_standard && file.json.as_deref() == Some(Path::new(STANDARD)) {
            return Err(Error::Usage(
                "the image and the JSON would both go to standard output: give a file for one of them".into(),
            ));
        }
        Ok(Self { format, content, is_standard })
    }

    /// The part of an image that a file gets.
    pub fn content(&self) -> Content {
        self.content
    }

    /// Writes an image to the file at `path`, or to standard output.
    pub fn write(&self, path: &Path, frame: &Frame) -> Result<()> {
        self.write_map(path, frame, None)
    }

    /// Writes an image that lies at `place` on the earth.
    pub fn write_map(&self, path: &Path, frame: &Frame, place: Option<&Place>) -> Result<()> {
        let image = Image { frame, content: self.content, place };
        if !self.is_standard {
            return self.format.write(path, &image);
        }
        let bytes = self.format.encoded(path, &image)?;
        let mut out = std::io::stdout().lock();
        let written = out.write_all(&bytes).and_then(|()| out.flush());
        written.map_err(|error| Error::write(Path::new("standard output"), error))
    }

    /// Turns the error of a pipe that its reader has closed into success: the reader has all that
    /// it wants.
    pub fn closed_is_done(&self, outcome: Result<()>) -> Result<()> {
        match outcome {
            Err(Error::Write { source, .. }) if self.is_standard && source.kind() == ErrorKind::BrokenPipe => Ok(()),
            outcome => outcome,
        }
    }
}
