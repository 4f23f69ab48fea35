//! Output files that appear whole or not at all.

use crate::{Error, Result};
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The writer of an output file: buffered, and seekable even if the final path is not.
pub type Output<'a> = BufWriter<&'a mut File>;

/// Writes the file at `path`: `fill` writes a temporary file beside it, which is renamed at the
/// end.
///
/// A reader of `path` sees the old file or the complete new one. After a failure or [`abandon`], no
/// part of the new file is left. A replaced file keeps its mode. Symbolic links are followed: the
/// target is replaced, and the link stays. A path that is not a file (a device, a pipe, an open
/// file in /proc) is written to and not replaced.
///
/// # Errors
///
/// [`Error::Write`] with `path` and the reason from the system or `fill`. A read-only file is not
/// replaced.
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut Output<'_>) -> io::Result<()>) -> Result<()> {
    finish(filled(path, fill)?.into_iter().collect())
}

/// Writes several files as [`write_whole`] does; none is renamed before all are written.
///
/// # Errors
///
/// As [`write_whole`].
pub fn write_together<'a>(files: impl IntoIterator<Item = (PathBuf, &'a [u8])>) -> Result<()> {
    let filled = files.into_iter().map(|(path, bytes)| filled(&path, |file| file.write_all(bytes)));
    finish(filled.filter_map(Result::transpose).collect::<Result<_>>()?)
}

/// Checks that [`write_whole`] can write at `path`, by creating a temporary file beside it and
/// removing it again.
///
/// # Errors
///
/// As [`write_whole`].
pub fn try_output(path: &Path) -> Result<()> {
    let tried = || match Target::of(path)? {
        Target::Stream => Ok(()),
        Target::File { end, existing } => Unfinished::begin(path, end, existing.as_ref()).map(drop),
    };
    tried().map_err(|source| Error::write(path, source))
}

/// Checks that files can be created in `folder`, or in its nearest existing ancestor if it is
/// missing.
///
/// # Errors
///
/// [`Error::Write`] with `folder` and the reason from the system.
pub fn try_folder(folder: &Path) -> Result<()> {
    let there = folder.ancestors().map(or_current).find(|folder| fs::symlink_metadata(folder).is_ok());
    let there = there.unwrap_or(folder);
    let tried = || {
        if !fs::metadata(there)?.is_dir() {
            return Err(io::ErrorKind::NotADirectory.into());
        }
        Unfinished::begin(folder, there.join("any"), None).map(drop)
    };
    tried().map_err(|source| Error::write(folder, source))
}

/// The file that [`write_whole`] would create or replace for `path`.
///
/// Symbolic links are followed, and the existing part of the folder is canonical. None for a path
/// that is written to but not replaced.
pub fn place_of(path: &Path) -> Option<PathBuf> {
    let end = match end_of_links(path) {
        Ok(end) => end?,
        Err(_) => path.to_owned(),
    };
    if fs::metadata(&end).is_ok_and(|there| !there.is_file() && !there.is_dir()) {
        return None;
    }
    let canonical = |folder: &Path| {
        let rest = end.strip_prefix(folder).ok()?;
        let canonical = or_current(folder).canonicalize().ok()?;
        // Joining an empty path would append a slash and turn the path of a file into that of a
        // folder.
        Some(if rest.as_os_str().is_empty() { canonical } else { canonical.join(rest) })
    };
    Some(end.ancestors().find_map(canonical).unwrap_or(end))
}

/// Removes all temporary files, and blocks threads that would create or rename one later. For a
/// program that is about to exit while other threads may still write.
pub fn abandon() {
    let mut unfinished = lock();
    unfinished.drain(..).for_each(|path| drop(fs::remove_file(path)));
    // The lock is never released: threads that need it wait until the program exits.
    std::mem::forget(unfinished);
}

/// The existing temporary files. The lock is held while one is created, removed or renamed, so a
/// temporary file never exists without being listed.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn lock() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The longest chain of symbolic links that is followed, as in Linux.
const MOST_LINKS: usize = 40;

/// The target of an output path.
enum Target {
    /// A device, pipe or open file that is written to and not replaced.
    Stream,
    /// A file after following symbolic links, and its metadata if it exists.
    File { end: PathBuf, existing: Option<Metadata> },
}

impl Target {
    fn of(path: &Path) -> io::Result<Self> {
        let Some(end) = end_of_links(path)? else { return Ok(Self::Stream) };
        let existing = match fs::metadata(&end) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            there => Some(there?),
        };
        match &existing {
            Some(there) if there.is_dir() => {
                return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a directory"));
            }
            // Renaming a file onto a device would replace the device.
            Some(there) if !there.is_file() => return Ok(Self::Stream),
            // Renaming needs no write permission on the file, but a read-only file is meant to
            // stay. The mode decides, since root may write to any file.
            Some(there) if there.permissions().readonly() => {
                return Err(io::Error::new(io::ErrorKind::PermissionDenied, "it is read-only"));
            }
            Some(_) => drop(OpenOptions::new().write(true).open(&end)?),
            None => {}
        }
        Ok(Self::File { end, existing })
    }
}

/// Follows a chain of symbolic links to its end, whether the end exists or not. None for a link in
/// /proc to a file that a process has open: it leads nowhere if the file has no name.
fn end_of_links(path: &Path) -> io::Result<Option<PathBuf>> {
    let mut end = path.to_owned();
    for _ in 0..MOST_LINKS {
        let of_process = || folder_of(&end).canonicalize().is_ok_and(|folder| folder.starts_with("/proc"));
        match fs::read_link(&end) {
            Ok(_) if of_process() => return Ok(None),
            Ok(target) => end = folder_of(&end).join(target),
            Err(_) => return Ok(Some(end)),
        }
    }
    Err(io::Error::other("too many symbolic links"))
}

fn folder_of(path: &Path) -> &Path {
    or_current(path.parent().unwrap_or(path))
}

fn or_current(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
}

/// A temporary file that is deleted on drop unless it was renamed.
struct Unfinished {
    file: File,
    /// The path of the temporary file; None once it is renamed.
    temporary: Option<PathBuf>,
    /// The path to which it is renamed.
    end: PathBuf,
    /// The path that the caller gave, for errors.
    asked: PathBuf,
}

impl Unfinished {
    fn begin(asked: &Path, end: PathBuf, existing: Option<&Metadata>) -> io::Result<Self> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create_new(true);
        #[cfg(unix)]
        {
            use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
            // A private file's replacement is private from the start; for a new file the umask
            // decides.
            options.mode(existing.map_or(0o666, |existing| existing.mode() & 0o777));
        }
        let mut unfinished = lock();
        let (file, temporary) = loop {
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let temporary = folder_of(&end).join(format!(".epsplat-{:x}-{number:x}", std::process::id()));
            match options.open(&temporary) {
                Ok(file) => break (file, temporary),
                // A killed process with the same process id left this file.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        };
        unfinished.push(temporary.clone());
        drop(unfinished);
        let whole = Self { file, temporary: Some(temporary), end, asked: asked.to_owned() };
        if let Some(existing) = existing {
            whole.become_like(existing)?;
        }
        Ok(whole)
    }

    /// Takes over mode and, as far as the system allows, owner and group of the existing file.
    fn become_like(&self, existing: &Metadata) -> io::Result<()> {
        #[cfg(unix)]
        {
            use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
            let own = self.file.metadata()?;
            if (own.uid(), own.gid()) != (existing.uid(), existing.gid()) {
                let _ = fchown(&self.file, Some(existing.uid()), Some(existing.gid()));
            }
            self.file.set_permissions(fs::Permissions::from_mode(existing.mode() & 0o777))
        }
        #[cfg(not(unix))]
        self.file.set_permissions(existing.permissions())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if let Some(temporary) = self.temporary.take() {
            let mut unfinished = lock();
            // A file that cannot be removed is left.
            let _ = fs::remove_file(&temporary);
            unfinished.retain(|path| *path != temporary);
        }
    }
}

/// Renames finished files to their final paths.
fn finish(files: Vec<Unfinished>) -> Result<()> {
    let mut files = files;
    let mut unfinished = lock();
    let named = files.iter_mut().try_for_each(|file| {
        let Some(temporary) = &file.temporary else { return Ok(()) };
        fs::rename(temporary, &file.end).map_err(|source| Error::write(&file.asked, source))?;
        unfinished.retain(|path| path != temporary);
        file.temporary = None;
        Ok(())
    });
    // Dropping `files` deletes those that were not renamed, which needs the lock.
    drop(unfinished);
    named
}

/// Lets `fill` write a temporary file, and returns it ready to be renamed. If `path` is not a file,
/// the content is copied to it instead, and the result is None.
fn filled(path: &Path, fill: impl FnOnce(&mut Output<'_>) -> io::Result<()>) -> Result<Option<Unfinished>> {
    let filled = || match Target::of(path)? {
        Target::Stream => {
            let mut whole = tempfile::tempfile()?;
            buffered(&mut whole, fill)?;
            whole.rewind()?;
            // Append, because the open stream may be a file that other processes write to as well.
            io::copy(&mut whole, &mut OpenOptions::new().append(true).open(path)?)?;
            Ok(None)
        }
        Target::File { end, existing } => {
            let mut whole = Unfinished::begin(path, end, existing.as_ref())?;
            buffered(&mut whole.file, fill)?;
            Ok(Some(whole))
        }
    };
    filled().map_err(|source| Error::write(path, source))
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

    #[cfg(unix)]
    #[test]
    fn links_stay_and_modes_too_and_what_is_read_only_is_not_replaced() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        let write = |name: &str, bytes: &[u8]| write_whole(&at(name), |out| out.write_all(bytes));
        for bits in [0o600, 0o666, 0o751] {
            fs::write(at("old"), "old").unwrap();
            fs::set_permissions(at("old"), fs::Permissions::from_mode(bits)).unwrap();
            write("old", b"new").unwrap();
            assert_eq!((mode(&at("old")), fs::read(at("old")).unwrap()), (bits, b"new".to_vec()));
        }
        // A chain of links, the second relative to its own folder, and a link to a missing file.
        fs::create_dir(at("sub")).unwrap();
        symlink("sub/second", at("first")).unwrap();
        symlink("../old", at("sub/second")).unwrap();
        symlink("sub/made", at("dangling")).unwrap();
        write("first", b"linked").unwrap();
        write("dangling", b"made").unwrap();
        assert_eq!(fs::read(at("old")).unwrap(), b"linked");
        assert_eq!(fs::read(at("sub/made")).unwrap(), b"made");
        assert!(["first", "sub/second", "dangling"].iter().all(|link| at(link).is_symlink()));
        assert_eq!(place_of(&at("first")), Some(at("old").canonicalize().unwrap()));
        symlink("round", at("round")).unwrap();
        assert!(write("round", b"").unwrap_err().to_string().contains("symbolic links"));
        // A read-only file is refused, also for root.
        fs::set_permissions(at("old"), fs::Permissions::from_mode(0o444)).unwrap();
        for refused in [write("old", b""), write("first", b""), try_output(&at("first"))] {
            assert!(refused.unwrap_err().to_string().ends_with("it is read-only"));
        }
        assert_eq!(fs::read(at("old")).unwrap(), b"linked");
        assert!(names(folder.path()).iter().all(|name| !name.starts_with(".epsplat-")));
    }

    #[test]
    fn several_files_take_their_names_together_or_none_does() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let both = |a: &'static [u8], b: &'static [u8]| write_together([(at("a"), a), (at("b"), b)]);
        both(b"1", b"2").unwrap();
        fs::remove_file(at("b")).unwrap();
        fs::create_dir(at("b")).unwrap();
        assert!(both(b"3", b"4").unwrap_err().to_string().contains("is a directory"));
        assert_eq!(fs::read(at("a")).unwrap(), b"1");
        assert_eq!(names(folder.path()).len(), 2);
    }

    #[test]
    fn outputs_and_folders_are_tried() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("file"), "").unwrap();
        try_output(&at("new")).unwrap();
        try_output(&at("file")).unwrap();
        try_folder(&at("no/such/folder")).unwrap();
        for refused in [try_output(folder.path()), try_output(&at("no/new")), try_output(&at("file/new"))] {
            assert!(matches!(refused, Err(Error::Write { .. })));
        }
        for refused in [try_folder(&at("file")), try_folder(&at("file/new"))] {
            assert!(matches!(refused, Err(Error::Write { .. })));
        }
        assert_eq!(names(folder.path()), ["file"]);
    }
}
