//! Decides whether surfaces show through each other, and how their fragments are then composited.

use super::{Facts, Settings};
use crate::scene::{Composite, Map};

/// Returns the effective composite of a picture of the scene that `facts` describe. Layers of
/// opaque surfaces become [`Composite::Opaque`], because only the nearest shows, unless a map needs
/// the others.
pub fn composited(facts: &Facts, options: &Settings) -> Composite {
    let (low, _) = facts.color;
    match options.composite {
        Composite::Layers(_) if low[3] >= 1.0 && options.opacity >= 1.0 && !options.maps.has(Map::Surfaces) => {
            Composite::Opaque
        }
        chosen => chosen,
    }
}

/// How the fragment lists of pixels are composited ([`fragments`](crate::passes::fragments)).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Lists {
    /// Fragments are blended into surfaces, which are composited
    /// ([`layers`](crate::passes::layers)).
    Layers,
    /// Fragments are composited one by one ([`sorted`](crate::passes::sorted)).
    Sorted,
}

/// The weight of a fragment, besides its kernel's, where all fragments of a pixel are summed in any
/// order ([`oit`](crate::passes::oit)).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Oit {
    /// A function of the fragment's depth.
    Weighted,
    /// The transmittance in front of the fragment, estimated from moments
    /// ([`moments`](crate::passes::moments)).
    Moments,
}

impl Oit {
    /// Its name among a picture's needs.
    pub fn need(self) -> &'static str {
        match self {
            Self::Weighted => "oit-weighted",
            Self::Moments => "oit-moments",
        }
    }

    /// Returns the order-free weight of a picture, if it has one.
    pub(super) fn of(options: &Settings) -> Option<Self> {
        match options.composite {
            Composite::Weighted => Some(Self::Weighted),
            Composite::Moments => Some(Self::Moments),
            _ => None,
        }
    }
}

impl Lists {
    /// Its name among a picture's needs.
    pub fn need(self) -> &'static str {
        match self {
            Self::Layers => "lists-layers",
            Self::Sorted => "lists-sorted",
        }
    }

    /// Returns how a picture composites fragment lists, if it has any; the same for all renderers.
    pub(super) fn of(facts: &Facts, options: &Settings) -> Option<Self> {
        match composited(facts, options) {
            Composite::Opaque | Composite::Weighted | Composite::Moments => None,
            Composite::Layers(_) => Some(Self::Layers),
            Composite::Sorted | Composite::Gaussians => Some(Self::Sorted),
        }
    }
}
