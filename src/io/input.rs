//! What is read: a file, or a copy of what cannot be sought in.

use std::fs::File;
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

use super::Format;
use crate::{Error, Result};

/// Bytes from the start by which formats are told apart.
const START: u64 = 32;

/// A file that is open to be read: it can be sought in, and how long it is is known.
#[derive(Debug)]
pub struct Input {
    pub(super) file: File,
    /// Bytes.
    pub(super) length: u64,
    /// What errors call it; files that it names lie beside it.
    pub(super) path: PathBuf,
    pub(super) format: Format,
}

impl Input {
    /// Opens the file at `path`, or for `-` standard input, and tells its format: the one that is given, or else that of its name's
    /// extension in either case, or else that of its first bytes.
    ///
    /// Pipes and devices are read to their end into a temporary file without a name, which goes when the input does.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] where the system cannot read or has no room for the copy, [`Error::Malformed`] where nothing tells the format.
    pub fn open(path: &Path, format: Option<Format>) -> Result<Self> {
        let standard = path == Path::new("-");
        let path = if standard { Path::new("standard input") } else { path };
        let named = format.or_else(|| if standard { None } else { Format::of_name(path) });
        let opened = || {
            if standard {
                return Ok(Opened::Stream(Box::new(io::stdin().lock())));
            }
            let file = File::open(path)?;
            let metadata = file.metadata()?;
            // A directory can be opened, and says what it is when it is read.
            if metadata.is_file() || metadata.is_dir() {
                return Ok(Opened::File(file, metadata.len()));
            }
            Ok(Opened::Stream(Box::new(file)))
        };
        let opened = opened().map_err(|error| Error::read(path, error))?;
        opened.into_input(path, named)
    }
}

/// What was opened.
enum Opened {
    File(File, u64),
    Stream(Box<dyn Read>),
}

impl Opened {
    fn into_input(self, path: &Path, named: Option<Format>) -> Result<Input> {
        let failed = |error| Error::read(path, error);
        let mut start = Vec::new();
        let (file, length, format) = match self {
            Self::File(mut file, length) => {
                let format = match named {
                    Some(format) => format,
                    None => {
                        (&mut file).take(START).read_to_end(&mut start).map_err(failed)?;
                        file.rewind().map_err(failed)?;
                        Format::of_start(&start).ok_or_else(|| unknown(path, &start))?
                    }
                };
                (file, length, format)
            }
            Self::Stream(mut stream) => {
                // The format is told first: what is no cloud may have no end.
                (&mut stream).take(START).read_to_end(&mut start).map_err(failed)?;
                let format = named.or_else(|| Format::of_start(&start)).ok_or_else(|| unknown(path, &start))?;
                let (file, length) = copied(&start, stream).map_err(failed)?;
                (file, length, format)
            }
        };
        Ok(Input { file, length, path: path.to_owned(), format })
    }
}

/// Neither its name nor its first bytes say that it is of a format that is read.
fn unknown(path: &Path, start: &[u8]) -> Error {
    if let Some(what) = Format::unread(path, start) {
        return Error::malformed(path, what);
    }
    let formats = Format::sentence();
    Error::malformed(
        path,
        format!("its format is not known: {formats} files are read; if it is one, --input-format says which"),
    )
}

/// All bytes of a stream, of which `start` is read, in a temporary file; and how many.
fn copied(start: &[u8], mut rest: impl Read) -> io::Result<(File, u64)> {
    let no_room = |error: io::Error| {
        let folder = std::env::temp_dir();
        io::Error::new(
            error.kind(),
            format!("it cannot be copied to a temporary file in {}: {error}", folder.display()),
        )
    };
    let mut file = tempfile::tempfile().map_err(no_room)?;
    file.write_all(start).map_err(no_room)?;
    let copied = io::copy(&mut rest, &mut file).map_err(|error| match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => no_room(error),
        _ => error,
    })?;
    file.rewind()?;
    Ok((file, start.len() as u64 + copied))
}
