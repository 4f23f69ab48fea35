//! A cache of pages of a file. Computing a node above many subtrees reads either few of the rows
//! below it, or all of them in order.

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use crate::Result;

/// Rows in a page.
const PAGE: u64 = 1 << 12;

/// The largest number of pages in the cache.
const SLOTS: u64 = 64;

/// A range of rows, and the value that was read from them.
type Page<T> = (Range<u64>, Arc<T>);

/// Cached pages of a growing file.
pub(super) struct Pages<T> {
    slots: Vec<Mutex<Option<Page<T>>>>,
}

impl<T> Pages<T> {
    /// An empty cache.
    pub fn new() -> Self {
        Self { slots: (0..SLOTS).map(|_| Mutex::new(None)).collect() }
    }

    /// Calls `see` with each page that has some of the `wanted` rows, and their range within the
    /// page. `all` is the number of rows in the file.
    ///
    /// Pages that are not in the cache are read, and replace others.
    pub fn each(
        &self,
        (wanted, all): (Range<u64>, u64),
        read: impl Fn(Range<u64>) -> Result<T>,
        mut see: impl FnMut(&T, Range<usize>),
    ) -> Result<()> {
        let mut next = wanted.start;
        while next < wanted.end {
            let start = next - next % PAGE;
            let page = self.page(start..all.min(start + PAGE), &read)?;
            let end = wanted.end.min(start + PAGE);
            see(&page, (next - start) as usize..(end - start) as usize);
            next = end;
        }
        Ok(())
    }

    fn page(&self, rows: Range<u64>, read: impl Fn(Range<u64>) -> Result<T>) -> Result<Arc<T>> {
        let slot = &self.slots[(rows.start / PAGE % SLOTS) as usize];
        let lock = || slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, page)) = lock().as_ref().filter(|(known, _)| *known == rows) {
            return Ok(page.clone());
        }
        // No lock is held during the read: while it waits, the thread may run other work that needs
        // a page.
        let page = Arc::new(read(rows.clone())?);
        *lock() = Some((rows, page.clone()));
        Ok(page)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::Error;

    #[test]
    fn rows_are_those_of_pages_and_pages_are_read_once() {
        let pages = Pages::new();
        let seen = |wanted: Range<u64>, all: u64| {
            let mut seen = Vec::new();
            let read = |rows: Range<u64>| Ok(rows.collect::<Vec<u64>>());
            pages.each((wanted, all), read, |page, of| seen.extend_from_slice(&page[of])).unwrap();
            seen
        };
        for (wanted, all) in [(0..5, 9), (7..9, 9), (4000..9000, 9000), (9000..9003, 30_000), (5..5, 9)] {
            assert!(seen(wanted.clone(), all).into_iter().eq(wanted), "{all}");
        }
        let far = SLOTS * PAGE;
        assert_eq!(seen(far + 1..far + 3, far + 9), [far + 1, far + 2]);
        let none = |_: Range<u64>| Err(Error::Usage("it is read".into()));
        let there = |wanted: Range<u64>| pages.each((wanted, far + 9), none, |_: &Vec<u64>, _| ()).is_ok();
        assert!(there(far..far + 9) && !there(0..5));
    }
}
