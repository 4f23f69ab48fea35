//! Networks of processes that draw one picture together: how bytes get from each process to each
//! other one ([`Network`]), how the values of pixels are reduced over it ([`Reduction`]), and the
//! Message Passing Interface, which is such a network.
//!
//! Each process calls the same functions in the same order, and all messages go by [`exchanged`]: a
//! process that fails says so there, so that all of them end instead of waiting for it.

mod blocks;
mod carried;
mod listed;
mod packed;
mod pixels;
mod reduction;

#[cfg(feature = "mpi")]
pub mod mpi;

pub use self::carried::{Carried, joined};
pub use self::reduction::{Reduction, Wire};

use crate::error::{Error, Result};

/// Carries bytes between the processes that draw a picture together.
pub trait Network: Sync {
    /// Number of this process, from 0.
    fn rank(&self) -> usize;

    /// Number of processes.
    fn size(&self) -> usize;

    /// Sends `to[k]` to process `k` and returns the message of each process to this one, in their
    /// order. It waits until all processes have called it.
    ///
    /// # Errors
    /// Any error of the network.
    fn all_to_all(&self, to: Vec<Vec<u8>>) -> Result<Vec<Vec<u8>>>;
}

/// The last byte of a message from a process that did not fail; others send their exit code.
const DONE: u8 = 0;

/// Exchanges messages as [`Network::all_to_all`] does, or ends the work of all processes if one of
/// them has an error in place of its messages. Wherever a process fails, this is its last call, and
/// the others learn of it by their next one.
///
/// # Errors
/// [`Error::Process`] in the first process that failed, [`Error::OtherProcess`] in all others, and
/// errors of the network.
pub fn exchanged(network: &dyn Network, own: Result<Vec<Vec<u8>>>) -> Result<Vec<Vec<u8>>> {
    let (mut to, error) = match own {
        Ok(to) => (to, None),
        // All have learnt of this one.
        Err(error @ (Error::Process { .. } | Error::OtherProcess { .. })) => return Err(error),
        Err(error) => (vec![Vec::new(); network.size()], Some(error)),
    };
    let code = error.as_ref().map_or(DONE, Error::exit_code);
    to.iter_mut().for_each(|bytes| bytes.push(code));
    let mut got = network.all_to_all(to)?;
    let codes: Vec<u8> = got.iter_mut().map(|bytes| bytes.pop().unwrap_or(1)).collect();
    let first = codes.iter().position(|code| *code != DONE);
    match (first, error) {
        (None, _) => Ok(got),
        (Some(rank), Some(source)) if rank == network.rank() => Err(Error::Process { rank, source: Box::new(source) }),
        (Some(rank), _) => Err(Error::OtherProcess { rank, code: codes[rank] }),
    }
}

/// Returns the value of `outcome` if all processes have one.
///
/// # Errors
/// As [`exchanged`].
pub fn together<T>(network: &dyn Network, outcome: Result<T>) -> Result<T> {
    let (value, none) = match outcome {
        Ok(value) => (Some(value), Ok(vec![Vec::new(); network.size()])),
        Err(error) => (None, Err(error)),
    };
    exchanged(network, none)?;
    // A process without a value has had an error.
    value.ok_or_else(|| Error::Usage("the processes do not agree".into()))
}

/// Sends the same bytes to all processes, and returns those of each.
///
/// # Errors
/// As [`exchanged`].
pub fn gathered(network: &dyn Network, own: &[u8]) -> Result<Vec<Vec<u8>>> {
    exchanged(network, Ok(vec![own.to_vec(); network.size()]))
}
