//! The reason why a reader failed, independent of the file's path.

use crate::Error;
use std::cell::Cell;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::path::Path;
use std::sync::Once;

/// A reader's failure, without the path.
#[derive(Debug)]
pub(super) enum Fault {
    /// The system could not read.
    Io(io::Error),
    /// The file violates its format; the text is one clause.
    Malformed(String),
    /// An option cannot be followed with this file; the text is one clause.
    Usage(String),
}

impl Fault {
    /// Adds the path.
    pub(super) fn of(self, path: &Path) -> Error {
        match self {
            Self::Io(source) => Error::read(path, source),
            Self::Malformed(what) => Error::malformed(path, what),
            Self::Usage(what) => Error::Usage(format!("{}: {what}", path.display())),
        }
    }
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// Reserves memory for `more` items; an allocation failure is an error and does not abort.
pub(super) fn reserve<T>(items: &mut Vec<T>, more: u64) -> Result<(), Fault> {
    let more = usize::try_from(more).unwrap_or(usize::MAX);
    items.try_reserve_exact(more).map_err(|_| Fault::Io(io::ErrorKind::OutOfMemory.into()))
}

/// Parts of a file that could not be read: scans, nodes, chunks.
#[derive(Debug, Default)]
pub(super) struct Unread {
    /// Descriptions of the first unread parts, each with its reason.
    named: Vec<String>,
    parts: u64,
    points: u64,
    first: Option<Fault>,
}

impl Unread {
    /// The most parts that a sentence names.
    const MOST_NAMED: usize = 8;

    /// Records that a part of `points` points is left out; `clause` describes it, given the reason.
    /// Fails with `fault` in strict mode, or if `fault` is a failure of the system.
    pub(super) fn add(
        &mut self,
        clause: impl FnOnce(&str) -> String,
        points: u64,
        fault: Fault,
        strict: bool,
    ) -> Result<(), Fault> {
        let Fault::Malformed(what) = &fault else { return Err(fault) };
        if strict {
            return Err(fault);
        }
        if self.named.len() < Self::MOST_NAMED {
            self.named.push(clause(what));
        }
        self.parts += 1;
        self.points = self.points.saturating_add(points);
        self.first.get_or_insert(fault);
        Ok(())
    }

    pub(super) fn is_empty(&self) -> bool {
        self.parts == 0
    }

    /// Returns a sentence about the parts that are left out of the file at `path`, which has `all`
    /// parts of this `kind`; no sentence if no part is left out. Fails with the first fault if no
    /// part was `read`.
    pub(super) fn told(self, path: &Path, (kind, all): (&str, u64), read: bool) -> Result<Vec<String>, Fault> {
        match self.first {
            None => return Ok(Vec::new()),
            Some(fault) if !read => return Err(fault),
            Some(_) => {}
        }
        let more = self.parts - self.named.len() as u64;
        let more = if more > 0 { format!("; and {more} more") } else { String::new() };
        Ok(vec![format!(
            "{}: {} of {all} {kind} left out, with {} points: {}{more} (--strict refuses the file)",
            path.display(),
            self.parts,
            self.points,
            self.named.join("; ")
        )])
    }
}

/// The file name, for progress lines.
pub(super) fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

thread_local! {
    /// Whether panics on this thread come from a decoder. They become [`Fault`]s, and their
    /// messages are not printed.
    static HUSHED: Cell<bool> = const { Cell::new(false) };
}

/// Runs a decoder of another crate, and turns its panic on corrupt data into a [`Fault`]; nothing
/// is printed.
///
/// A decoder's other threads still print their panics unless they call [`hush_thread`].
pub(super) fn surviving<T>(run: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    let before = HUSHED.get();
    hush_thread();
    let outcome = catch_unwind(AssertUnwindSafe(run));
    HUSHED.set(before);
    outcome.unwrap_or_else(|_| Err(Fault::Malformed("its points cannot be decoded; the file is damaged".into())))
}

/// Suppresses the messages of panics on this thread from now on.
pub(super) fn hush_thread() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |panic| {
            // A thread that is exiting has no `HUSHED` any more, but decodes nothing either.
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
