//! Why reading stopped, before it is known which file it was.

use crate::Error;
use std::cell::Cell;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::path::Path;
use std::sync::Once;

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

thread_local! {
    /// Whether panics on this thread are those of a decoder, which become a [`Fault`].
    static HUSHED: Cell<bool> = const { Cell::new(false) };
}

/// Runs what calls a decoder of another crate: corrupt data can make it panic. Nothing is printed of it.
///
/// A decoder's work on other threads is hushed only if they are: see [`hush_thread`].
pub(super) fn surviving<T>(run: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    let before = HUSHED.get();
    hush_thread();
    let outcome = catch_unwind(AssertUnwindSafe(run));
    HUSHED.set(before);
    outcome.unwrap_or_else(|_| Err(Fault::Malformed("its points cannot be decoded; the file is damaged".into())))
}

/// Lets panics on this thread go unprinted from now on.
pub(super) fn hush_thread() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |panic| {
            // A thread that is ending has no flag any more, and decodes nothing.
            if !HUSHED.try_with(Cell::get).unwrap_or(false) {
                usual(panic);
            }
        }));
    });
    HUSHED.set(true);
}

#[cfg(test)]
mod tests {
    #![allow(clippy::panic)]
    use super::*;

    #[test]
    fn panics_are_hushed_in_decoders_and_nowhere_else() {
        assert!(!HUSHED.get());
        let outer = surviving(|| {
            let inner: Result<(), Fault> = surviving(|| panic!("a panic of a test"));
            assert!(HUSHED.get() && matches!(inner, Err(Fault::Malformed(_))));
            Ok(())
        });
        assert!(outer.is_ok() && !HUSHED.get());
        let panicked: Result<(), Fault> = surviving(|| panic!("another"));
        assert!(panicked.is_err() && !HUSHED.get());
    }
}
