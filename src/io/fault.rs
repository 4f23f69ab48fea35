//! Why reading stopped, before it is known which file it was.

use crate::Error;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// A reader's failure without the path.
#[derive(Debug)]
pub(super) enum Fault {
    /// The system could not read.
    Io(io::Error),
    /// The file is not what its format says; one clause.
    Malformed(String),
}

impl Fault {
    /// The failure as the caller sees it.
    pub(super) fn of(self, path: &Path) -> Error {
        match self {
            Self::Io(source) => Error::read(path, source),
            Self::Malformed(what) => Error::malformed(path, what),
        }
    }
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// Reserves room for `more` items, as an error and not an abort where the system has none.
pub(super) fn reserve<T>(items: &mut Vec<T>, more: u64) -> Result<(), Fault> {
    let more = usize::try_from(more).unwrap_or(usize::MAX);
    items.try_reserve_exact(more).map_err(|_| Fault::Io(io::ErrorKind::OutOfMemory.into()))
}

/// The name of a file for a progress line.
pub(super) fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Runs what calls a decoder of another crate: corrupt data can make it panic.
pub(super) fn surviving<T>(run: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    catch_unwind(AssertUnwindSafe(run))
        .unwrap_or_else(|_| Err(Fault::Malformed("its points cannot be decoded; the file is damaged".into())))
}
