//! Progress of long work.

/// Receives the progress of work that may take seconds. Stages follow each other; `advance` may be
/// called from any thread.
pub trait Progress: Sync {
    /// A stage begins. `what` describes it, and `units` is its amount of work (0 if unknown).
    fn begin(&self, what: &str, units: u64);
    /// This many more units are done.
    fn advance(&self, units: u64);
    /// The stage is over.
    fn end(&self);
    /// A sentence for the user: a default that was chosen, a part that was left out, a
    /// warning. Ignored unless implemented.
    fn note(&self, _line: &str) {}
}

/// Ignores all progress.
impl Progress for () {
    fn begin(&self, _what: &str, _units: u64) {}
    fn advance(&self, _units: u64) {}
    fn end(&self) {}
}
