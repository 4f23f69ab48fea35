//! Numbers that process 0 deals to all processes as they ask for them, so that each has work until
//! none is left, however long the work on a number takes.

use std::ffi::c_int;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use super::Mpi;
use super::library::From;
use crate::error::Result;
use crate::network::Network;

/// The longest time between two looks for a message.
const LONGEST_WAIT: Duration = Duration::from_millis(1);

/// Numbers from 0 on that are dealt.
pub struct Deal {
    next: AtomicU64,
    count: u64,
}

impl Deal {
    /// The numbers below `count`.
    pub fn new(count: usize) -> Self {
        Self { next: AtomicU64::new(0), count: count as u64 }
    }

    /// The next number in process 0; None if none is left.
    pub fn next(&self) -> Option<usize> {
        Some(self.dealt()).filter(|number| *number < self.count).map(|number| number as usize)
    }

    fn dealt(&self) -> u64 {
        self.next.fetch_add(1, Ordering::Relaxed)
    }
}

impl Mpi {
    /// Deals numbers in process 0 to all others, which ask by [`Mpi::asked`]. Returns when all of
    /// them know that none is left, or once `is_over`.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) with the library's code.
    pub fn deal(&self, deal: &Deal, is_over: impl Fn() -> bool) -> Result<()> {
        let mut asking = self.size() - 1;
        while asking > 0 && !is_over() {
            let Some(rank) = self.library.receive(From::Any)? else {
                std::thread::sleep(LONGEST_WAIT);
                continue;
            };
            let number = deal.dealt();
            self.library.send(number, rank as c_int)?;
            asking -= usize::from(number >= deal.count);
        }
        Ok(())
    }

    /// The next of `count` numbers, from process 0; None if none is left. After that no process
    /// asks again.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) with the library's code.
    pub fn asked(&self, count: usize) -> Result<Option<usize>> {
        self.library.send(self.rank() as u64, 0)?;
        loop {
            if let Some(number) = self.library.receive(From::Rank(0))? {
                return Ok(Some(number as usize).filter(|number| *number < count));
            }
            std::thread::sleep(LONGEST_WAIT / 10);
        }
    }
}
