//! Errors of the library as exceptions. Their classes are in `epsplat/_errors.py`.

use std::io::ErrorKind;

use epsplat::Error;
use pyo3::prelude::*;

/// The name of the exception's class.
fn class(error: &Error) -> &'static str {
    match error {
        Error::Usage(_) => "UsageError",
        Error::Read { .. } | Error::Write { .. } => "FileError",
        Error::Malformed { .. } => "MalformedError",
        Error::EmptyScene(_) => "EmptySceneError",
        Error::NoMemory { .. } => "NoMemoryError",
        Error::NoAdapter(_) | Error::Limit { .. } | Error::Gpu { .. } => "DeviceError",
        Error::View { source, .. } | Error::Process { source, .. } => class(source),
        Error::OtherProcess { .. } => "Error",
        Error::Study { .. } => "StudyError",
    }
}

/// Returns the exception of an error, with the command line's sentence.
pub fn exception(py: Python<'_>, error: &Error) -> PyErr {
    let is_missing = matches!(error, Error::Read { source, .. } if source.kind() == ErrorKind::NotFound);
    named(py, if is_missing { "MissingFileError" } else { class(error) }, &error.to_string())
}

/// Returns an exception of unusable arguments.
pub fn usage(py: Python<'_>, sentence: &str) -> PyErr {
    named(py, "UsageError", sentence)
}

/// Returns an exception of a class of `epsplat/_errors.py`.
pub fn named(py: Python<'_>, class: &str, sentence: &str) -> PyErr {
    let made = py.import("epsplat._errors").and_then(|module| module.getattr(class)?.call1((sentence,)));
    made.map_or_else(|error| error, PyErr::from_value)
}
