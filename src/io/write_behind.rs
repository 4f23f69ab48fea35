//! Writing of outputs in other threads while the next ones are being made.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use crate::error::{Error, Result};

/// Passes each of `items` to one of `writers` threads, and returns the results of `write` in order.
///
/// The calling thread makes one item after the other, the next as soon as a writer has taken the
/// previous one. At most `writers + 1` items exist at a time, so memory does not grow with their
/// number, however slow the writers are. Several items are written at a time, in no particular
/// order.
///
/// # Errors
///
/// The error of the first item, in order, that could not be made or written. After a failure is
/// seen, no more items are made, and those that are being written are completed.
pub fn write_behind<T: Send, R: Send>(
    writers: NonZeroUsize,
    items: impl Iterator<Item = Result<T>>,
    write: impl Fn(T) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    // A rendezvous channel: an item that waits in a queue would be one more in memory.
    let (sender, receiver) = sync_channel(0);
    let receiver = Arc::new(Mutex::new(receiver));
    let failed = AtomicBool::new(false);
    let mut outcomes = thread::scope(|scope| {
        let (write, failed) = (&write, &failed);
        let writing: Vec<_> = (0..writers.get())
            .map(|_| {
                let receiver = Arc::clone(&receiver);
                scope.spawn(move || {
                    let mut outcomes = Vec::new();
                    while let Some((index, item)) = take(&receiver) {
                        let outcome = write(item);
                        failed.fetch_or(outcome.is_err(), Ordering::Relaxed);
                        outcomes.push((index, outcome));
                    }
                    outcomes
                })
            })
            .collect();
        // Only the writers hold receivers now, so sending fails if panics have ended all of them.
        drop(receiver);
        let mut outcomes = Vec::new();
        for (index, item) in items.enumerate() {
            let sent = match item {
                Ok(item) => sender.send((index, item)).is_ok(),
                Err(error) => {
                    outcomes.push((index, Err(error)));
                    false
                }
            };
            if !sent || failed.load(Ordering::Relaxed) {
                break;
            }
        }
        drop(sender);
        for thread in writing {
            match thread.join() {
                Ok(written) => outcomes.extend(written),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        outcomes
    });
    outcomes.sort_by_key(|(index, _): &(usize, Result<R, Error>)| *index);
    outcomes.into_iter().map(|(_, outcome)| outcome).collect()
}

/// The next item; None when there are no more. Idle writers wait for the lock.
fn take<T>(receiver: &Mutex<Receiver<T>>) -> Option<T> {
    receiver.lock().unwrap_or_else(PoisonError::into_inner).recv().ok()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::sync::atomic::AtomicUsize;
    use std::time::Duration;

    use super::*;

    fn two() -> NonZeroUsize {
        NonZeroUsize::new(2).unwrap()
    }

    #[test]
    fn all_is_written_and_few_items_exist_at_a_time() {
        let (alive, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let items = (0..50u64).map(|item| {
            most.fetch_max(alive.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
            Ok(item)
        });
        let written = write_behind(two(), items, |item| {
            // Later items take less time, so they finish out of order.
            thread::sleep(Duration::from_micros(100 * (50 - item)));
            alive.fetch_sub(1, Ordering::SeqCst);
            Ok(2 * item)
        });
        assert!(written.unwrap().into_iter().eq((0..50).map(|item| 2 * item)));
        assert_eq!(most.into_inner(), 3);
    }

    #[test]
    fn the_first_failure_ends_it() {
        let bad = |what: u64| Err(Error::EmptyScene(what.to_string()));
        let made = AtomicUsize::new(0);
        let items = || {
            (0..1000u64).map(|item| {
                made.fetch_add(1, Ordering::SeqCst);
                if item == 40 { bad(item) } else { Ok(item) }
            })
        };
        let written = write_behind(two(), items(), |item| if item >= 10 { bad(item) } else { Ok(item) });
        assert_eq!(written.unwrap_err().to_string(), "10");
        assert!(made.swap(0, Ordering::SeqCst) < 20);
        let written = write_behind(two(), items(), Ok);
        assert_eq!(written.unwrap_err().to_string(), "40");
        assert_eq!(made.into_inner(), 41);
    }
}
