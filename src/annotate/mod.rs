//! Marks on a finished picture: a legend, a scale bar, an arrow to the north. They change the
//! colour of a frame, and no map.
//!
//! All sizes follow from the size of the picture.

mod canvas;
mod legend;
mod north;
mod scale_bar;
mod text;
mod ticks;

use glam::DVec3;

use self::canvas::Canvas;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::scene::{Camera, ColorKey, Projection};

/// The marks to draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Marks {
    /// A legend of the colours.
    pub legend: bool,
    /// A bar of a length of the scene.
    pub scale_bar: bool,
    /// An arrow to +y of map coordinates.
    pub north: bool,
}

/// The least cosine between a camera's view and straight down at which it looks from above.
const DOWN: f64 = 0.999;

impl Marks {
    /// Rejects marks that a picture of this camera cannot have.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] for a scale bar in a perspective picture, and for an arrow to the north in
    /// a picture that is not orthographic and seen from above.
    pub fn check(self, camera: &Camera) -> Result<()> {
        let is_orthographic = camera.projection == Projection::Orthographic;
        if self.scale_bar && !is_orthographic {
            return Err(Error::Usage(
                "--scale-bar needs one scale for the whole picture, which perspective has not: give --ortho, or leave it out".into(),
            ));
        }
        let down = camera.rotation.row(2).dot(-DVec3::Z);
        if self.north && !(is_orthographic && down >= DOWN) {
            return Err(Error::Usage(
                "--north needs an orthographic picture from above: give --ortho and a camera that looks along -z, or leave it out".into(),
            ));
        }
        Ok(())
    }

    /// Draws the marks on the colour of a frame.
    ///
    /// # Errors
    ///
    /// As [`check`](Self::check).
    pub fn draw(self, mut frame: Frame, camera: &Camera, key: Option<&ColorKey>) -> Result<Frame> {
        self.check(camera)?;
        let mut canvas = Canvas::of(&mut frame);
        if let Some(key) = key.filter(|_| self.legend) {
            legend::draw(&mut canvas, key);
        }
        if self.scale_bar {
            scale_bar::draw(&mut canvas, camera.fx);
        }
        if self.north {
            let [x, y] = [0, 1].map(|axis| camera.rotation.row(axis).y);
            north::draw(&mut canvas, [x, y]);
        }
        Ok(frame)
    }
}

#[cfg(test)]
mod tests;
