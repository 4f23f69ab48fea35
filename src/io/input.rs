//! Inputs of readers: a file, a file on a server, or a copy of a stream that is not seekable.

use std::fs::{File, Metadata};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::source::Source;
use super::values::text_of;
use super::{Format, vpc};
use crate::{Error, Result, address};

/// The number of first bytes that decide the format: all in front of the triangles of a binary STL
/// file.
const START: u64 = 84;

/// The most bytes that are copied from a stream: 4 GiB. A pipe may have no end.
pub const MOST_COPIED: u64 = 1 << 32;

/// An open, seekable file of known length and format.
#[derive(Debug)]
pub struct Input {
    pub(super) source: Source,
    /// Length in bytes.
    pub(super) length: u64,
    /// The path, for errors; an address without its secrets. Files that the input refers to are
    /// looked up beside it.
    pub(super) path: PathBuf,
    pub(super) format: Format,
    /// Whether the file is a copy of a stream, which cannot be read again.
    copied: bool,
}

/// An input in a file of this system.
pub(super) struct Local {
    pub file: File,
    /// Length in bytes.
    pub length: u64,
    /// The path, as in [`Input`].
    pub path: PathBuf,
}

/// Copies of streams that were inspected but not read yet, with the paths that will open them.
static LOOKED_AT: Mutex<Vec<(PathBuf, Input)>> = Mutex::new(Vec::new());

fn looked_at() -> MutexGuard<'static, Vec<(PathBuf, Input)>> {
    LOOKED_AT.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Input {
    /// Opens the file at `path`, or standard input for `-`, and determines its format. A path that
    /// begins with `http://` or `https://` is the address of a file on a server.
    ///
    /// The format is `format` if given, else that of the file's extension (upper or lower case),
    /// else that of its first bytes. The first bytes overrule the extensions of text: a PLY file
    /// may be called `.txt`. Pipes are copied to an unnamed temporary file, which is
    /// deleted with the input. So are files on servers, except LAS and PLY files of servers that
    /// send ranges of bytes: the readers of these ask for the ranges that they need. Devices are
    /// refused.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] if the system cannot read, or if the copy of a stream does not fit on disk
    /// or exceeds [`MOST_COPIED`]. [`Error::Malformed`] if the format cannot be determined.
    pub fn open(path: &Path, format: Option<Format>) -> Result<Self> {
        let mut looked_at = looked_at();
        if let Some(at) = looked_at.iter().position(|(known, _)| known == path) {
            return Ok(looked_at.swap_remove(at).1);
        }
        drop(looked_at);
        let standard = path == Path::new("-");
        let shown = address::shown(path);
        let called = if standard { Path::new("standard input") } else { &*shown };
        if vpc::is_one(called) {
            return Err(Error::malformed(called, "it is a virtual point cloud, and one file is needed: name a tile"));
        }
        let of_name = if standard { None } else { Format::of_name(called) };
        // Text of any kind may have the extension of a table.
        let (certain, likely) = match of_name {
            Some(Format::Xyz) => (format, of_name),
            _ => (format.or(of_name), None),
        };
        let opened = Opened::of(path, standard).map_err(|error| Error::read(called, error))?;
        opened.into_input(called, certain, likely)
    }

    /// Whether the input is a copy of a stream.
    pub(crate) fn is_copy(&self) -> bool {
        self.copied
    }

    /// The input as a file of this system. A file on a server is copied.
    pub(super) fn local(self) -> Result<Local> {
        let Self { source, length, path, .. } = self;
        let file = source.into_file().map_err(|error| Error::read(&path, error))?;
        Ok(Local { file, length, path })
    }

    /// Rewinds the file. If it is a copy of a stream, it is stored for the next call that opens
    /// `path`, because the stream itself is consumed; otherwise it is closed.
    pub(crate) fn keep(mut self, path: &Path) -> io::Result<()> {
        self.source.rewind()?;
        if self.copied {
            looked_at().push((path.to_owned(), self));
        }
        Ok(())
    }
}

/// Refuses a device: it may have no end, and reading may have side effects.
pub(crate) fn check_kind(there: &Metadata) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = there.file_type();
        if kind.is_char_device() || kind.is_block_device() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is a device, not a file"));
        }
    }
    let _ = there;
    Ok(())
}

/// Refuses anything but a regular file. For paths that another file names: opening a pipe would
/// block until somebody writes to it.
pub(crate) fn check_regular(path: &Path) -> io::Result<()> {
    let there = std::fs::metadata(path)?;
    check_kind(&there)?;
    if there.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a directory"));
    }
    if there.is_file() { Ok(()) } else { Err(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file")) }
}

/// Largest text file that is read into memory, bytes: camera files and benchmark studies.
const MOST_TEXT: u64 = 1 << 28;

/// Reads the text of a file or a pipe, in UTF-8 or UTF-16.
///
/// # Errors
///
/// [`Error::Read`] for a device, for more than 256 MiB, and where the system cannot read.
pub(crate) fn text(path: &Path) -> Result<String> {
    let start = || match address::of(path) {
        Some(address) => remote_start(address, MOST_TEXT + 1),
        None => {
            check_kind(&std::fs::metadata(path)?)?;
            let mut bytes = Vec::new();
            File::open(path)?.take(MOST_TEXT + 1).read_to_end(&mut bytes)?;
            Ok(bytes)
        }
    };
    let read = || {
        let bytes = start()?;
        if bytes.len() as u64 > MOST_TEXT {
            return Err(io::Error::new(
                io::ErrorKind::FileTooLarge,
                format!("it is longer than {} MiB", MOST_TEXT >> 20),
            ));
        }
        text_of(&bytes)
    };
    read().map_err(|error| Error::read(path, error))
}

/// Standard input as a file that shares the stream's position.
#[cfg(unix)]
pub(crate) fn standard_input() -> io::Result<File> {
    use std::os::fd::AsFd;
    Ok(io::stdin().as_fd().try_clone_to_owned()?.into())
}

/// An opened file with its length, or a stream.
enum Opened {
    File(File, u64),
    Stream(Box<dyn Read>),
    #[cfg(feature = "http")]
    Remote(super::remote::Remote),
}

#[cfg(feature = "http")]
use super::remote::start_of as remote_start;

#[cfg(not(feature = "http"))]
fn remote_start(_: &str, _: u64) -> io::Result<Vec<u8>> {
    Err(without_http())
}

/// The error for an address in a build that cannot ask servers.
#[cfg(not(feature = "http"))]
fn without_http() -> io::Error {
    io::Error::new(io::ErrorKind::Unsupported, "this build reads no remote files: build with '--features http'")
}

impl Opened {
    fn of(path: &Path, standard: bool) -> io::Result<Self> {
        if standard {
            return Self::standard();
        }
        if let Some(address) = address::of(path) {
            return Self::remote(address);
        }
        // A device is not even opened, because that may have side effects.
        let there = std::fs::metadata(path)?;
        check_kind(&there)?;
        let file = File::open(path)?;
        let metadata = file.metadata()?;
        // A directory can be opened; the error comes when it is read.
        if metadata.is_file() || metadata.is_dir() {
            return Ok(Self::File(file, metadata.len()));
        }
        Ok(Self::Stream(Box::new(file)))
    }

    #[cfg(feature = "http")]
    fn remote(address: &str) -> io::Result<Self> {
        use super::remote::{self, Patience, Remote};
        Ok(match Remote::open(address, Patience::of_environment()?)? {
            remote::Opened::Ranges(remote) => Self::Remote(remote),
            remote::Opened::Whole(_, Some(length)) if length > MOST_COPIED => return Err(remote::too_long()),
            remote::Opened::Whole(bytes, _) => Self::Stream(bytes),
        })
    }

    #[cfg(not(feature = "http"))]
    fn remote(_: &str) -> io::Result<Self> {
        Err(without_http())
    }

    #[cfg(unix)]
    fn standard() -> io::Result<Self> {
        let mut file = standard_input()?;
        let metadata = file.metadata()?;
        check_kind(&metadata)?;
        // If an earlier reader has consumed a part, the rest is read as a stream.
        if metadata.is_file() && file.stream_position()? == 0 {
            return Ok(Self::File(file, metadata.len()));
        }
        Ok(Self::Stream(Box::new(file)))
    }

    #[cfg(not(unix))]
    fn standard() -> io::Result<Self> {
        Ok(Self::Stream(Box::new(io::stdin().lock())))
    }

    fn into_input(self, path: &Path, named: Option<Format>, likely: Option<Format>) -> Result<Input> {
        let failed = |error| Error::read(path, error);
        let mut start = Vec::new();
        let detected = |start: &[u8]| {
            let likely = likely.filter(|_| Format::unread(path, start).is_none());
            Format::of_start(start).or(likely).ok_or_else(|| unknown(path, start))
        };
        let (source, length, format, copied) = match self {
            Self::File(mut file, length) => {
                let format = match named {
                    Some(format) => format,
                    None => {
                        (&mut file).take(START).read_to_end(&mut start).map_err(failed)?;
                        file.rewind().map_err(failed)?;
                        detected(&start)?
                    }
                };
                (Source::File(file), length, format, false)
            }
            #[cfg(feature = "http")]
            Self::Remote(remote) => {
                remote.read_at(0, START, &mut start).map_err(failed)?;
                let format = named.map_or_else(|| detected(&start), Ok)?;
                let length = remote.length();
                if format.is_read_in_part() {
                    (Source::Remote(remote), length, format, false)
                } else if let Some(what) = format.fault_of_start(&start) {
                    return Err(Error::malformed(path, what));
                } else {
                    (Source::File(remote.copied().map_err(failed)?), length, format, true)
                }
            }
            Self::Stream(mut stream) => {
                // The format is checked before copying, as a stream of other data may have no end.
                (&mut stream).take(START).read_to_end(&mut start).map_err(failed)?;
                let format = named.map_or_else(|| detected(&start), Ok)?;
                if let Some(what) = format.fault_of_start(&start) {
                    return Err(Error::malformed(path, what));
                }
                let (file, length) = copied(&start, stream, MOST_COPIED).map_err(failed)?;
                (Source::File(file), length, format, true)
            }
        };
        Ok(Input { source, length, path: path.to_owned(), format, copied })
    }
}

/// The error for a file whose extension and first bytes match no format.
fn unknown(path: &Path, start: &[u8]) -> Error {
    if let Some(what) = Format::unread(path, start) {
        return Error::malformed(path, what);
    }
    let formats = Format::sentence();
    Error::malformed(
        path,
        format!("its format is not known: {formats} files are read; if it is one, name it by --input-format"),
    )
}

/// Copies a stream to a temporary file: the bytes `start`, which are already read, and the `rest`;
/// at most `most` bytes in all. Returns the file and its length.
pub(super) fn copied(start: &[u8], rest: impl Read, most: u64) -> io::Result<(File, u64)> {
    let no_room = |error: io::Error| {
        let folder = std::env::temp_dir();
        io::Error::new(
            error.kind(),
            format!("it cannot be copied to a temporary file in {}: {error}", folder.display()),
        )
    };
    let mut file = tempfile::tempfile().map_err(no_room)?;
    file.write_all(start).map_err(no_room)?;
    let read = start.len() as u64;
    let mut rest = rest.take((most + 1).saturating_sub(read));
    let length = read
        + io::copy(&mut rest, &mut file).map_err(|error| match error.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => no_room(error),
            _ => error,
        })?;
    if length > most {
        let most = if most < 1 << 20 { format!("{most} bytes") } else { format!("{} MiB", most >> 20) };
        let what = format!("it is longer than {most}, the limit for a copy: name a file instead");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, what));
    }
    file.rewind()?;
    Ok((file, length))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_pipe_is_copied_up_to_a_length_that_is_told() {
        let copy = |length: u64| copied(b"ply\n", io::repeat(7).take(length), 100);
        for length in [0, 1, 96] {
            let (mut file, copied) = copy(length).unwrap();
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes).unwrap();
            assert_eq!((copied, bytes.len() as u64), (4 + length, 4 + length));
        }
        for length in [97, 1 << 20, u64::MAX] {
            let told = copy(length).unwrap_err().to_string();
            assert!(told.contains("longer than 100 bytes") && told.contains("name a file instead"), "{told}");
        }
    }

    #[test]
    fn a_stream_of_another_format_is_refused_by_its_first_bytes() {
        let open = |format: Format, start: &[u8]| {
            let stream = Opened::Stream(Box::new(io::Cursor::new(start.to_vec())));
            stream.into_input(Path::new("a"), Some(format), None).map(|input| input.length)
        };
        let zeros = [0; 84];
        for (_, format) in Format::READ.iter().copied() {
            let endless = Opened::Stream(Box::new(io::repeat(0)));
            let told = endless.into_input(Path::new("a"), Some(format), None).unwrap_err().to_string();
            assert!(told.starts_with("a: it is not a") && told.contains("its first"), "{told}");
            assert!(open(format, &zeros).is_err());
        }
        let utf16: Vec<u8> = "\u{feff}v 0 0 0\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        for (format, start) in [
            (Format::Ply, &b"ply\nformat"[..]),
            (Format::Ply, b"\xef\xbb\xbfply\r\n"),
            (Format::Las, b"LASF"),
            (Format::E57, b"ASTM-E57"),
            (Format::Obj, b"# a comment"),
            (Format::Obj, &utf16),
            (Format::Pcd, b"# a comment\nVERSION"),
            (Format::Stl, b"\0\0\0\0\x01"),
            (Format::Xyz, b"1 2 3"),
            // Too short for any format; the readers report that.
            (Format::Obj, b""),
        ] {
            assert_eq!(open(format, start).unwrap(), start.len() as u64, "{format:?}");
        }
    }
}
