//! Maps of a scene: square pixels of a given size on a grid, seen from straight above.

use std::ops::Range;

use glam::{DMat3, DVec3};
use serde::Serialize;

use super::{Bounds, Camera, Lens, Scene};
use crate::error::{Error, Result};

/// The most columns and the most rows of a map.
pub const MOST_SIDE: u32 = 1 << 22;

/// The most pixels of a map.
pub const MOST_PIXELS: u64 = 1 << 36;

/// The widest tile that is rendered at a time, pixels: with 4 samples in a row, a side of a sampled
/// image stays within [`MAX_SIDE`](super::camera::MAX_SIDE).
const TILE: u32 = 4096;

/// The most pixels of a band of rows, unless its rows are the fewest.
const BAND: u64 = 1 << 23;

/// The fewest rows of a band; each band projects all surfels again.
const FEWEST_ROWS: u64 = 64;

/// A coordinate this close to a line of the grid lies on it, pixels.
const ON_LINE: f64 = 1e-6;

/// The margin between the highest surfel and the camera, as a share of the scene's extent.
const MARGIN: f64 = 0.01;

/// A grid of square pixels over x and y, with x to the right and y (north) at the top.
///
/// The lines of the grid lie at multiples of the pixel size, so that maps with one pixel size fit
/// together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Grid {
    /// x of the left edge, world units.
    pub left: f64,
    /// y of the top edge, world units.
    pub top: f64,
    /// The edge of a pixel, world units.
    pub pixel: f64,
    /// The number of pixels in a row.
    pub columns: u32,
    /// The number of rows.
    pub rows: u32,
    /// z of the camera, world units; everything that shows lies below it.
    eye: f64,
    near: f64,
}

impl Grid {
    /// Returns the grid of pixels of the size `pixel` over `bounds` (xmin, ymin, xmax, ymax; by
    /// default those of `data`, or else of the scene's body), extended to whole pixels. `data` is
    /// the box of all points if `scene` is an overview of them, world units.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] for bounds without an area and for too many pixels.
    pub fn new(pixel: f64, bounds: Option<[f64; 4]>, (scene, data): (&Scene, Option<Bounds>)) -> Result<Self> {
        let body = scene.body().0;
        let body = data.unwrap_or(Bounds { min: body.min + scene.origin, max: body.max + scene.origin });
        let (low, high) = (body.min, body.max);
        let [left, bottom, right, top] = bounds.unwrap_or([low.x, low.y, high.x, high.y]);
        let (first, columns) = lines(left, right, pixel);
        let (last, rows) = lines(-top, -bottom, pixel);
        if !(columns <= f64::from(MOST_SIDE) && rows <= f64::from(MOST_SIDE) && columns * rows <= MOST_PIXELS as f64) {
            return Err(Error::Usage(format!(
                "a map of {left},{bottom} to {right},{top} with pixels of {pixel} would have {columns:.0}x{rows:.0} pixels: \
                 give a larger --pixel-size, or --bounds"
            )));
        }
        let margin = MARGIN * body.extent().length() + 2.0 * f64::from(scene.largest_radius());
        let near = Camera::default_near(scene);
        let eye = high.z + margin.max(2.0 * near);
        let (columns, rows) = (columns as u32, rows as u32);
        Ok(Self { left: first * pixel, top: -last * pixel, pixel, columns, rows, eye, near })
    }

    /// Returns the camera of a part of the grid.
    ///
    /// Its eye stands over a corner of pixels in the middle of the part, so that coordinates
    /// relative to it keep their digits.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if the part is empty or too large for one image.
    pub fn camera(&self, columns: Range<u32>, rows: Range<u32>) -> Result<Camera> {
        let size = (columns.len() as u32, rows.len() as u32);
        let (across, down) = (size.0 / 2, size.1 / 2);
        let eye = DVec3::new(
            self.left + f64::from(columns.start + across) * self.pixel,
            self.top - f64::from(rows.start + down) * self.pixel,
            self.eye,
        );
        let scale = 1.0 / self.pixel;
        let lens = Lens::OrthographicScale([scale, scale, f64::from(across), f64::from(down)]);
        let rotation = DMat3::from_cols(DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z).transpose();
        Camera::posed(size, lens, eye, rotation, self.near)
    }

    /// Returns the bands of rows that are rendered one after the other, from the top.
    pub fn bands(&self) -> impl Iterator<Item = Range<u32>> + use<> {
        let rows = (BAND / u64::from(self.columns)).clamp(FEWEST_ROWS, TILE.into()) as u32;
        pieces(self.rows, rows)
    }

    /// Returns the columns of the tiles of a band, from the left.
    pub fn tiles(&self) -> impl Iterator<Item = Range<u32>> + use<> {
        pieces(self.columns, TILE)
    }
}

/// Returns the number of the line at or before `low`, and the number of pixels from there to the
/// line at or behind `high`; at least 1.
fn lines(low: f64, high: f64, pixel: f64) -> (f64, f64) {
    let on_line = |at: f64| Some(at.round()).filter(|line| (line - at).abs() <= ON_LINE);
    let (low, high) = (low / pixel, high / pixel);
    let first = on_line(low).unwrap_or(low.floor());
    let last = on_line(high).unwrap_or(high.ceil());
    (first, (last - first).max(1.0))
}

/// Cuts `0..count` into pieces of `length`; the last has the remainder.
fn pieces(count: u32, length: u32) -> impl Iterator<Item = Range<u32>> {
    (0..count.div_ceil(length)).map(move |piece| piece * length..count.min((piece + 1) * length))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::Surfel;

    fn scene() -> Scene {
        let at = |x: f32, y: f32, z: f32| Surfel::disk(glam::Vec3::new(x, y, z), glam::Vec3::Z, 0.1);
        let surfels = vec![at(0.3, 0.2, 1.0), at(9.2, 4.9, 2.0), at(5.0, 3.0, 0.0)];
        Scene { origin: DVec3::new(636_000.0, 849_000.0, 0.0), surfels, ..Scene::default() }
    }

    #[test]
    fn grids_are_aligned_and_cover_their_bounds() {
        let grid = Grid::new(0.5, None, (&scene(), None)).unwrap();
        // x from 636000.3 to 636009.2, y from 849000.2 to 849004.9.
        assert_eq!((grid.left, grid.top, grid.columns, grid.rows), (636_000.0, 849_005.0, 19, 10));
        let given = Some([636_001.0, 849_001.0, 636_003.0, 849_002.5]);
        let grid = Grid::new(0.5, given, (&scene(), None)).unwrap();
        assert_eq!((grid.left, grid.top, grid.columns, grid.rows), (636_001.0, 849_002.5, 4, 3));
        // A tenth has no exact binary form, and 636000.3 is on a line of it.
        let grid = Grid::new(0.1, Some([636_000.3, 849_000.7, 636_000.9, 849_001.1]), (&scene(), None)).unwrap();
        assert!((grid.left - 636_000.3).abs() < 1e-9 && (grid.top - 849_001.1).abs() < 1e-9);
        assert_eq!((grid.columns, grid.rows), (6, 4));
        assert!(Grid::new(1e-9, None, (&scene(), None)).unwrap_err().to_string().contains("--bounds"));
    }

    /// A point at the centre of a pixel is seen there, in every tile.
    #[test]
    fn cameras_map_the_world_to_pixels() {
        let grid = Grid::new(0.25, Some([636_000.0, 849_000.0, 636_100.0, 849_050.0]), (&scene(), None)).unwrap();
        assert_eq!((grid.columns, grid.rows), (400, 200));
        for (columns, rows) in [(0..400, 0..200), (17..52, 40..81), (399..400, 199..200)] {
            let camera = grid.camera(columns.clone(), rows.clone()).unwrap();
            for (column, row) in [(columns.start, rows.start), (columns.end - 1, rows.end - 1)] {
                let x = 636_000.0 + (f64::from(column) + 0.5) * 0.25;
                let y = 849_050.0 - (f64::from(row) + 0.5) * 0.25;
                let p = camera.to_camera(DVec3::new(x, y, 1.0));
                let pixel = [camera.fx * p.x + camera.cx, camera.fy * p.y + camera.cy];
                let expected = [f64::from(column - columns.start) + 0.5, f64::from(row - rows.start) + 0.5];
                assert!((pixel[0] - expected[0]).abs() < 1e-6 && (pixel[1] - expected[1]).abs() < 1e-6);
                // All surfels lie below the camera.
                assert!(camera.to_camera(DVec3::new(x, y, 2.1)).z > camera.near);
            }
        }
    }

    #[test]
    fn bands_and_tiles_cover_the_grid() {
        let grid = Grid { left: 0.0, top: 0.0, pixel: 1.0, columns: 10_000, rows: 5_000, eye: 1.0, near: 1e-3 };
        let (bands, tiles): (Vec<_>, Vec<_>) = (grid.bands().collect(), grid.tiles().collect());
        assert_eq!(tiles, [0..4096, 4096..8192, 8192..10_000]);
        assert!(bands.windows(2).all(|pair| pair[0].end == pair[1].start));
        assert_eq!((bands[0].start, bands.last().unwrap().end), (0, 5_000));
        assert!(bands.iter().all(|band| band.len() as u64 * 10_000 <= BAND));
    }
}
