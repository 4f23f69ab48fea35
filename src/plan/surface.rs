//! The ways in which the fragments of a pixel become its colour. Each picture has one of them.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{Accumulator, Facts, Lists, Oit, Organisation, Raster, Settings};
use crate::error::Error;
use crate::scene::{Blend, Composite};

/// How the fragments of a pixel become its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Surface {
    /// Compute kernels sum the fragments within epsilon of the nearest one.
    Blended {
        /// How the splats are drawn.
        splats: Splats,
        /// Inputs are kept separate ([`individuals`](crate::passes::individuals)).
        separate: bool,
    },
    /// Only the nearest fragment shows, and compute kernels find it in this way.
    Nearest(Winner),
    /// Pixels have lists of their fragments, which are blended into surfaces
    /// ([`layers`](crate::passes::layers)).
    Layers {
        /// Some lists are sorted and composited in rounds, because they exceed the loop limit of
        /// one invocation.
        long_lists: bool,
    },
    /// Pixels have lists of their fragments, which are composited one by one
    /// ([`sorted`](crate::passes::sorted)).
    Sorted {
        /// As for [`Surface::Layers`].
        long_lists: bool,
        /// Lists end where nothing behind shows, as some would be too long otherwise.
        veils: bool,
    },
    /// All fragments of a pixel are summed in any order, weighted by an estimate of what lies in
    /// front of each.
    OrderFree(Oit),
    /// The rasteriser and its blender draw the splats.
    Raster {
        /// The format of the rasteriser's sums, and its depth test.
        raster: Raster,
        /// How the rasteriser's fragments are shown.
        shown: Rasterised,
        /// The rasteriser draws a triangle per splat instead of a quad
        /// ([`tuning::PIXELS_A_TRIANGLE`](super::tuning::PIXELS_A_TRIANGLE)).
        triangles: bool,
    },
}

/// How compute kernels draw the splats that they sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Splats {
    /// One by one.
    Scattered,
    /// One by one, with identical surfels drawn once. This requires the accumulator `fixed`, a
    /// surfel with many copies, no texture, and no separate inputs.
    Copies,
    /// Tiles draw at least the large ones. This requires the accumulator `fixed`, and options that
    /// do not ask for scatter.
    Tiles {
        /// Tiles sum all splats, large and small, and resolve their pixels directly, so no sums are
        /// stored. With separate inputs they keep what the input shows instead.
        gather: bool,
        /// The invocations of a tile, and how they get the splats that they draw.
        fetch: Fetch,
    },
}

/// The invocations of a tile, and how they get the splats that they draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Fetch {
    /// Eight invocations, each with a column of pixels, fetch eight splats and exchange them by
    /// subgroup operations (`wgsl/tiles/tile.wgsl`, `splat_shared.wgsl`).
    Shared,
    /// Eight invocations, each with a column of pixels, fetch each splat for themselves
    /// (`splat_plain.wgsl`).
    Alone,
    /// An invocation for each pixel; all of them read splats that were copied to workgroup memory
    /// (`wgsl/tiles/staged.wgsl`).
    Staged,
}

impl Fetch {
    /// Every way and its name.
    pub const ALL: [(Self, &'static str); 3] =
        [(Self::Shared, "shared"), (Self::Alone, "alone"), (Self::Staged, "staged")];
}

impl FromStr for Fetch {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let known = Self::ALL.iter().find(|(_, name)| *name == text);
        known
            .map(|(fetch, _)| *fetch)
            .ok_or_else(|| Error::Usage(format!("tiles do not fetch splats {text:?}: take shared, alone or staged")))
    }
}

/// How compute kernels find the only fragment that shows at a pixel
/// ([`winner`](crate::passes::winner)).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Winner {
    /// All surfels have one colour, so the nearest depth is enough.
    Depth,
    /// One atomic minimum of a 64-bit number finds depth and colour together.
    Once,
    /// The nearest depth first, then its colour in a second pass.
    Second,
}

/// How the fragments that the rasteriser draws are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Rasterised {
    /// Fragments within epsilon of the nearest one are blended.
    Blended,
    /// The nearest fragment shows, by the depth test.
    Nearest,
    /// This many layers are peeled, one after the other ([`peel`](crate::passes::peel)).
    Layers(u32),
}

impl Surface {
    /// Returns the surface of a picture by any renderer: tiles and the rasteriser's triangles are
    /// decided later, for an adapter and a number of surfels.
    pub(super) fn of_picture(facts: &Facts, options: &Settings) -> Self {
        let Some(raster) = options.raster else { return Self::by_compute(facts, options) };
        let shown = match (options.blend, options.composite, Lists::of(facts, options)) {
            (Blend::Nearest, _, _) => Rasterised::Nearest,
            (_, Composite::Layers(layers), Some(_)) => Rasterised::Layers(layers),
            _ => Rasterised::Blended,
        };
        Self::Raster { raster, shown, triangles: false }
    }

    /// The surface of a picture by compute kernels or by their twins.
    pub(super) fn by_compute(facts: &Facts, options: &Settings) -> Self {
        if options.blend == Blend::Nearest {
            return Self::Nearest(Winner::Second);
        }
        if let Some(oit) = Oit::of(options) {
            return Self::OrderFree(oit);
        }
        match Lists::of(facts, options) {
            Some(Lists::Layers) => Self::Layers { long_lists: false },
            Some(Lists::Sorted) => Self::Sorted { long_lists: false, veils: false },
            None => Self::Blended {
                splats: match options.accumulator {
                    Accumulator::Fixed if options.organisation != Organisation::Scatter => {
                        Splats::Tiles { gather: false, fetch: Fetch::Alone }
                    }
                    _ => Splats::Scattered,
                },
                separate: options.separate && facts.individuals.len() > 1,
            },
        }
    }

    /// Whether compute kernels make weighted sums, in storage or in a tile's registers.
    pub fn sums_by_compute(&self) -> bool {
        matches!(self, Self::Blended { .. } | Self::OrderFree(_))
    }

    /// Whether compute kernels accumulate fragments after the nearest depths are known.
    pub fn accumulates(&self) -> bool {
        self.sums_by_compute() || *self == Self::Nearest(Winner::Second)
    }

    /// Whether the nearest fragment is the only one that shows, by any renderer.
    pub fn shows_nearest(&self) -> bool {
        matches!(self, Self::Nearest(_) | Self::Raster { shown: Rasterised::Nearest, .. })
    }

    /// How compute kernels find the only fragment that shows.
    pub fn winner(&self) -> Option<Winner> {
        match self {
            Self::Nearest(winner) => Some(*winner),
            _ => None,
        }
    }

    /// How the fragment lists of pixels are composited, if they have any.
    pub fn lists(&self) -> Option<Lists> {
        match self {
            Self::Layers { .. } => Some(Lists::Layers),
            Self::Sorted { .. } => Some(Lists::Sorted),
            _ => None,
        }
    }

    /// Whether some lists are processed in rounds.
    pub fn long_lists(&self) -> bool {
        matches!(self, Self::Layers { long_lists: true } | Self::Sorted { long_lists: true, .. })
    }

    /// Whether lists end where nothing behind shows.
    pub fn veils(&self) -> bool {
        matches!(self, Self::Sorted { veils: true, .. })
    }

    /// The order-free weight of fragments, if all are summed.
    pub fn oit(&self) -> Option<Oit> {
        match self {
            Self::OrderFree(oit) => Some(*oit),
            _ => None,
        }
    }

    /// Whether all small splats of a band are drawn into its nearest depths by one dispatch that
    /// could also project them. Separate inputs are drawn one after the other. Frames with lists
    /// may be cut into bands once their fragments are counted.
    pub fn draws_small_once(&self) -> bool {
        match self {
            Self::Blended { separate, .. } => !separate,
            Self::Nearest(_) | Self::OrderFree(Oit::Moments) => true,
            _ => false,
        }
    }

    /// The rasteriser's options, if it draws the splats.
    pub fn raster(&self) -> Option<Raster> {
        match self {
            Self::Raster { raster, .. } => Some(*raster),
            _ => None,
        }
    }

    /// Number of layers that the rasteriser peels.
    pub fn peels(&self) -> Option<u32> {
        match self {
            Self::Raster { shown: Rasterised::Layers(layers), .. } => Some(*layers),
            _ => None,
        }
    }

    /// Whether the rasteriser draws a triangle per splat.
    pub fn by_triangles(&self) -> bool {
        matches!(self, Self::Raster { triangles: true, .. })
    }

    /// Whether inputs are kept separate.
    pub fn separate(&self) -> bool {
        matches!(self, Self::Blended { separate: true, .. })
    }

    /// Whether identical surfels are drawn once.
    pub fn copies(&self) -> bool {
        matches!(self, Self::Blended { splats: Splats::Copies, .. })
    }

    /// Whether tiles draw at least the large splats.
    pub fn tiles(&self) -> bool {
        matches!(self, Self::Blended { splats: Splats::Tiles { .. }, .. })
    }

    /// Whether tiles sum all splats.
    pub fn gathers(&self) -> bool {
        matches!(self, Self::Blended { splats: Splats::Tiles { gather: true, .. }, .. })
    }

    /// How the invocations of a tile get splats; `None` if no tiles are drawn.
    pub fn fetch(&self) -> Option<Fetch> {
        match self {
            Self::Blended { splats: Splats::Tiles { fetch, .. }, .. } => Some(*fetch),
            _ => None,
        }
    }

    /// The surface without the properties that depend on the number of drawn surfels.
    pub fn before_cut(self) -> Self {
        self.sized(false, false, false)
    }

    /// Sets the properties that depend on the number of drawn surfels: whether tiles gather all
    /// splats, whether lists end early, and whether some lists are processed in rounds. A surface
    /// ignores properties that it does not have.
    pub fn sized(self, gather: bool, veils: bool, long_lists: bool) -> Self {
        match self {
            Self::Blended { splats: Splats::Tiles { fetch, .. }, separate } => {
                Self::Blended { splats: Splats::Tiles { gather, fetch }, separate }
            }
            Self::Layers { .. } => Self::Layers { long_lists },
            Self::Sorted { .. } => Self::Sorted { long_lists, veils },
            other => other,
        }
    }
}
