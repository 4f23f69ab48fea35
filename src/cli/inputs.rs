//! Help texts of inputs.

use epsplat::io::Format;

/// Returns the help text of an input: `what` it is and its file extensions.
pub(super) fn help_of(what: &str) -> String {
    let extensions: Vec<_> = Format::READ.iter().map(|(name, _)| format!(".{name}")).collect();
    format!("{what}: {}; - is standard input, http(s)://... a remote file", extensions.join(", "))
}

/// Returns the help text of a mesh: `what` it is and its file extensions.
pub(super) fn help_of_mesh(what: &str) -> String {
    let extensions: Vec<_> = Format::mesh_names().map(|name| format!(".{name}")).collect();
    format!("{what}: {}", extensions.join(", "))
}

/// Returns the help text of inputs that may also be folders.
pub(super) fn help_of_all(what: &str) -> String {
    format!("{}; a folder stands for its files, .vpc for its tiles", help_of(what))
}
