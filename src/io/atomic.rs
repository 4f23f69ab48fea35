//! Output files that appear whole or not at all.

use crate::{Error, Result};
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

/// What a file's bytes are written to: buffered, and seekable even where the final path is not.
pub type Output<'a> = BufWriter<&'a mut File>;

/// Writes the file at `path` through `fill`, into a temporary file beside it that takes its name at the end.
///
/// A reader of `path` sees the old file or the finished new one; after a failure no part of the new one is left. A path
/// that names something other than a file (a device, a pipe) is written to and not replaced.
///
/// # Errors
///
/// [`Error::Write`] with `path` and what the system or `fill` said.
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut Output<'_>) -> io::Result<()>) -> Result<()> {
    write(path, fill).map_err(|source| Error::write(path, source))
}

fn write(path: &Path, fill: impl FnOnce(&mut Output<'_>) -> io::Result<()>) -> io::Result<()> {
    if let Ok(existing) = fs::metadata(path) {
        if existing.is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a directory"));
        }
        if !existing.is_file() {
            // Renaming onto a device would replace the device.
            let mut whole = tempfile::tempfile()?;
            buffered(&mut whole, fill)?;
            whole.rewind()?;
            io::copy(&mut whole, &mut OpenOptions::new().write(true).open(path)?)?;
            return Ok(());
        }
    }
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".epsplat-");
    #[cfg(unix)]
    {
        // A temporary file is private by default; this one becomes an ordinary file, so the umask decides.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    fs::metadata(folder)?;
    // The message would name the temporary file, which nobody asked for; its kind says what is wrong with the folder.
    let mut whole = builder.tempfile_in(folder).map_err(|error| io::Error::from(error.kind()))?;
    buffered(whole.as_file_mut(), fill)?;
    whole.persist(path).map_err(|failed| failed.error)?;
    Ok(())
}

fn buffered(file: &mut File, fill: impl FnOnce(&mut Output<'_>) -> io::Result<()>) -> io::Result<()> {
    let mut output = BufWriter::with_capacity(1 << 18, file);
    fill(&mut output)?;
    output.flush()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_file_appears_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.bin");
        write_whole(&path, |out| out.write_all(b"first")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"first");
        let failed = write_whole(&path, |out| {
            out.write_all(&[0; 1 << 20])?;
            Err(io::Error::other("the source ran dry"))
        });
        assert_eq!(failed.unwrap_err().to_string(), format!("cannot write {}: the source ran dry", path.display()));
        assert_eq!(fs::read(&path).unwrap(), b"first");
        assert_eq!(names(folder.path()), ["out.bin"]);
    }

    #[test]
    fn a_fill_may_seek_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.bin");
        write_whole(&path, |out| {
            out.write_all(b"0123")?;
            out.seek(io::SeekFrom::Start(1))?;
            out.write_all(b"x")
        })
        .unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"0x23");
    }

    #[test]
    fn a_missing_folder_and_a_directory_are_write_errors() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("no/such/out.bin");
        let message = write_whole(&missing, |_| Ok(())).unwrap_err().to_string();
        assert!(message.starts_with(&format!("cannot write {}: No such file", missing.display())), "{message}");
        assert!(!message.contains(".epsplat-"), "{message}");
        assert!(matches!(write_whole(folder.path(), |_| Ok(())), Err(Error::Write { .. })));
        assert!(names(folder.path()).is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn permissions_follow_the_umask_and_devices_survive() {
        use std::os::unix::fs::{FileTypeExt, PermissionsExt};
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        write_whole(&ours, |_| Ok(())).unwrap();
        File::create(&plain).unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
        let null = Path::new("/dev/null");
        write_whole(null, |out| out.write_all(b"gone")).unwrap();
        assert!(fs::metadata(null).unwrap().file_type().is_char_device());
    }
}
