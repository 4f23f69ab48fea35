//! The maps that an image may have beside its colour.
//!
//! Each map is a row of [`MAPS`], which determines its words per pixel on the device, its channels
//! in an EXR, and its name on the command line and in studies.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// A map beside the colour. Every one is normalised by the weight sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Map {
    /// Camera-space z, world units; +inf where nothing is visible. With triangles, or inputs that
    /// are rendered as separate surfaces, the depth decides between surfaces. Fragments then count
    /// by their squared weights, because a fragment of larger weight lies nearer to its surface.
    Depth,
    /// Unit normal in world space; 0 where nothing is visible. Estimated normals have no side of
    /// their own and are turned toward the viewer. Given normals stay as they are, and only those
    /// on the pixel's side are blended ([`Sides`](crate::plan::Sides)).
    Normal,
    /// The sum of weights; 0 where nothing is visible.
    Weight,
    /// The number of accepted fragments.
    Count,
    /// The smallest relative distance of any of the pixel's fragments to a yes-or-no decision (disk
    /// rim, epsilon, near depth). Only the reference backend makes this map. Where it is tiny, f32
    /// may legitimately decide otherwise.
    Decision,
    /// The number of the input and of the point in it (both from 0,
    /// [`Scene::provenance`](super::Scene::provenance)) of the visible surfel with the greatest
    /// weight. Ties are broken by the surfels' contents ([`index`](mod@crate::passes::index)).
    /// [`NOTHING`](crate::passes::index::NOTHING) where nothing is visible.
    Index,
    /// The transmittance of all surfaces to the background ([`Composite`](super::Composite)): 1
    /// where nothing is visible, 0 behind opaque surfaces.
    Transmittance,
    /// The number of surfaces composited at the pixel, or of fragments for
    /// [`Composite::Sorted`](super::Composite::Sorted); 0 where nothing is visible.
    Layers,
    /// The visibility of the surfaces behind the last of
    /// [`Composite::Layers`](super::Composite::Layers): their alpha times the transmittance of the
    /// layers; 0 where there are none.
    Tail,
    /// The TexZ map of Tien 2008 (section 5.2): the mean texture coordinates (u, v), origin bottom
    /// left, and the mean depth ([`Camera::depth`](super::Camera::depth)), world units, of a
    /// textured pixel's fragments. 0, 0 and +inf where nothing is visible. Only surfels have
    /// coordinates here: they are 0 where a triangle is visible.
    TexZ,
    /// Depth ([`Camera::depth`](super::Camera::depth), world units) and alpha of the nearest
    /// [`SURFACES`] surfaces composited at the pixel, or of fragments for
    /// [`Composite::Sorted`](super::Composite::Sorted). A tail has its nearest depth. +inf and 0
    /// where there are no more.
    Surfaces,
    /// World coordinate along the scene's up axis of the surface at the depth of [`Map::Depth`],
    /// world units; -inf where nothing is visible. It is made from the depth after a frame is
    /// rendered.
    Height,
}

/// The number of surfaces in [`Map::Surfaces`].
pub const SURFACES: usize = 8;

/// The channels of [`Map::Surfaces`], two for each surface.
const SURFACE_CHANNELS: [&str; 2 * SURFACES] =
    ["1.Z", "1.A", "2.Z", "2.A", "3.Z", "3.A", "4.Z", "4.A", "5.Z", "5.A", "6.Z", "6.A", "7.Z", "7.A", "8.Z", "8.A"];

/// The names and storage of one map.
#[derive(Debug)]
pub struct MapRow {
    /// The map.
    pub map: Map,
    /// The map's name in options and studies, and before its channels in an EXR.
    pub name: &'static str,
    /// The channels in an EXR, one for each value of a pixel.
    pub channels: &'static [&'static str],
    /// The name of the need for this map in reports
    /// ([`SceneNeeds::names`](crate::plan::SceneNeeds::names)).
    pub need: &'static str,
    /// The WGSL override constant with the index of the map's first word in a pixel of the image.
    /// None if no device makes the map.
    pub image_word: Option<&'static str>,
    /// The map that this one is made from after a frame is rendered. None if the renderer makes it.
    pub from: Option<Map>,
    /// Whether the rasteriser makes the map too.
    pub raster: bool,
    /// Whether the map describes all surfaces of a pixel instead of the nearest one.
    pub composited: bool,
    /// Whether only surfels have values of the map.
    pub of_surfels: bool,
    /// Whether the values are integers, stored in the bits of an f32.
    pub numbers: bool,
    /// Whether comparisons of two images include this map.
    pub compared: bool,
    /// The values where nothing is visible, if not all 0: as many as [`channels`](Self::channels),
    /// or a shorter list that repeats. For integers it has the values that a device writes.
    pub nothing: &'static [f32],
}

/// All maps, in the order of [`Map`].
pub const MAPS: [MapRow; 12] = [
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
        of_surfels: true,
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
    MapRow {
        raster: false,
        from: Some(Map::Depth),
        nothing: &[f32::NEG_INFINITY],
        ..row(Map::Height, "height", &["Z"], "height", None)
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
        from: None,
        raster: true,
        composited: false,
        of_surfels: false,
        numbers: false,
        compared: true,
        nothing: &[],
    }
}

impl Map {
    /// The map's row in [`MAPS`].
    pub fn row(self) -> &'static MapRow {
        &MAPS[self as usize]
    }

    /// The number of values per pixel.
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Maps(u32);

impl Maps {
    /// The empty set.
    pub const NONE: Self = Self(0);

    /// The maps that every device makes, both by compute and by its rasteriser.
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

    /// The maps that describe all surfaces of a pixel.
    pub const COMPOSITED: Self = Self::of(&[Map::Transmittance, Map::Layers, Map::Tail, Map::Surfaces]);

    /// The set of `maps`.
    pub const fn of(maps: &[Map]) -> Self {
        let (mut set, mut k) = (0, 0);
        while k < maps.len() {
            set |= 1 << maps[k] as u32;
            k += 1;
        }
        Self(set)
    }

    /// Whether the set contains `map`.
    pub const fn has(self, map: Map) -> bool {
        self.0 >> map as u32 & 1 == 1
    }

    /// The union with `others`.
    pub const fn and(self, others: &[Map]) -> Self {
        Self(self.0 | Self::of(others).0)
    }

    /// The union with `others`.
    pub const fn and_all(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    /// The set without `others`.
    pub const fn but(self, others: &[Map]) -> Self {
        Self(self.0 & !Self::of(others).0)
    }

    /// The intersection with `others`.
    pub const fn among(self, others: Self) -> Self {
        Self(self.0 & others.0)
    }

    /// The set without `others`.
    pub const fn beside(self, others: Self) -> Self {
        Self(self.0 & !others.0)
    }

    /// The maps in the set, in the order of [`MAPS`].
    pub fn iter(self) -> impl Iterator<Item = Map> {
        MAPS.iter().map(|row| row.map).filter(move |map| self.has(*map))
    }

    /// The number of maps in the set.
    pub fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// The set with each map that is made after a frame is rendered replaced by its source.
    pub fn rendered(self) -> Self {
        self.iter().fold(Self::NONE, |maps, map| maps.and(&[map.row().from.unwrap_or(map)]))
    }

    /// Whether the set is empty.
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
