//! The compiled part of the Python package `epsplat`. `python/epsplat/*.py` are its callers, and
//! `python/epsplat/_epsplat.pyi` describes it.

mod arrays;
mod clouds;
mod error;
mod images;
mod machines;
mod options;
mod renderer;
mod research;
mod scene;
mod stack;
mod task;
mod view;

use pyo3::prelude::*;

#[pymodule]
mod _epsplat {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::clouds::{arrays, coverage, lod, sample, simplify, surfels, visible, write};
    #[pymodule_export]
    use crate::images::{encode, save};
    #[pymodule_export]
    use crate::machines::{merge_parts, picture};
    #[pymodule_export]
    use crate::renderer::{OfMap, Renderer};
    #[pymodule_export]
    use crate::research::{compare, study};
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::view::View;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
