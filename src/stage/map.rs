//! Maps from straight above, on a grid of pixels of a given size, rendered in bands of rows.

use glam::DVec3;

use super::{Picture, Renderer, View};
use crate::annotate::Marks;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::options::CameraOptions;
use crate::passes::unseen::Unseen;
use crate::progress::Progress;
use crate::render::Report;
use crate::scene::{Grid, Up};

/// Counts of a map that was rendered.
#[derive(Debug)]
pub struct Survey {
    /// Times and counts: those of the first tile, with the times of all.
    pub report: Report,
    /// The number of images that were rendered.
    pub tiles: u64,
    /// Why nothing is visible in the first tile; None if something is visible in any.
    pub unseen: Option<Unseen>,
}

impl Renderer {
    /// Returns the grid of the map that `options` ask for by their pixel size and bounds.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] without a pixel size, for options that place a camera, if z is not up, or
    /// for too many pixels.
    pub fn grid(&self, options: &CameraOptions) -> Result<Grid> {
        let usage = |what: &str| Err(Error::Usage(what.into()));
        let CameraOptions {
            size,
            eye,
            from,
            target,
            up,
            fov,
            projection,
            ortho,
            intrinsics,
            file,
            pixel_size,
            bounds,
            near,
            azimuth,
            elevation,
        } = options;
        let Some(pixel) = *pixel_size else { return usage("a map needs the size of its pixels: give --pixel-size") };
        let lens = fov.or(*near).is_some()
            || projection.is_some()
            || ortho.is_some()
            || intrinsics.is_some()
            || size.is_some();
        if lens || eye.or(*target).is_some() || from.is_some() || azimuth.or(*elevation).is_some() || file.is_some() {
            return usage("--pixel-size looks from straight above: leave other options of the camera out");
        }
        match (up, self.scene().up) {
            (Some(DVec3::Z), _) | (None, Up::Z) => Grid::new(pixel, *bounds, (self.scene(), self.data())),
            (None, Up::Y) => usage(
                "--pixel-size makes a map of x and y, and in these files y is up: give --up z if z is up in truth",
            ),
            (Some(_), _) => {
                usage("--pixel-size makes a map of x and y, in which z is up: leave --up out, or give --up z")
            }
        }
    }

    /// Renders a map, and passes its bands of rows to `give`, from the top.
    ///
    /// # Errors
    ///
    /// As [`Renderer::frame`], and those of `give`.
    pub fn map(
        &mut self,
        grid: &Grid,
        progress: &dyn Progress,
        mut give: impl FnMut(Frame) -> Result<()>,
    ) -> Result<Survey> {
        let marks = self.check_tiles(grid)?;
        let (mut first, mut tiles, mut visible): (Option<Picture>, u64, bool) = (None, 0, false);
        let planned = grid.bands().count() as u64 * grid.tiles().count() as u64;
        let counts = planned > 1;
        // The bar counts tiles and not their stages.
        let notes = Notes(progress);
        let of_tile: &dyn Progress = if counts { &notes } else { progress };
        if counts {
            progress.begin("rendering tiles", planned);
        }
        for rows in grid.bands() {
            let mut across = Vec::new();
            for columns in grid.tiles() {
                let view = View::from(grid.camera(columns, rows.clone())?);
                let mut picture = self.rendered(&view, (false, DVec3::Z), of_tile)?;
                tiles += 1;
                if counts {
                    progress.advance(1);
                }
                visible |= picture.unseen.is_none();
                across.push(std::mem::replace(&mut picture.frame, Frame::of_colors(0, 0, Vec::new())));
                match &mut first {
                    Some(first) => add(&mut first.report, &picture.report),
                    None => first = Some(picture),
                }
            }
            let Some(mut band) = Frame::joined(across) else { continue };
            if marks != Marks::default() {
                let key = first.as_ref().and_then(|first| first.key.as_ref());
                band = marks.draw(band, &grid.camera(0..grid.columns, 0..grid.rows)?, key)?;
            }
            give(band)?;
        }
        if counts {
            progress.end();
        }
        let Some(Picture { report, unseen, .. }) = first else {
            return Err(Error::Usage("a map needs at least one pixel".into()));
        };
        Ok(Survey { report, tiles, unseen: unseen.filter(|_| !visible) })
    }
}

impl Renderer {
    /// Rejects what cannot be drawn in tiles or bands, and returns the marks of the map.
    fn check_tiles(&self, grid: &Grid) -> Result<Marks> {
        let (bands, across) = (grid.bands().count(), grid.tiles().count());
        let refused = |what: &str, most: &str| {
            let size = format!("{}x{}", grid.columns, grid.rows);
            Err(Error::Usage(format!(
                "{what} needs a map of one {most}, and {size} pixels are more: give a larger --pixel-size, or less by --bounds"
            )))
        };
        let marks = self.options.marks.marks();
        if self.options.look.edl.is_some() && bands * across > 1 {
            return refused("--edl, which looks at neighbouring pixels,", "tile (4096 columns and 8 million pixels)");
        }
        if marks == Marks::default() {
            return Ok(marks);
        }
        if bands > 1 {
            return refused("a mark (--legend, --scale-bar, --north)", "band (8 million pixels)");
        }
        marks.check(&grid.camera(0..grid.columns, 0..grid.rows)?)?;
        Ok(marks)
    }
}

/// Forwards notes alone.
struct Notes<'a>(&'a dyn Progress);

impl Progress for Notes<'_> {
    fn begin(&self, _what: &str, _units: u64) {}
    fn advance(&self, _units: u64) {}
    fn end(&self) {}

    fn note(&self, line: &str) {
        self.0.note(line);
    }
}

/// Adds the times of another tile.
fn add(report: &mut Report, other: &Report) {
    for (pass, ms) in &other.passes {
        *report.passes.entry(pass.clone()).or_default() += ms;
    }
    report.total_ms += other.total_ms;
    report.compile_ms += other.compile_ms;
    report.overflows = report.overflows.max(other.overflows);
}
