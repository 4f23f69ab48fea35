//! Describes a pass of the algorithm for the device: WGSL files, kernels and constants.

use super::steps::Kernel;
use super::{SceneNeeds, Settings};

/// Inputs that determine the constants of a module.
#[derive(Clone, Copy, Debug)]
pub struct Making<'a> {
    /// The needs of scene and options.
    pub needs: &'a SceneNeeds,
    /// The options of the render.
    pub options: &'a Settings,
    /// Number of surfels in the scene.
    pub surfels: u64,
}

/// A pass: the files it adds to a render's module, the kernels that are dispatched, and the
/// override constants that are set. The bindings, the proof that loops end, and the tests of the
/// layout follow from these rows.
pub struct Pass {
    /// The pass's name, which its file and its time in reports have too.
    pub name: &'static str,
    /// Its WGSL files.
    pub files: fn(&SceneNeeds) -> Vec<&'static str>,
    /// The kernels that are dispatched.
    pub kernels: fn(&SceneNeeds) -> Vec<Kernel>,
    /// Its override constants, by name.
    pub constants: fn(&Making<'_>) -> Vec<(&'static str, f64)>,
}

/// Files that are compiled together, with the kernels that are dispatched.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Module {
    /// Names of WGSL files; their order does not matter.
    pub files: Vec<&'static str>,
    /// The entry points that are dispatched.
    pub kernels: Vec<Kernel>,
}
