//! Where a map lies on the earth: its grid, and the coordinate system of the scene.

use std::path::Path;

use super::{Format, Input, las};
use crate::error::{Error, Result};

/// The position of a map and its coordinate system.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// x of the left edge of the first pixel, world units.
    pub left: f64,
    /// y of the top edge of the first pixel, world units.
    pub top: f64,
    /// The edge of a pixel, world units.
    pub pixel: f64,
    /// The coordinate system.
    pub keys: GeoKeys,
}

impl Place {
    /// Returns the text of a world file: the size of a pixel, and the centre of the first one.
    pub fn world_file(&self) -> String {
        let Self { left, top, pixel, .. } = self;
        let (x, y) = (left + 0.5 * pixel, top - 0.5 * pixel);
        format!("{pixel}\n0\n0\n-{pixel}\n{x}\n{y}\n")
    }
}

/// The keys of a coordinate system, as GeoTIFF and LAS files store them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GeoKeys {
    /// Keys: id, location, count, and value or offset.
    pub entries: Vec<[u16; 4]>,
    /// The numbers that keys refer to.
    pub doubles: Vec<f64>,
    /// The texts that keys refer to.
    pub texts: String,
}

/// The key for the meaning of a pixel's coordinates, and its value: those of the pixel's corner.
const RASTER: u16 = 1025;
const PIXEL_IS_AREA: u16 = 1;

/// Keys: the kind of model, and the codes of geographic and projected systems.
const MODEL: u16 = 1024;
const GEOGRAPHIC: u16 = 2048;
const PROJECTED: u16 = 3072;

impl GeoKeys {
    /// Returns the keys of the coordinate system of the file at `path`; None if it names none. Only
    /// LAS files are looked at.
    ///
    /// # Errors
    ///
    /// As [`Input::open`], and [`Error::Malformed`] for a damaged header.
    pub fn of_file(path: &Path, format: Option<Format>) -> Result<Option<Self>> {
        let input = Input::open(path, format)?;
        let failed = |error| Error::read(path, error);
        let keys = match input.format {
            Format::Las => las::geo_keys(input.source.try_clone().map_err(failed)?, input.length, &input.path)?,
            _ => None,
        };
        input.keep(path).map_err(failed)?;
        Ok(keys)
    }

    /// Returns the keys of the system with an EPSG code.
    pub fn of_code(code: u16, geographic: bool) -> Self {
        let (model, system) = if geographic { (2, GEOGRAPHIC) } else { (1, PROJECTED) };
        Self { entries: vec![[MODEL, 0, 1, model], [system, 0, 1, code]], ..Self::default() }
    }

    /// Whether no coordinate system is known.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Returns the directory of a raster whose positions are those of corners of pixels: its own
    /// header, then the keys in order. It is empty if no coordinate system is known.
    pub fn directory(&self) -> Vec<u16> {
        if self.is_empty() {
            return Vec::new();
        }
        let raster = [RASTER, 0, 1, PIXEL_IS_AREA];
        let mut entries: Vec<_> = self.entries.iter().copied().filter(|entry| entry[0] != RASTER).collect();
        entries.push(raster);
        entries.sort_by_key(|entry| entry[0]);
        [[1, 1, 0, entries.len() as u16]].into_iter().chain(entries).flatten().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_world_file_has_the_centre_of_the_first_pixel() {
        let place = Place { left: 636_000.0, top: 849_005.0, pixel: 0.5, keys: GeoKeys::default() };
        assert_eq!(place.world_file(), "0.5\n0\n0\n-0.5\n636000.25\n849004.75\n");
    }

    #[test]
    fn directories_are_sorted_and_say_that_a_pixel_is_an_area() {
        assert!(GeoKeys::default().directory().is_empty());
        let keys =
            GeoKeys { entries: vec![[3072, 0, 1, 25832], [1025, 0, 1, 2], [1024, 0, 1, 1]], ..GeoKeys::default() };
        assert_eq!(keys.directory(), [1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, 25832]);
        assert_eq!(GeoKeys::of_code(4326, true).directory()[4..12], [1024, 0, 1, 2, 1025, 0, 1, 1]);
    }
}
