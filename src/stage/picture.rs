//! A rendered view: the frame, and what users learn about it.

use glam::DVec3;

use super::{ReadReport, ViewReport, heights};
use crate::annotate::Marks;
use crate::error::Result;
use crate::frame::Frame;
use crate::passes::unseen::{Unseen, is_empty};
use crate::plan::Settings;
use crate::render::Report;
use crate::scene::{Camera, ColorKey, Maps, Scene};

/// A rendered view.
#[derive(Debug)]
pub struct Picture {
    /// The colour and the maps.
    pub frame: Frame,
    /// Times and counts.
    pub report: Report,
    /// The camera, with values from the scene filled in.
    pub camera: Camera,
    /// The camera as the options that reproduce it.
    pub view: ViewReport,
    /// Counts of what was read for this view; None if the inputs were read whole.
    pub read: Option<ReadReport>,
    /// Why nothing is visible; None if something is.
    pub unseen: Option<Unseen>,
    /// The meaning of the colours, if they show an attribute.
    pub key: Option<ColorKey>,
}

impl Picture {
    /// Adds the maps of `wanted` that are made from others. `up` is the axis of heights.
    pub(super) fn with_heights(self, up: DVec3, wanted: Maps) -> Self {
        let frame = heights::made(self.frame, &self.camera, up, wanted);
        Self { frame, ..self }
    }

    /// Draws marks on the frame.
    pub(super) fn marked(self, marks: Marks) -> Result<Self> {
        if marks == Marks::default() {
            return Ok(self);
        }
        let frame = marks.draw(self.frame, &self.camera, self.key.as_ref())?;
        Ok(Self { frame, ..self })
    }

    /// Combines a rendered frame with its view and counts, and with the reason if it is empty.
    pub(super) fn of(
        scene: &Scene,
        settings: &Settings,
        (frame, report): (Frame, Report),
        (camera, view): (Camera, ViewReport),
        (read, key): (Option<ReadReport>, Option<ColorKey>),
    ) -> Self {
        let unseen = is_empty(&frame, settings).then(|| Unseen::of(scene, &camera, settings));
        Self { frame, report, camera, view, read, unseen, key }
    }
}
