//! One scene of a study, and what its configurations showed on it.

use std::collections::BTreeMap;

use super::config::Config;
use super::definition::{Definition, SceneEntry};
use super::staging::Staged;
use crate::frame::Frame;
use crate::plan::RenderOptions;
use crate::render::{Backend, DeviceBytes};

/// One scene of a sweep.
pub(super) struct Case<'a> {
    pub definition: &'a Definition,
    pub entry: &'a SceneEntry,
    pub staged: &'a Staged,
    pub gpu: Option<&'a Backend>,
}

/// One configuration on it.
pub(super) struct Timed<'a> {
    pub config: &'a Config,
    pub options: &'a RenderOptions,
    /// Mean milliseconds of a frame over the cameras, one value a run.
    pub total_ms: Vec<f64>,
    /// The same of each pass.
    pub passes: BTreeMap<String, Vec<f64>>,
    /// What the last run showed, a frame for each camera.
    pub frames: Vec<Frame>,
    pub bytes: DeviceBytes,
    /// Surfels and nodes that are drawn in place of all surfels, mean over the cameras, if levels of detail are cut.
    pub cut: Option<f64>,
    /// Whether the last run has the bits of the first.
    pub stable: bool,
}
