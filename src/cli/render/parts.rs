//! `epsplat render --lod` of files with levels of detail of their own: a picture reads what it takes of them.

use epsplat::plan::RenderOptions as Settings;
use epsplat::scene::{Camera, Scene};
use epsplat::{Error, Progress, Result};
use serde::Serialize;

use super::super::progress::Bars;
use super::Arguments;
use super::memory::Memory;
use super::octrees::Octrees;
use super::scene::Made;
use super::tree::Tree;

/// Inputs of which a picture reads what it takes, which depends on nothing that another picture takes.
pub(super) enum Parts {
    /// COPC files that are one scene.
    Octrees(Box<Octrees>),
    /// A file of `epsplat lod`.
    Tree(Box<Tree>),
}

/// What a picture takes.
pub(super) struct Part {
    pub made: Made,
    /// How it is drawn.
    pub settings: Settings,
    pub read: Read,
}

/// What a picture read of what there is: of all files together.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Read {
    pub nodes: [u64; 2],
    pub points: [u64; 2],
    /// Of nodes and points as the files have them.
    pub bytes: [u64; 2],
}

impl Parts {
    /// The inputs, if a picture with `settings` takes parts of them.
    pub fn of(arguments: &Arguments, settings: &Settings, bars: &Bars) -> Result<Option<Self>> {
        if settings.detail.is_finest() {
            return match arguments.device.memory {
                Some(_) => {
                    Err(Error::Usage("--memory is of pictures that take a part: take --lod of a size above 0".into()))
                }
                None => Ok(None),
            };
        }
        if let Some(tree) = Tree::of(arguments)? {
            return Ok(Some(Self::Tree(Box::new(tree))));
        }
        Ok(Octrees::of(arguments, bars)?.map(|octrees| Self::Octrees(Box::new(octrees))))
    }

    /// What tells where the scene is, before a camera is.
    pub fn overview(&self) -> &Scene {
        match self {
            Self::Octrees(octrees) => &octrees.overview,
            Self::Tree(tree) => &tree.overview,
        }
    }

    /// What the picture of `camera` with `settings` takes, of which there may be so many frames at once.
    pub fn scene(
        &mut self,
        arguments: &Arguments,
        (camera, frames): (&Camera, u64),
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Part> {
        let memory = arguments.device.memory.map(|most| Memory::of(most, camera, settings, frames)).transpose()?;
        match self {
            Self::Octrees(octrees) => octrees.scene(arguments, camera, settings, progress),
            Self::Tree(tree) => tree.scene(memory, camera, settings, progress),
        }
    }
}

impl Read {
    /// One line.
    pub fn sentence(&self) -> String {
        let Self { nodes: [nodes, all_nodes], points: [points, all_points], bytes } = self;
        let [bytes, all_bytes] = bytes.map(|bytes| bytes as f64 / 1e6);
        format!(
            "read {nodes} of {all_nodes} nodes of the levels of detail, {points} of {all_points} points: {bytes:.1} of {all_bytes:.1} MB"
        )
    }
}
