//! A kernel file of a user in place of a built-in one.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use crate::error::{Error, Result};

/// A WGSL text that replaces the built-in file of the name `file`, such as `kernel_ellipse.wgsl`.
///
/// It is parsed from `FILE=PATH`: the built-in file's name and the path of the text.
#[derive(Clone, Debug, PartialEq)]
pub struct Replacement {
    file: String,
    by: By,
}

#[derive(Clone, Debug, PartialEq)]
enum By {
    Path(PathBuf),
    /// A text, and its name in errors.
    Text(Arc<str>, String),
}

impl Replacement {
    /// Creates a replacement of `file` by `text`.
    pub fn new(file: impl Into<String>, text: impl Into<Arc<str>>) -> Self {
        let file = file.into();
        Self { by: By::Text(text.into(), file.clone()), file }
    }

    /// Returns the name of the built-in file.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Returns the path of a text that is not read yet; `None` for a text in memory.
    pub fn path(&self) -> Option<&Path> {
        match &self.by {
            By::Path(path) => Some(path),
            By::Text(..) => None,
        }
    }

    /// Returns this replacement with its text in memory, so that later changes of the file have no
    /// effect.
    ///
    /// # Errors
    /// [`Error::Read`] for a file that cannot be read.
    pub fn loaded(&self) -> Result<Self> {
        Ok(Self { file: self.file.clone(), by: By::Text(self.text()?, self.shown()) })
    }

    /// Returns the name of the text in errors: its path, or the name of the built-in file.
    pub fn shown(&self) -> String {
        match &self.by {
            By::Path(path) => path.display().to_string(),
            By::Text(_, shown) => shown.clone(),
        }
    }

    /// Returns this replacement with a relative path resolved against `folder`.
    #[must_use]
    pub fn within(self, folder: &Path) -> Self {
        let by = match self.by {
            By::Path(path) => By::Path(folder.join(path)),
            text => text,
        };
        Self { by, ..self }
    }

    /// Returns the text. Reads it if it is not in memory.
    ///
    /// # Errors
    /// [`Error::Read`] for a file that cannot be read.
    pub fn text(&self) -> Result<Arc<str>> {
        match &self.by {
            By::Text(text, _) => Ok(text.clone()),
            By::Path(path) => {
                let text = std::fs::read_to_string(path).map_err(|error| Error::read(path, error))?;
                Ok(text.into())
            }
        }
    }
}

impl FromStr for Replacement {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text.split_once('=') {
            Some((file, path)) if !file.is_empty() && !path.is_empty() => {
                Ok(Self { file: file.to_owned(), by: By::Path(path.into()) })
            }
            _ => Err(Error::Usage(format!(
                "'{text}' names no two files: give FILE=PATH, such as kernel_ellipse.wgsl=mine.wgsl"
            ))),
        }
    }
}
