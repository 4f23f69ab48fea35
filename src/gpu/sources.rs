//! WGSL sources of the kernels: named files, which are joined into modules.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::exact::ARITHMETIC;
use super::{Replacement, loops};
use crate::error::{Error, Result};

// Defines `FILES`, the name and text of each file of `wgsl/`, as the build script found them.
include!(concat!(env!("OUT_DIR"), "/kernels.rs"));

/// The line by which a file claims that kernels set its workgroup memory before they read it.
const SETS_MEMORY: &str = "// Kernels set the workgroup memory of this file before they read it.";

/// The source of a module.
#[derive(PartialEq)]
pub(crate) struct Text {
    pub joined: String,
    /// Whether every loop gets a counter that ends it.
    pub counts_loops: bool,
    /// The workgroup variables that kernels set before they read them.
    pub set_memory: Vec<String>,
    /// Whether kernels divide and take roots by functions of their own on every device.
    pub divides: bool,
    /// The name of each joined file in messages, and its number of lines.
    files: Vec<(String, u32)>,
}

impl Text {
    /// Creates a module of one text, in which every loop gets a counter.
    pub fn alone(text: &str) -> Self {
        let joined = format!("{text}\n{}", Sources::default().join(&[ARITHMETIC]));
        Self { joined, counts_loops: true, divides: false, set_memory: Vec::new(), files: Vec::new() }
    }

    /// Maps a line of the joined text to its file and the line in that file. Both line numbers
    /// start at 1.
    pub fn place_of(&self, line: u32) -> Option<(&str, u32)> {
        let mut first = 1;
        self.files.iter().find_map(|(name, lines)| {
            let within = line.checked_sub(first)?;
            first += lines;
            (within < *lines).then_some((name.as_str(), within + 1))
        })
    }
}

/// The WGSL files of the kernels: the built-in files, which a researcher (or a test that must fail)
/// can replace in part.
#[derive(Clone, Debug)]
pub struct Sources {
    texts: BTreeMap<&'static str, Cow<'static, str>>,
    /// Names in messages of the files that a user wrote.
    shown: BTreeMap<&'static str, String>,
    counts_loops: bool,
    divides: bool,
}

impl Default for Sources {
    fn default() -> Self {
        Self {
            texts: FILES.iter().map(|&(name, text)| (name, Cow::Borrowed(text))).collect(),
            shown: BTreeMap::new(),
            counts_loops: false,
            divides: false,
        }
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

    /// Replaces built-in files by texts of a user.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no such file, and errors of reading.
    pub fn with(mut self, replacements: &[Replacement]) -> Result<Self> {
        for replacement in replacements {
            let file = replacement.file();
            let Some((&file, _)) = self.texts.get_key_value(file) else {
                return Err(Error::Usage(format!(
                    "there is no kernel file {file} to replace: the files in wgsl/ have names such as kernel_ellipse.wgsl"
                )));
            };
            self.texts.insert(file, Cow::Owned(replacement.text()?.to_string()));
            self.shown.insert(file, replacement.shown());
        }
        Ok(self)
    }

    /// Returns the text of a replaced file and its name in messages; `None` for a built-in file.
    pub(crate) fn replaced(&self, file: &str) -> Option<(&str, &str)> {
        match self.texts.get_key_value(file) {
            Some((file, Cow::Owned(text))) => Some((text, self.shown.get(file).map_or(file, String::as_str))),
            _ => None,
        }
    }

    /// Returns these sources with counters in all loops, even in those that are proven to end.
    pub(crate) fn with_counted_loops(self) -> Self {
        Self { counts_loops: true, ..self }
    }

    /// Returns these sources with division and roots by functions of their own, even on devices
    /// whose instructions round to nearest.
    pub(crate) fn with_own_division(self) -> Self {
        Self { divides: true, ..self }
    }

    /// Returns the source of the module of `files`, and of the arithmetic.
    pub(crate) fn text(&self, files: &[&str]) -> Text {
        self.text_of(&[files, &[ARITHMETIC]].concat())
    }

    /// Returns the source of the module of `files` alone.
    pub(super) fn text_of(&self, files: &[&str]) -> Text {
        let shown = |file: &&str| {
            let text = self.texts.get(file).map_or("", |text| text);
            // Joining ends each text with a line break.
            let lines = text.matches('\n').count() as u32 + 1;
            (self.shown.get(file).map_or_else(|| (*file).to_owned(), String::clone), lines)
        };
        Text {
            joined: self.join(files),
            counts_loops: !self.all_end(files),
            divides: self.divides,
            set_memory: self.set_memory(files),
            files: files.iter().map(shown).collect(),
        }
    }

    /// Whether all loops of `files` are proven to end and so need no counters.
    pub(super) fn all_end(&self, files: &[&str]) -> bool {
        let ends = |file: &&str| matches!(self.texts.get(file), Some(Cow::Borrowed(text)) if loops::all_end(text));
        !self.counts_loops && files.iter().all(ends)
    }

    /// The workgroup variables of `files` that kernels set before they read them, as their files
    /// claim; none if a file is not built in.
    fn set_memory(&self, files: &[&str]) -> Vec<String> {
        let built_in: Option<Vec<&str>> = files
            .iter()
            .map(|file| match self.texts.get(file) {
                Some(Cow::Borrowed(text)) => Some(*text),
                _ => None,
            })
            .collect();
        let claiming = built_in.unwrap_or_default().into_iter().filter(|text| text.contains(SETS_MEMORY));
        let variables = claiming.flat_map(str::lines).filter_map(|line| line.strip_prefix("var<workgroup> "));
        variables.filter_map(|line| Some(line.split_once(':')?.0.to_owned())).collect()
    }

    /// Joins `files` into one module. WGSL's module scope is free of order, so joining is
    /// concatenation.
    pub fn join(&self, files: &[&str]) -> String {
        files.iter().map(|name| self.texts.get(name).map_or("", |text| text)).collect::<Vec<_>>().join("\n")
    }
}
