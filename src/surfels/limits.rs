//! What keeps the stray points of scans from spoiling a picture.

use crate::{Error, Result};

/// Which points of a cloud become surfels, and of those whose radius is estimated, how large they may be and whether they curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Points are left out whose mean distance to 16 neighbours exceeds the mean of all by more than so many standard
    /// deviations; None keeps all.
    pub outliers: Option<f64>,
    /// No estimated half-axis is longer than this times the median of those of the neighbours; infinite for no limit.
    pub largest_ratio: f64,
    /// Disks of estimated sizes curve as the surface around them does ([`Cap`](crate::scene::Cap)); else they are flat.
    pub curved: bool,
}

impl Default for Limits {
    /// All points, no half-axis above three times those around it, and curved disks.
    fn default() -> Self {
        Self { outliers: None, largest_ratio: 3.0, curved: true }
    }
}

impl Limits {
    /// Refuses what limits nothing or everything.
    pub(crate) fn check(&self) -> Result<()> {
        if self.outliers.is_some_and(|deviations| !(deviations.is_finite() && deviations >= 0.0)) {
            return Err(Error::Usage(
                "outliers are beyond a number of standard deviations that is not negative".into(),
            ));
        }
        if self.largest_ratio.is_nan() || self.largest_ratio < 1.0 {
            return Err(Error::Usage("the largest radius is at least 1 times that of the neighbours".into()));
        }
        Ok(())
    }
}
