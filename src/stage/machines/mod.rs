//! Pictures that several processes draw. Either each draws a share of the scene and leaves a
//! [`Part`], and [`merge`] joins the parts of all: parts are bytes, so files, object stores or the
//! messages of a task system carry them. Or the processes of a network exchange values while they
//! draw ([`Renderer::frame_over`](crate::Renderer::frame_over)).
//!
//! ```text
//! depths  = merge(renderer.part(view, share, None) for all shares)
//! sums    = merge(renderer.part(view, share, Some(&depths)) for all shares)
//! picture = sums.picture(device)                                  the bits of renderer.frame(view)
//! ```

mod draw;
mod files;
mod header;
mod merge;
mod ranks;

use std::io::Write;
use std::path::{Path, PathBuf};

pub use self::merge::{Merged, merge, merge_files};
pub(super) use self::ranks::Drawing;
pub use self::ranks::Ranked;

use self::header::{Header, Holds};
use crate::error::{Error, Result};
use crate::io::atomic;
use crate::io::part::{Content, Section};

/// The work of one or more processes on a picture: the nearest depths of their shares of the scene,
/// or the sums of their shares within the nearest depths of all.
#[derive(Clone)]
pub struct Part {
    /// Its name in errors.
    name: PathBuf,
    header: Header,
    sections: Vec<Section>,
}

impl Part {
    /// Reads a part from a file.
    ///
    /// # Errors
    /// [`Error::Read`], or [`Error::Malformed`] for a file that is damaged, of another version or
    /// no part.
    pub fn read(path: &Path) -> Result<Self> {
        Self::of_bytes(path, &std::fs::read(path).map_err(|error| Error::read(path, error))?)
    }

    /// Reads a part from the bytes of its file. `name` names it in errors.
    ///
    /// # Errors
    /// [`Error::Malformed`] for bytes that are damaged, of another version or no part.
    pub fn of_bytes(name: impl Into<PathBuf>, bytes: &[u8]) -> Result<Self> {
        let name = name.into();
        let content = Content::decoded(bytes).map_err(|what| Error::malformed(&name, what))?;
        let header = Header::decoded(&content.header).map_err(|what| Error::malformed(&name, what))?;
        Ok(Self { name, header, sections: content.sections })
    }

    /// The bytes of the part's file. The layout is documented in
    /// [`io::part`](crate::io::part).
    pub fn bytes(&self) -> Vec<u8> {
        Content { header: self.header.encoded(), sections: self.sections.clone() }.encoded()
    }

    /// Writes the part to a file, which appears whole or not at all.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn write(&self, path: &Path) -> Result<()> {
        atomic::write_whole(path, |file| file.write_all(&self.bytes()))
    }

    /// Whether the part holds nearest depths; otherwise it holds sums.
    pub fn holds_depths(&self) -> bool {
        self.header.holds == Holds::Depths
    }

    /// The numbers of the shares in the part, from 1, and the number of shares of the scene.
    pub fn shares(&self) -> (&[u32], u32) {
        (&self.header.shares, self.header.of)
    }

    /// An error that names the part.
    fn refused(&self, what: impl Into<String>) -> Error {
        Error::malformed(&self.name, what)
    }
}
