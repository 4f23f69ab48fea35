//! The bytes of an input: a file, or a file on a server.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;

#[cfg(feature = "http")]
use super::remote::Remote;

/// Bytes of known length in which positions can be sought.
#[derive(Debug)]
pub enum Source {
    /// A file, or a copy of a stream.
    File(File),
    /// A file on a server that sends ranges.
    #[cfg(feature = "http")]
    Remote(Remote),
}

impl Source {
    /// The file; None if it is on a server.
    pub fn file(&mut self) -> Option<&mut File> {
        match self {
            Self::File(file) => Some(file),
            #[cfg(feature = "http")]
            Self::Remote(_) => None,
        }
    }

    /// The file, or a copy of the one on a server: an unnamed temporary file.
    pub fn into_file(self) -> io::Result<File> {
        match self {
            Self::File(file) => Ok(file),
            #[cfg(feature = "http")]
            Self::Remote(remote) => remote.copied(),
        }
    }

    /// Another source of the same bytes. Its position may be shared: seek before reading.
    pub fn try_clone(&self) -> io::Result<Self> {
        Ok(match self {
            Self::File(file) => Self::File(file.try_clone()?),
            #[cfg(feature = "http")]
            Self::Remote(remote) => Self::Remote(remote.clone()),
        })
    }

    /// Appends up to `length` bytes from the offset `at`: fewer only at the end. May move the
    /// position.
    pub fn read_at(&self, at: u64, length: u64, into: &mut Vec<u8>) -> io::Result<()> {
        match self {
            Self::File(file) => {
                let mut file = file;
                file.seek(SeekFrom::Start(at))?;
                file.take(length).read_to_end(into).map(drop)
            }
            #[cfg(feature = "http")]
            Self::Remote(remote) => remote.read_at(at, length, into),
        }
    }

    /// Receives ranges that will be read soon from a server, several at the same time. Files are
    /// not read.
    pub fn expect(&self, ranges: impl IntoIterator<Item = Range<u64>>) -> io::Result<()> {
        match self {
            Self::File(_) => {
                let _ = ranges;
                Ok(())
            }
            #[cfg(feature = "http")]
            Self::Remote(remote) => remote.expect(ranges),
        }
    }

    /// Frees the memory of bytes that were received from a server.
    pub fn forget(&self) {
        match self {
            Self::File(_) => {}
            #[cfg(feature = "http")]
            Self::Remote(remote) => remote.forget(),
        }
    }

    /// Fails if any earlier read from a server failed. Readers that take an error of reading for
    /// damage call it in the end.
    pub fn check(&self) -> io::Result<()> {
        match self {
            Self::File(_) => Ok(()),
            #[cfg(feature = "http")]
            Self::Remote(remote) => remote.check(),
        }
    }
}

impl Read for Source {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(out),
            #[cfg(feature = "http")]
            Self::Remote(remote) => remote.read(out),
        }
    }
}

impl Seek for Source {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Self::File(file) => file.seek(to),
            #[cfg(feature = "http")]
            Self::Remote(remote) => remote.seek(to),
        }
    }
}
