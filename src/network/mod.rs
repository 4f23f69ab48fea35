//! Networks of processes that draw one picture together: how bytes get from each process to each
//! other one ([`Network`]), how the values of pixels are reduced over it ([`Reduction`]), and the
//! Message Passing Interface, which is such a network.
//!
//! Each process calls the same functions in the same order. A process that fails takes part in the
//! next [`together`] and says so there, so that all of them end instead of waiting for it.

mod blocks;
mod packed;
mod reduction;

#[cfg(feature = "mpi")]
pub mod mpi;

pub use self::reduction::{Reduction, Wire};

use crate::error::{Error, Result};

/// Carries bytes between the processes that draw a picture together.
pub trait Network: Sync {
    /// Number of this process, from 0.
    fn rank(&self) -> usize;

    /// Number of processes.
    fn size(&self) -> usize;

    /// Sends `to[k]` to process `k` and returns what each process sent to this one, in the order of
    /// processes. It waits until all processes have called it.
    ///
    /// # Errors
    /// Any error of the network.
    fn all_to_all(&self, to: Vec<Vec<u8>>) -> Result<Vec<Vec<u8>>>;

    /// Sends the same bytes to all processes, and returns those of each.
    ///
    /// # Errors
    /// Any error of the network.
    fn all_gather(&self, own: &[u8]) -> Result<Vec<Vec<u8>>> {
        self.all_to_all(vec![own.to_vec(); self.size()])
    }
}

/// A word for the processes whose outcome is a value.
const DONE: u8 = 0;

/// Returns the value of `outcome` if all processes have one. Otherwise each process has an error:
/// the first one that failed its own, which it should print, and the others
/// [`Error::OtherProcess`].
///
/// # Errors
/// The errors above, and those of the network.
pub fn together<T>(network: &dyn Network, outcome: Result<T>) -> Result<T> {
    let code = outcome.as_ref().err().map_or(DONE, Error::exit_code);
    let codes = network.all_gather(&[code])?;
    match codes.iter().position(|code| *code != [DONE]) {
        None => outcome,
        // What all processes say alike needs no number.
        Some(0) if network.rank() == 0 => outcome,
        Some(first) if first == network.rank() => {
            outcome.map_err(|source| Error::Process { rank: first, source: Box::new(source) })
        }
        Some(first) => {
            Err(Error::OtherProcess { rank: first, code: codes[first].first().copied().unwrap_or(1).max(1) })
        }
    }
}
