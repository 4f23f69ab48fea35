//! A pass of the algorithm, as what a device needs of it: a row of WGSL files, kernels and constants.

use super::steps::Kernel;
use super::{RenderOptions, SceneNeeds};

/// What the numbers of a module follow from.
#[derive(Clone, Copy, Debug)]
pub struct Making<'a> {
    /// What exists.
    pub needs: &'a SceneNeeds,
    /// What was chosen.
    pub options: &'a RenderOptions,
    /// Surfels of the scene.
    pub surfels: u64,
}

/// A pass: which files it joins to a render's module, which kernels are dispatched, and which overridable constants are set. From
/// these rows follow bindings, the proof that loops end, and the tests of the layout.
pub struct Pass {
    /// Its name, that of its file, and of its time in reports.
    pub name: &'static str,
    /// Its files.
    pub files: fn(&SceneNeeds) -> Vec<&'static str>,
    /// Its kernels.
    pub kernels: fn(&SceneNeeds) -> Vec<Kernel>,
    /// Its constants, by name.
    pub constants: fn(&Making<'_>) -> Vec<(&'static str, f64)>,
}

/// Files that are compiled together, and the kernels among them that are dispatched.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Module {
    /// Names of WGSL files; their order does not matter.
    pub files: Vec<&'static str>,
    /// Entry points.
    pub kernels: Vec<Kernel>,
}
