//! One scene of a study, and the results of its configurations.

use std::collections::BTreeMap;

use super::config::Config;
use super::definition::{Definition, SceneEntry};
use super::staging::Staged;
use crate::frame::Frame;
use crate::plan::Settings;
use crate::render::{Backend, DeviceBytes};

/// One point of a scene's sweep, with the backend of the configurations that need an adapter.
pub(super) struct Case<'a> {
    pub definition: &'a Definition,
    pub entry: &'a SceneEntry,
    pub staged: &'a Staged,
    pub gpu: Option<&'a Backend>,
}

/// One configuration on a [`Case`], with its times and its last frames.
pub(super) struct Timed<'a> {
    pub config: &'a Config,
    pub options: &'a Settings,
    /// Time per frame in ms, mean over the cameras; one value per run.
    pub total_ms: Vec<f64>,
    /// Time of each pass in ms, as in `total_ms`, by the pass's name.
    pub passes: BTreeMap<String, Vec<f64>>,
    /// Frames of the last run, one per camera.
    pub frames: Vec<Frame>,
    pub bytes: DeviceBytes,
    /// Number of surfels and octree nodes in the drawn cut, mean over the cameras; `None` without
    /// levels of detail.
    pub cut: Option<f64>,
    /// Whether the frames of the last run are bit-identical to those of the warm-up.
    pub stable: bool,
}
