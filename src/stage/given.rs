//! Points in the memory of the caller.

use std::borrow::Cow;

use crate::error::Result;
use crate::io::Points;
use crate::progress::Progress;

/// Memory of the caller that a [`Scene`](super::Scene) draws in place of files. The points are
/// taken from it whenever surfels are made, as files are read then, so that the scene itself keeps
/// no copy.
pub trait Given: Send + Sync {
    /// The number of inputs.
    fn inputs(&self) -> usize;

    /// Returns the points of each input: the same at each call.
    ///
    /// # Errors
    ///
    /// Any error, which ends the render.
    fn points(&self, progress: &dyn Progress) -> Result<Cow<'_, [Points]>>;
}

impl Given for Vec<Points> {
    fn inputs(&self) -> usize {
        self.len()
    }

    fn points(&self, _: &dyn Progress) -> Result<Cow<'_, [Points]>> {
        Ok(Cow::Borrowed(self))
    }
}
