//! User-written blending kernels: their weights in f64, and counts of invalid weights.

use std::fmt;
use std::sync::Arc;

use serde::Serialize;

/// Number of steps of the distance from a disk's centre at which a kernel is tested.
const DISTANCES: u32 = 4096;

/// The error that a loop of a kernel did not end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Endless;

/// A user-written blending kernel, evaluated in f64. The reference draws with it in place of a
/// built-in kernel, so that the device's error is only its rounding.
#[derive(Clone)]
pub struct OwnKernel {
    name: String,
    weight: Arc<dyn Fn(f64) -> Result<f64, Endless> + Send + Sync>,
}

impl fmt::Debug for OwnKernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "OwnKernel({})", self.name)
    }
}

/// Two kernels are equal if they are clones of the same kernel.
impl PartialEq for OwnKernel {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && Arc::ptr_eq(&self.weight, &other.weight)
    }
}

impl OwnKernel {
    /// Creates a kernel from its weight, a function of the squared distance from the disk's centre
    /// in radii. The weight is 1 at the centre, and the rim is at distance 1. Reports call the
    /// kernel `name`.
    pub fn new(name: impl Into<String>, weight: impl Fn(f64) -> f64 + Send + Sync + 'static) -> Self {
        Self::fallible(name, move |rho2| Ok(weight(rho2)))
    }

    /// As [`Self::new`], for a weight that may fail to be evaluated.
    pub(crate) fn fallible(
        name: impl Into<String>,
        weight: impl Fn(f64) -> Result<f64, Endless> + Send + Sync + 'static,
    ) -> Self {
        Self { name: name.into(), weight: Arc::new(weight) }
    }

    /// The weight at the squared distance `rho2`, clamped to [0, 1]; 0 if it is NaN or a loop does
    /// not end.
    pub fn weight(&self, rho2: f64) -> f64 {
        (self.weight)(rho2).ok().filter(|weight| !weight.is_nan()).unwrap_or(0.0).clamp(0.0, 1.0)
    }

    /// Tests the kernel at 4,097 distances from the disk's centre to `farthest` radii, and counts
    /// weights outside [0, 1]. It stops at a loop that does not end.
    pub fn faults(&self, farthest: f64) -> KernelFaults {
        let mut faults = KernelFaults { kernel: self.name.clone(), ..KernelFaults::default() };
        for k in 0..=DISTANCES {
            if faults.endless > 0 {
                break;
            }
            faults.tried += 1;
            let rho = farthest * f64::from(k) / f64::from(DISTANCES);
            let count = match (self.weight)(rho * rho) {
                Err(Endless) => &mut faults.endless,
                Ok(weight) if weight.is_nan() => &mut faults.not_a_number,
                Ok(weight) if weight.is_infinite() => &mut faults.infinite,
                Ok(weight) if weight < 0.0 => &mut faults.negative,
                // Rounding may exceed 1 a little, which is no fault.
                Ok(weight) if weight > 1.0 + 1e-6 => &mut faults.above_one,
                Ok(_) => continue,
            };
            *count += 1;
            faults.first.get_or_insert(rho);
        }
        faults
    }
}

/// Counts of the invalid weights of a user-written kernel. The device clamps weights to [0, 1], so
/// that a picture does not show such faults.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct KernelFaults {
    /// The kernel's file or name.
    pub kernel: String,
    /// Number of distances from a disk's centre that were tested.
    pub tried: u32,
    /// Weights that are NaN.
    pub not_a_number: u32,
    /// Weights that are infinite.
    pub infinite: u32,
    /// Weights below 0.
    pub negative: u32,
    /// Weights above 1.
    pub above_one: u32,
    /// Calls whose loops do not end.
    pub endless: u32,
    /// The least distance with a fault, in radii.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first: Option<f64>,
}

impl KernelFaults {
    /// Returns a line that says which weights are wrong; None if all are valid.
    pub fn sentence(&self) -> Option<String> {
        let first = self.first?;
        let counts = [
            (self.not_a_number, "NaN"),
            (self.infinite, "infinite"),
            (self.negative, "negative"),
            (self.above_one, "above 1"),
            (self.endless, "missing, as a loop does not end"),
        ];
        let wrong: u32 = counts.iter().map(|(count, _)| count).sum();
        let counts: Vec<_> =
            counts.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect();
        Some(format!(
            "warning: of {} weights of the kernel {}, {} are wrong, first at {first:.4} radii: {}; the picture has them clamped to 0 to 1",
            self.tried,
            self.kernel,
            wrong,
            counts.join(", ")
        ))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn weights_that_are_none_are_counted_and_named() {
        let fine = OwnKernel::new("fine", |rho2| 1.0 - rho2);
        assert_eq!(fine.faults(1.0).sentence(), None);
        assert_eq!(fine.weight(0.25), 0.75);
        let root = OwnKernel::new("root", |rho2| (-1.0 - rho2).sqrt());
        assert_eq!((root.faults(1.0).not_a_number, root.faults(1.0).first), (4097, Some(0.0)));
        assert_eq!(root.weight(0.5), 0.0);
        let below = OwnKernel::new("below", |rho2| 0.5 - rho2).faults(1.0);
        assert_eq!((below.negative, below.not_a_number), (1200, 0));
        let sentence = below.sentence().unwrap();
        assert!(sentence.contains("kernel below, 1200 are wrong, first at 0.7073 radii: 1200 negative"), "{sentence}");
        assert_eq!(OwnKernel::new("high", |rho2| 2.0 * (1.0 - rho2)).faults(1.0).above_one, 2897);
        let endless = OwnKernel::fallible("endless", |rho2| if rho2 > 0.25 { Err(Endless) } else { Ok(1.0) });
        assert_eq!((endless.faults(1.0).endless, endless.faults(1.0).tried), (1, 2050));
        assert_eq!(endless.weight(0.5), 0.0);
        // Corners of squares lie at sqrt(2) radii.
        assert!(OwnKernel::new("cone", |rho2| 1.0 - rho2.sqrt()).faults(2f64.sqrt()).negative > 1000);
    }
}
