//! The kernels' texts: named files of WGSL, which are joined into modules.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::loops;
use crate::error::{Error, Result};

// `FILES`: each file of `wgsl/` by its name, as the build script found them.
include!(concat!(env!("OUT_DIR"), "/kernels.rs"));

/// A module's text.
pub(crate) struct Text {
    pub joined: String,
    /// Every loop gets a counter that ends it.
    pub counts_loops: bool,
}

/// The kernels' texts. The built-in ones, of which a researcher (or a test that must fail) may replace parts.
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
    /// Replaces the one place in `file` that reads `from`; an error if there is not exactly one.
    pub fn replace(mut self, file: &str, from: &str, to: &str) -> Result<Self> {
        let text = self.texts.get_mut(file).ok_or_else(|| Error::Usage(format!("there is no kernel file {file}")))?;
        if text.matches(from).count() != 1 {
            return Err(Error::Usage(format!("{file} must hold {from:?} once, to be replaced")));
        }
        *text = Cow::Owned(text.replacen(from, to, 1));
        Ok(self)
    }

    /// These texts, every loop of which is counted, those that are known to end too.
    pub(crate) fn with_counted_loops(self) -> Self {
        Self { counts_loops: true, ..self }
    }

    /// The module of `files`.
    pub(super) fn text(&self, files: &[&str]) -> Text {
        Text { joined: self.join(files), counts_loops: !self.all_end(files) }
    }

    /// Whether all loops of `files` are known to end, and so need not be counted.
    pub(super) fn all_end(&self, files: &[&str]) -> bool {
        let ends = |file: &&str| matches!(self.texts.get(file), Some(Cow::Borrowed(text)) if loops::all_end(text));
        !self.counts_loops && files.iter().all(ends)
    }

    /// One module of `files`: WGSL's module scope is free of order, so joining is concatenation.
    pub fn join(&self, files: &[&str]) -> String {
        files.iter().map(|name| self.texts.get(name).map_or("", |text| text)).collect::<Vec<_>>().join("\n")
    }
}
