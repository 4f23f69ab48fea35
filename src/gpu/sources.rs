//! WGSL sources of the kernels: named files, which are joined into modules.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::loops;
use crate::error::{Error, Result};

// Defines `FILES`, the name and text of each file of `wgsl/`, as the build script found them.
include!(concat!(env!("OUT_DIR"), "/kernels.rs"));

/// The source of a module.
pub(crate) struct Text {
    pub joined: String,
    /// Whether every loop gets a counter that ends it.
    pub counts_loops: bool,
}

/// The WGSL files of the kernels. They are the built-in ones, parts of which a researcher (or a
/// test that must fail) can replace.
#[derive(Clone, Debug)]
pub struct Sources {
    texts: BTreeMap<&'static str, Cow<'static, str>>,
    counts_loops: bool,
}

impl Default for Sources {
    fn default() -> Self {
        Self { texts: FILES.iter().map(|&(name, text)| (name, Cow::Borrowed(text))).collect(), counts_loops: false }
    }
}

impl Sources {
    /// Replaces the one occurrence of `from` in `file` by `to`.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no such file, or `from` does not occur exactly once.
    pub fn replace(mut self, file: &str, from: &str, to: &str) -> Result<Self> {
        let text = self.texts.get_mut(file).ok_or_else(|| Error::Usage(format!("there is no kernel file {file}")))?;
        if text.matches(from).count() != 1 {
            return Err(Error::Usage(format!("{file} must contain {from:?} exactly once to be replaced")));
        }
        *text = Cow::Owned(text.replacen(from, to, 1));
        Ok(self)
    }

    /// Returns these sources with counters in all loops, even in those that are proven to end.
    pub(crate) fn with_counted_loops(self) -> Self {
        Self { counts_loops: true, ..self }
    }

    /// Returns the source of the module of `files`.
    pub(super) fn text(&self, files: &[&str]) -> Text {
        Text { joined: self.join(files), counts_loops: !self.all_end(files) }
    }

    /// Whether all loops of `files` are proven to end and so need no counters.
    pub(super) fn all_end(&self, files: &[&str]) -> bool {
        let ends = |file: &&str| matches!(self.texts.get(file), Some(Cow::Borrowed(text)) if loops::all_end(text));
        !self.counts_loops && files.iter().all(ends)
    }

    /// Joins `files` into one module. WGSL's module scope is free of order, so joining is
    /// concatenation.
    pub fn join(&self, files: &[&str]) -> String {
        files.iter().map(|name| self.texts.get(name).map_or("", |text| text)).collect::<Vec<_>>().join("\n")
    }
}
