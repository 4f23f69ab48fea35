//! Limits that keep the stray points of scans from spoiling a picture.

use crate::{Error, Result};

/// Limits on the points that become surfels and, where radii are estimated, on the surfels' size
/// and curvature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Leaves out points whose mean distance to 16 neighbours exceeds the mean over all points by
    /// more than this many standard deviations; None keeps all.
    pub outliers: Option<f64>,
    /// No estimated half-axis is longer than this times the median of the neighbours'; infinite for
    /// no limit.
    pub largest_ratio: f64,
    /// Surfels whose size is estimated curve as the surface around them does
    /// ([`Cap`](crate::scene::Cap)); otherwise they are flat.
    pub curved: bool,
}

impl Default for Limits {
    /// All points, no half-axis longer than three times the median of the neighbours', and curved
    /// surfels.
    fn default() -> Self {
        Self { outliers: None, largest_ratio: 3.0, curved: true }
    }
}

impl Limits {
    /// Rejects limits out of range.
    pub(crate) fn check(&self) -> Result<()> {
        if self.outliers.is_some_and(|deviations| !(deviations.is_finite() && deviations >= 0.0)) {
            return Err(Error::Usage(
                "the limit for outliers must be a finite number of standard deviations that is not negative".into(),
            ));
        }
        if self.largest_ratio.is_nan() || self.largest_ratio < 1.0 {
            return Err(Error::Usage("the limit for radii must be at least 1 times the neighbours'".into()));
        }
        Ok(())
    }
}
