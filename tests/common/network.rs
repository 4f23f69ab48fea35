//! A network of threads, in place of processes.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use epsplat::low_level::network::Network;
use epsplat::{Error, Result};

/// A network of threads that draw together. A thread that leaves ends the work of the others.
pub struct Threads {
    size: usize,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// The messages of each thread in this round.
    sent: Vec<Option<Vec<Vec<u8>>>>,
    /// Number of threads that took their messages.
    took: usize,
    left: bool,
}

/// One thread of the network. Dropping it tells the others that it left.
pub struct Member<'a> {
    threads: &'a Threads,
    rank: usize,
}

impl Threads {
    pub fn new(size: usize) -> Self {
        let state = State { sent: vec![None; size], ..State::default() };
        Self { size, state: Mutex::new(state), changed: Condvar::new() }
    }

    pub fn member(&self, rank: usize) -> Member<'_> {
        Member { threads: self, rank }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(
        &'a self,
        mut state: MutexGuard<'a, State>,
        until: impl Fn(&State) -> bool,
    ) -> Result<MutexGuard<'a, State>> {
        while !until(&state) {
            if state.left {
                return Err(Error::Usage("another thread left".into()));
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        Ok(state)
    }
}

impl Network for Member<'_> {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.threads.size
    }

    fn all_to_all(&self, to: Vec<Vec<u8>>) -> Result<Vec<Vec<u8>>> {
        assert_eq!(to.len(), self.size());
        let Threads { size, changed, .. } = self.threads;
        // The next round begins when all have taken the messages of the last one.
        let mut state = self.threads.wait(self.threads.state(), |state| state.sent[self.rank].is_none())?;
        state.sent[self.rank] = Some(to);
        changed.notify_all();
        let mut state = self.threads.wait(state, |state| state.sent.iter().all(Option::is_some))?;
        let got = state.sent.iter().map(|sent| sent.as_ref().map_or_else(Vec::new, |sent| sent[self.rank].clone()));
        let got = got.collect();
        state.took += 1;
        if state.took == *size {
            (state.sent, state.took) = (vec![None; *size], 0);
            changed.notify_all();
        } else {
            drop(self.threads.wait(state, |state| state.sent[self.rank].is_none())?);
        }
        Ok(got)
    }
}

impl Drop for Member<'_> {
    fn drop(&mut self) {
        self.threads.state().left = true;
        self.threads.changed.notify_all();
    }
}
