//! What an image may hold beside its colour. A map is a row of [`MAPS`]: from it follow the words of a pixel on the device, the layer
//! of an EXR, and the names that command line and studies know.

use std::str::FromStr;

use crate::error::Error;

/// A map beside the colour. Every one is normalised by the weight sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Map {
    /// Camera-space z, world units; +inf where nothing is. Where it tells surfaces apart, beside triangles or of inputs that are kept apart,
    /// a fragment counts by the square of its weight, as it lies nearer to its surface the more it weighs.
    Depth,
    /// Unit normal in world space; 0 where nothing is. Normals that were estimated have no side of their own and are
    /// turned toward the viewer; given ones stay as they are, and those of the pixel's side alone are blended ([`Sides`](crate::plan::Sides)).
    Normal,
    /// The sum of weights; 0 where nothing is.
    Weight,
    /// Accepted fragments.
    Count,
    /// Reference only: the smallest relative distance of any fragment of the pixel to a yes-or-no decision (disk rim,
    /// epsilon, near depth). Where it is tiny, f32 may rightly decide otherwise.
    Decision,
    /// The number of the input and of the point in it (both from 0, [`Scene::provenance`](super::Scene::provenance)) that the visible
    /// surfel with the greatest weight is; of equal weights, by what the surfels are ([`index`](mod@crate::passes::index)).
    /// [`NOTHING`](crate::passes::index::NOTHING) where nothing is.
    Index,
    /// What the surfaces of a pixel let through to the background, 1 where nothing is, 0 behind what is opaque
    /// ([`Composite`](super::Composite)).
    Transmittance,
    /// How many surfaces are composited at a pixel, of [`Composite::Sorted`](super::Composite::Sorted) fragments; 0 where nothing is.
    Layers,
    /// How much what lies behind the last of [`Composite::Layers`](super::Composite::Layers) shows: its alpha times what the layers let
    /// through to it; 0 where nothing does.
    Tail,
    /// The TexZ map of Tien 2008 (section 5.2): the mean texture coordinates (u, v), origin bottom left, and the mean camera-space z, world
    /// units, of the fragments of a painted pixel; 0, 0 and +inf where nothing is. Coordinates are of surfels: 0 where a triangle shows.
    TexZ,
    /// Depth, camera-space z in world units, and alpha of the nearest [`SURFACES`] surfaces that are composited at a pixel, of
    /// [`Composite::Sorted`](super::Composite::Sorted) fragments; of a tail the nearest depth. +inf and 0 where there are no more.
    Surfaces,
}

/// Surfaces of a pixel of which [`Map::Surfaces`] tells.
pub const SURFACES: usize = 8;

/// Their channels; in an EXR each surface is a layer.
const SURFACE_CHANNELS: [&str; 2 * SURFACES] =
    ["1.Z", "1.A", "2.Z", "2.A", "3.Z", "3.A", "4.Z", "4.A", "5.Z", "5.A", "6.Z", "6.A", "7.Z", "7.A", "8.Z", "8.A"];

/// How one map is named and kept.
#[derive(Debug)]
pub struct MapRow {
    /// Which.
    pub map: Map,
    /// Its name in options and studies, and of its layer in an EXR.
    pub name: &'static str,
    /// Its channels in an EXR, each a value of a pixel.
    pub channels: &'static [&'static str],
    /// What asks for it in reports ([`SceneNeeds::names`](crate::plan::SceneNeeds::names)).
    pub need: &'static str,
    /// The overridable constant of WGSL that says which word of a pixel's image is its first. None of a map that the reference alone makes.
    pub image_word: Option<&'static str>,
    /// The rasteriser makes it too.
    pub raster: bool,
    /// It tells of all surfaces of a pixel and not of the nearest one.
    pub composited: bool,
    /// Its values are whole numbers, kept in the bits of an f32.
    pub numbers: bool,
    /// Two images are compared in it.
    pub compared: bool,
    /// Its values where nothing is, if they are not all 0: as many as [`channels`](Self::channels),
    /// or their first ones over and over. Of numbers those that a device writes.
    pub nothing: &'static [f32],
}

/// The maps, in the order of [`Map`].
pub const MAPS: [MapRow; 11] = [
    MapRow { nothing: &[f32::INFINITY], ..row(Map::Depth, "depth", &["Z"], "depth", Some("DEPTH_IMAGE")) },
    row(Map::Normal, "normal", &["X", "Y", "Z"], "normal-map", Some("NORMAL_IMAGE")),
    row(Map::Weight, "weight", &["Y"], "weight-map", Some("WEIGHT_IMAGE")),
    row(Map::Count, "count", &["Y"], "count", Some("COUNT_IMAGE")),
    MapRow {
        raster: false,
        compared: false,
        nothing: &[f32::INFINITY],
        ..row(Map::Decision, "decision", &["Y"], "decision", None)
    },
    MapRow {
        raster: false,
        numbers: true,
        compared: false,
        ..row(Map::Index, "index", &["input", "point"], "index", Some("INDEX_IMAGE"))
    },
    MapRow {
        raster: false,
        composited: true,
        nothing: &[1.0],
        ..row(Map::Transmittance, "transmittance", &["Y"], "transmittance", Some("TRANSMITTANCE_IMAGE"))
    },
    MapRow {
        raster: false,
        composited: true,
        ..row(Map::Layers, "layers", &["Y"], "layers-map", Some("LAYERS_IMAGE"))
    },
    MapRow { raster: false, composited: true, ..row(Map::Tail, "tail", &["Y"], "tail-map", Some("TAIL_IMAGE")) },
    MapRow {
        raster: false,
        nothing: &[0.0, 0.0, f32::INFINITY],
        ..row(Map::TexZ, "texz", &["U", "V", "Z"], "texz-map", Some("TEXZ_IMAGE"))
    },
    MapRow {
        raster: false,
        composited: true,
        compared: false,
        nothing: &[f32::INFINITY, 0.0],
        ..row(Map::Surfaces, "surfaces", &SURFACE_CHANNELS, "surfaces", Some("SURFACES_IMAGE"))
    },
];

const fn row(
    map: Map,
    name: &'static str,
    channels: &'static [&'static str],
    need: &'static str,
    image_word: Option<&'static str>,
) -> MapRow {
    MapRow {
        map,
        name,
        channels,
        need,
        image_word,
        raster: true,
        composited: false,
        numbers: false,
        compared: true,
        nothing: &[],
    }
}

impl Map {
    /// Its row.
    pub fn row(self) -> &'static MapRow {
        &MAPS[self as usize]
    }

    /// Values of a pixel.
    pub fn width(self) -> usize {
        self.row().channels.len()
    }
}

impl FromStr for Map {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let row = MAPS.iter().find(|row| row.name == text);
        row.map(|row| row.map).ok_or_else(|| {
            let names = MAPS.iter().map(|row| row.name).collect::<Vec<_>>().join(", ");
            Error::Usage(format!("there is no map {text:?}: take some of {names}"))
        })
    }
}

/// A set of maps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Maps(u32);

impl Maps {
    /// No map.
    pub const NONE: Self = Self(0);

    /// All that every device makes, by compute and by its rasteriser.
    pub const ON_DEVICE: Self = {
        let (mut set, mut row) = (0, 0);
        while row < MAPS.len() {
            if MAPS[row].raster {
                set |= 1 << row;
            }
            row += 1;
        }
        Self(set)
    };

    /// Those that tell of all surfaces of a pixel.
    pub const COMPOSITED: Self = Self::of(&[Map::Transmittance, Map::Layers, Map::Tail, Map::Surfaces]);

    /// Those of `maps`.
    pub const fn of(maps: &[Map]) -> Self {
        let (mut set, mut k) = (0, 0);
        while k < maps.len() {
            set |= 1 << maps[k] as u32;
            k += 1;
        }
        Self(set)
    }

    /// Whether `map` is one of them.
    pub const fn has(self, map: Map) -> bool {
        self.0 >> map as u32 & 1 == 1
    }

    /// These and those.
    pub const fn and(self, others: &[Map]) -> Self {
        Self(self.0 | Self::of(others).0)
    }

    /// These and all of `others`.
    pub const fn and_all(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    /// These but `others`.
    pub const fn but(self, others: &[Map]) -> Self {
        Self(self.0 & !Self::of(others).0)
    }

    /// Those of these that are among `others`.
    pub const fn among(self, others: Self) -> Self {
        Self(self.0 & others.0)
    }

    /// Those of these that are not among `others`.
    pub const fn beside(self, others: Self) -> Self {
        Self(self.0 & !others.0)
    }

    /// Each of them, in the order of [`MAPS`].
    pub fn iter(self) -> impl Iterator<Item = Map> {
        MAPS.iter().map(|row| row.map).filter(move |map| self.has(*map))
    }

    /// How many.
    pub fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// There is none.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_by_their_maps_and_names() {
        for (number, row) in MAPS.iter().enumerate() {
            assert_eq!((row.map as usize, row.name.parse::<Map>().unwrap()), (number, row.map));
        }
        assert!("colour".parse::<Map>().unwrap_err().to_string().contains("depth, normal"));
        assert!(MAPS.iter().all(|row| row.composited == Maps::COMPOSITED.has(row.map)));
    }

    #[test]
    fn a_set_has_what_it_was_made_of() {
        let set = Maps::of(&[Map::Depth, Map::Count]).and(&[Map::Decision]);
        assert_eq!(set.iter().collect::<Vec<_>>(), [Map::Depth, Map::Count, Map::Decision]);
        assert_eq!((set.len(), Maps::NONE.len()), (3, 0));
        assert!(!Maps::ON_DEVICE.has(Map::Decision) && Maps::ON_DEVICE.has(Map::Count));
        assert_eq!(set.but(&[Map::Depth]), Maps::of(&[Map::Count, Map::Decision]));
    }
}
