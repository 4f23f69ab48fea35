//! Files with levels of detail: only the nodes that a picture needs are read.

use serde::Serialize;

use super::Request;
use super::memory::Memory;
use super::octrees::Octrees;
use super::tree::Tree;
use super::whole::Made;
use crate::error::{Error, Result};
use crate::plan::Settings;
use crate::progress::Progress;
use crate::scene::{Bounds, Camera, ColorKey, Scene};

/// Inputs that are read in part for each picture. The part does not depend on earlier pictures.
pub(super) enum Parts {
    /// COPC files, together one scene.
    Octrees(Box<Octrees>),
    /// A file that `epsplat lod` wrote.
    Tree(Box<Tree>),
}

/// The part of the inputs that a picture needs, as a scene.
pub(super) struct Part {
    pub made: Made,
    /// Settings to draw the scene with: without levels of detail if all of it is to be drawn.
    pub settings: Settings,
    pub read: ReadReport,
    /// The meaning of colours, if they show an attribute.
    pub key: Option<ColorKey>,
}

/// Counts of what a picture read, and totals: `[read, total]`, summed over all files.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReadReport {
    /// Nodes of the levels of detail.
    pub nodes: [u64; 2],
    /// Points of a COPC file, or surfels of a file of `epsplat lod`.
    pub points: [u64; 2],
    /// Bytes of nodes and points in the files.
    pub bytes: [u64; 2],
}

impl Parts {
    /// Opens the inputs if a picture with `settings` needs only parts of them. Otherwise None.
    ///
    /// # Errors
    /// [`Error::Usage`] if `--memory` is given and the inputs have to be read whole.
    pub fn of(request: &Request<'_>, settings: &Settings, progress: &dyn Progress) -> Result<Option<Self>> {
        if settings.detail.is_finest() {
            return match request.device.memory {
                Some(_) => {
                    Err(Error::Usage("--memory needs levels of detail: give --lod a size that is above 0".into()))
                }
                None => Ok(None),
            };
        }
        if let Some(tree) = Tree::of(request)? {
            return Ok(Some(Self::Tree(Box::new(tree))));
        }
        Ok(Octrees::of(request, progress)?.map(|octrees| Self::Octrees(Box::new(octrees))))
    }

    /// A coarse scene from which the camera is framed before anything else is read.
    pub fn overview(&self) -> &Scene {
        match self {
            Self::Octrees(octrees) => &octrees.overview,
            Self::Tree(tree) => &tree.overview,
        }
    }

    /// The box of all points, if the files are COPC files that state it; world coordinates.
    pub fn bounds(&self) -> Option<Bounds> {
        match self {
            Self::Octrees(octrees) => octrees.bounds(),
            Self::Tree(_) => None,
        }
    }

    /// Reads the part for the picture of `camera` with `settings`.
    ///
    /// `frames` is the number of frames in memory at once, for the limit of `--memory`.
    pub fn scene(
        &mut self,
        request: &Request<'_>,
        (camera, frames): (&Camera, u64),
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Part> {
        let memory = request.device.memory.map(|most| Memory::of(most, camera, settings, frames)).transpose()?;
        match self {
            Self::Octrees(octrees) => octrees.scene(request, camera, settings, progress),
            Self::Tree(tree) => tree.scene(memory, camera, settings, progress),
        }
    }
}

impl ReadReport {
    /// Returns the counts as one line for people.
    pub fn sentence(&self) -> String {
        let Self { nodes: [nodes, all_nodes], points: [points, all_points], bytes } = self;
        let [bytes, all_bytes] = bytes.map(|bytes| bytes as f64 / 1e6);
        format!(
            "read {nodes} of {all_nodes} nodes of the levels of detail, {points} of {all_points} points: {bytes:.1} of {all_bytes:.1} MB"
        )
    }
}
