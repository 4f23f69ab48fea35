//! The guide: how to make pictures, and how they come about.
//!
//! Its chapters are the files of `src/guide`, which read as well in the repository.

/// Cameras, units, depth tolerance, kernels and light.
#[cfg_attr(doc, doc = include_str!("guide/conventions.md"))]
pub mod conventions {}

/// Colours by attribute, filters and legends.
#[cfg_attr(doc, doc = include_str!("guide/attributes.md"))]
pub mod attributes {}

/// Surfels from points.
#[cfg_attr(doc, doc = include_str!("guide/points.md"))]
pub mod points {}

/// Surfels and triangles from meshes.
#[cfg_attr(doc, doc = include_str!("guide/meshes.md"))]
pub mod meshes {}

/// Surfaces that show through, inputs that are kept apart, and Gaussian surfels.
#[cfg_attr(doc, doc = include_str!("guide/transparency.md"))]
pub mod transparency {}

/// Levels of detail.
#[cfg_attr(doc, doc = include_str!("guide/levels.md"))]
pub mod levels {}

/// Files that are read and written.
#[cfg_attr(doc, doc = include_str!("guide/files.md"))]
pub mod files {}

/// Pictures that several processes draw together.
#[cfg_attr(doc, doc = include_str!("guide/machines.md"))]
pub mod machines {}

/// Adapters and accumulators.
#[cfg_attr(doc, doc = include_str!("guide/adapters.md"))]
pub mod adapters {}

/// The papers' pictures.
#[cfg_attr(doc, doc = include_str!("guide/papers.md"))]
pub mod papers {}

/// The package for Python.
#[cfg_attr(doc, doc = include_str!("guide/python.md"))]
pub mod python {}
