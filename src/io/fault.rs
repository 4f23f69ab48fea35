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

/// Parts of a file that could not be read: scans, nodes, chunks.
#[derive(Debug, Default)]
pub(super) struct Unread {
    /// The first of them, each with its reason.
    named: Vec<String>,
    parts: u64,
    points: u64,
    first: Option<Fault>,
}

impl Unread {
    /// Parts that a sentence names, each with its reason.
    const MOST_NAMED: usize = 8;

    /// Leaves out a part of so many points, of which a clause says what is wrong with it. Fails if
    /// files are read strictly, and for what is not the file's fault.
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

    /// The sentence about the file at `path`, which has `all` parts of this kind; where none of
    /// them was `read`, the first one's fault.
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
