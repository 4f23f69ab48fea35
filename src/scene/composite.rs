//! What shows of the surfaces behind a pixel's nearest one.
//!
//! # What alpha is
//!
//! A surfel's alpha a_i, times [`RenderOptions::opacity`](crate::plan::RenderOptions::opacity) A, is
//!
//! - in **layers** the opacity of the *surface* that overlapping surfels make. The fragments of a pixel are parted into surfaces, and a
//!   surface has the weighted means of its fragments, as the nearest one always had: with weights w_i and premultiplied colours c_i
//!
//!   `alpha = A sum(w_i a_i) / sum(w_i)`, `colour = A sum(w_i c_i) / sum(w_i)`.
//!
//!   Both are divided by the summed weight, so a cloud of alpha 0.5 has the opacity 0.5 however densely it is sampled.
//!   The summed weight itself is no part of it: it is small between the centres of disks that just meet, and surfaces would have holes there
//!   (README, "What shows through").
//! - **sorted** the opacity of one *fragment* at the surfel's centre, which falls off with the kernel: `alpha_i = A w_i a_i`. So a denser
//!   cloud is more opaque.
//!
//! By the rules of Gaussian surfels ([`gaussian`](super::gaussian)) alphas are cut off below and above besides.
//!
//! Either way, from front to back in linear light, `shown += T colour` and `T *= 1 - alpha`, from a transmittance T of 1; what is left of it
//! shows the background.
//!
//! Two ways approximate what is sorted by sums in any order ([`oit`](crate::passes::oit)), to compare with.

use std::str::FromStr;

use crate::error::Error;

/// What is composited at a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Composite {
    /// Its nearest surface alone, whose alpha shows the background.
    #[default]
    Opaque,
    /// So many of its surfaces from front to back, [`ALL_LAYERS`] for all.
    Layers(u32),
    /// Every fragment, in the order of depths; of one depth in that of the [`order`](crate::passes::order).
    Sorted,
    /// The same by the rules of Gaussian surfels ([`gaussian`](super::gaussian)).
    Gaussians,
    /// About that, without an order: every fragment, by a weight that falls with its depth (McGuire and Bavoil 2013).
    Weighted,
    /// About that, without an order: every fragment, by what the moments of all say is let through before it (Münstermann et al. 2018).
    Moments,
}

impl Composite {
    /// Fragments are summed in any order, all of a pixel at once.
    pub fn is_order_free(self) -> bool {
        matches!(self, Self::Weighted | Self::Moments)
    }
}

/// As many layers as there are surfaces.
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

/// What becomes of the surfaces behind the last of [`Composite::Layers`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tail {
    /// They are blended by weight, as one more surface.
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
            _ => Err(Error::Usage(format!("what lies behind the last layer is a sum or none, not {text:?}"))),
        }
    }
}

/// Transmittances below this show nothing more: what lies behind could change a colour by that part of itself.
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
