//! The Message Passing Interface. The library of the cluster is loaded when a job is found, so one
//! program runs under Open MPI and under MPICH and what descends from it (Intel MPI, Cray MPICH,
//! MVAPICH), and nothing of them is needed to build it or to run it alone.

mod deal;
mod job;
mod library;

use std::ffi::c_int;

pub use self::deal::Deal;
pub use self::job::Job;
use self::library::Library;
use super::Network;
use crate::error::{Error, Result};

/// Most bytes that one call of the library carries, together for all processes: its counts are C
/// integers.
const MOST_AT_ONCE: usize = 1 << 30;

/// A process of an MPI job. Only the thread that joined calls its functions.
///
/// Dropping it ends all processes of the job with exit code 1, unless [`Mpi::finish`] was called: a
/// process that leaves alone would let the others wait.
pub struct Mpi {
    library: Library,
    rank: usize,
    size: usize,
    finished: bool,
}

impl Mpi {
    /// Joins the job that started this process; `None` if the process runs alone.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no MPI library for the job, or if it fails.
    pub fn join() -> Result<Option<Self>> {
        let variable = |name: &str| std::env::var(name).ok();
        let Some(job) = Job::of(variable).filter(|job| job.size > 1) else { return Ok(None) };
        let library = Library::load(&job, variable(library::VARIABLE)).map_err(|error| job.said_once(error))?;
        let [rank, size] = library.started()?.map(|number| usize::try_from(number).unwrap_or(0));
        if size != job.size {
            library.finalize();
            return Err(job.said_once(Error::Usage(format!(
                "the MPI library ({}) starts {size} processes, and the job has {}: name that of the launcher, as in \
                 {}=/path/libmpi.so",
                library.version(),
                job.size,
                library::VARIABLE
            ))));
        }
        Ok(Some(Self { library, rank, size, finished: false }))
    }

    /// The name and version of the library, as it says them.
    pub fn version(&self) -> &str {
        self.library.version()
    }

    /// Leaves the job together with all other processes.
    pub fn finish(mut self) {
        self.finished = true;
        self.library.finalize();
    }

    /// Ends all processes of the job at once, with this exit code.
    pub fn abort(&self, code: u8) {
        self.library.abort(code);
    }

    /// Runs one round of [`Network::all_to_all`]: at most `most` bytes for each process.
    fn round(&self, to: &[Vec<u8>], lengths: &[[usize; 2]], (done, most): (usize, usize)) -> Result<Vec<Vec<u8>>> {
        let part = |length: usize| length.saturating_sub(done).min(most);
        let sent: Vec<usize> = to.iter().map(|bytes| part(bytes.len())).collect();
        let got: Vec<usize> = lengths.iter().map(|[length, _]| part(*length)).collect();
        // The address of an empty vector is Open MPI's MPI_IN_PLACE, so neither buffer is empty.
        let mut out = Vec::with_capacity(sent.iter().sum::<usize>().max(1));
        for (bytes, length) in to.iter().zip(&sent) {
            out.extend_from_slice(&bytes[bytes.len().min(done)..][..*length]);
        }
        let mut into = vec![0; got.iter().sum::<usize>().max(1)];
        self.library.all_to_all_v((&out, &counts(&sent)?), (&mut into, &counts(&got)?))?;
        let mut rest = &into[..];
        let mut taken = |length: &usize| {
            let (taken, after) = rest.split_at(*length);
            rest = after;
            taken.to_vec()
        };
        Ok(got.iter().map(&mut taken).collect())
    }
}

/// Counts and their running sums, as C integers.
fn counts(lengths: &[usize]) -> Result<[Vec<c_int>; 2]> {
    let failed = |_| Error::Usage("a message between processes is longer than 2 GiB".into());
    let count = |length: usize| c_int::try_from(length).map_err(failed);
    let mut sum = 0;
    let mut places = Vec::with_capacity(lengths.len());
    for length in lengths {
        places.push(count(sum)?);
        sum += length;
    }
    Ok([lengths.iter().map(|length| count(*length)).collect::<Result<_>>()?, places])
}

impl Network for Mpi {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.size
    }

    fn all_to_all(&self, mut to: Vec<Vec<u8>>) -> Result<Vec<Vec<u8>>> {
        to.resize(self.size, Vec::new());
        let longest = to.iter().map(Vec::len).max().unwrap_or(0);
        // Each process learns the length of its message, and the longest message of the sender.
        let words = to.iter().flat_map(|bytes| [bytes.len() as u64, longest as u64]);
        self.library.meet()?;
        let lengths = self.library.all_to_all(&words.collect::<Vec<_>>())?;
        let lengths: Vec<[usize; 2]> = lengths.chunks_exact(2).map(|two| [two[0] as usize, two[1] as usize]).collect();
        let longest = lengths.iter().map(|[_, longest]| *longest).max().unwrap_or(0);
        let most = MOST_AT_ONCE / self.size;
        let mut all = vec![Vec::new(); self.size];
        for done in (0..longest).step_by(most.max(1)) {
            let round = self.round(&to, &lengths, (done, most))?;
            all.iter_mut().zip(round).for_each(|(all, bytes)| all.extend(bytes));
        }
        Ok(all)
    }
}

impl Drop for Mpi {
    fn drop(&mut self) {
        if !self.finished {
            self.abort(1);
        }
    }
}
