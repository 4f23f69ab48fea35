//! Transparency: how a pixel shows the surfaces behind its nearest one.
//!
//! # Meaning of alpha
//!
//! A surfel's alpha a_i, times [`Settings::opacity`](crate::plan::Settings::opacity) A,
//! means
//!
//! - in **layers** mode: the opacity of the *surface* that overlapping surfels form. The fragments
//!   of a pixel are grouped into surfaces, and each surface has the weighted means of its
//!   fragments, with weights w_i and premultiplied colours c_i:
//!
//!   `alpha = A sum(w_i a_i) / sum(w_i)`, `colour = A sum(w_i c_i) / sum(w_i)`.
//!
//!   Both are divided by the summed weight, so a cloud of alpha 0.5 has the opacity 0.5 at any
//!   sampling density. The summed weight itself must not count as opacity: it is small between the
//!   centres of disks that just meet, and surfaces would have holes
//!   there (the guide, transparency).
//! - in **sorted** mode: the opacity of one *fragment* at the surfel's centre, which falls off with
//!   the kernel: `alpha_i = A w_i a_i`. A denser cloud is therefore more opaque.
//!
//! For Gaussian surfels ([`gaussian`](super::gaussian)) alphas also have a lower cutoff and an
//! upper limit.
//!
//! Both modes composite from front to back in linear light, `shown += T colour` and
//! `T *= 1 - alpha`, starting with a transmittance T of 1; the background shows through the
//! remaining T.
//!
//! For comparison, two modes approximate the sorted one by order-independent sums
//! ([`oit`](crate::passes::oit)).

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// The fragments or surfaces that are composited at a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Composite {
    /// The nearest surface alone; the background shows through its alpha.
    #[default]
    Opaque,
    /// This many of the nearest surfaces, front to back; [`ALL_LAYERS`] for all.
    Layers(u32),
    /// Every fragment, front to back; fragments at one depth in the order of
    /// [`order`](crate::passes::order).
    Sorted,
    /// As [`Self::Sorted`], by the rules of Gaussian surfels ([`gaussian`](super::gaussian)).
    Gaussians,
    /// An approximation of [`Self::Sorted`] without sorting: every fragment counts by a weight that
    /// falls with its depth (McGuire and Bavoil 2013).
    Weighted,
    /// An approximation of [`Self::Sorted`] without sorting: every fragment counts by the
    /// transmittance in front of it, which is estimated from moments of all fragments (Münstermann
    /// et al. 2018).
    Moments,
}

impl Composite {
    /// Whether all fragments of a pixel are summed at once, in any order.
    pub fn is_order_free(self) -> bool {
        matches!(self, Self::Weighted | Self::Moments)
    }
}

/// The layer count for all surfaces of a pixel.
pub const ALL_LAYERS: u32 = u32::MAX;

impl FromStr for Composite {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let layers = |number: &str| number.parse().ok().filter(|layers| *layers > 0).map(Self::Layers);
        let named = match text.split_once(':') {
            None if text == "opaque" => Some(Self::Opaque),
            None if text == "layers" => Some(Self::Layers(ALL_LAYERS)),
            None if text == "sorted" => Some(Self::Sorted),
            None if text == "gaussians" => Some(Self::Gaussians),
            None if text == "weighted" => Some(Self::Weighted),
            None if text == "moments" => Some(Self::Moments),
            Some(("layers", number)) => layers(number),
            _ => None,
        };
        named.ok_or_else(|| {
            Error::Usage(format!(
                "surfaces are composited opaque, layers (all of them), layers:L (the nearest L), sorted, gaussians, weighted or moments, \
                 not {text:?}"
            ))
        })
    }
}

/// The treatment of the surfaces behind the last of [`Composite::Layers`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Tail {
    /// They are blended by weight into one more surface.
    #[default]
    Sum,
    /// They are left out.
    None,
}

impl FromStr for Tail {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "sum" => Ok(Self::Sum),
            "none" => Ok(Self::None),
            _ => Err(Error::Usage(format!("the tail behind the last layer is sum or none, not {text:?}"))),
        }
    }
}

/// Compositing ends below this transmittance: anything behind changes a colour by at most this
/// fraction of itself.
pub const LEAST_TRANSMITTANCE: f64 = 1.0 / (1u64 << 30) as f64;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn ways_to_composite_are_read_and_refused() {
        for (text, composite) in [
            ("opaque", Composite::Opaque),
            ("layers", Composite::Layers(ALL_LAYERS)),
            ("layers:3", Composite::Layers(3)),
            ("sorted", Composite::Sorted),
            ("gaussians", Composite::Gaussians),
            ("weighted", Composite::Weighted),
            ("moments", Composite::Moments),
        ] {
            assert_eq!(text.parse::<Composite>().unwrap(), composite);
        }
        for bad in ["", "layers:", "layers:0", "layers:-1", "layers:x", "sorted:2", "opaque:1", "layer"] {
            assert!(bad.parse::<Composite>().is_err(), "{bad}");
        }
    }
}
