//! Whether surfaces show through each other at all, and what becomes of their fragments if they do.

use super::{Facts, RenderOptions};
use crate::scene::{Composite, Map};

/// What is composited in a picture of the scene that `facts` are of: of surfaces that are all opaque the nearest one, as nobody sees
/// another, unless a map asks for them.
pub fn composited(facts: &Facts, options: &RenderOptions) -> Composite {
    let (low, _) = facts.color;
    match options.composite {
        Composite::Layers(_) if low[3] >= 1.0 && options.opacity >= 1.0 && !options.maps.has(Map::Surfaces) => {
            Composite::Opaque
        }
        chosen => chosen,
    }
}

/// What becomes of the lists of pixels' fragments ([`fragments`](crate::passes::fragments)).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Lists {
    /// Surfaces, blended each and composited ([`layers`](crate::passes::layers)).
    Layers,
    /// They are composited one by one ([`sorted`](crate::passes::sorted)).
    Sorted,
}

/// What weighs a fragment beside its kernel, where all of a pixel are summed in any order ([`oit`](crate::passes::oit)).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Oit {
    /// Its depth.
    Weighted,
    /// What the moments of all fragments say of its depth ([`moments`](crate::passes::moments)).
    Moments,
}

impl Oit {
    /// That of a picture, if it has one.
    pub(super) fn of(options: &RenderOptions) -> Option<Self> {
        match options.composite {
            Composite::Weighted => Some(Self::Weighted),
            Composite::Moments => Some(Self::Moments),
            _ => None,
        }
    }
}

impl Lists {
    /// Those of a picture, whoever renders it.
    pub(super) fn of(facts: &Facts, options: &RenderOptions) -> Option<Self> {
        match composited(facts, options) {
            Composite::Opaque | Composite::Weighted | Composite::Moments => None,
            Composite::Layers(_) => Some(Self::Layers),
            Composite::Sorted | Composite::Gaussians => Some(Self::Sorted),
        }
    }
}
