//! Whether surfaces show through each other at all.

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
