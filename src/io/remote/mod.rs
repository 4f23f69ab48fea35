//! Files on servers, read over HTTP by ranges of bytes.
//!
//! ```text
//! request   one range of bytes, asked for again if the connection is lost
//! answer    checks that an answer is the range that was asked for, of the same file
//! cache     the ranges that were received last
//! ```

mod answer;
mod cache;
mod request;

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::iter::once;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use self::answer::Version;
use self::cache::Cache;
use self::request::Server;
use super::input::{MOST_COPIED, copied};

/// Size of the first range, and of each range behind a jump, bytes. The header and the records of
/// most LAS files fit in it.
const BLOCK: u64 = 1 << 14;

/// Largest amount that is read ahead of a sequential reader, bytes. A LAZ chunk of 50,000 points
/// takes a few hundred kilobytes.
const MOST_AHEAD: u64 = 1 << 22;

/// Largest range of one request, bytes. Larger ranges are divided, so that several connections
/// share them and a lost connection costs little.
const MOST_ASKED: u64 = 1 << 20;

/// Most bytes that are received before they are read, gaps included.
const MOST_EXPECTED: u64 = 3 << 24;

/// Ranges with at most this many bytes between them are one request: the headers of a request and
/// its answer take about as many.
const GAP: u64 = 1 << 10;

/// Number of requests for a file at the same time. At 50 ms each, 16 make 320 requests a second.
const CONNECTIONS: usize = 16;

/// Limits of waiting for a server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patience {
    /// Longest time until a connection is made.
    pub connect: Duration,
    /// Longest time in which not one byte arrives. Lost connections are tried again within it.
    pub stall: Duration,
}

impl Patience {
    /// Limits for a stall of this length.
    pub fn of_stall(stall: Duration) -> Self {
        Self { connect: stall.min(Duration::from_secs(10)), stall }
    }
}

impl Patience {
    /// The limits that the environment asks for: 30 s without a byte, or as many as the variable
    /// `EPSPLAT_HTTP_TIMEOUT` says, and at most 10 s for a connection. TCP sends a lost packet
    /// again after 1, 2, 4 and 8 s, so 30 s outlast four losses in a row.
    ///
    /// # Errors
    ///
    /// The variable is no number of seconds from 0.01 to 86,400.
    pub fn of_environment() -> io::Result<Self> {
        let Some(asked) = std::env::var_os("EPSPLAT_HTTP_TIMEOUT") else {
            return Ok(Self::of_stall(Duration::from_secs(30)));
        };
        let seconds = asked.to_str().and_then(|asked| asked.trim().parse::<f64>().ok());
        match seconds.filter(|seconds| (0.01..=86_400.0).contains(seconds)) {
            Some(seconds) => Ok(Self::of_stall(Duration::from_secs_f64(seconds))),
            None => Err(answer::error("EPSPLAT_HTTP_TIMEOUT is no number of seconds from 0.01 to 86400")),
        }
    }
}

/// A file on a server, with a position. Clones have positions of their own, and share connections
/// and received bytes.
#[derive(Clone, Debug)]
pub struct Remote {
    shared: Arc<Shared>,
    at: u64,
    /// The end of the last read.
    read_to: u64,
    /// The size of the range that was received last because this clone read it, bytes.
    window: u64,
}

#[derive(Debug)]
struct Shared {
    server: Server,
    version: Version,
    cache: Mutex<Cache>,
    /// The first error. Every later read repeats it, so no reader can take it for damage.
    failed: Mutex<Option<(io::ErrorKind, String)>>,
}

/// A remote file after the first request.
pub enum Opened {
    /// The server sends ranges.
    Ranges(Remote),
    /// The server sends files only whole; the bytes of this one, and its length if the server
    /// states it.
    Whole(Box<dyn Read>, Option<u64>),
}

impl Remote {
    /// Asks for the first bytes of the file at `address`.
    ///
    /// # Errors
    ///
    /// The server cannot be reached, refuses, or sends something else than it says. The error's
    /// text is a clause without the address.
    pub fn open(address: &str, patience: Patience) -> io::Result<Opened> {
        let server = Server::new(address, patience)?;
        match server.first(BLOCK)? {
            request::First::Part(bytes, version) => {
                let cache = Mutex::new(Cache::default());
                let shared = Arc::new(Shared { server, version, cache, failed: Mutex::default() });
                shared.cache().insert(0, bytes);
                Ok(Opened::Ranges(Self { shared, at: 0, read_to: 0, window: BLOCK }))
            }
            request::First::Whole(bytes, length) => Ok(Opened::Whole(bytes, length)),
        }
    }

    /// Length of the file, bytes.
    pub fn length(&self) -> u64 {
        self.shared.version.length
    }

    /// Appends up to `length` bytes from the offset `at`: fewer only at the end of the file.
    pub fn read_at(&self, at: u64, length: u64, into: &mut Vec<u8>) -> io::Result<()> {
        let end = at.saturating_add(length).min(self.length());
        let mut at = at;
        while at < end {
            if let Some(bytes) = self.shared.cache().at(at) {
                let taken = &bytes[..bytes.len().min((end - at) as usize)];
                into.extend_from_slice(taken);
                at += taken.len() as u64;
                continue;
            }
            self.shared.receive(joined(once(at..end.min(at + MOST_AHEAD))))?;
        }
        Ok(())
    }

    /// Receives ranges that will be read soon, several at the same time: as many of the first ones
    /// as are kept for sure.
    pub fn expect(&self, ranges: impl IntoIterator<Item = Range<u64>>) -> io::Result<()> {
        // A range that exceeds the limit is cut, so that a claimed length takes no memory.
        let within = |range: Range<u64>| {
            let most = range.start.saturating_add(2 * MOST_EXPECTED);
            range.start..range.end.min(self.length()).min(most)
        };
        let missing = self.shared.cache().missing(ranges.into_iter().map(within));
        let mut sum = 0;
        let kept = |range: &Range<u64>| {
            sum += range.end.saturating_sub(range.start);
            sum <= MOST_EXPECTED
        };
        self.shared.receive(joined(missing).into_iter().take_while(kept).collect())
    }

    /// Frees the memory of received bytes. They are asked for again if they are read again.
    pub fn forget(&self) {
        self.shared.cache().clear();
    }

    /// Fails with the first error of any earlier read.
    pub fn check(&self) -> io::Result<()> {
        self.shared.check()
    }

    /// Copies the whole file to an unnamed temporary file.
    pub fn copied(mut self) -> io::Result<File> {
        if self.length() > MOST_COPIED {
            return Err(too_long());
        }
        self.rewind()?;
        copied(&[], self, MOST_COPIED).map(|(file, _)| file)
    }
}

/// The error for a file that is too long to be copied.
pub fn too_long() -> io::Error {
    let what = format!("it is longer than {} MiB, the limit for a copy: download the file", MOST_COPIED >> 20);
    io::Error::new(io::ErrorKind::FileTooLarge, what)
}

/// Joins sorted ranges with small gaps, and divides large ones.
fn joined(ranges: impl IntoIterator<Item = Range<u64>>) -> Vec<Range<u64>> {
    let mut joined: Vec<Range<u64>> = Vec::new();
    for range in ranges {
        match joined.last_mut() {
            Some(last) if range.start <= last.end + GAP => last.end = last.end.max(range.end),
            _ => joined.push(range),
        }
    }
    let divided = |range: Range<u64>| {
        let end = range.end;
        range.step_by(MOST_ASKED as usize).map(move |start| start..end.min(start + MOST_ASKED))
    };
    joined.into_iter().flat_map(divided).collect()
}

impl Shared {
    fn cache(&self) -> MutexGuard<'_, Cache> {
        self.cache.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Receives these ranges into the cache, several at the same time.
    fn receive(&self, ranges: Vec<Range<u64>>) -> io::Result<()> {
        self.check()?;
        let threads = ranges.len().min(CONNECTIONS);
        let queue = Mutex::new(ranges.into_iter());
        let work = || {
            loop {
                let next = queue.lock().unwrap_or_else(PoisonError::into_inner).next();
                let Some(range) = next.filter(|_| self.check().is_ok()) else { return };
                match self.server.fetch(range.clone(), &self.version) {
                    Ok(bytes) => self.cache().insert(range.start, bytes),
                    Err(error) => self.fail(error),
                }
            }
        };
        std::thread::scope(|scope| {
            // Where the system refuses a thread, the others do its work.
            (1..threads).for_each(|_| drop(std::thread::Builder::new().spawn_scoped(scope, work)));
            work();
        });
        self.check()
    }

    fn fail(&self, error: io::Error) {
        let mut failed = self.failed.lock().unwrap_or_else(PoisonError::into_inner);
        failed.get_or_insert_with(|| (error.kind(), error.to_string()));
    }

    fn check(&self) -> io::Result<()> {
        let failed = self.failed.lock().unwrap_or_else(PoisonError::into_inner);
        failed.as_ref().map_or(Ok(()), |(kind, what)| Err(io::Error::new(*kind, what.clone())))
    }
}

impl Read for Remote {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if out.is_empty() || self.at >= self.length() {
            return Ok(0);
        }
        loop {
            if let Some(bytes) = self.shared.cache().at(self.at) {
                let count = bytes.len().min(out.len());
                out[..count].copy_from_slice(&bytes[..count]);
                self.at += count as u64;
                self.read_to = self.at;
                return Ok(count);
            }
            // A reader that goes on where its last read ended will likely go on further.
            self.window = if self.at == self.read_to { (2 * self.window).min(MOST_AHEAD) } else { BLOCK };
            let end = (self.at + self.window).min(self.length());
            let end = self.shared.cache().next_long(self.at + 1..end, BLOCK).unwrap_or(end);
            self.shared.receive(joined(once(self.at..end)))?;
        }
    }
}

impl Seek for Remote {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.length().checked_add_signed(by),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
        };
        self.at = at.ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "a position before the file"))?;
        Ok(self.at)
    }
}

/// The first bytes of the file at `address`, at most `most`.
pub fn start_of(address: &str, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    match Remote::open(address, Patience::of_environment()?)? {
        Opened::Ranges(remote) => remote.read_at(0, most, &mut bytes)?,
        Opened::Whole(whole, _) => drop(whole.take(most).read_to_end(&mut bytes)?),
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::single_range_in_vec_init)]
    fn near_ranges_are_joined_and_large_ones_divided() {
        assert_eq!(
            joined(vec![0..10, 10..20, 20 + GAP..30 + GAP, 40 + 2 * GAP..50 + 2 * GAP]),
            [0..30 + GAP, 40 + 2 * GAP..50 + 2 * GAP]
        );
        let large = 5..2 * MOST_ASKED + 6;
        let divided = [5..MOST_ASKED + 5, MOST_ASKED + 5..2 * MOST_ASKED + 5, 2 * MOST_ASKED + 5..2 * MOST_ASKED + 6];
        assert_eq!(joined(vec![large]), divided);
    }
}
