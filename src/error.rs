//! Errors. Each is one sentence that names the file, adapter or limit and says what to do.

use std::path::{Path, PathBuf};

use crate::address;

/// The library's result.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A failure, worded for the person at the terminal.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be opened or read.
    #[error("cannot read {path}: {source}", path = shown(path))]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A file was read, but its content violates its format.
    #[error("{path}: {what}", path = shown(path))]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The fault, and its place.
        what: String,
    },
    /// An output file could not be written; no partial file is left.
    #[error("cannot write {path}: {source}", path = shown(path))]
    Write {
        /// The file that was asked for.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// An argument that can never work, whatever the files and the machine (exit code 2).
    #[error("{0}")]
    Usage(String),
    /// The system has too little memory.
    #[error("the system has no memory for {what}: about {mebibytes} MiB are needed")]
    NoMemory {
        /// The data that would need the memory.
        what: String,
        /// The size of that data, MiB.
        mebibytes: u64,
    },
    /// The inputs together hold nothing to draw.
    #[error("{0}")]
    EmptyScene(String),
    /// No adapter fits what was asked.
    #[error("{0}")]
    NoAdapter(String),
    /// A limit of the adapter would be exceeded.
    #[error("{adapter}: {limit} is {available}, but {needed} are needed {what}")]
    Limit {
        /// The adapter's name.
        adapter: String,
        /// The limit as WebGPU names it.
        limit: &'static str,
        /// The adapter's value of the limit.
        available: u64,
        /// The value that the render needs.
        needed: u64,
        /// The use of that value, and what to change.
        what: String,
    },
    /// The graphics stack failed: out of memory, lost device, rejected shader.
    #[error("{adapter}: {what}")]
    Gpu {
        /// The adapter's name.
        adapter: String,
        /// The device's report.
        what: String,
    },
    /// One picture of many failed.
    #[error("the view {path}: {source}", path = shown(path))]
    View {
        /// Where the picture would have been written.
        path: PathBuf,
        /// Why there is none.
        source: Box<Error>,
    },
    /// This process of a job failed. All others know that.
    #[error("{}{source}", of_process(*rank))]
    Process {
        /// The number of the process, from 0.
        rank: usize,
        /// Why it failed.
        source: Box<Error>,
    },
    /// Another process of the job failed, and prints why.
    #[error("process {rank} of the job failed")]
    OtherProcess {
        /// The number of that process, from 0.
        rank: usize,
        /// Its exit code.
        code: u8,
    },
    /// A benchmark study ran to its end, but a configuration did not do what the study states.
    #[error("the study {name} failed: {what}")]
    Study {
        /// The study's name.
        name: String,
        /// The configuration and scene that failed, and how.
        what: String,
    },
}

/// Names a process for a message. The errors of the first one are mostly those of all.
fn of_process(rank: usize) -> String {
    if rank == 0 { String::new() } else { format!("process {rank}: ") }
}

/// Formats a path for a message, without control characters. Paths may come from a file's content,
/// and a terminal would obey control characters in them. Addresses lose their secrets.
fn shown(path: &Path) -> String {
    address::shown(path).display().to_string().replace(char::is_control, "\u{fffd}")
}

impl Error {
    /// Returns the error of a file whose content violates its format.
    pub fn malformed(path: &Path, what: impl Into<String>) -> Self {
        Self::Malformed { path: path.to_owned(), what: what.into() }
    }

    /// Returns the error of a file that could not be read.
    pub fn read(path: &Path, source: std::io::Error) -> Self {
        Self::Read { path: path.to_owned(), source }
    }

    /// Returns the error of a file that could not be written.
    pub fn write(path: &Path, source: std::io::Error) -> Self {
        Self::Write { path: path.to_owned(), source }
    }

    /// Names the file of an [`Error::EmptyScene`] if there is exactly one input.
    #[must_use]
    pub fn of_inputs(self, inputs: &[PathBuf]) -> Self {
        match (self, inputs) {
            (Self::EmptyScene(what), [input]) => Self::malformed(input, what),
            (error, _) => error,
        }
    }

    /// Wraps this error as that of the picture at `path`, which is one of many.
    pub fn of_view(self, path: &Path) -> Self {
        Self::View { path: path.to_owned(), source: Box::new(self) }
    }

    /// The exit code of this failure on the command line: 2 for unusable arguments, 1 for a failed
    /// run.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            Self::View { source, .. } | Self::Process { source, .. } => source.exit_code(),
            Self::OtherProcess { code, .. } => *code,
            _ => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_on_a_line() {
        let path = Path::new("a\u{1b}[31m\n.png");
        let none = || std::io::Error::from(std::io::ErrorKind::NotFound);
        let view = Error::Usage("no".into()).of_view(path);
        for error in [Error::read(path, none()), Error::write(path, none()), Error::malformed(path, "no"), view] {
            let message = error.to_string();
            assert!(!message.contains(char::is_control) && message.contains("[31m"), "{message}");
        }
    }
}
